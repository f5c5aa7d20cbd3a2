"""Every event of the micropolygon front end and of bucketing against Python, the scan's by hand."""

import numpy as np
import pytest

from tests import naive_buckets
from tests.test_bucketing import GT200, H200, bucketed, some_boxes
from tests.test_counts_of_warps import nonzero
from tilestamp.simulator.stages.eisenacher2010.bucket_count import BucketInitEvent, bucket_count
from tilestamp.simulator.stages.eisenacher2010.bucket_scan import BucketScanEvent, bucket_scan
from tilestamp.simulator.stages.eisenacher2010.split_counts import oracle_work, subdivide_work, transform_work
from tilestamp.simulator.stages.eisenacher2010.tile_range import screen_tiles

by_machine = pytest.mark.parametrize("simt", [GT200, H200, H200._replace(warp=16)], ids=["gt200", "h200", "warp 16"])


def queue(length=300, seed=2):
    """Sub-patches of 40 patches in order, with the oracle's word on each, and places for what is left of them."""
    rng = np.random.default_rng(seed)
    patch = np.sort(rng.integers(0, 40, length)).astype(np.int32)
    path = rng.choice(5, length, p=[0.2, 0.4, 0.1, 0.1, 0.2]).astype(np.uint8)
    path[:32] = 1
    wished = np.select([path == 1, path >= 3], [1, 4], 0)
    return patch, path, (np.cumsum(wished) - wished).astype(np.uint32)


@by_machine
def test_transform(simt):
    assert nonzero(transform_work(17, simt).counts()) == nonzero(naive_buckets.transform(17 * 16, simt))


@by_machine
def test_oracle(simt):
    patch, path, _ = queue()
    expected = naive_buckets.oracle(patch.tolist(), path.tolist(), simt)
    assert nonzero(oracle_work(patch, path, simt).counts()) == nonzero(expected)


@by_machine
def test_subdivide(simt):
    _, path, places = queue()
    expected = naive_buckets.subdivide(path.tolist(), places.tolist(), simt)
    assert nonzero(subdivide_work(path, places, simt).counts()) == nonzero(expected)


@by_machine
@pytest.mark.parametrize(("tile", "bound"), [(8, 4), (4, 8)])
def test_bucket_count(tile, bound, simt):
    boxes = some_boxes(333, bound)
    tiles, *_, works, _, _ = bucketed(boxes, tile, bound, simt)
    expected = naive_buckets.bucket_count(boxes, tile, tiles.columns, tiles.rows, tiles.slots, simt)
    assert nonzero(works[1].counts()) == nonzero(expected)


@by_machine
@pytest.mark.parametrize(("tile", "bound"), [(8, 4), (4, 8)])
def test_bucket_write(tile, bound, simt):
    boxes = some_boxes(333, bound)
    tiles, _, idx, start, _, _, _, writes = bucketed(boxes, tile, bound, simt)
    given = (boxes, idx.tolist(), start.tolist(), tile, tiles.columns, tiles.rows, tiles.slots)
    assert nonzero(writes[0].counts()) == nonzero(naive_buckets.bucket_write(*given, simt))


def test_init_clears_a_word_a_thread():
    """150 x 100 pixels in tiles of 4 have 38 x 25 = 950 counters: 256 a block, 182 in the last."""
    work = bucket_count(some_boxes(9, 4), screen_tiles(150, 100, 4, 4), H200).works[0]
    E = BucketInitEvent
    assert work.table[:, E.STORE_WARPS].tolist() == [8, 8, 8, 6]
    assert work.table[:, E.STORE_LANES].tolist() == [256, 256, 256, 182]
    assert work.table[:, E.STORE_TRANSACTIONS].tolist() == [32, 32, 32, 23]
    assert work.table[:, E.STORE_BYTES].tolist() == [1024, 1024, 1024, 736]


def test_scan_of_1500_counters_by_hand():
    """Two blocks of 1024 and 476 counters, one block for their two sums, and the sums added back.

    A sweep over the tree of 256 vectors has 128, 64, 32, 16, 8, 4, 2, 1 lanes: 255, in 4 + 2 + 6 warps.
    """
    _, (scan, sums, add), _ = bucket_scan(np.zeros(1500, np.uint32), H200)
    E = BucketScanEvent
    order = [E.WARPS, E.LANES, E.STEP_WARPS, E.STEP_LANES, E.BARRIER, E.LOAD_TRANSACTIONS, E.LOAD_BYTES]
    order += [E.STORE_TRANSACTIONS, E.STORE_BYTES]
    assert scan.table[:, order].tolist() == [
        [8, 256, 24, 510, 17 * 8, 128, 4096, 129, 4096 + 32],
        [8, 119, 24, 510, 17 * 8, 60, 60 * 32, 61, 61 * 32],
    ]
    assert sums.table[:, order].tolist() == [[8, 1, 24, 510, 17 * 8, 1, 32, 1, 32]]
    assert add.table[:, order].tolist() == [
        [8, 256, 0, 0, 8, 129, 4096 + 32, 128, 4096],
        [8, 119, 0, 0, 8, 61, 61 * 32, 60, 60 * 32],
    ]
