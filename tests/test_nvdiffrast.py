"""The nvdiffrast reference: ids of the GPU, barycentrics of exact arithmetic, its shapes and refusals."""

from fractions import Fraction

import numpy as np
import pytest

from tilestamp.models.errors import TilestampError
from tilestamp.simulator.nvdiffrast import rasterize

TRIANGLE = np.array([[[-1, -1, 0, 1], [1, -1, 0.5, 1], [-1, 1, -0.5, 1]]], np.float32)
TRI = np.array([[0, 1, 2]], np.int32)


def barycentrics(corners, x, y):
    """u, v and z/w of clip corners at a point, as fractions."""
    p = [[Fraction(float(c)) for c in corner] for corner in corners]
    q = [(a[0] - x * a[3], a[1] - y * a[3]) for a in p]
    areas = [q[i - 2][0] * q[i - 1][1] - q[i - 2][1] * q[i - 1][0] for i in range(3)]
    total = sum(areas)
    z, w = (sum(a * corner[c] for a, corner in zip(areas, p, strict=True)) for c in (2, 3))
    return areas[0] / total, areas[1] / total, z / w


def test_row_0_is_at_y_minus_1_and_ids_start_at_1():
    rast = rasterize(TRIANGLE, TRI, (8, 16))
    assert rast.shape == (1, 8, 16, 4)
    assert rast.dtype == np.float32
    assert rast[0, 0, 0, 3] == 1
    assert rast[0, 7, 15].tolist() == [0, 0, 0, 0]


def test_u_and_v_weigh_vertices_0_and_1():
    u, v, zw, _ = rasterize(TRIANGLE, TRI, (64, 64))[0, 0, 63 - 1]
    assert u < 0.03
    assert v > 0.95
    assert zw == pytest.approx(0.5 * v - 0.5 * (1 - u - v), abs=1e-6)


def test_values_are_within_float32_rounding_of_exact_ones():
    rng = np.random.default_rng(2)
    w = rng.uniform(0.5, 4, (1, 30, 1))
    pos = (np.concatenate([rng.uniform(-1, 1, (1, 30, 3)), np.ones((1, 30, 1))], -1) * w).astype(np.float32)
    tri = np.arange(30, dtype=np.int32).reshape(-1, 3)
    rast = rasterize(pos, tri, (24, 32))[0]
    drawn = np.argwhere(rast[..., 3] > 0)
    assert len(drawn) > 100
    for j, i in drawn[::3]:
        corners = pos[0, tri[int(rast[j, i, 3]) - 1]]
        exact = barycentrics(corners, Fraction(2 * int(i) + 1, 32) - 1, Fraction(2 * int(j) + 1, 24) - 1)
        exact = [min(max(float(e), low), 1.0) for e, low in zip(exact, (0, 0, -1), strict=True)]
        assert np.allclose(rast[j, i, :3], exact, rtol=1.2e-7, atol=1e-9) or sum(exact[:2]) > 1


def test_each_image_of_a_batch_is_drawn_by_itself():
    both = rasterize(np.concatenate([TRIANGLE, -TRIANGLE * [[[1, 1, 1, -1]]]]).astype(np.float32), TRI, (8, 8))
    assert np.array_equal(both[0], rasterize(TRIANGLE, TRI, (8, 8))[0])
    assert both[1, 7, 7, 3] == 1


def test_of_equal_triangles_the_later_shows():
    assert rasterize(TRIANGLE, np.repeat(TRI, 3, axis=0), (8, 8))[0, 0, 0, 3] == 3


def test_a_triangle_with_an_index_out_of_range_is_not_drawn():
    tri = np.array([[0, 1, 3], [0, 1, -1]], np.int32)
    assert not rasterize(TRIANGLE, tri, (8, 8)).any()


def test_nan_positions_give_no_nan():
    broken = TRIANGLE.copy()
    broken[0, 1, 2] = np.nan
    assert np.isfinite(rasterize(broken, TRI, (8, 8))).all()


@pytest.mark.parametrize(
    ("pos", "tri", "resolution", "sentence"),
    [
        (TRIANGLE[0], TRI, (8, 8), r"pos must be a float32 array \[B, V, 4\], not float32 \[3, 4\]"),
        (TRIANGLE.astype(float), TRI, (8, 8), "float64"),
        ([[1, 2]], TRI, (8, 8), "not list"),
        (TRIANGLE, TRI.astype(np.int64), (8, 8), "tri must be an int32"),
        (TRIANGLE, TRI[0], (8, 8), "tri must be an int32"),
        (TRIANGLE, TRI[:0], (8, 8), "must not be empty"),
        (TRIANGLE, TRI, 8, r"resolution must be \(height, width\)"),
        (TRIANGLE, TRI, (8, 4096), "8x4096"),
        (TRIANGLE, TRI, (0, 8), "0x8"),
    ],
)
def test_other_arguments_are_refused_in_a_sentence(pos, tri, resolution, sentence):
    with pytest.raises(TilestampError, match=sentence):
        rasterize(pos, tri, resolution)


@pytest.mark.shared
@pytest.mark.parametrize("scene", ["bunny", "nearclip5k", "edges_512", "soup2k"])
def test_ids_are_those_of_the_gpu(shared, scene):
    folder = shared / "silicon" / "ids"
    with np.load(folder / f"{scene}_input.npz") as data, np.load(folder / f"{scene}_512.npz") as gpu:
        rast = rasterize(data["positions"][None], data["triangles"], gpu["id"].shape)
        assert np.array_equal(rast[0, ..., 3], gpu["id"])
