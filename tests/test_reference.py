"""The exact rasterizer against Python's rationals, and facts that any exact coverage has."""

from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tests import naive_coverage as naive
from tilestamp.models.errors import TilestampError
from tilestamp.simulator.reference.coverage import (
    Grid,
    exact_coverage,
    exact_visibility,
    homogeneous_corners,
    pixel_grid,
    screen_corners,
    visibility,
)
from tilestamp.simulator.reference.orientation import COMPONENTS, edge_function, edge_sign, sure_sign, two_product
from tilestamp.simulator.reference.picture import exact_picture

SCRATCH = np.empty(COMPONENTS)
reals = st.floats(-1e6, 1e6, allow_subnormal=False).map(lambda v: float(np.float32(v)))
corner = st.tuples(reals, reals, st.floats(0.125, 1e3).map(lambda v: float(np.float32(v))))


def rational_sign(p, q, x, y, w):
    value = naive._det(*([Fraction(v) for v in row] for row in (p, q, (x, y, w))))
    return naive._sign(value)


@settings(max_examples=60, deadline=None)
@given(corner, corner, reals, reals)
def test_edge_sign_is_the_rational_one(p, q, x, y):
    assert edge_sign(np.array(p), np.array(q), x, y, 1.0, SCRATCH) == rational_sign(p, q, x, y, 1.0)


@settings(max_examples=60, deadline=None)
@given(corner, corner, st.integers(0, 1024), st.integers(-1, 1))
def test_sure_sign_decides_points_on_and_beside_an_edge(p, q, step, nudge):
    """Points of the edge itself, rounded to doubles, and their neighbours: where the filter cannot decide."""
    s = step / 1024
    w = p[2] + (q[2] - p[2]) * s
    x, y = ((p[k] + (q[k] - p[k]) * s) / w for k in (0, 1))
    x = float(np.nextafter(x, nudge * np.inf)) if nudge else x
    assume(x == 0 or abs(x) > 1e-200)  # products with a subnormal leave the range of a double
    edge = np.empty(6)
    edge_function(np.array(p), np.array(q), edge)
    assert sure_sign(edge, np.array(p), np.array(q), x, y, 1.0, SCRATCH) == rational_sign(p, q, x, y, 1.0)


@settings(max_examples=60, deadline=None)
@given(st.floats(1e-60, 1e100), st.floats(-1e100, -1e-60))
def test_a_product_and_its_rest_are_the_rational_product(a, b):
    product, rest = two_product(a, b)
    assert Fraction(product) + Fraction(rest) == Fraction(a) * Fraction(b)


def test_a_point_a_double_away_from_an_edge_is_seen_on_its_side():
    p, q = np.array([0.5, 0.5, 1.0]), np.array([12.0, 12.0, 1.0])
    beside = float(np.nextafter(0.5, 1.0))  # Shewchuk's example: the rounded determinant is 0
    assert edge_sign(p, q, beside, 0.5, 1.0, SCRATCH) == -edge_sign(p, q, 0.5, beside, 1.0, SCRATCH) != 0


@pytest.mark.parametrize("seed", range(2))
def test_coverage_is_the_rational_one_where_corners_lie_on_samples(seed):
    corners = np.random.default_rng(seed).integers(0, 25, (12, 3, 2)) / 2.0
    homogeneous = np.concatenate([corners, np.ones((12, 3, 1))], axis=2)
    wanted = naive.hits(homogeneous, Grid(0.5, 0.5, 1.0, 1.0, 12, 12))
    assert np.array_equal(exact_coverage(corners, 12, 12).hits, wanted)


@pytest.mark.parametrize("seed", range(2))
def test_triangles_across_the_eyes_plane_cover_what_the_rational_ones_do(seed):
    random = np.random.default_rng(seed)
    positions = random.uniform(-2, 2, (12, 4)).astype(np.float32)
    positions[:, 2] = 0.0  # inside the depth range wherever w is positive
    triangles = np.arange(12, dtype=np.int32).reshape(4, 3)
    corners, _ = homogeneous_corners(positions, triangles, 11, 7)
    seen = exact_visibility(positions, triangles, 11, 7)
    assert np.array_equal(seen.hits, naive.hits(corners, pixel_grid(11, 7)))


def test_a_fan_around_a_sample_covers_every_sample_once():
    rim = [(0, 0), (4, 0), (8, 0), (8, 4), (8, 8), (4, 8), (0, 8), (0, 4), (0, 0)]
    corners = np.array([[(3.5, 4.5), a, b] for a, b in pairwise(rim)], float)
    assert (exact_coverage(corners, 8, 8).hits == 1).all()


def test_left_and_top_edges_own_their_samples():
    box = np.array([[(0.5, 0.5), (2.5, 0.5), (0.5, 2.5)], [(2.5, 2.5), (0.5, 2.5), (2.5, 0.5)]])
    assert exact_coverage(box, 3, 3).hits.tolist() == [[1, 1, 0], [1, 1, 0], [0, 0, 0]]


def test_the_nearest_triangle_is_seen_and_the_first_of_equals():
    big = np.array([[(0, 0), (8, 0), (0, 8)]] * 3, float)
    depths = np.array([[0.5] * 3, [0.25] * 3, [0.25] * 3])
    seen = exact_coverage(big, 4, 4, depths=depths)
    assert seen.ids[0, 0] == 1
    assert seen.hits[0, 0] == 3


def test_depth_is_the_rational_one_to_the_last_places():
    random = np.random.default_rng(1)
    positions = random.uniform(-1, 1, (3, 4)).astype(np.float32)
    positions[:, 3] = (1.0, 1.5, 2.0)
    triangle = np.array([[0, 1, 2]], np.int32)
    corners, depths = homogeneous_corners(positions, triangle, 16, 16)
    seen, grid = exact_visibility(positions, triangle, 16, 16), pixel_grid(16, 16)
    j, i = (int(k[0]) for k in np.nonzero(seen.hits))
    wanted = naive.depth(corners[0], depths[0], grid.x + i * grid.dx, grid.y + j * grid.dy)
    assert abs(seen.depth[j, i] - float(wanted)) < 1e-14


def test_back_faces_are_left_out_where_asked():
    positions = np.array([(-1, -1, 0, 1), (1, -1, 0, 1), (-1, 1, 0, 1)], np.float32)
    front, back = np.array([[0, 1, 2]], np.int32), np.array([[0, 2, 1]], np.int32)
    assert exact_visibility(positions, front, 8, 8, cull_backfaces=True).hits.sum() == 28
    assert exact_visibility(positions, back, 8, 8, cull_backfaces=True).hits.sum() == 0


def test_corners_that_are_not_finite_are_refused():
    with pytest.raises(TilestampError, match="finite"):
        exact_coverage(np.full((1, 3, 2), np.nan), 4, 4)


def test_screen_corners_cover_as_pixels_do():
    corners = np.random.default_rng(3).uniform(-2, 18, (6, 3, 2)).astype(np.float32).astype(np.float64)
    deep = np.concatenate([corners, np.zeros((6, 3, 1))], axis=2)
    wanted = exact_coverage(corners, 16, 12)
    assert np.array_equal(visibility(*screen_corners(deep, 16, 12), 16, 12).hits, wanted.hits)


def test_a_converged_pixel_holds_the_share_that_a_triangle_covers():
    """A triangle whose edge runs through the pixels from corner to corner: half of each is white."""
    half = np.array([[(0, 0, 0), (8, 0, 0), (0, 8, 0)]], float)
    picture = exact_picture(*screen_corners(half, 8, 8), np.ones((1, 3, 3)), 8, 8, side=16)
    assert picture[0, 0] == pytest.approx(1.0)
    assert picture[7, 7] == pytest.approx(0.0)
    assert picture[3, 4] == pytest.approx(0.5, abs=1 / 32)


def test_colours_are_interpolated_in_perspective():
    """On an edge from w = 1 to w = 3 the middle of the screen is three quarters of the way to the near colour."""
    positions = np.array([(-1, -1, 0, 1), (3, -3, 0, 3), (-1, 1, 0, 1)], np.float32)
    corners, depths = homogeneous_corners(positions, np.array([[0, 1, 2]], np.int32), 64, 64)
    colors = np.zeros((1, 3, 3))
    colors[0, 1] = 1.0
    picture = exact_picture(corners, depths, colors, 64, 64, side=1)
    assert picture[63, 31, 0] == pytest.approx(0.25, abs=0.02)


def test_a_texture_is_integrated_over_the_pixel():
    square = np.array([[(0, 0, 0), (4, 0, 0), (4, 4, 0)], [(0, 0, 0), (4, 4, 0), (0, 4, 0)]], float)
    uvs = np.array([[(0, 0), (8, 0), (8, 8)], [(0, 0), (8, 8), (0, 8)]], float)
    texture = np.full((2, 2, 4), 255, np.uint8)
    texture[0] = 0
    picture = exact_picture(*screen_corners(square, 4, 4), np.ones((2, 3, 3)), 4, 4, uvs=uvs, texture=texture)
    assert picture == pytest.approx(0.5, abs=0.01)
