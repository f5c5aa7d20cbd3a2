"""Lists by tile of moving triangles: a thread a triangle, each entry with a mask of the samples that it may cover.

As Ru's lists (``ru2016/tile_lists``): a first launch counts, a scan gives each list its place, and a second one fills,
with an atomic and a store of 8 bytes for each pair. The lanes of a warp step through their tiles together, and in each
through the intervals of time and lens, so that a step is as long as its longest lane.
"""

from dataclasses import replace
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.atomics import add_requests, count_atomics
from tilestamp.models.coalescing import contiguous, transactions
from tilestamp.models.counters import count, ratio, shown
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.stochastic.bounds import Visits
from tilestamp.simulator.stages.thread_per_item import Access, thread_per_item
from tilestamp.simulator.work import Work

BLOCK = 128  # threads
SCAN_BLOCK = 256
TRIANGLE_BYTES = 96  # two ends, three corners, four words
ENTRY_BYTES = 8  # triangle and mask
COUNTER_BYTES = 4


@shown(
    count("VISIT_LANES", "pairs of triangle and tile looked at"),
    ratio("bound_share", "APPEND_LANES", "VISIT_LANES", "pairs that are listed"),
)
class MovingListEvent(IntEnum):
    """Events of one block."""

    WARPS = 0
    WARP_LANES = 1
    VISIT_STEPS = 2  # warp steps over tiles
    VISIT_LANES = 3
    BOUND_STEPS = 4  # warp steps over bounds: one over all of shutter and lens, then one an interval
    BOUND_LANES = 5
    APPENDS = 6  # warp steps in which a lane appends
    APPEND_LANES = 7
    ATOMIC_LANES = 8
    ATOMIC_REQUESTS = 9
    ATOMIC_CONFLICTS = 10
    ATOMIC_DEPTH = 11
    LOAD_TRANSACTIONS = 12
    LOAD_BYTES = 13
    STORE_TRANSACTIONS = 14
    STORE_BYTES = 15
    LONGEST_BOUNDS = 16  # most bound steps of a warp: the dependent chain of the block
    LONGEST_APPENDS = 17


class MovingLists(NamedTuple):
    """Triangles by tile, in their order.

    Parameters
    ----------
    starts : ndarray, (tiles + 1,), int64
    entries : ndarray, (starts[-1],), int32
    masks : ndarray, (starts[-1],), int64
        Samples of a pixel that the entry may cover, a bit each.
    """

    starts: NDArray[np.int64]
    entries: NDArray[np.int32]
    masks: NDArray[np.int64]


def moving_lists(
    visits: Visits, tiles: int, simt: Simt, triangle_bytes: int = TRIANGLE_BYTES, owners: NDArray[Any] | None = None
) -> StageResult[MovingLists]:
    """Make the lists from what the bounds found.

    Parameters
    ----------
    visits : Visits
    tiles : int
        Of the screen.
    simt : Simt
    triangle_bytes : int
        Read by each thread.
    owners : ndarray, (threads,), optional
        Triangle of each thread; none: its own number.

    Returns
    -------
    outputs : MovingLists
    works : count, scan and fill
    """
    simt = Simt(*map(int, simt))
    listed = np.flatnonzero(visits.masks)
    order = listed[np.argsort(visits.tiles[listed], kind="stable")]
    of = np.arange(len(visits.starts) - 1) if owners is None else owners
    triangles = np.repeat(of.astype(np.int32), np.diff(visits.starts))
    starts = np.searchsorted(visits.tiles[order], np.arange(tiles + 1))
    table = np.zeros((max(1, -(-(len(visits.starts) - 1) // BLOCK)), len(MovingListEvent)), np.int64)
    requests = np.zeros(tiles * COUNTER_BYTES // 32 + 1, np.int64)
    _count(*visits, starts.copy(), requests, simt, triangle_bytes, table)
    lists = MovingLists(starts, triangles[order], visits.masks[order])
    return StageResult(lists, _works(table, requests, triangle_bytes * (len(visits.starts) - 1), tiles, simt))


def _works(
    table: NDArray[np.int64], requests: NDArray[np.int64], footprint: int, tiles: int, simt: Simt
) -> tuple[Work, ...]:
    loaded, stored, asked = (
        int(table[:, event].sum())
        for event in (MovingListEvent.LOAD_BYTES, MovingListEvent.STORE_BYTES, MovingListEvent.ATOMIC_REQUESTS)
    )
    counters = Stream("tile_counters", "atomic", 32 * asked, COUNTER_BYTES * tiles)
    streams = (Stream("triangles", "load", loaded, footprint), counters)
    filling = Work("moving_lists", MovingListEvent, table, BLOCK, streams=streams, atomic_requests=requests)
    counted = table.copy()
    counted[:, [MovingListEvent.STORE_TRANSACTIONS, MovingListEvent.STORE_BYTES]] = 0
    appended = ENTRY_BYTES * int(table[:, MovingListEvent.APPEND_LANES].sum())
    scan = thread_per_item(
        "moving_lists", "tile_scan", tiles, SCAN_BLOCK, simt,
        (Access("tile_counters", COUNTER_BYTES, 1),), (Access("tile_starts", COUNTER_BYTES, 1),),
    )  # fmt: skip
    entries = Stream("tile_lists", "store", stored, appended)
    return (
        replace(filling, kernel="moving_counts", table=counted),
        scan,
        replace(filling, streams=(*filling.streams, entries)),
    )


@kernel
def _count(
    starts: Any,
    tiles: Any,
    masks: Any,
    bounds: Any,
    next_place: Any,
    requests: Any,
    simt: Simt,
    triangle_bytes: int,
    table: Any,
) -> None:
    """Count what each warp of triangles does: lanes take the next tile of their boxes together."""
    counters, places = np.empty(simt.warp, np.int64), np.empty(simt.warp, np.int64)
    triangles = len(starts) - 1
    for first in range(0, triangles, simt.warp):
        row, last = table[first // BLOCK], min(first + simt.warp, triangles)
        number, size = contiguous(first * triangle_bytes, (last - first) * triangle_bytes, simt.coalescing)
        row[MovingListEvent.WARPS] += 1
        row[MovingListEvent.WARP_LANES] += last - first
        row[MovingListEvent.LOAD_TRANSACTIONS] += number
        row[MovingListEvent.LOAD_BYTES] += size
        step, bound_steps, appends = 0, 0, 0
        while True:
            looking, longest, appending = 0, 0, 0
            for p in range(first, last):
                counters[p - first], places[p - first] = -1, -1
                at = starts[p] + step
                if at >= starts[p + 1]:
                    continue
                looking += 1
                longest = max(longest, bounds[at])
                row[MovingListEvent.BOUND_LANES] += bounds[at]
                if masks[at]:
                    appending += 1
                    counters[p - first] = COUNTER_BYTES * tiles[at]
                    places[p - first] = ENTRY_BYTES * next_place[tiles[at]]
                    next_place[tiles[at]] += 1
            if not looking:
                break
            step += 1
            bound_steps += longest
            row[MovingListEvent.VISIT_STEPS] += 1
            row[MovingListEvent.VISIT_LANES] += looking
            if appending:
                appends += 1
                _append(counters, places, last - first, requests, simt, row)
        row[MovingListEvent.BOUND_STEPS] += bound_steps
        row[MovingListEvent.LONGEST_BOUNDS] = max(row[MovingListEvent.LONGEST_BOUNDS], bound_steps)
        row[MovingListEvent.LONGEST_APPENDS] = max(row[MovingListEvent.LONGEST_APPENDS], appends)


@kernel
def _append(counters: Any, places: Any, lanes: int, requests: Any, simt: Simt, row: Any) -> None:
    """Count one warp's atomic and its store."""
    active, asked, conflicts, depth = count_atomics(counters, lanes, simt.atomic_merge)
    add_requests(counters, lanes, simt.atomic_merge, 0, requests)
    number, size = transactions(places, lanes, ENTRY_BYTES, simt.coalescing)
    row[MovingListEvent.APPENDS] += 1
    row[MovingListEvent.APPEND_LANES] += active
    row[MovingListEvent.ATOMIC_LANES] += active
    row[MovingListEvent.ATOMIC_REQUESTS] += asked
    row[MovingListEvent.ATOMIC_CONFLICTS] += conflicts
    row[MovingListEvent.ATOMIC_DEPTH] += depth
    row[MovingListEvent.STORE_TRANSACTIONS] += number
    row[MovingListEvent.STORE_BYTES] += size
