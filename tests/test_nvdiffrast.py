"""nvdiffrast's rasterize: barycentrics and derivatives of exact arithmetic, images of a batch, viewports, refusals."""

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
    rast, rast_db = rasterize(TRIANGLE, TRI, (8, 16))
    assert rast_db.shape == (1, 8, 16, 4)
    assert rast.shape == (1, 8, 16, 4)
    assert rast.dtype == np.float32
    assert rast[0, 0, 0, 3] == 1
    assert rast[0, 7, 15].tolist() == [0, 0, 0, 0]


def test_u_and_v_weigh_vertices_0_and_1():
    u, v, zw, _ = rasterize(TRIANGLE, TRI, (64, 64))[0][0, 0, 63 - 1]
    assert u < 0.03
    assert v > 0.95
    assert zw == pytest.approx(0.5 * v - 0.5 * (1 - u - v), abs=1e-6)


def random_triangles(count=10):
    rng = np.random.default_rng(2)
    w = rng.uniform(0.5, 4, (1, 3 * count, 1))
    pos = np.concatenate([rng.uniform(-1, 1, (1, 3 * count, 3)), np.ones((1, 3 * count, 1))], -1) * w
    return pos.astype(np.float32), np.arange(3 * count, dtype=np.int32).reshape(-1, 3)


def exact_at(corners, i, j, width, height):
    return barycentrics(corners, (2 * i + 1) / Fraction(width) - 1, (2 * j + 1) / Fraction(height) - 1)


def test_values_are_near_exact_ones():
    pos, tri = random_triangles()
    rast = rasterize(pos, tri, (24, 32))[0][0]
    drawn = np.argwhere(rast[..., 3] > 0)
    assert len(drawn) > 100
    for j, i in drawn[::3]:
        corners = pos[0, tri[int(rast[j, i, 3]) - 1]]
        exact = exact_at(corners, int(i), int(j), 32, 24)
        exact = [min(max(float(e), low), 1.0) for e, low in zip(exact, (0, 0, -1), strict=True)]
        assert np.allclose(rast[j, i, :3], exact, atol=2e-6) or sum(exact[:2]) > 1


def test_derivatives_are_those_of_exact_barycentrics():
    pos, tri = random_triangles()
    rast, rast_db = (array[0] for array in rasterize(pos, tri, (24, 32)))
    step = Fraction(1, 2**20)
    for j, i in np.argwhere((rast[..., :2] > 0).all(axis=-1) & (rast[..., :2].sum(axis=-1) < 1))[::7]:
        corners = pos[0, tri[int(rast[j, i, 3]) - 1]]
        here = exact_at(corners, int(i), int(j), 32, 24)
        right = exact_at(corners, int(i) + step, int(j), 32, 24)
        above = exact_at(corners, int(i), int(j) + step, 32, 24)
        wanted = [float((there[k] - here[k]) / step) for k in (0, 1) for there in (right, above)]
        assert np.allclose(rast_db[j, i], wanted, rtol=1e-3, atol=1e-5)


def test_each_image_of_a_batch_is_drawn_by_itself():
    both = rasterize(np.concatenate([TRIANGLE, -TRIANGLE * [[[1, 1, 1, -1]]]]).astype(np.float32), TRI, (8, 8))[0]
    assert np.array_equal(both[0], rasterize(TRIANGLE, TRI, (8, 8))[0][0])
    assert both[1, 7, 7, 3] == 1


def test_of_equal_triangles_the_later_shows():
    assert rasterize(TRIANGLE, np.repeat(TRI, 3, axis=0), (8, 8))[0][0, 0, 0, 3] == 3


def test_a_triangle_with_an_index_out_of_range_is_not_drawn():
    tri = np.array([[0, 1, 3], [0, 1, -1]], np.int32)
    assert not rasterize(TRIANGLE, tri, (8, 8))[0].any()


def test_nan_positions_give_no_nan():
    broken = TRIANGLE.copy()
    broken[0, 1, 2] = np.nan
    assert np.isfinite(rasterize(broken, TRI, (8, 8))[0]).all()


@pytest.mark.parametrize(
    ("pos", "tri", "resolution", "sentence"),
    [
        (TRIANGLE[0], TRI, (8, 8), "needs ranges"),
        (TRIANGLE[..., :3].copy(), TRI, (8, 8), r"not float32 \[1, 3, 3\]"),
        (TRIANGLE.astype(float), TRI, (8, 8), "float64"),
        ([[1, 2]], TRI, (8, 8), "not list"),
        (TRIANGLE, TRI.astype(np.int64), (8, 8), "tri must be int32"),
        (TRIANGLE, TRI[0], (8, 8), "tri must be int32"),
        (TRIANGLE, TRI[:0], (8, 8), "must not be empty"),
        (TRIANGLE, TRI, 8, r"resolution must be \(height, width\)"),
        (TRIANGLE, TRI, (8.5, 8), r"resolution must be \(height, width\)"),
        (TRIANGLE, TRI, (8, 8, 8), r"resolution must be \(height, width\)"),
        (TRIANGLE, TRI, (0, 8), "0x8"),
    ],
)
def test_other_arguments_are_refused_in_a_sentence(pos, tri, resolution, sentence):
    with pytest.raises(TilestampError, match=sentence):
        rasterize(pos, tri, resolution)


RANGES = np.array([[1, 2], [0, 1], [2, 5], [-1, 2], [0, -2]], np.int32)


def test_a_range_draws_its_triangles_by_their_numbers():
    pos, tri = random_triangles(3)
    images, _ = rasterize(pos[0], tri, (24, 32), RANGES)
    for image, (start, count) in zip(images, RANGES.tolist(), strict=True):
        chosen = tri[max(start, 0) : max(start + count, 0)]
        alone = rasterize(pos, chosen, (24, 32))[0][0] if len(chosen) else np.zeros_like(image)
        alone[..., 3] += max(start, 0) * (alone[..., 3] > 0)
        assert np.array_equal(image, alone)


@pytest.mark.parametrize(
    ("ranges", "sentence"),
    [
        (RANGES.astype(np.int64), "ranges must be int32"),
        (RANGES[0], r"ranges must be int32 \[B, 2\]"),
        (RANGES[:, :1].copy(), r"not int32 \[5, 1\]"),
    ],
)
def test_other_ranges_are_refused(ranges, sentence):
    with pytest.raises(TilestampError, match=sentence):
        rasterize(TRIANGLE[0], TRI, (8, 8), ranges)


def test_instanced_mode_ignores_ranges_as_the_original_does():
    assert rasterize(TRIANGLE, TRI, (8, 8), RANGES)[0].shape == (1, 8, 8, 4)


def test_mended_instanced_mode_refuses_ranges():
    with pytest.raises(TilestampError, match="ranges go with pos"):
        rasterize(TRIANGLE, TRI, (8, 8), RANGES, faults="mended")


def test_derivatives_come_with_grad_db_off_too():
    assert rasterize(TRIANGLE, TRI, (8, 8), None, False)[1].any()


@pytest.mark.parametrize("edge", [1000, 2060, 3000])
def test_an_axis_of_more_than_2048_pixels_is_drawn_in_viewports(edge):
    x = 2 * edge / 4100 - 1
    pos = np.array([[[x, -9, 0, 1], [x, 9, 0, 1], [-9, 0, 0, 1]]], np.float32)
    ids = rasterize(pos, TRI, (4, 4100))[0][0, ..., 3]
    assert np.array_equal(ids, np.tile(np.arange(4100) < edge, (4, 1)))


class Lent:
    """An array of another library: all that is known of it is how to get at its memory."""

    def __init__(self, array):
        self.array = array

    def __dlpack__(self, **options):
        return self.array.__dlpack__(**options)

    def __dlpack_device__(self):
        return self.array.__dlpack_device__()


def test_arrays_of_other_libraries_are_taken():
    assert np.array_equal(rasterize(Lent(TRIANGLE), Lent(TRI), (8, 8))[0], rasterize(TRIANGLE, TRI, (8, 8))[0])


def test_the_price_of_a_call_is_that_of_five_kernels_on_the_gpu():
    pos, tri = random_triangles()
    rast, _, run = rasterize(pos, tri, (64, 64), cost="h200")
    assert list(run.stages.index) == ["triangle_setup", "bin_raster", "coarse_raster", "fine_raster", "pixel_shader"]
    assert run.counts["pixel_shader.DRAWN_LANES"] == np.count_nonzero(rast[..., 3])


def test_a_priced_call_returns_the_same_arrays():
    pos, tri = random_triangles()
    plain = rasterize(pos, tri, (40, 2100))
    priced = rasterize(pos, tri, (40, 2100), cost="h200")
    assert all(np.array_equal(a, b) for a, b in zip(plain, priced, strict=False))
