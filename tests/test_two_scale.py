"""Tiles in two scales: the lists and the picture of one level, and who walks through what."""

import numpy as np
import pytest

from tests.test_tile_raster import HEIGHT, WIDTH, drawn, some_grids
from tilestamp.experiments.exploration import two_scale
from tilestamp.models.errors import TilestampError
from tilestamp.models.machine import load_machine
from tilestamp.simulator.pipelines.micropolygon import MicropolygonOptions
from tilestamp.simulator.simulation import simulate
from tilestamp.simulator.stages.eisenacher2010.bucket_count import bucket_count
from tilestamp.simulator.stages.eisenacher2010.bucket_scan import bucket_scan
from tilestamp.simulator.stages.eisenacher2010.bucket_write import bucket_write
from tilestamp.simulator.stages.eisenacher2010.macro_raster import MacroRasterEvent, macro_raster
from tilestamp.simulator.stages.eisenacher2010.refine_buckets import RefineEvent, refine_buckets
from tilestamp.simulator.stages.eisenacher2010.tile_range import screen_tiles

H200, GTX280 = load_machine("h200").simt, load_machine("gtx280").simt


def bucketed(vertices, tile, simt=H200, bound=4):
    boxes = np.hstack([vertices[..., :2].min(axis=1), vertices[..., :2].max(axis=1)])
    tiles = screen_tiles(WIDTH, HEIGHT, tile, bound)
    (count, idx), _, _ = bucket_count(boxes, tiles, simt)
    start = bucket_scan(count, simt).outputs
    return boxes, count, start, bucket_write(boxes, tiles, count, start, idx, simt).outputs, tiles


def lists_of(count, start, lists):
    return [lists[s : s + n].tolist() for s, n in zip(start.tolist(), count.tolist(), strict=True)]


@pytest.mark.parametrize("simt", [H200, GTX280])
@pytest.mark.parametrize(("coarse", "tile"), [(16, 4), (16, 8), (32, 4), (32, 16)])
def test_refined_buckets_have_the_grids_of_one_level(coarse, tile, simt):
    vertices = some_grids(300)
    boxes, count, start, lists, large = bucketed(vertices, coarse, simt)
    fine, (work,), _ = refine_buckets(boxes, count, start, lists, large, screen_tiles(WIDTH, HEIGHT, tile, 4), simt)
    one = bucketed(vertices, tile, simt)
    assert list(map(sorted, lists_of(*fine))) == list(map(sorted, lists_of(*one[1:4])))
    assert work.total(RefineEvent.ENTRIES) == len(one[3]) == len(fine.lists)
    assert work.total(RefineEvent.SLOT_LANES) == 2 * len(one[3])  # counted, and then written
    assert work.total(RefineEvent.BATCH_LANES) == 2 * len(lists)


def test_shared_counters_replay_for_lanes_that_want_the_same():
    vertices = np.repeat(some_grids(1), 32, axis=0)
    vertices[..., :2] += 10 - vertices[..., :2].min(axis=(0, 1))  # within one tile of 16, and one of 8
    boxes, count, start, lists, large = bucketed(vertices, 16)
    work = refine_buckets(boxes, count, start, lists, large, screen_tiles(WIDTH, HEIGHT, 8, 4), H200).works[0]
    assert work.total(RefineEvent.SHARED_ATOMIC) == 2
    assert work.total(RefineEvent.BANK_REPLAYS) == 2 * 31


def naive_walks(boxes, lists, coarse, tile, columns):
    """Grids that each warp of a coarse tile walks through: 32 lanes are a warp, or two of an 8x8 tile."""
    sides, batch, turn = coarse // tile, coarse**2 // 16, max(1, 32 // tile**2)
    found = []
    for block, members in enumerate(lists):
        left, top = block % columns * coarse, block // columns * coarse
        walked = critical = 0
        for first in range(0, len(members), batch):
            warps = [0] * (sides**2 // turn)
            for f in range(sides**2):
                x, y = left + f % sides * tile, top + f // sides * tile
                for grid in members[first : first + batch]:
                    x0, y0, x1, y1 = boxes[grid]
                    on_screen = x < WIDTH and y < HEIGHT
                    warps[f // turn] += on_screen and x1 >= x and x0 < x + tile and y1 >= y and y0 < y + tile
            walked, critical = walked + sum(warps), critical + max(warps)
        found.append((walked * max(1, tile**2 // 32), critical))
    return found


@pytest.mark.parametrize(("coarse", "tile"), [(16, 4), (16, 8), (32, 4), (32, 8)])
def test_warps_walk_through_their_own_fine_tile_and_wait_for_the_busiest(coarse, tile):
    vertices = some_grids(500)
    boxes, count, start, lists, large = bucketed(vertices, coarse)
    fine = screen_tiles(WIDTH, HEIGHT, tile, 4)
    pixels, (work,), _ = macro_raster(vertices, boxes, count, start, lists, large, fine, WIDTH, HEIGHT, H200)
    image, depth, overdraw, works, *_ = drawn(vertices, tile)
    assert np.array_equal(pixels.image, image)
    assert np.array_equal(pixels.depth, depth)
    assert np.array_equal(pixels.overdraw, overdraw)
    naive = naive_walks(boxes, lists_of(count, start, lists), coarse, tile, large.columns)
    assert work.table[:, MacroRasterEvent.WALK_WARPS].tolist() == [walked for walked, _ in naive]
    assert work.table[:, MacroRasterEvent.CRITICAL_GRIDS].tolist() == [critical for _, critical in naive]
    for name in ("QUAD_WARPS", "SUBTILE_PASS", "BOX_WARPS", "BOX_LANES", "HIT_LANES", "SAMPLE_TESTS"):
        assert work.total(MacroRasterEvent[name]) == works[0].total(works[0].events[name]), name
    assert work.total(MacroRasterEvent.MASK_LANES) == len(lists)
    assert work.block == coarse**2


@pytest.mark.parametrize("machine", ["gtx280", "h200"])
@pytest.mark.parametrize("options", [{"tile": 4}, {"tile": 8}, {"tile": 8, "second_level": "buckets"}])
@pytest.mark.parametrize("bound", [4.0, 16.0])
def test_the_picture_is_that_of_one_level(options, bound, machine):
    size = {"machine": machine, "width": 160, "height": 120, "bound": bound}
    one, two = simulate("teapot", **size), simulate("teapot", coarse=16, **options, **size)
    assert np.array_equal(one.image, two.image)
    assert np.array_equal(one.depth, two.depth)


@pytest.mark.parametrize(
    "options",
    [{"coarse": 16, "tile": 16}, {"coarse": 32, "tile": 16}, {"coarse": 16, "spp": 4},
     {"coarse": 16, "box_tests": False}, {"coarse": 16, "grid": 5}, {"coarse": 16, "shading": "visible"}],
)  # fmt: skip
def test_what_does_not_go_together_is_refused(options):
    with pytest.raises(TilestampError, match=r"^coarse tiles"):
        MicropolygonOptions(**options)


def test_a_machine_without_blocks_of_a_coarse_tile_is_left_out():
    assert two_scale._run("masks, 8 in 32", 4.0, "gtx280") is None
