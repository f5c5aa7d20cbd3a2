"""Events of tile raster and dicing that follow from the lengths of lists, by hand; a transaction is 32 bytes.

What depends on coverage is in ``naive_tiles``.
"""

import numpy as np
import pytest

from tests.test_counts_of_warps import nonzero
from tests.test_tile_raster import GT200, H200, HEIGHT, WIDTH, drawn, some_grids
from tilestamp.models.coalescing import transactions
from tilestamp.simulator.stages.eisenacher2010.dice_counts import DiceEvent, dice_work
from tilestamp.simulator.stages.eisenacher2010.tile_range import screen_tiles
from tilestamp.simulator.stages.eisenacher2010.tile_raster import tile_raster
from tilestamp.simulator.stages.eisenacher2010.tile_raster_events import TileRasterEvent as E

COVERAGE = {"BOX_WARPS", "BOX_LANES", "HIT_WARPS", "HIT_LANES", "Z_WARPS", "Z_LANES", "SUBTILE_PASS", "SAMPLE_TESTS"}
FIVE_GRIDS = {  # in a tile of 8 x 8: 64 threads, 2 warps, 4 grids of 16 vertices in shared memory at once
    "PIXEL_WARPS": 2,
    "PIXEL_LANES": 64,
    "LIST_WARPS": 2,
    "GRIDS": 5,
    "BATCHES": 2,  # of 4 grids and of 1
    "BATCH_WARPS": 4,
    "GATHER_WARPS": 3,  # 64 lanes, then 16
    "GATHER_LANES": 80,
    "QUAD_WARPS": 5 * 9 * 2,
    "QUAD_LANES": 5 * 9 * 64,
    "BARRIERS": 8,  # each warp before and after each batch
    "SHARED_ACCESSES": 3 + 4 * 90,  # vertices stored; four of them read for each quad
    "BANK_REPLAYS": 3 * 3,  # 16-byte vectors: a quarter-warp a pass
    "LOAD_TRANSACTIONS": 2 * 2 + 3 + 5 * 8,  # COUNT and START by each warp; two indices at a time; 256 bytes a grid
    "STORE_TRANSACTIONS": 2 * 8,  # colour and depth, rows of 32 bytes
}


def five_in_the_first_tile(**options):
    """Counts of a tile with five grids."""
    vertices = some_grids(5, size=3.0)
    vertices[..., :2] = 1 + vertices[..., :2] % 5
    *_, works, _, _ = drawn(vertices, width=64, height=8, **options)
    (work,) = works
    counts = {event.name: int(work.table[0, event]) for event in E}
    assert work.total(E.GRIDS) == 5
    return counts


def bytes_of(expected):
    """Each transaction is a sector."""
    return {f"{kind}_BYTES": 32 * expected[f"{kind}_TRANSACTIONS"] for kind in ("LOAD", "STORE")}


def test_a_tile_with_five_grids():
    counts = five_in_the_first_tile()
    expected = FIVE_GRIDS | bytes_of(FIVE_GRIDS)
    expected |= {"SUBTILE_TEST_WARPS": 90, "SUBTILE_TEST_LANES": 2880}
    expected |= {"BOX_TEST_WARPS": 2 * counts["SUBTILE_PASS"], "BOX_TEST_LANES": 64 * counts["SUBTILE_PASS"]}
    expected |= {"EDGE_SETUP_WARPS": counts["BOX_WARPS"], "SAMPLE_HITS": counts["HIT_LANES"]}
    assert {name: n for name, n in nonzero(counts).items() if name not in COVERAGE} == expected


def test_samples_are_resolved_through_shared_memory():
    """Four sub-tiles: each warp stores and loads each once, at words a tile's row apart from lane to lane or two."""
    plain, sampled = five_in_the_first_tile(), five_in_the_first_tile(spp=4)
    assert sampled["RESOLVE_WARPS"] == 2
    assert sampled["SHARED_ACCESSES"] == plain["SHARED_ACCESSES"] + 2 * 4 * 2
    assert sampled["BARRIERS"] == plain["BARRIERS"] + 2 * 2
    assert (sampled["SUBTILE_TEST_WARPS"], sampled["SUBTILE_TEST_LANES"]) == (4 * 90, 4 * 2880)
    assert sampled["STORE_TRANSACTIONS"] == 8  # colour alone
    # a warp's stores: 4 rows of 8 words, 16 words apart: two rows to a bank; its loads: 8 words 2 apart, rows 32 apart
    assert sampled["BANK_REPLAYS"] - plain["BANK_REPLAYS"] == 2 * 4 * ((2 - 1) + (4 - 1))


def test_without_box_tests_every_thread_evaluates_every_quad():
    counts = five_in_the_first_tile(box_tests=False)
    assert counts["SUBTILE_TEST_WARPS"] == counts["BOX_TEST_WARPS"] == 0
    assert (counts["SUBTILE_PASS"], counts["BOX_WARPS"], counts["BOX_LANES"]) == (45, 90, 2880)
    assert counts["SAMPLE_TESTS"] == 2880


def test_loaded_edges_are_432_bytes_a_grid():
    """27 vectors by 16 lanes and by 11; of an even grid 8 + 6 sectors, of an odd one 9 + 6."""
    plain, loaded = five_in_the_first_tile(), five_in_the_first_tile(edges="loaded")
    assert (loaded["EDGE_GATHER_WARPS"], loaded["EDGE_GATHER_LANES"]) == (6, 135)
    assert loaded["EDGE_SETUP_WARPS"] == 0
    assert loaded["SHARED_ACCESSES"] == plain["SHARED_ACCESSES"] + 6 + 3 * plain["BOX_WARPS"]
    assert loaded["BANK_REPLAYS"] == plain["BANK_REPLAYS"] + 6 * 3
    assert loaded["LOAD_TRANSACTIONS"] == plain["LOAD_TRANSACTIONS"] + 3 * 14 + 2 * 15


def test_an_empty_tile_reads_its_count_and_writes_its_pixels():
    *_, works, _, _ = drawn(some_grids(0), width=64, height=8)
    counts = {event.name: int(works[0].table[0, event]) for event in E}
    assert nonzero(counts) == {
        "PIXEL_WARPS": 2, "PIXEL_LANES": 64, "LOAD_TRANSACTIONS": 2, "LOAD_BYTES": 64, "STORE_TRANSACTIONS": 16,
        "STORE_BYTES": 512,
    }  # fmt: skip


@pytest.mark.parametrize("textured", [False, True])
def test_dicing_five_sub_patches_of_three_patches(textured):
    """80 lanes; half-warps that share a patch share its 8 sectors."""
    work = dice_work(np.array([0, 0, 1, 1, 2], np.int32), 3, textured, H200)
    expected = {
        "VERTEX_WARPS": 3,
        "VERTEX_LANES": 80,
        "PATCHES": 5,
        "LOAD_TRANSACTIONS": 3 * 8 + 3,  # points; and an entry or two of 8 bytes a warp
        "STORE_TRANSACTIONS": 40 + 3,  # vertices of 16 bytes; and a box or two of 16 a warp
        "TEXTURE_LANES": 80 * textured,
    }
    expected |= bytes_of(expected)
    assert nonzero(work.counts()) == nonzero(expected)
    assert set(work.counts()) == {event.name for event in DiceEvent}


@pytest.mark.parametrize("simt", [GT200, H200])
def test_each_tile_stores_its_pixels_on_the_screen_wherever_it_begins(simt):
    tiles, nothing = screen_tiles(WIDTH, HEIGHT, 8, 4), np.zeros(0, np.uint32)
    lists = np.zeros(tiles.total, np.uint32), np.zeros(tiles.total, np.uint32), nothing
    table = tile_raster(np.zeros((0, 16, 4), np.float32), *lists, tiles, WIDTH, HEIGHT, simt)[1][0].table
    for block, row in enumerate(table):
        x, y = np.arange(64) % 8 + block % tiles.columns * 8, np.arange(64) // 8 + block // tiles.columns * 8
        addresses = np.where((x < WIDTH) & (y < HEIGHT), 4 * (y * WIDTH + x), -1)
        warps = [transactions(warp, 32, 4, int(simt.coalescing)) for warp in addresses.reshape(2, 32)]
        assert [row[E.STORE_TRANSACTIONS], row[E.STORE_BYTES]] == [2 * sum(each) for each in zip(*warps, strict=True)]
