"""Displacement maps: vertices where a slow evaluation puts them, and bounds that hold."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tests import naive_patches
from tests.test_dice import SIZE, VIEW, flat, squares
from tilestamp.models.errors import TilestampError
from tilestamp.models.machine import load_machine
from tilestamp.simulator.pipelines.micropolygon import MicropolygonOptions
from tilestamp.simulator.scenes.scene import Patches, Scene
from tilestamp.simulator.simulation import simulate
from tilestamp.simulator.stages.eisenacher2010.bound_and_split import bound_and_split
from tilestamp.simulator.stages.eisenacher2010.bucket_count import bucket_count
from tilestamp.simulator.stages.eisenacher2010.bucket_scan import bucket_scan
from tilestamp.simulator.stages.eisenacher2010.bucket_write import bucket_write
from tilestamp.simulator.stages.eisenacher2010.dice import dice
from tilestamp.simulator.stages.eisenacher2010.displace import dice_displaced, padded
from tilestamp.simulator.stages.eisenacher2010.tile_range import screen_tiles
from tilestamp.simulator.stages.eisenacher2010.tile_raster import tile_raster

H200 = load_machine("h200").simt


def bent(seed, spread=0.3):
    points = flat()
    points[..., :3] += np.random.default_rng(seed).uniform(-spread, spread, (1, 16, 3)).astype(np.float32)
    return points


def naive_normal(net, u, v, step=1e-5):
    """Unit normal by differences."""
    p = lambda a, b: np.array(naive_patches.surface(net, a, b)[:3])  # noqa: E731 - a formula
    n = np.cross(p(u + step, v) - p(u - step, v), p(u, v + step) - p(u, v - step))
    return n / np.linalg.norm(n)


def test_vertices_lie_along_the_normal_by_the_level_of_the_map():
    points, relief = bent(4), np.array([[0, 51], [255, 102]], np.uint8)
    entries, matrix = [(0, 1, 1, 0), (0, 0, 0, 0)], VIEW.matrix(*SIZE)
    grids, works, _ = dice_displaced(points, squares(*entries), matrix, *SIZE, H200, relief=relief, relief_height=0.2)
    assert works[0].variant == "displaced"
    for n, (p, level, i, j) in enumerate(entries):
        for row, column in np.ndindex(4, 4):
            u, v = (i + column / 3) / 2**level, (j + row / 3) / 2**level
            height = (1 - v) * (0.2 * u) + v * (1 - u + 0.4 * u)
            place = np.append(
                naive_patches.surface(points[p], u, v)[:3] + 0.2 * height * naive_normal(points[p], u, v), 1
            )
            x, y, w, z = naive_patches.to_screen([place], matrix, *SIZE)[0]
            assert np.allclose(grids.vertices[n, 4 * row + column, :3], [x / w, y / w, z / w], atol=2e-3)


def test_neighbours_share_the_displaced_vertices_of_their_edge():
    relief = np.random.default_rng(1).integers(0, 256, (5, 7), dtype=np.uint8)
    entries = squares((0, 1, 0, 0), (0, 1, 1, 0))
    grids = dice_displaced(bent(2), entries, VIEW.matrix(*SIZE), *SIZE, H200, relief=relief, relief_height=0.1).outputs
    assert (grids.vertices[0, 3::4, :3] == grids.vertices[1, 0::4, :3]).all()


@settings(max_examples=25, deadline=None)
@given(
    st.integers(0, 2**31), st.floats(0.0, 0.1), st.sampled_from([4.0, 8.0, 16.0]), st.floats(2.0, 6.0),
)  # fmt: skip
def test_no_vertex_and_no_sample_leaves_its_bound(seed, height, bound, distance):
    """Each vertex within ``room``, each grid within the bound, and its slots lose no sample."""
    random = np.random.default_rng(seed)
    points, relief = bent(seed), random.integers(0, 256, (6, 6), dtype=np.uint8)
    eye = type(VIEW)((0.3, -distance, 0.6 * distance), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 40.0, 0.1, 50.0)
    matrix = eye.matrix(*SIZE)
    try:
        room = padded(points, matrix, *SIZE, bound, height)
    except TilestampError:
        assume(False)
    parts = bound_and_split(points, room.matrix, room.width, room.height, room.bound, H200).outputs
    grids = dice_displaced(points, parts, matrix, *SIZE, H200, relief=relief, relief_height=height).outputs
    plain = dice(points, parts, matrix, *SIZE, H200).outputs
    on_screen = (plain.boxes[:, :2] < SIZE).all(axis=1) & (plain.boxes[:, 2:] > 0).all(axis=1)
    moved = np.abs(grids.vertices[on_screen, :, :2] - plain.vertices[on_screen, :, :2])
    assert moved.max(initial=0) <= room.room + 1e-3
    assert (grids.boxes[:, 2:] - grids.boxes[:, :2]).max(initial=0) <= bound * (1 + 1e-5)  # float32 corners
    own, wide = (hits(grids, screen_tiles(*SIZE, 4, size)) for size in (bound, 500.0))
    assert np.array_equal(own, wide)


def hits(grids, tiles):
    (count, idx), _, _ = bucket_count(grids.boxes, tiles, H200)
    start = bucket_scan(count, H200).outputs
    lists = bucket_write(grids.boxes, tiles, count, start, idx, H200).outputs
    return tile_raster(grids.vertices, count, start, lists, tiles, *SIZE, H200).outputs.overdraw


def test_what_displacement_brings_onto_the_screen_is_not_culled():
    """A patch tilted to the right, just left of the screen."""
    points = flat(size=0.4)
    points[..., 2] = points[..., 0]  # its normal points to the left and up, or to the right and down
    points[..., 0] -= 1.24
    scene, white = Scene("outside", Patches(points)), np.full((2, 2), 255, np.uint8)
    frame = {"machine": "h200", "width": 64, "height": 64, "camera": np.diag([1.0, 1.0, -0.5, 1.0]), "bound": 32.0}
    seen = [
        (simulate(Scene("outside", Patches(net)), relief=white, relief_height=0.3, **frame).depth < 1).sum()
        for net in (points, points.reshape(1, 4, 4, 4).transpose(0, 2, 1, 3).reshape(1, 16, 4))
    ]
    assert (simulate(scene, **frame).depth == 1).all()
    assert max(seen) > 0


def test_a_flat_relief_leaves_the_picture_almost_as_it_is():
    size = {"machine": "h200", "width": 160, "height": 120}
    plain = simulate("teapot", **size)
    other = simulate("teapot", relief=np.zeros((2, 2), np.uint8), relief_height=0.0, **size)
    assert (plain.image != other.image).any(axis=2).mean() < 1e-3
    assert other.frame.facts["widest_grid"] <= 4.0


def test_room_is_exact_for_a_parallel_projection():
    """There w is 1: a step along a unit vector moves a pixel by its row's length."""
    matrix = np.diag([0.5, 0.25, -0.1, 1.0])
    room = padded(flat(), matrix, 200, 100, 50.0, 0.1)
    assert room.room == pytest.approx(0.1 * 0.5 * 100)
    assert (room.width, room.height) == (200 + 2 * math.ceil(room.room), 100 + 2 * math.ceil(room.room))
    assert room.bound == pytest.approx(50 - 2 * room.room)


@pytest.mark.parametrize(
    "options", [{"grid": 5}, {"shading": "shared"}, {"cull": "sorted"}, {"bound_rule": "pixel_extent"}]
)
def test_what_does_not_go_together_is_refused(options):
    with pytest.raises(TilestampError, match=r"^relief"):
        MicropolygonOptions(relief=np.zeros((2, 2), np.uint8), **options)


def test_displacement_beyond_the_bound_or_at_the_eye_is_refused():
    for height, said in ((1.0, "more than twice"), (1e3, "too near to the eye")):
        with pytest.raises(TilestampError, match=said):
            simulate(
                "teapot", machine="h200", width=64, height=48, relief=np.zeros((2, 2), np.uint8), relief_height=height
            )
    with pytest.raises(TilestampError, match="must be"):
        simulate("teapot", machine="h200", width=64, height=48, relief=np.zeros((2, 2, 2), np.uint8))
