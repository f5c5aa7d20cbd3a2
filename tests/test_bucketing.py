"""Parallel bucketing: exact lists, and conflicts as the machine would meet them."""

import csv

import numpy as np
import pytest
from numba import get_num_threads, set_num_threads

from tests.diced_scenes import diced
from tests.naive_tiles import naive_buckets, naive_conflicts
from tilestamp.models.atomics import count_atomics
from tilestamp.models.simt import AtomicMerge, Coalescing, Simt
from tilestamp.simulator.stages.eisenacher2010.bucket_conflicts import atomic_rule, count_wanted, most_wanted
from tilestamp.simulator.stages.eisenacher2010.bucket_count import BucketCountEvent as Event
from tilestamp.simulator.stages.eisenacher2010.bucket_count import bucket_count
from tilestamp.simulator.stages.eisenacher2010.bucket_scan import BucketScanEvent, bucket_scan
from tilestamp.simulator.stages.eisenacher2010.bucket_write import BucketWriteEvent, bucket_write
from tilestamp.simulator.stages.eisenacher2010.tile_range import screen_tiles

GT200 = Simt(32, Coalescing.HALF_WARP_SEGMENTS, 16, 16, AtomicMerge.NONE, 30)
H200 = Simt()
WIDTH, HEIGHT = 100, 60


def some_boxes(number, bound, seed=1, step=1.5):
    """Boxes below ``bound`` along a random walk, so that neighbours share tiles; some lie off the screen."""
    random = np.random.default_rng(seed)
    center = np.cumsum(random.normal(0, step, (number, 2)), axis=0) % [WIDTH + 8, HEIGHT + 8] - 4
    size = random.uniform(0, bound, (number, 2))
    return np.hstack([center, center + size]).astype(np.float32)


def bucketed(boxes, tile, bound, simt, **options):
    tiles = screen_tiles(WIDTH, HEIGHT, tile, bound)
    (count, idx), works, _ = bucket_count(boxes, tiles, simt, **options)
    start, scans, _ = bucket_scan(count, simt)
    lists, writes, _ = bucket_write(boxes, tiles, count, start, idx, simt)
    return tiles, count, idx, start, lists, works, scans, writes


@pytest.mark.parametrize("simt", [GT200, H200])
@pytest.mark.parametrize(("tile", "bound"), [(4, 4), (8, 4), (32, 8), (4, 8)])
def test_lists_are_those_of_one_thread_after_the_other(tile, bound, simt):
    boxes = some_boxes(700, bound)
    tiles, count, idx, start, lists, *_ = bucketed(boxes, tile, bound, simt)
    naive_count, naive_idx, naive_lists = naive_buckets(boxes, tile, tiles.columns, tiles.rows, tiles.slots, simt.warp)
    assert count.tolist() == naive_count
    assert idx.tolist() == naive_idx
    assert [lists[s : s + n].tolist() for s, n in zip(start, count, strict=True)] == naive_lists


@pytest.mark.parametrize("aggregate", [False, True])
@pytest.mark.parametrize("padding", [1, 8, 3])
@pytest.mark.parametrize("simt", [GT200, H200, H200._replace(warp=16), H200._replace(warp=64)])
def test_conflicts_are_those_counted_lane_by_lane(simt, padding, aggregate):
    boxes = some_boxes(333, 4)
    tiles, *_, works, _, _ = bucketed(boxes, 8, 4, simt, padding=padding, aggregate=aggregate)
    expected = naive_conflicts(boxes, 8, tiles.columns, tiles.rows, tiles.slots, simt, padding, aggregate)
    assert {name: works[1].total(Event[name]) for name in expected} == expected


@pytest.mark.parametrize("merge", list(AtomicMerge))
def test_a_warp_is_counted_by_the_rules_of_the_machine(merge):
    random = np.random.default_rng(3)
    rule = atomic_rule(H200._replace(atomic_merge=merge), 1)
    words, chunks, sent = np.empty(32, np.int64), np.zeros(8, np.int64), 0
    for _ in range(200):
        tile = random.integers(-3, 40, 32)
        counters, _, depth, _, _, requests = count_wanted(tile, 32, rule, words, chunks)
        active, sent = int((tile >= 0).sum()), sent + requests
        addresses = np.where(tile >= 0, 4 * tile, -1)
        assert (active, requests, active - counters, depth) == count_atomics(addresses, 32, merge)
        assert most_wanted(tile, 32) == depth
    assert chunks.sum() == sent


def test_three_slots_a_side_when_a_bound_is_larger_than_a_tile():
    assert screen_tiles(WIDTH, HEIGHT, 4, 8).slots == 3
    assert screen_tiles(WIDTH, HEIGHT, 8, 8).slots == 2


def test_padding_to_a_chunk_a_counter_leaves_every_lock_to_one_tile():
    works = bucketed(some_boxes(500, 4), 8, 4, GT200, padding=8)[5]
    assert works[1].total(Event.LOCK_DEPTH) == works[1].total(Event.GROUP_DEPTH)


def test_aggregation_leaves_no_conflict_and_the_same_lists():
    boxes = some_boxes(500, 4)
    plain, merged = bucketed(boxes, 8, 4, H200), bucketed(boxes, 8, 4, H200, aggregate=True)
    assert merged[5][1].total(Event.ATOMIC_CONFLICTS) == 0
    assert np.array_equal(plain[4], merged[4])


def test_counts_add_up_over_tiles_patches_and_chunks():
    _, count, _, start, lists, works, _, writes = bucketed(some_boxes(900, 4), 8, 4, H200)
    total = int(count.sum())
    assert int(start[-1] + count[-1]) == total == len(lists)
    assert works[1].total(Event.SLOT_LANES) == total == writes[0].total(BucketWriteEvent.WRITE_LANES)
    assert works[1].atomic_requests.sum() == works[1].total(Event.ATOMIC_REQUESTS)


def test_without_merging_each_chunk_gets_as_many_requests_as_patches():
    _, count, *_, works, _, _ = bucketed(some_boxes(900, 4), 8, 4, GT200)
    assert np.array_equal(works[1].atomic_requests, np.add.reduceat(count, np.arange(0, len(count), 8)))


def test_nothing_depends_on_counting_or_on_threads():
    boxes = some_boxes(2000, 4)
    tiles = screen_tiles(WIDTH, HEIGHT, 8, 4)
    threads = get_num_threads()
    results = [bucket_count(boxes, tiles, GT200), bucket_count(boxes, tiles, GT200, counting=False)]
    set_num_threads(1)
    try:
        results.append(bucket_count(boxes, tiles, GT200))
    finally:
        set_num_threads(threads)
    for (count, idx), _, _ in results:
        assert np.array_equal(count, results[0].outputs.counts)
        assert np.array_equal(idx, results[0].outputs.idx)
    assert np.array_equal(results[0].works[1].table, results[2].works[1].table)
    assert np.array_equal(results[0].works[1].atomic_requests, results[2].works[1].atomic_requests)


def test_an_empty_queue_makes_empty_lists():
    *_, lists, works, _, writes = bucketed(some_boxes(0, 4), 8, 4, H200)
    assert len(lists) == 0
    assert len(works[1].table) == 0 == len(writes[0].table)


def test_a_scan_of_more_than_a_block_scans_the_sums_of_blocks_and_adds_them_back():
    random = np.random.default_rng(5)
    count = random.integers(0, 50, 1024 * 1024 + 7).astype(np.uint32)
    start, works, _ = bucket_scan(count, H200)
    assert start.tolist() == [0, *np.cumsum(count)[:-1].tolist()]
    assert [(w.kernel, w.grid) for w in works] == [
        ("scan_blocks", 1025),
        ("scan_blocks", 2),
        ("scan_blocks", 1),
        ("add_sums", 2),
        ("add_sums", 1025),
    ]


def test_a_scan_reads_and_writes_each_counter_once_a_level():
    _, works, _ = bucket_scan(np.zeros(1000, np.uint32), H200)
    assert works[0].total(BucketScanEvent.LOAD_BYTES) == works[0].total(BucketScanEvent.STORE_BYTES) == 4000


def test_writes_of_one_warp_to_one_list_share_segments():
    boxes = np.tile(np.float32([1, 1, 2, 2]), (64, 1))
    writes = bucketed(boxes, 8, 4, H200)[7]
    assert writes[0].total(BucketWriteEvent.STORE_BYTES) == 64 * 4


@pytest.mark.shared
@pytest.mark.parametrize("tile", [4, 8, 16, 32])
@pytest.mark.parametrize("name", ["teapot_512x512_bb4", "teapot_512x512_bb8"])
def test_conflicts_of_the_measured_scenes(name, tile, shared):
    """The statistics of the H200's own inputs; our grids differ from them by float32 rounding of a few boxes."""
    grids, camera = diced(shared, name)
    with (shared / "silicon" / "micropolygon_conflicts.csv").open() as file:
        published = {
            r["metric"]: int(r["value"]) for r in csv.DictReader(file) if (r["scene"], r["tile"]) == (name, str(tile))
        }
    tiles = screen_tiles(camera["width"], camera["height"], tile, camera["bound_pixels"])
    (count, _), works, _ = bucket_count(grids.boxes, tiles, H200)
    ours = {
        "atomic_instructions": works[1].total(Event.ATOMIC),
        "lane_atomics": works[1].total(Event.ATOMIC_LANES),
        "distinct_addresses_summed_over_instructions": works[1].total(Event.ATOMIC_LANES)
        - works[1].total(Event.ATOMIC_CONFLICTS),
        "distinct_sectors_summed_over_instructions": works[1].total(Event.ATOMIC_SECTORS),
        "sum_of_max_multiplicity": works[1].total(Event.ATOMIC_DEPTH),
        "max_COUNT": int(count.max()),
    }
    assert ours == pytest.approx({key: published[key] for key in ours}, rel=1e-3)
