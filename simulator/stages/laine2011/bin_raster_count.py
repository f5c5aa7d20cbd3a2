"""What bin raster counts: loads, atomics, segments and their writes, and what a round waits for."""

from typing import Any

from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.laine2011.bin_raster_cover import WARP
from tilestamp.simulator.stages.laine2011.bin_raster_events import BinRasterEvent

BLOCK = 512  # threads, and triangles of a round
BIN_SEGMENT = 512  # entries
ENTRY_BYTES = 4
SINGLE, FAST, SLOW = 0, 1, 2  # path of a warp: all boxes one bin, none over 2 x 2, anything


@kernel(lent=True)
def count_load(events: Any, loads: int, segments: int, size: int) -> None:
    """Count loads, their transactions and bytes."""
    events[BinRasterEvent.LOAD] += loads
    events[BinRasterEvent.LOAD_TRANSACTIONS] += segments
    events[BinRasterEvent.LOAD_BYTES] += size


@kernel(lent=True)
def count_atomic(events: Any, executed: int) -> None:
    """One thread's global atomic: a draw, or the allocation of a round's segments."""
    events[BinRasterEvent.ATOMIC] += executed
    events[BinRasterEvent.ATOMIC_LANES] += executed
    events[BinRasterEvent.ATOMIC_REQUESTS] += executed
    events[BinRasterEvent.ATOMIC_DEPTH] += executed


@kernel(lent=True)
def visible_of(subtriangles: Any) -> tuple[int, int]:
    """Warps of a read with a visible triangle, and with one that has several sub-triangles."""
    visible, several = 0, 0
    for first in range(0, subtriangles.size, WARP):
        most = 0
        for n in subtriangles[first : first + WARP]:
            most = max(most, int(n))
        visible, several = visible + (most > 0), several + (most > 1)
    return visible, several


@kernel(lent=True)
def count_bins(bins: int, events: Any) -> None:
    """Count the warps of a round with a bin each, and the clears of the masks of all warps."""
    warps = (bins + WARP - 1) // WARP
    events[BinRasterEvent.BIN_WARPS] += warps
    events[BinRasterEvent.BIN_LANES] += bins
    events[BinRasterEvent.MASK_CLEARS] += BLOCK // WARP * warps
    events[BinRasterEvent.MASK_WARPS] += BLOCK // WARP
    events[BinRasterEvent.MASK_LANES] += BLOCK // WARP * min(bins, WARP)


@kernel(lent=True)
def count_longest(walk: int, steps: int, paths: int, events: Any) -> None:
    """Count what a round waits for: its longest walk, its most steps of a slow warp, and the paths that are taken."""
    events[BinRasterEvent.LONGEST_WALKS] += walk
    events[BinRasterEvent.LONGEST_SLOW] += steps
    events[BinRasterEvent.SINGLE_ROUNDS] += paths & 1
    events[BinRasterEvent.FAST_ROUNDS] += (paths >> FAST) & 1
    events[BinRasterEvent.SLOW_ROUNDS] += (paths >> SLOW) & 1


@kernel(lent=True)
def count_segments(given: Any, counts: Any, scratch: Any, events: Any) -> None:
    """Count new segments of a round: a bin needs one where its entries pass a multiple of 512.

    Its link is written where the last one ends; the new one's own link and count stand beside those of its neighbours.
    """
    before = scratch.before
    fresh, warps, stores = 0, 0, 0
    for first in range(0, counts.size, WARP):
        mine = 0
        for b in range(first, min(first + WARP, counts.size)):
            if _segments(counts[b]) > _segments(before[b]):
                scratch.segment[b] = scratch.warps[1] + fresh + mine
                mine += 1
            before[b] = counts[b]
        if mine > 0:
            stores += mine + 2 * _sectors(scratch.warps[1] + fresh, mine, given.segment_bytes)
        fresh, warps = fresh + mine, warps + (mine > 0)
    scratch.warps[1] += fresh
    _count_store(events, stores, given.segment_bytes)
    events[BinRasterEvent.SEGMENTS] += fresh
    events[BinRasterEvent.ALLOC_WARPS] += warps
    events[BinRasterEvent.SHARED_ATOMIC] += warps
    events[BinRasterEvent.ALLOC_ROUNDS] += fresh > 0
    count_atomic(events, fresh > 0)


@kernel(lent=True)
def count_closing(given: Any, counts: Any, scratch: Any, events: Any) -> None:
    """Count the open segments at the end of a batch, and the writes of their counts."""
    for first in range(0, counts.size, WARP):
        closing, last = 0, -1
        stores = 0
        for b in range(first, min(first + WARP, counts.size)):
            if counts[b] % BIN_SEGMENT:
                closing += 1
                here = scratch.segment[b] * ENTRY_BYTES >> given.segment_log2
                stores, last = stores + (here != last), here
        events[BinRasterEvent.CLOSING_WARPS] += closing > 0
        _count_store(events, stores, given.segment_bytes)


@kernel(lent=True)
def _count_store(events: Any, segments: int, size: int) -> None:
    events[BinRasterEvent.STORE_TRANSACTIONS] += segments
    events[BinRasterEvent.STORE_BYTES] += segments * size


@kernel(lent=True)
def _sectors(first: int, words: int, size: int) -> int:
    """Memory segments of ``words`` words from word ``first`` on."""
    return ((first + words) * ENTRY_BYTES - 1) // size - first * ENTRY_BYTES // size + 1


@kernel(lent=True)
def _segments(entries: int) -> int:
    return (entries + BIN_SEGMENT - 1) // BIN_SEGMENT
