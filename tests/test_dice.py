"""Dice: positions, boxes, normals and colours of grids."""

import json
import math

import numpy as np
import pytest

from tests import naive_patches
from tilestamp.models.errors import TilestampError
from tilestamp.models.simt import Coalescing, Simt
from tilestamp.simulator.scenes import LookAt, load_scene
from tilestamp.simulator.stages.eisenacher2010.bound_and_split import SubPatches, bound_and_split
from tilestamp.simulator.stages.eisenacher2010.dice import dice
from tilestamp.simulator.stages.eisenacher2010.dice_counts import DiceEvent, dice_work
from tilestamp.simulator.stages.eisenacher2010.snap_edges import Snapped, snap_works

GTX280 = Simt(warp=32, coalescing=Coalescing.HALF_WARP_SEGMENTS, banks=16, bank_lanes=16)
VIEW = LookAt((1.0, -5.0, 2.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 40.0, 0.1, 50.0)
SIZE = (96, 64)


def squares(*entries):
    """Sub-patches from (patch, level, i, j)."""
    patch, level, i, j = zip(*entries, strict=True)
    types = (np.int32, np.uint8, np.uint16, np.uint16)
    arrays = [np.array(column, dtype) for column, dtype in zip((patch, level, i, j), types, strict=True)]
    return SubPatches(*arrays, np.empty((0, 5), np.int64))


def flat(height=0.0, size=1.0):
    """Make a flat square patch with its edges along x and y, facing up."""
    y, x = np.divmod(np.arange(16), 4)
    columns = [(x / 3 - 0.5) * size, (y / 3 - 0.5) * size, 0 * x + height, 0 * x + 1]
    return np.stack(columns, axis=1).astype(np.float32)[None]


def colors(grids):
    """RGBA bytes of all vertices, (N, 16, 4)."""
    return np.ascontiguousarray(grids.vertices[:, :, 3]).view(np.uint8).reshape(len(grids.vertices), 16, 4)


@pytest.mark.small
def test_positions_and_depths_are_those_of_a_slow_evaluation():
    rng = np.random.default_rng(7)
    points = np.repeat(flat(), 2, axis=0)
    points[..., :3] += rng.uniform(-0.3, 0.3, (2, 16, 3)).astype(np.float32)
    weights = rng.uniform(0.5, 2.0, (2, 16, 1)).astype(np.float32)
    rational = points * weights
    entries = [(0, 0, 0, 0), (1, 2, 3, 1), (0, 5, 31, 0), (1, 9, 300, 17)]
    matrix = VIEW.matrix(*SIZE)
    for net in (points, rational):
        grids, _, _ = dice(net, squares(*entries), matrix, *SIZE, GTX280, counting=False)
        slow = [naive_patches.grid(net[p], level, i, j, matrix, *SIZE) for p, level, i, j in entries]
        assert np.abs(grids.vertices[..., :2] - np.array(slow)[..., :2]).max() < 1e-3
        assert np.abs(grids.vertices[..., 2] - np.array(slow)[..., 2]).max() < 1e-6


def test_boxes_bound_the_sixteen_vertices():
    grids, _, _ = dice(flat(), squares((0, 1, 1, 0), (0, 0, 0, 0)), VIEW.matrix(*SIZE), *SIZE, GTX280)
    xy = grids.vertices[..., :2]
    assert (grids.boxes == np.concatenate([xy.min(axis=1), xy.max(axis=1)], axis=1)).all()


def test_neighbours_share_the_vertices_of_their_common_edge():
    grids, _, _ = dice(flat(), squares((0, 1, 0, 0), (0, 1, 1, 0)), VIEW.matrix(*SIZE), *SIZE, GTX280)
    assert (grids.vertices[0, 3::4, :3] == grids.vertices[1, 0::4, :3]).all()


def test_row_zero_is_the_top_of_the_image():
    matrix = np.eye(4)  # clip space as it is: y up
    grids, _, _ = dice(flat(size=2.0), squares((0, 0, 0, 0)), matrix, *SIZE, GTX280)
    assert np.allclose(grids.boxes[0], [0, 0, *SIZE], atol=1e-4)
    assert np.allclose(grids.vertices[0, 0, :2], [0, SIZE[1]], atol=1e-4)  # x = y = -1


def test_a_rational_quarter_circle_is_round():
    """A quadratic arc with weight sqrt(1/2) raised to a cubic: radius 1 at every vertex."""
    h = math.sqrt(0.5)
    p0, p1, p2 = np.array([1, 0, 0, 1.0]), np.array([h, h, 0, h]), np.array([0, 1, 0, 1.0])
    arc = [p0, (p0 + 2 * p1) / 3, (2 * p1 + p2) / 3, p2]
    points = np.array([[np.add(q, [0, 0, row * q[3] / 3, 0]) for row in range(4) for q in arc]], np.float32)
    grids, _, _ = dice(points, squares((0, 0, 0, 0), (0, 1, 1, 1)), np.eye(4), 2, 2, GTX280)
    x, y = grids.vertices[..., 0] - 1, 1 - grids.vertices[..., 1]
    assert np.abs(np.hypot(x, y) - 1).max() < 1e-6


def test_a_square_lit_from_the_front_is_brighter_than_one_seen_edge_on():
    top = LookAt((0.0, 0.0, 5.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 40.0, 0.1, 50.0)
    low = LookAt((0.0, -5.0, 0.3), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 40.0, 0.1, 50.0)
    white = np.full((1, 1, 3), 255, np.uint8)
    bright, dark = (
        colors(dice(flat(), squares((0, 0, 0, 0)), view.matrix(*SIZE), *SIZE, GTX280, texture=white)[0])
        for view in (top, low)
    )
    assert bright[..., 0].min() > dark[..., 0].max()


def test_both_sides_of_a_surface_are_lit():
    white = np.full((1, 1, 3), 255, np.uint8)
    turned = flat()[:, ::-1]  # u reversed and v reversed keeps the side; swapping them does not
    other = flat().reshape(1, 4, 4, 4).transpose(0, 2, 1, 3).reshape(1, 16, 4)
    front, kept, back = (
        colors(dice(net, squares((0, 0, 0, 0)), VIEW.matrix(*SIZE), *SIZE, GTX280, texture=white)[0])
        for net in (flat(), turned, other)
    )
    assert (np.sort(front, axis=1) == np.sort(kept, axis=1)).all()
    assert (np.sort(front, axis=1) == np.sort(back, axis=1)).all()


@pytest.mark.parametrize("edge", [slice(0, 4), slice(12, 16), slice(0, 16, 4), slice(3, 16, 4)])
def test_a_collapsed_edge_is_shaded_like_its_surroundings(edge):
    white = np.full((1, 1, 3), 255, np.uint8)
    points = flat()
    points[0, edge] = points[0, edge].mean(axis=0)
    grids, _, _ = dice(points, squares((0, 0, 0, 0)), VIEW.matrix(*SIZE), *SIZE, GTX280, texture=white)
    shades = colors(grids)[0, :, 0].astype(int)
    assert np.ptp(shades) <= 3
    assert shades.min() > 60


def test_a_patch_that_is_one_point_has_a_colour_and_no_nan():
    points = np.broadcast_to(np.float32([0.1, 0.2, 0.3, 1.0]), (1, 16, 4)).copy()
    grids, _, _ = dice(points, squares((0, 0, 0, 0)), VIEW.matrix(*SIZE), *SIZE, GTX280)
    assert np.isfinite(grids.vertices[..., :3]).all()
    assert (colors(grids)[..., 3] == 255).all()
    assert (colors(grids)[..., 0] > 0).all()


def test_texture_lies_with_u_to_the_right_and_v_down():
    texture = np.zeros((2, 2, 4), np.uint8)
    texture[0, 1, 0] = texture[1, 0, 1] = 255  # red at the end of u, green at the end of v
    grids, _, _ = dice(flat(), squares((0, 0, 0, 0)), VIEW.matrix(*SIZE), *SIZE, GTX280, texture=texture)
    shown = colors(grids)[0].astype(int)
    assert shown[3, 0] > shown[3, 1] + 50
    assert shown[12, 1] > shown[12, 0] + 50


def test_counting_changes_nothing_but_the_works():
    entries = squares(*[(0, 3, k, k) for k in range(8)])
    counted, works, _ = dice(flat(), entries, VIEW.matrix(*SIZE), *SIZE, GTX280)
    uncounted, none, _ = dice(flat(), entries, VIEW.matrix(*SIZE), *SIZE, GTX280, counting=False)
    assert counted.vertices.tobytes() == uncounted.vertices.tobytes()
    assert len(works) == 1
    assert none == ()


def test_a_half_warp_dices_a_patch_in_whole_segments():
    work = dice(flat(), squares(*[(0, 0, 0, 0)] * 17), VIEW.matrix(*SIZE), *SIZE, GTX280)[1][0]
    assert work.table[:, DiceEvent.PATCHES].tolist() == [16, 1]
    assert work.total(DiceEvent.VERTEX_LANES) == 17 * 16
    assert work.total(DiceEvent.VERTEX_WARPS) == 9
    # 16 points of 16 bytes are two segments of 128 bytes, and the entry one of 32; then two of vertices and the box
    assert work.total(DiceEvent.LOAD_TRANSACTIONS) == 17 * 3
    assert work.total(DiceEvent.STORE_BYTES) == 17 * (256 + 32)


def sectors_of_a_block(patches):
    """32-byte sectors that the warps of one block touch: the points of two sub-patches, and their queue entries."""
    sectors = 0
    for first in range(0, len(patches), 2):
        pair = patches[first : first + 2]
        sectors += len({(16 * patch + point) * 16 // 32 for patch in pair for point in range(16)}) + 1
    return sectors


def test_a_warp_loads_the_sectors_that_it_touches_once():
    """Queue neighbours are mostly of one urPatch, and a warp holds two of them."""
    patches = np.sort(np.random.default_rng(3).integers(0, 12, 77)).astype(np.int32)
    table = dice_work(patches, 12, False, Simt()).table
    expected = [sectors_of_a_block(patches[first : first + 16].tolist()) for first in range(0, 77, 16)]
    assert table[:, DiceEvent.LOAD_TRANSACTIONS].tolist() == expected
    assert (table[:, DiceEvent.LOAD_BYTES] == 32 * np.array(expected)).all()


@pytest.mark.parametrize(("patches", "sectors"), [([5, 5], 8 + 1), ([5, 6], 16 + 1), ([5], 8 + 1), ([5, 6, 6], 26)])
def test_two_half_warps_share_the_sectors_of_one_patch(patches, sectors):
    work = dice_work(np.array(patches, np.int32), 8, False, Simt())
    assert work.total(DiceEvent.LOAD_TRANSACTIONS) == sectors


@pytest.mark.parametrize(("together", "sectors"), [(1, 136_000), (2, 72_000), (3, 93_336)])
def test_loads_are_those_that_an_h200_counts(together, sectors):
    """Read by ncu on an H200: 16,000 sub-patches, so many of one patch in a row; queue entry and control points."""
    work = dice_work((np.arange(16_000) // together).astype(np.int32), 16_000, False, Simt())
    assert work.total(DiceEvent.LOAD_TRANSACTIONS) == sectors


def test_snapping_dices_again_the_sub_patches_that_it_touches():
    patch = np.array([0, 1, 1, 2, 2, 2, 3], np.int32)
    touched = np.array([0, 1, 0, 1, 0, 1, 0], np.bool_)
    again = snap_works(Snapped(None, touched, np.ones(7, np.int64)), patch, 4, Simt(), textured=False)[1]
    assert again.total(DiceEvent.LOAD_TRANSACTIONS) == (16 + 1) + (8 + 1)  # 1 and 2 in a warp, then 2 alone


@pytest.mark.parametrize("simt", [GTX280, Simt(coalescing=Coalescing.WARP_LINES)])
def test_rules_that_serve_parts_of_a_warp_share_nothing(simt):
    same, other = (dice_work(np.array(patches, np.int32), 8, False, simt) for patches in ([5, 5], [5, 6]))
    assert same.total(DiceEvent.LOAD_TRANSACTIONS) == other.total(DiceEvent.LOAD_TRANSACTIONS)


def test_no_sub_patches_are_no_grids():
    entries = SubPatches(*(array[:0] for array in squares((0, 0, 0, 0))))
    grids, works, _ = dice(flat(), entries, VIEW.matrix(*SIZE), *SIZE, GTX280)
    assert grids.vertices.shape == (0, 16, 4)
    assert works[0].table.shape == (0, len(DiceEvent))


@pytest.mark.parametrize("texture", [np.zeros((2, 2), np.uint8), np.zeros((2, 2, 3)), np.zeros((0, 2, 3), np.uint8)])
def test_textures_of_other_shapes_are_refused(texture):
    with pytest.raises(TilestampError, match="texture must be"):
        dice(flat(), squares((0, 0, 0, 0)), VIEW.matrix(*SIZE), *SIZE, GTX280, texture=texture)


def patches_written(boxes, size, tile, slots):
    """Tiles that the boxes overlap, at most ``slots`` a side."""
    first = np.maximum(np.floor(boxes[:, :2] / tile), 0)
    last = np.minimum(np.floor(boxes[:, 2:] / tile), -(-np.array(size) // tile) - 1)
    last = np.minimum(last, first + slots - 1)
    return int(np.maximum(last - first + 1, 0).prod(axis=1).sum())


@pytest.mark.shared
@pytest.mark.parametrize("name", ["teapot_512x512_bb4", "teapot_512x512_bb8", "bigguy_512x512_bb4"])
def test_patches_written_by_tile_are_those_measured(shared, name):
    scene = json.loads((shared / "silicon" / "micropolygon_cameras.json").read_text())[name]
    points, size = load_scene(scene["model"]).patches.points, (scene["width"], scene["height"])
    camera = scene["model_to_clip"], *size
    subpatches, _, _ = bound_and_split(points, *camera, scene["bound_pixels"], GTX280, counting=False)
    grids, _, _ = dice(points, subpatches, *camera, GTX280, counting=False)
    for tile, written in scene["patches_written_by_tile"].items():
        slots = 3 if scene["bound_pixels"] > int(tile) else 2
        assert patches_written(grids.boxes, size, int(tile), slots) == pytest.approx(written, rel=1e-3)


@pytest.mark.shared
def test_the_killeroo_view_gives_the_papers_sub_patches(shared):
    """270 k sub-patches and 445 k patches rasterized: the second was fitted, the first is predicted within 1 %."""
    scene = load_scene("killeroo")
    matrix = scene.views["default"].matrix(1600, 1200)
    subpatches, _, _ = bound_and_split(
        scene.patches.points, matrix, 1600, 1200, 4, GTX280, bound_rule="pixel_extent", counting=False
    )
    assert len(subpatches.patch) == pytest.approx(270_000, rel=0.01)
    grids, _, _ = dice(scene.patches.points, subpatches, matrix, 1600, 1200, GTX280, counting=False)
    assert patches_written(grids.boxes, (1600, 1200), 8, 2) == pytest.approx(445_000, rel=0.002)
