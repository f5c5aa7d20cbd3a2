"""Fisheye, paraboloid and cylinder: samples against fractions, cones that hold, tessellation, and what is refused."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.naive_stochastic import determinant
from tests.test_counts_of_warps import HOPPER
from tilestamp import simulate
from tilestamp.experiments.exploration.nonlinear import EYE, room
from tilestamp.models.errors import TilestampError
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.stages.fatahalian2009.micropolygon_samples import new_samples
from tilestamp.simulator.stages.fatahalian2009.sample_positions import sample_positions
from tilestamp.simulator.stages.nonlinear.bounds import BIN, edge_planes, outlines, visit_bins, visit_cones
from tilestamp.simulator.stages.nonlinear.projections import KINDS, cones, project, projection, rays
from tilestamp.simulator.stages.nonlinear.tessellate import tessellate
from tilestamp.simulator.stages.stochastic.sample_raster import SampleRasterEvent, ray_raster
from tilestamp.simulator.stages.stochastic.tile_lists import MovingLists, moving_lists

WIDTH, HEIGHT, TILE = 37, 9, 4
TILES = -(-WIDTH // TILE) * -(-HEIGHT // TILE)
WIDEST = {"fisheye": 360.0, "paraboloid": 330.0, "cylindrical": 360.0}
widest = pytest.mark.parametrize(("kind", "fov"), [*WIDEST.items(), ("fisheye", 90.0)])


def soup(count, seed=1, size=6):
    """Triangles with whole coordinates all around the eye."""
    return np.random.default_rng(seed).integers(-size, size + 1, (count, 3, 3)).astype(np.float32)


def everywhere(count):
    entries = np.tile(np.arange(count, dtype=np.int32), TILES)
    return MovingLists(np.arange(TILES + 1) * count, entries, np.ones(len(entries), np.int64))


def draw(planes, lists, light):
    samples = new_samples(WIDTH, HEIGHT, sample_positions(1))
    return samples, ray_raster(planes.normals, planes.volumes, lists, light, samples, HOPPER, tile=TILE).works[0]


def bounded(planes, to):
    """Lists by bins, then tiles."""
    found, bins = outlines(planes), -(-WIDTH // (TILE * BIN)) * -(-HEIGHT // (TILE * BIN))
    listed = moving_lists(visit_bins(found, to, TILE), bins, HOPPER).outputs
    visits, owners = visit_cones(found, listed, to, 1, TILE)
    return moving_lists(visits, TILES, HOPPER, owners=owners).outputs


def distance(corners, ray):
    """Distance along a ray in fractions; a ray through an edge lies a little along x, less along y, less along z."""
    columns = [[Fraction(float(value)) for value in corner] for corner in corners]
    whole = determinant(*columns)
    if whole == 0:
        return None
    shares = []
    for k in range(3):
        share = []
        for to in (ray, (1, 0, 0), (0, 1, 0), (0, 0, 1)):
            changed = list(columns)
            changed[k] = [Fraction(float(value)) for value in to]
            share.append(determinant(*changed) / whole)
        if share <= [0, 0, 0, 0]:
            return None
        shares.append(share[0])
    return 1 / sum(shares)


def nearest(corners, ray):
    if np.isnan(ray).any():
        return -1
    found = [(far, p) for p, far in enumerate(distance(corner, ray) for corner in corners) if far is not None]
    return min(found)[1] if found else -1


def light_of(kind, fov):
    y, x = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    return rays(projection(kind, fov, WIDTH, HEIGHT), x, y)[:, :, None]


@widest
def test_every_sample_is_that_of_fractions(kind, fov):
    corners, light = soup(8), light_of(kind, fov)
    samples, _ = draw(edge_planes(corners, double=True), everywhere(8), light)
    expected = [[nearest(corners, light[y, x, 0]) for x in range(WIDTH)] for y in range(HEIGHT)]
    assert samples.polygon.reshape(HEIGHT, WIDTH).tolist() == expected
    assert len(np.unique(expected)) > 2


def test_lines_of_sight_through_edges_are_those_of_fractions():
    corners = soup(8, seed=3, size=2)
    light = np.random.default_rng(4).integers(-2, 3, (HEIGHT, WIDTH, 1, 3)).astype(float)
    light[0, :, 0] = corners[0, 0]  # through corners
    samples, _ = draw(edge_planes(corners, double=True), everywhere(8), light)
    for y, x in np.ndindex(HEIGHT, WIDTH):
        p = samples.polygon.reshape(HEIGHT, WIDTH)[y, x]
        far = {q: distance(corners[q], light[y, x, 0]) for q in range(8)}
        hits = {q: value for q, value in far.items() if value is not None}
        assert (p < 0) == (not hits), (x, y)
        assert p < 0 or hits[p] == min(hits.values())


@given(st.integers(0, 10**6), st.sampled_from(KINDS), st.floats(20, 350), st.booleans())
@settings(max_examples=40, deadline=None)
def test_no_hit_lies_outside_the_bounds(seed, kind, fov, double):
    corners = soup(5, seed)
    corners[::2] = corners[::2] * np.float32(0.2) + np.float32([3, -2, 1])  # small ones too
    planes, to, light = edge_planes(corners, double=double), projection(kind, fov, WIDTH, HEIGHT), light_of(kind, fov)
    lists = bounded(planes, to)
    (brute, all_hits), (samples, hits) = draw(planes, everywhere(5), light), draw(planes, lists, light)
    assert hits.total(SampleRasterEvent.SAMPLE_HITS) == all_hits.total(SampleRasterEvent.SAMPLE_HITS)
    assert (samples.polygon == brute.polygon).all()


@widest
@pytest.mark.parametrize("size", [4, 32])
def test_a_cone_holds_all_lines_of_sight_of_its_square(kind, fov, size):
    to = projection(kind, fov, 100, 76)
    x, y = np.random.default_rng(2).random((2, 20000)) * [[100], [76]]
    x, y = np.concatenate([x, np.floor(x)]), np.concatenate([y, np.floor(y)])  # and corners
    light = rays(to, x, y)
    of = cones(to, size)[(y // size * -(-100 // size) + x // size).astype(int)]
    angle = np.arccos(np.clip((light * of[:, :3]).sum(axis=1), -1, 1))
    assert (np.isnan(angle) | (angle <= of[:, 3] + 1e-7)).all()
    assert np.nanmax(angle / of[:, 3]) > 0.7


@widest
def test_projection_and_line_of_sight_are_inverse(kind, fov):
    to = projection(kind, fov, 80, 60)
    x, y = np.random.default_rng(3).random((2, 500)) * [[80], [60]]
    light = rays(to, x, y)
    seen = ~np.isnan(light[:, 0])
    assert np.linalg.norm(light[seen], axis=1) == pytest.approx(1)
    assert project(to, 3 * light[seen]) == pytest.approx(np.stack([x, y], axis=1)[seen], abs=1e-6)


def test_the_width_of_the_picture_is_the_angle():
    for kind, fov in WIDEST.items():
        to = projection(kind, fov / 2, 80, 80)
        left = rays(to, 0.0, 40.0)
        assert np.degrees(np.arctan2(left[0], left[2])) == pytest.approx(-fov / 4)


def picture(kind, fov=200.0, n=4, **options):
    return simulate(
        room(n), "nonlinear", width=WIDTH * 3, height=HEIGHT * 3, camera=EYE, fidelity="counts", projection=kind,
        fov=fov, **options,
    )  # fmt: skip


@pytest.mark.parametrize("double", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_each_line_of_sight_leaves_a_closed_room_once(kind, double):
    drawn = picture(kind, WIDEST[kind], double=double)
    seen = np.count_nonzero(drawn.triangle_ids >= 0)
    assert drawn.counts["sample_raster.SAMPLE_HITS"] == seen
    assert seen == 9 * WIDTH * HEIGHT or kind == "fisheye"


@pytest.mark.parametrize("kind", KINDS)
def test_tessellation_comes_near_as_lines_come_near(kind):
    right = picture(kind).triangle_ids
    wrong = [
        (picture(kind, method="tessellated", tolerance=tolerance).triangle_ids != right).mean()
        for tolerance in (8.0, 1.0, 0.05)
    ]
    assert wrong[0] > wrong[1] >= wrong[2]
    assert wrong[2] < 0.01


def test_edges_are_halved_until_their_middles_are_near():
    to = projection("fisheye", 180.0, 400, 300)
    corners = soup(6, seed=5).astype(float) + np.array([0, 0, 8])
    small, parents = tessellate(corners, to, 0.25, HOPPER).outputs
    for k in range(3):
        a, b = small[:, k], small[:, (k + 1) % 3]
        off = project(to, (a + b) / 2) - (project(to, a) + project(to, b)) / 2
        assert np.linalg.norm(off, axis=1).max() <= 0.25
    area = np.linalg.norm(np.cross(small[:, 1] - small[:, 0], small[:, 2] - small[:, 0]), axis=1)
    whole = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    assert np.bincount(parents, area, 6) == pytest.approx(whole)


def test_triangles_across_the_seam_are_torn_and_counted():
    drawn = picture("cylindrical", 360.0, n=3, method="tessellated")
    assert drawn.frame.facts["torn"] > 0
    assert "on the seam" in drawn.frame.warnings[0]
    assert (picture("cylindrical", 360.0, n=3).triangle_ids >= 0).all()


def test_what_cannot_be_seen_is_refused():
    with pytest.raises(TilestampError, match="less than 360 degrees"):
        simulate("teapot", "nonlinear", width=8, height=8, projection="paraboloid", fov=360.0)
    flat = Scene.from_clip_space([[0, 0, 0, 1], [1, 0, 0, 1], [0, 1, 0, 1]], [[0, 1, 2]])
    with pytest.raises(TilestampError, match="perspective camera"):
        simulate(flat, "nonlinear", width=8, height=8)
