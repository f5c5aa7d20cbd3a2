"""nvdiffrast's interface beside a slow form of its arithmetic, in float32 with fused multiply-adds: every bit.

What is fused with what is measured on an H200; here it is written down a second time, one number after another.
"""

import numpy as np
import pytest

from tilestamp.simulator.nvdiffrast import antialias, interpolate, rasterize, texture, texture_construct_mip
from tilestamp.simulator.stages.laine2011.exact import fma
from tilestamp.simulator.stages.laine2011.pixel_barycentrics import pixel_barycentrics

ZERO, HALF, ONE, TWO = (np.float32(x) for x in (0, 0.5, 1, 2))
HEIGHT, WIDTH = 11, 31  # of both 1 / n - 1 rounds otherwise than (1 - n) / n


@pytest.fixture(autouse=True)
def silent():
    with np.errstate(all="ignore"):
        yield


def cross(a, b, c, d):
    return fma(a, b, -(c * d))


def clamped(value):
    """0 for NaN, too."""
    return ZERO if not value > 0 else min(value, ONE)


def slow_pixel(corners, i, j):
    """u, v, z/w and derivatives at pixel (i, j)."""
    step_x, step_y = TWO / np.float32(WIDTH), TWO / np.float32(HEIGHT)
    fx = fma(np.float32(i), step_x, ONE / np.float32(WIDTH) - ONE)
    fy = fma(np.float32(j), step_y, ONE / np.float32(HEIGHT) - ONE)
    (p, q, r), (x, y, z, w) = corners, corners.T
    x0, x1, x2 = (fma(c[3], -fx, c[0]) for c in (p, q, r))
    y0, y1, y2 = (fma(c[3], -fy, c[1]) for c in (p, q, r))
    areas = cross(x1, y2, y1, x2), cross(y0, x2, x0, y2), cross(x0, y1, y0, x1)
    inverse = ONE / (areas[2] + (areas[0] + areas[1]))
    u, v = clamped(areas[0] * inverse), clamped(areas[1] * inverse)
    depth, scale = (fma(c[2], areas[2], fma(c[0], areas[0], c[1] * areas[1])) for c in (z, w))
    depth = np.fmax(np.fmin(depth / scale, ONE), -ONE)
    beyond = ONE / np.fmax(u + v, ONE)
    u, v = u * beyond, v * beyond
    e0, e1, e2 = cross(w[1], y[2], y[1], w[2]), cross(y[0], w[2], w[0], y[2]), cross(w[0], y[1], y[0], w[1])
    f0, f1, f2 = cross(x[1], w[2], w[1], x[2]), cross(w[0], x[2], x[0], w[2]), cross(x[0], w[1], w[0], x[1])
    along_x, along_y = e2 + (e0 + e1), f2 + (f0 + f1)
    rx, ry = inverse * step_x, inverse * step_y
    steps = rx * fma(u, along_x, -e0), ry * fma(u, along_y, -f0), rx * fma(v, along_x, -e1), ry * fma(v, along_y, -f1)
    return [u, v, depth, *steps]


def scene(kind, count=60):
    """Random triangles: small, slivers, or through the eye plane."""
    rng = np.random.default_rng(6)
    xyz = rng.uniform(-1, 1, (3 * count, 3))
    w = rng.uniform(-0.6 if kind == "near" else 0.5, 3, (3 * count, 1))
    if kind == "slivers":
        xyz[2::3] = xyz[::3] + (xyz[1::3] - xyz[::3]) * rng.uniform(0, 1, (count, 1)) + 0.06
    return np.hstack([xyz * w, w])[None].astype(np.float32), np.arange(3 * count, dtype=np.int32).reshape(-1, 3)


def bits(values):
    """Bits of float32, all NaN alike."""
    values = np.ascontiguousarray(values, np.float32)
    return np.where(np.isnan(values), 0, values.view(np.int32))


@pytest.mark.parametrize("kind", ["small", "slivers", "near"])
def test_every_bit_of_a_pixel(kind):
    pos, tri = scene(kind)
    rast, rast_db = (array[0] for array in rasterize(pos, tri, (HEIGHT, WIDTH)))
    drawn = np.argwhere(rast[..., 3] > 0)
    slow = [slow_pixel(pos[0, tri[int(rast[j, i, 3]) - 1]], i, j) for j, i in drawn]
    found = np.concatenate([rast[..., :3], rast_db], -1)[tuple(drawn.T)]
    assert len(drawn) > 50
    assert np.array_equal(bits(found), bits(slow))


def test_a_depth_that_is_no_number_is_1_and_such_a_weight_0():
    corners = np.array([[-1, -1, -np.inf, 1], [1, -1, np.inf, 1], [-1, 1, 0, 1], [0, 0, 0, 0]], np.float32)
    ids, tri = np.array([[0], [1]], np.int32), np.array([[0, 1, 2], [3, 3, 3]], np.int32)
    out = pixel_barycentrics(ids, corners, tri)[:, 0]
    assert out[:, 2].tolist() == [1, 1]
    assert out[1, :2].tolist() == [0, 0]


def test_depths_are_cut_off_at_the_near_and_far_plane():
    corners = np.array([[-1, -1, z, 1] for z in (-9, 9)] + [[1, -1, 0, 1], [-1, 1, 0, 1]], np.float32)
    ids, tri = np.array([[0, -1, -1], [1, -1, -1], [-1, -1, -1]], np.int32), np.array([[0, 2, 3], [1, 2, 3]], np.int32)
    assert pixel_barycentrics(ids, corners, tri)[:2, 0, 2].tolist() == [-1, 1]


def image():
    pos, tri = scene("small")
    return (tri, *rasterize(pos, tri, (HEIGHT, WIDTH)))


def test_every_bit_of_an_attribute():
    tri, rast, rast_db = image()
    attr = np.random.default_rng(1).uniform(-1, 1, (180, 2)).astype(np.float32)
    out, out_da = interpolate(attr, rast, tri, rast_db, "all")
    for j, i in np.argwhere(rast[0, ..., 3] > 0):
        (u, v), (a, b, c) = rast[0, j, i, :2], attr[tri[int(rast[0, j, i, 3]) - 1]]
        weight, d = (ONE - u) - v, rast_db[0, j, i]
        assert out[0, j, i].tolist() == [fma(weight, c[k], fma(u, a[k], v * b[k])) for k in (0, 1)]
        wanted = [fma(d[s], a[k] - c[k], d[2 + s] * (b[k] - c[k])) for k in (0, 1) for s in (0, 1)]
        assert out_da[0, j, i].tolist() == wanted


def test_background_beside_a_triangle_is_0_times_vertex_0():
    tri, rast, _ = image()
    rast = np.tile(rast, (1, 1, 3, 1))
    rast[:, :4, 8:16, 3], rast[:, 4:8, 8:16, 3], rast[:, 4, 8, 3] = 0, 0, 1  # an empty warp, one with a triangle
    out = interpolate(np.full((180, 1), -1, np.float32), rast, tri)[0][0, ..., 0]
    assert not np.signbit(out[:4, 8:16]).any()
    assert np.signbit(out[4:8, 9:16]).all()


def slow_linear(tex, u, v):
    """Bilinear lookup in one image, wrapped."""
    height, width = tex.shape[:2]
    x = fma(u - np.floor(u), np.float32(width), -HALF)
    y = fma(v - np.floor(v), np.float32(height), -HALF)
    i, j = int(np.floor(x)), int(np.floor(y))
    s, t = x - np.float32(i), y - np.float32(j)
    rows = [[tex[(j + b) % height, (i + a) % width] for a in (0, 1)] for b in (0, 1)]
    low, high = ([fma(s, b - a, a) for a, b in zip(*row, strict=True)] for row in rows)
    return [fma(t, b - a, a) for a, b in zip(low, high, strict=True)]


def test_every_bit_of_a_linear_lookup():
    rng = np.random.default_rng(2)
    tex, uv = rng.uniform(-1, 1, (1, 4, 6, 2)).astype(np.float32), rng.uniform(-3, 3, (1, 9, 9, 2)).astype(np.float32)
    out = texture(tex, uv)[0]
    assert [out[j, i].tolist() for j, i in np.ndindex(9, 9)] == [
        slow_linear(tex[0], *uv[0, j, i]) for j, i in np.ndindex(9, 9)
    ]


def test_every_bit_of_a_smaller_level():
    tex = np.random.default_rng(3).uniform(-1, 1, (1, 4, 8, 1)).astype(np.float32)
    a, b, c, d = tex[:, ::2, ::2], tex[:, ::2, 1::2], tex[:, 1::2, ::2], tex[:, 1::2, 1::2]
    levels = texture_construct_mip(tex)
    assert np.array_equal(levels[0], np.float32(0.25) * (((a + b) + c) + d))
    assert np.array_equal(levels[2], HALF * (levels[1][:, :, ::2] + levels[1][:, :, 1::2]))


def level(uv_da, **options):
    """Level that a pixel with these derivatives takes, of a texture of 64x64 whose levels hold their numbers."""
    tex = np.zeros((1, 64, 64, 1), np.float32)
    levels = [np.full((1, 64 >> n, 64 >> n, 1), n, np.float32) for n in range(1, 7)]
    uv, uv_da = np.full((1, 1, 1, 2), 0.5, np.float32), np.array(uv_da, np.float32).reshape(1, 1, 1, 4)
    return float(texture(tex, uv, uv_da, mip=levels, **options)[0, 0, 0, 0])


@pytest.mark.parametrize("turn", [0.0, 0.7, 2.0])
def test_the_level_follows_the_longer_axis_of_a_turned_footprint(turn):
    c, s = np.cos(turn), np.sin(turn)
    turned = np.array([[c, -s], [s, c]]) @ np.diag([6 / 64, 2 / 64]) @ np.array([[0.6, -0.8], [0.8, 0.6]])
    assert level(turned.reshape(-1)) == pytest.approx(np.log2(6), abs=1e-5)


@pytest.mark.parametrize(("derivative", "wanted"), [(0, 0), (np.nan, 0), (1e30, 6), (1e-30, 0)])
def test_a_level_is_one_of_those_there_are(derivative, wanted):
    assert level([derivative, 0, 0, 0]) == wanted


@pytest.mark.parametrize(("first", "blended"), [(0, True), (1, False)])
def test_a_vertex_across_an_edge_that_is_nowhere_has_a_positive_side(first, blended):
    x = 2 * 3.6 / 8 - 1
    pos = np.array([[[x, -9, 0, 1], [x, 9, 0, 1], [-9, 0, 0, 1], [0, 0, 0, 0]]], np.float32)
    tri = np.array([[first, 1 - first, 2], [0, 1, 3]], np.int32)  # whose sides, NaN, are positive on the GPU
    rast, _ = rasterize(pos, tri[:1].copy(), (8, 8))
    color = (rast[..., 3:] > 0).astype(np.float32)
    assert np.array_equal(antialias(color, rast, pos, tri), color) != blended


def test_a_direction_whose_reciprocal_overflows_still_has_a_face():
    faces = np.arange(1, 7, dtype=np.float32)[None, :, None, None, None] * np.ones((1, 6, 2, 2, 1), np.float32)
    d = np.array([1e-40, 0, 0, 0, -1e-40, 0, 0, 0, 1e-40], np.float32).reshape(1, 1, 3, 3)
    assert texture(faces, d, filter_mode="nearest", boundary_mode="cube").reshape(-1).tolist() == [1, 4, 5]
