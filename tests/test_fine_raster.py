"""Coverage and fine raster against Python integers, GPU images, and the rules of watertight meshes."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests import naive_cudaraster as naive
from tests.tile_lists import box_lists
from tilestamp.models.simt import Simt
from tilestamp.simulator.stages.laine2011.coverage import centroid_sample, pixel_mask, sample_mask, square_mask
from tilestamp.simulator.stages.laine2011.fine_raster import fine_raster
from tilestamp.simulator.stages.laine2011.fine_raster_queue import FineRasterEvent
from tilestamp.simulator.stages.laine2011.fine_raster_shade import blend_over
from tilestamp.simulator.stages.laine2011.frame_buffers import FrameBuffers, clear_depth_value, new_buffers
from tilestamp.simulator.stages.laine2011.subtriangle import DEPTH_MAX
from tilestamp.simulator.stages.laine2011.triangle_setup import triangle_setup

E = FineRasterEvent
MODES = {"depth": (True, True), "blend": (False, True), "depth-only": (True, False), "color": (False, False)}
point = st.tuples(st.integers(-200, 200), st.integers(-200, 200))


def draw(positions, triangles, size=(32, 24), *, mode="depth", release="1.1", samples=1, cull=None, **options):
    depth, interpolate = MODES[mode]
    positions, triangles = np.asarray(positions, np.float32), np.asarray(triangles, np.int32)
    setup, _, _ = triangle_setup(
        positions, triangles, *size, Simt(), release=release, samples=samples, cull_backfaces=cull, depth=depth,
        interpolate=interpolate,
    )  # fmt: skip
    lists = box_lists(setup, *size)
    return fine_raster(setup, *lists, *size, Simt(), release=release, samples=samples, mode=mode, **options)


def header(a, b, c):
    """Counter-clockwise corners as int16, or None without area."""
    area = naive.cross(b[0] - a[0], b[1] - a[1], c[0] - a[0], c[1] - a[1])
    return None if area == 0 else np.array([*a, *(b if area > 0 else c), *(c if area > 0 else b)], np.int16)


def check_mask(a, b, c):
    corners = header(a, b, c)
    if corners is None:
        return
    points = [(int(corners[2 * k]) + 64, int(corners[2 * k + 1]) + 64) for k in range(3)]
    mask = int(pixel_mask(corners, -64, -64))
    for j in range(8):
        for i in range(8):
            assert (mask >> (8 * j + 7 - i)) & 1 == naive.covers(points, 16 * i + 8, 16 * j + 8)


@given(point, point, point)
@settings(max_examples=60, derandomize=True, deadline=None)
def test_pixel_mask_is_the_edge_predicate(a, b, c):
    check_mask(a, b, c)


@given(point, st.tuples(st.integers(-16000, 16000), st.integers(-16000, 16000)), point)
@settings(max_examples=60, derandomize=True, deadline=None)
def test_pixel_mask_of_a_long_edge_through_the_tile_is_the_edge_predicate(middle, along, c):
    check_mask(*((middle[0] + s * along[0], middle[1] + s * along[1]) for s in (-1, 1)), c)


@given(point, point, point, st.sampled_from([1, 2, 3]))
@settings(max_examples=60, derandomize=True, deadline=None)
def test_every_covered_sample_is_in_a_touched_square(a, b, c, s):
    corners = header(a, b, c)
    if corners is None:
        return
    points = [(int(corners[2 * k]) + 64, int(corners[2 * k + 1]) + 64) for k in range(3)]
    squares, n, step = int(square_mask(corners, -64, -64)), 1 << s, 16 >> s
    for j in range(8):
        for i in range(8):
            samples = sample_mask(corners, 16 * i + 8 - 64, 16 * j + 8 - 64, s)
            assert not samples or (squares >> (8 * j + 7 - i)) & 1
            for k in range(n):
                x = (i * n + naive.PATTERN[n][k]) * step + step // 2
                y = (j * n + k) * step + step // 2
                assert (samples >> k) & 1 == naive.covers(points, x, y)


def test_centroid_is_the_centre_when_all_or_none_are_covered():
    assert centroid_sample(0b1111, 2) == centroid_sample(0, 2) == -1
    assert centroid_sample(0b1000, 2) == 3
    assert centroid_sample(0b1010, 2) == 1  # as near as 3, and first


def mesh_soup(seed, count=14, spread=1.0, near=0.0):
    """Random triangles; some cross the view planes by ``spread``, and the near plane by ``near``."""
    rng = np.random.default_rng(seed)
    positions = rng.uniform(-spread, spread, (3 * count, 4))
    positions[:, 2] = rng.uniform(-1 - near, 1, 3 * count)
    positions[:, 3] = rng.uniform(0.8, 1.6, 3 * count)
    positions[:, 2] *= positions[:, 3]
    return positions.astype(np.float32), np.arange(3 * count, dtype=np.int32).reshape(-1, 3)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("release", "samples"), [("nvdiffrast", 1), ("1.1", 1), ("1.1", 2), ("1.1", 4), ("1.1", 8)])
def test_pictures_are_the_plain_minimum_of_each_sample(seed, release, samples):
    size = (20, 13) if samples < 8 else (11, 9)
    spread, near = ((0.8, 0.0), (3.0, 0.0), (1.2, 0.6), (300.0, 0.3))[seed]
    positions, triangles = mesh_soup(seed, count=14 if spread < 100 else 40, spread=spread, near=near)
    buffers, _, _ = draw(positions, triangles, size, release=release, samples=samples)
    ids, depths = naive.draw(positions, triangles, *size, release=release, samples=samples)
    assert len(ids) > 20
    for k in range(samples):
        for j in range(size[1]):
            for i in range(size[0]):
                assert buffers.ids[k, j, i] == ids.get((k, j, i), -1)
                assert buffers.depth[k, j, i] == depths.get((k, j, i), DEPTH_MAX)


@pytest.mark.parametrize(("depth", "updates"), [(DEPTH_MAX - 1, 2), (DEPTH_MAX, 1), (2**32 - 1, 0)])
def test_the_tiles_largest_depth_is_taken_anew_only_where_a_pixel_had_it(depth, updates):
    """A tile starts from ``DEPTH_MAX``, which no pixel has where an earlier draw's depths all lie beyond."""
    pixels = new_buffers(8, 8)
    buffers = FrameBuffers(pixels.color, np.full_like(pixels.depth, depth), pixels.ids)
    corners, triangles = [[-3, -3, 0, 1], [3, -3, 0, 1], [0, 3, 0, 1]], [[0, 1, 2]] * 40
    _, (work,), _ = draw(corners, triangles, (8, 8), buffers=buffers)
    assert work.total(E.ZMAX_UPDATES) == updates


def grid(seed, n=6, shake=0.8):
    """Make a watertight mesh over more than the viewport: a grid with its inner vertices moved about."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.linspace(-1.5, 1.5, n + 1), np.linspace(-1.5, 1.5, n + 1))
    inner = np.zeros((n + 1, n + 1))
    inner[1:-1, 1:-1] = 1.0 * shake / n
    x, y = x + inner * rng.uniform(-1, 1, x.shape), y + inner * rng.uniform(-1, 1, x.shape)
    w = rng.uniform(0.7, 1.5, x.shape)
    positions = np.stack([x * w, y * w, np.zeros_like(x), w], -1).reshape(-1, 4).astype(np.float32)
    i = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    triangles = np.concatenate([np.stack([i, i + 1, i + n + 1], -1), np.stack([i + 1, i + n + 2, i + n + 1], -1)])
    return positions, triangles.astype(np.int32)


@pytest.mark.parametrize("samples", [1, 2, 4, 8])
@given(st.integers(0, 10**6))
@settings(max_examples=8, derandomize=True, deadline=None)
def test_a_watertight_mesh_has_no_hole_and_no_double_hit(samples, seed):
    size = (40, 24)
    buffers, (work,), _ = draw(*grid(seed), size, mode="color", samples=samples, cull=False)
    assert buffers.ids.min() >= 0
    assert work.total(E.SAMPLE_HITS) == size[0] * size[1] * samples


@pytest.mark.parametrize("samples", [1, 2, 4, 8])
def test_shared_edges_on_sample_positions_hit_once(samples):
    size, n = (16, 16), 16
    step = 2 * np.arange(n * samples + 1) / (n * samples) - 1
    on = np.concatenate([[-1.5], step + 1 / (n * samples), [1.5]])  # every vertex on a site of the sample grid
    x, y = np.meshgrid(on, on)
    k = len(on)
    positions = np.stack([x, y, np.zeros_like(x), np.ones_like(x)], -1).reshape(-1, 4)
    i = (np.arange(k - 1)[:, None] * k + np.arange(k - 1)).ravel()
    triangles = np.concatenate([np.stack([i, i + 1, i + k], -1), np.stack([i + 1, i + k + 1, i + k], -1)])
    buffers, (work,), _ = draw(positions, triangles, size, mode="color", samples=samples)
    assert buffers.ids.min() >= 0
    assert work.total(E.SAMPLE_HITS) == 256 * samples


@pytest.mark.parametrize("samples", [1, 4])
def test_a_fan_of_slivers_has_no_hole(samples):
    angle = np.linspace(0, 2 * np.pi, 400)
    rim = np.stack([3 * np.cos(angle), 3 * np.sin(angle), 0 * angle, 0 * angle + 1], -1)
    rim[-1] = rim[0]
    positions = np.concatenate([[[0.01, 0.02, 0, 1]], rim])
    triangles = [[0, i, i + 1] for i in range(1, 400)]
    buffers, (work,), _ = draw(positions, triangles, (32, 24), mode="color", samples=samples)
    assert buffers.ids.min() >= 0
    assert work.total(E.SAMPLE_HITS) == 32 * 24 * samples


FULL = [[-1, -1, 0, 1], [3, -1, 0, 1], [-1, 3, 0, 1]]


def test_of_equal_depths_the_earlier_shows_in_1_1_and_the_later_in_nvdiffrast():
    twice = [[0, 1, 2], [0, 1, 2]]
    assert set(draw(FULL, twice)[0].ids.ravel()) == {0}
    assert set(draw(FULL, twice, release="nvdiffrast")[0].ids.ravel()) == {1}


def test_blending_is_that_of_triangles_drawn_one_after_another():
    rng = np.random.default_rng(3)
    positions, triangles = mesh_soup(7, count=40, spread=0.9)
    colors = rng.uniform(0, 1, (len(positions), 4)).astype(np.float32)
    together, _, _ = draw(positions, triangles, mode="blend", colors=colors, cull=False)
    apart = None
    for triangle in triangles:
        apart, _, _ = draw(positions, [triangle], mode="blend", colors=colors, cull=False, buffers=apart)
    assert np.array_equal(together.color, apart.color)
    assert len(np.unique(together.color)) > 100


def test_a_transparent_layer_mixes_by_its_alpha():
    assert blend_over(0x80FFFFFF, 0xFF000000) & 0xFF == 0x80
    assert blend_over(0xFF123456, 0x01020304) == 0xFF123456
    assert blend_over(0x00123456, 0x01020304) == 0x01020304


def test_colours_are_interpolated_with_perspective():
    positions = [[-1, -1, 0, 1], [3 * 4, -4, 0, 4], [-1, 3, 0, 1]]
    colors = np.array([[0, 0, 0, 1], [1, 1, 1, 1], [0, 0, 0, 1]], np.float32)
    buffers, _, _ = draw(positions, [[0, 1, 2]], (64, 64), colors=colors)
    for i in (3, 20, 50):
        x, y = (2 * i + 1) / 64 - 1, 1 / 64 - 1
        flat = (x + 1) / 4  # screen-space weight of vertex 1
        weight = (flat / 4) / (flat / 4 + (1 - flat))
        assert abs(int(buffers.color[0, 0, i] & 255) - 255 * weight) < 1
        assert y < 0


def test_without_interpolation_the_last_vertex_gives_the_colour():
    colors = np.array([[1, 0, 0, 1], [0, 1, 0, 1], [0, 0, 1, 1]], np.float32)
    buffers, _, _ = draw(FULL, [[0, 1, 2]], mode="color", colors=colors)
    assert set(buffers.color.ravel()) == {0xFFFF0000}


def test_depth_only_writes_no_colour():
    buffers, _, _ = draw(FULL, [[0, 1, 2]], mode="depth-only", clear_color=0x01020304)
    assert set(buffers.color.ravel()) == {0x01020304}
    assert buffers.depth.max() < DEPTH_MAX


def test_clear_depth_hides_what_is_behind_it():
    assert clear_depth_value(1.0) == DEPTH_MAX
    behind, _, _ = draw(FULL, [[0, 1, 2]], clear_depth=0.4)
    before, _, _ = draw(FULL, [[0, 1, 2]], clear_depth=0.6)
    assert (behind.ids.max(), before.ids.min()) == (-1, 0)


IMAGES = [
    ("bunny", 512), ("bunny", 1024), ("dragon100k", 512), ("edges_512", 512), ("nearclip5k", 512), ("nearclip5k", 1024),
    ("soup2k", 512), ("teapot16k", 512), ("teapot16k", 1024),
]  # fmt: skip


@pytest.mark.shared
@pytest.mark.parametrize(("scene", "width"), IMAGES)
def test_ids_and_depths_are_those_of_an_h200(shared, scene, width):
    folder = shared / "silicon" / "ids"
    with np.load(folder / f"{scene}_input.npz") as data, np.load(folder / f"{scene}_{width}.npz") as gpu:
        height = gpu["id"].shape[0]
        buffers, _, _ = draw(data["positions"], data["triangles"], (width, height), release="nvdiffrast")
        assert np.array_equal(buffers.ids[0, :height, :width] + 1, gpu["id"])
        assert np.array_equal(buffers.depth[0, :height, :width], gpu["depth"])
