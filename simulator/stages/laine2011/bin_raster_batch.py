"""One batch of bin raster: reads, rounds of 512 and the three coverage paths (Laine & Karras 2011, section 4).

A batch is what a block draws from its queue. It counts the entries of each bin and every event, and lists its pairs of
a bin and an entry, which are put in their places when all batches have been counted.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.laine2011.bin_raster_count import (
    BLOCK,
    ENTRY_BYTES,
    FAST,
    SINGLE,
    SLOW,
    count_atomic,
    count_bins,
    count_closing,
    count_load,
    count_longest,
    count_segments,
    count_visible,
)
from tilestamp.simulator.stages.laine2011.bin_raster_cover import (
    BIN_SIDE_LOG2,
    COLUMNS,
    ROWS,
    SINGLE_TRIANGLE,
    WARP,
    WarpBoxes,
    X,
    Y,
    entry_slot,
    header_load,
    lane_edges,
    new_boxes,
    room_for,
    small_votes,
    touches,
    walk_votes,
    warp_boxes,
)
from tilestamp.simulator.stages.laine2011.bin_raster_events import BinRasterEvent

RING = 2048  # entries that wait for their round


class BinInput(NamedTuple):
    """What triangle setup leaves for bin raster, and the grid of bins."""

    subtriangles: NDArray[np.uint8]
    headers: NDArray[np.int16]
    misc: NDArray[np.uint32]
    half_x: int  # sub-pixels from the lower-left corner to the centre of the viewport
    half_y: int
    bins_x: int
    bins_y: int
    segment_bytes: int  # of the machine's memory transactions
    segment_log2: int


class BinScratch(NamedTuple):
    """Working space of one batch."""

    ring: NDArray[np.int64]  # (RING,) queue entries
    before: NDArray[np.int64]  # (bins,) entries before the round
    stamp: NDArray[np.int64]  # (steps, bins) last warp and memory segment that wrote to the bin at that step
    warps: NDArray[np.int64]  # (2,) warps and segments so far
    segment: NDArray[np.int64]  # (bins,) last segment of each bin, by the order of allocation in the batch


@kernel
def _new_scratch(bins: int, counting: bool) -> Any:
    steps = bins if counting else 0
    stamp = np.zeros((steps, bins), np.int64)
    i64 = np.int64
    return BinScratch(np.empty(RING, i64), np.zeros(bins, i64), stamp, np.zeros(2, i64), np.zeros(bins, i64))


@kernel(lent=True)
def _read_step(given: BinInput, ring: Any, read: int, write: int, first: int, end: int, events: Any) -> tuple[int, int]:
    """Read 512 counts and append their sub-triangles in order; returns the next triangle and the ring's end.

    The first triangle whose sub-triangles do not all fit, and all after it, are read again later.
    """
    last = min(first + BLOCK, end)
    go_on, start = last, write
    visible, most = 0, 0
    for triangle in range(first, last):  # several at once
        n = given.subtriangles[np.uint64(triangle)]
        visible, most = visible + (n > 0), max(most, n)
    if most <= 1 and write + visible - read < RING:
        for triangle in range(first, last):  # without a branch: what is culled is overwritten by the next
            ring[np.uint64(write & (RING - 1))] = triangle * 8 + SINGLE_TRIANGLE
            write += given.subtriangles[np.uint64(triangle)]
    else:
        for triangle in range(first, last):
            n = int(given.subtriangles[triangle])
            if write + n - read > RING:
                go_on = triangle
                break
            for k in range(n):
                ring[(write + k) % RING] = triangle * 8 + (SINGLE_TRIANGLE if n == 1 else k)
            write += n
    if events is not None:
        warps = (last - first + WARP - 1) // WARP
        events[BinRasterEvent.READ_STEPS] += 1
        events[BinRasterEvent.READ_WARPS] += warps
        events[BinRasterEvent.READ_LANES] += last - first
        events[BinRasterEvent.VISIBLE_LANES] += visible
        events[BinRasterEvent.ENTRIES] += write - start
        events[BinRasterEvent.OVERFLOWS] += go_on < last
        for start in range(first, last, WARP):  # a byte a lane
            segments = ((min(start + WARP, last) - 1) >> given.segment_log2) - (start >> given.segment_log2) + 1
            count_load(events, 1, segments, segments * given.segment_bytes)
            count_visible(given.subtriangles[start : min(start + WARP, last)], events)
    return go_on, write


@kernel(lent=True)
def _load_warp(given: BinInput, ring: Any, first: int, lanes: int, boxes: WarpBoxes) -> tuple[int, int, int]:
    """Boxes of a warp's triangles; returns the path that follows from them, bins of the largest box, and of all."""
    for lane in range(lanes):
        boxes.slot[lane] = entry_slot(ring[(first + lane) % RING], given.misc)
    largest, area, side = warp_boxes(
        boxes,
        lanes,
        given.headers,
        given.half_x,
        given.half_y,
        BIN_SIDE_LOG2,
        given.bins_x - 1,
        given.bins_y - 1,
    )
    if side <= 2:
        return (FAST if largest > 1 else SINGLE), largest, area
    for lane in range(lanes):
        lane_edges(boxes, lane, given.half_x, given.half_y, BIN_SIDE_LOG2)
    return SLOW, largest, area


@kernel(lent=True)
def _emit_warp(
    given: BinInput,
    path: int,
    boxes: WarpBoxes,
    lanes: int,
    scratch: BinScratch,
    first: int,
    counts: Any,
    pairs: Any,
    used: int,
    events: Any,
) -> int:
    """List a warp's triangles with the bins that they touch; count the segments of memory that this writes.

    Returns the pairs in use.
    """
    start, stores = used, 0
    for lane in range(lanes):
        x, y = np.int64(boxes.box[X + lane]), np.int64(boxes.box[Y + lane])
        step = 0
        for row in range(np.int64(boxes.box[ROWS + lane])):
            for column in range(np.int64(boxes.box[COLUMNS + lane])):
                if path != SLOW or touches(boxes, lane, column, row):
                    b = x + column + (y + row) * given.bins_x
                    pairs[used, 0], pairs[used, 1] = b, scratch.ring[(first + lane) % RING]
                    if events is not None:
                        mark = (scratch.warps[0] << 32) | (counts[b] * ENTRY_BYTES >> given.segment_log2)
                        stores += scratch.stamp[step, b] != mark
                        scratch.stamp[step, b] = mark
                    counts[b] += 1
                    used += 1
                step += 1
    if events is not None:
        events[BinRasterEvent.EMITS] += used - start
        events[BinRasterEvent.STORE_TRANSACTIONS] += stores
        events[BinRasterEvent.STORE_BYTES] += stores * given.segment_bytes
    return used


@kernel(lent=True)
def _distinct_bins(boxes: WarpBoxes, lanes: int) -> int:
    """Distinct bins of a warp whose boxes are one bin each."""
    distinct = 0
    for lane in range(lanes):
        new = True
        for other in range(lane - 1, -1, -1):
            if boxes.box[X + other] == boxes.box[X + lane] and boxes.box[Y + other] == boxes.box[Y + lane]:
                new = False
                break
        distinct += new
    return distinct


@kernel(lent=True)
def _count_warp(
    given: BinInput, path: int, largest: int, area: int, boxes: WarpBoxes, lanes: int, scratch: BinScratch, first: int,
    events: Any,
) -> None:  # fmt: skip
    """Count what a warp's loads, its path and the walk to its queues cost."""
    indirect = False
    for lane in range(lanes):
        indirect |= scratch.ring[(first + lane) % RING] & 7 != SINGLE_TRIANGLE
    events[BinRasterEvent.BOX_BINS] += area
    events[BinRasterEvent.INDIRECT_WARPS] += indirect
    if path == SINGLE:
        events[BinRasterEvent.SINGLE_WARPS] += 1
        events[BinRasterEvent.SINGLE_LANES] += lanes
        events[BinRasterEvent.SINGLE_LOOPS] += _distinct_bins(boxes, lanes)
        ors, replays = 0, 0
    elif path == FAST:
        events[BinRasterEvent.FAST_WARPS] += 1
        events[BinRasterEvent.FAST_LANES] += lanes
        ors, replays = small_votes(boxes, lanes, given.bins_x)
    else:
        events[BinRasterEvent.SLOW_WARPS] += 1
        events[BinRasterEvent.SLOW_LANES] += lanes
        events[BinRasterEvent.SLOW_STEPS] += largest
        events[BinRasterEvent.SLOW_LANE_STEPS] += area
        ors, replays, ends = walk_votes(boxes, lanes, largest, given.bins_x)
        events[BinRasterEvent.ROW_ENDS] += ends
    events[BinRasterEvent.WALK_STEPS] += largest
    events[BinRasterEvent.ENQUEUE_STEPS] += ors if path == SLOW else largest
    events[BinRasterEvent.SHARED_ATOMIC] += ors
    events[BinRasterEvent.BANK_REPLAYS] += replays
    count_load(events, 1, *header_load(boxes, lanes, given.segment_bytes))


@kernel
def play_batch(given: BinInput, b: int, batch: int, counts: Any, events: Any) -> Any:
    """Bin the input triangles of batch b, of ``batch`` triangles; fills ``counts`` by bin, returns pairs, (n, 2).

    A pair is a bin and an entry of it; those of a bin come in their order.
    """
    pairs, used = np.empty((batch, 2), np.int32), np.int64(0)
    first, end = b * batch, min((b + 1) * batch, given.subtriangles.size)
    scratch, boxes = _new_scratch(counts.size, events is not None), new_boxes()
    read = write = np.int64(0)  # literals that change in a loop have their callees compiled twice
    while True:
        while write - read < BLOCK and first < end:
            first, write = _read_step(given, scratch.ring, read, write, first, end, events)
        m: Any = min(BLOCK, write - read)
        longest, steps, paths = 0, 0, 0
        for start in range(read, read + m, WARP):
            lanes = min(WARP, read + m - start)
            path, largest, area = _load_warp(given, scratch.ring, start, lanes, boxes)
            if events is not None:
                scratch.warps[0] += 1
                longest, paths = max(longest, largest), paths | (1 << path)
                steps = max(steps, largest if path == SLOW else 0)
                _count_warp(given, path, largest, area, boxes, lanes, scratch, start, events)
            pairs = room_for(pairs, used, area)
            used = _emit_warp(given, path, boxes, lanes, scratch, start, counts, pairs, used, events)
        if events is not None:
            events[BinRasterEvent.ROUNDS] += 1
            events[BinRasterEvent.ROUND_WARPS] += (m + WARP - 1) // WARP
            events[BinRasterEvent.TRIANGLES] += m
            count_bins(counts.size, events)
            count_longest(longest, steps, paths, events)
            count_segments(given, counts, scratch, events)
        read += m
        if read == write and first >= end:
            break
    if events is not None:
        events[BinRasterEvent.BATCHES] += 1
        events[BinRasterEvent.CLOSED_SEGMENTS] += np.count_nonzero(counts)
        count_closing(given, counts, scratch, events)
        count_atomic(events, 1)
    return pairs[:used]
