"""Culling grids behind what a tile shows: the same picture, fewer tests; and what the sort does."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.test_tile_raster import HEIGHT, WIDTH, drawn, some_grids
from tests.test_two_scale import bucketed
from tilestamp.experiments.exploration import overlap
from tilestamp.models.errors import TilestampError
from tilestamp.models.machine import load_machine
from tilestamp.simulator.pipelines.micropolygon import MicropolygonOptions
from tilestamp.simulator.simulation import simulate
from tilestamp.simulator.stages.eisenacher2010.culled_raster import (
    MARGIN,
    SORTED_TOGETHER,
    CulledRasterEvent,
    culled_raster,
)

H200 = load_machine("h200").simt


def culled(vertices, tile=8, *, by_depth=True):
    _, count, start, lists, tiles = bucketed(vertices, tile)
    return culled_raster(vertices, count, start, lists, tiles, WIDTH, HEIGHT, H200, by_depth=by_depth)


def covering(depths, seed=3):
    """Grids that each cover the first tile, at some depths."""
    place = np.stack(np.meshgrid(np.arange(4), np.arange(4)), axis=-1).reshape(16, 2) / 3
    vertices = np.zeros((len(depths), 16, 4), np.float32)
    vertices[..., :2] = 10 * place - 1
    vertices[..., 2] = np.asarray(depths, np.float32)[:, None]
    vertices.view(np.uint32)[..., 3] = np.random.default_rng(seed).integers(0, 2**24, (len(depths), 1)) | 0xFF000000
    return vertices


@pytest.mark.parametrize("by_depth", [True, False])
@pytest.mark.parametrize("tile", [4, 8, 16])
def test_the_picture_is_that_of_all_grids(tile, by_depth):
    vertices = some_grids(2000, size=9)
    image, depth, *_ = drawn(vertices, tile, bound=9)
    _, count, start, lists, tiles = bucketed(vertices, tile, bound=9)
    pixels, (work,), _ = culled_raster(vertices, count, start, lists, tiles, WIDTH, HEIGHT, H200, by_depth=by_depth)
    assert np.array_equal(pixels.image, image)
    assert np.array_equal(pixels.depth, depth)
    table = work.table
    assert (table[:, CulledRasterEvent.GRIDS] + table[:, CulledRasterEvent.CULLED]).tolist() == count.tolist()
    assert work.total(CulledRasterEvent.CULLED) > 0.2 * len(lists)


def naive_culled(depths, batch, *, by_depth):
    """Grids passed over in a tile that each grid covers: one after the other, as a block would."""
    order = sorted(depths) if by_depth else depths
    far = shown = 1.0
    taken = 0
    for depth in order:
        if depth - MARGIN >= far:
            continue
        shown, taken = min(shown, depth), taken + 1
        if taken % batch == 0:
            far = shown
    return len(depths) - taken


@settings(max_examples=30, deadline=None)
@given(st.lists(st.integers(1, 60), min_size=1, max_size=50), st.booleans())
def test_grids_passed_over_are_those_of_one_block_run_by_itself(places, by_depth):
    depths = [float(np.float32(place / 64)) for place in places]
    work = culled(covering(depths), by_depth=by_depth).works[0]
    assert work.table[0, CulledRasterEvent.CULLED] == naive_culled(depths, 4, by_depth=by_depth)


def test_a_grid_as_near_as_what_is_shown_is_culled_only_behind_the_margin():
    near = [0.5] * 4
    for depth, gone in ((0.5, 0), (0.5 + float(MARGIN) / 2, 0), (0.5 + 2 * float(MARGIN), 1)):
        work = culled(covering([*near, depth]), by_depth=False).works[0]
        assert work.table[0, CulledRasterEvent.CULLED] == gone


def test_a_pixel_that_nothing_covers_keeps_all_grids():
    vertices = covering(np.linspace(0.1, 0.9, 40))
    vertices[..., 0] *= 0.8  # leaves the last column of the tile
    assert culled(vertices).works[0].table[0, CulledRasterEvent.CULLED] == 0


@pytest.mark.parametrize(("grids", "bits", "pieces"), [(1, 0, 1), (2, 1, 1), (33, 6, 1), (SORTED_TOGETHER, 10, 1)])
def test_a_bitonic_sort_has_so_many_steps(grids, bits, pieces):
    work = culled(covering(np.linspace(0.1, 0.9, grids))).works[0]
    steps = pieces * bits * (bits + 1) // 2
    assert work.table[0, CulledRasterEvent.SORT_STEPS] == steps
    assert work.table[0, CulledRasterEvent.SORT_WARPS] == steps * math.ceil((1 << bits) / 2 / 32)
    assert work.shared_bytes >= 8 * grids


def test_longer_lists_are_sorted_by_pieces_and_none_is_lost():
    depths = np.random.default_rng(2).uniform(0.1, 0.9, SORTED_TOGETHER + 10)
    vertices = covering(depths)
    pixels, (work,), _ = culled(vertices)
    assert work.table[0, CulledRasterEvent.SORT_STEPS] == 55 + 10  # 1024 and 16
    assert np.array_equal(pixels.image[:8, :8], drawn(vertices)[0][:8, :8])


@pytest.mark.parametrize("machine", ["gtx280", "h200"])
@pytest.mark.parametrize("cull", ["behind", "sorted"])
def test_a_frame_is_the_same_with_fewer_tests(cull, machine):
    size = {"machine": machine, "width": 160, "height": 120}
    plain, other = simulate("teapot", **size), simulate("teapot", cull=cull, **size)
    assert np.array_equal(plain.image, other.image)
    assert np.array_equal(plain.depth, other.depth)
    assert other.counts["tile_raster.SAMPLE_TESTS"] < 0.85 * plain.counts["tile_raster.SAMPLE_TESTS"]
    assert other.counts["dice.STORE_BYTES"] > plain.counts["dice.STORE_BYTES"]


def test_of_many_sheets_sorting_leaves_the_first():
    run = overlap.sheets("sorted", 8).run("h200")
    assert run.counts["tile_raster.CULLED"] > 0.8 * run.counts["tile_raster.LISTED"]
    assert np.array_equal(run.image, overlap.sheets("none", 8).run("h200").image)


@pytest.mark.parametrize("options", [{"spp": 4}, {"tile": 32}, {"coarse": 16}, {"shading": "shared"}, {"hybrid": True}])
def test_what_does_not_go_together_is_refused(options):
    with pytest.raises(TilestampError, match=r"^cull"):
        MicropolygonOptions(cull="sorted", **options)
