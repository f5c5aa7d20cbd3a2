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
    visible_of,
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
    count_votes,
    find_slots,
    header_load,
    lane_edges,
    new_boxes,
    row_ends,
    touches,
    warp_boxes,
    with_room,
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
    stamp: NDArray[np.int64]  # (bins, bins) at each step last warp and memory segment that wrote to a bin
    warps: NDArray[np.int64]  # (3,) warps and segments so far, and steps whose stamps are clear
    segment: NDArray[np.int64]  # (bins,) last segment of each bin, by the order of allocation in the batch


@kernel
def _new_scratch(bins: int) -> Any:
    i64 = np.int64
    stamp = np.empty((bins, bins), i64)  # most of it is never touched
    return BinScratch(np.empty(RING, i64), np.zeros(bins, i64), stamp, np.zeros(3, i64), np.zeros(bins, i64))


@kernel(lent=True)
def _ready_stamps(scratch: BinScratch, steps: int) -> None:
    """Clear the stamps of steps that no warp before has had; begin the next warp."""
    for step in range(scratch.warps[2], steps):
        for b in range(scratch.stamp.shape[1]):
            scratch.stamp[step, b] = 0
    scratch.warps[2] = max(scratch.warps[2], steps)
    scratch.warps[0] += 1


@kernel(lent=True)
def _read_step(given: BinInput, ring: Any, read: int, write: int, first: int, end: int, events: Any) -> tuple[int, int]:
    """Read 512 counts and append their sub-triangles in order; returns the next triangle and the ring's end.

    The first triangle whose sub-triangles do not all fit, and all after it, are read again later.
    """
    last = min(first + BLOCK, end)
    go_on, start = last, write
    visible, most, visible_warps, multi_warps = 0, 0, 0, 0
    for triangle in range(first, last):  # several at once
        n = given.subtriangles[np.uint64(triangle)]
        visible, most = visible + (n > 0), max(most, n)
    if most <= 1 and write + visible - read < RING:
        for warp in range(first, last, WARP):
            before = write
            for triangle in range(warp, min(warp + WARP, last)):  # without a branch: the next overwrites what is culled
                ring[np.uint64(write & (RING - 1))] = triangle * 8 + SINGLE_TRIANGLE
                write += given.subtriangles[np.uint64(triangle)]
            visible_warps += write > before
    else:
        visible_warps, multi_warps = visible_of(given.subtriangles[first:last])
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
        events[BinRasterEvent.VISIBLE_WARPS] += visible_warps
        events[BinRasterEvent.MULTI_WARPS] += multi_warps
        segments = 0
        for warp in range(first, last, WARP):  # a byte a lane
            segments += ((min(warp + WARP, last) - 1) >> given.segment_log2) - (warp >> given.segment_log2) + 1
        count_load(events, warps, segments, segments * given.segment_bytes)
    return go_on, write


@kernel(lent=True)
def _load_warp(given: BinInput, ring: Any, first: int, lanes: int, boxes: WarpBoxes) -> tuple[int, int, int, bool]:
    """Boxes of a warp's triangles; returns its path, bins of the largest, of all, and what find_slots returns."""
    indirect = find_slots(ring[first % RING : first % RING + lanes], given.misc, boxes)  # rounds do not wrap around
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
        return (FAST if largest > 1 else SINGLE), largest, area, indirect
    for lane in range(lanes):
        lane_edges(boxes, lane, given.half_x, given.half_y, BIN_SIDE_LOG2)
    return SLOW, largest, area, indirect


@kernel(lent=True)
def _emit_single(
    given: BinInput, boxes: WarpBoxes, lanes: int, scratch: BinScratch, counts: Any, pairs: Any, used: int, events: Any
) -> int:
    """``_emit_warp`` of triangles in a bin each, a run of lanes with the same bin at a time; count the bins, too."""
    lane, stores, distinct, number = 0, 0, 0, scratch.warps[0]
    while lane < lanes:
        b, start = np.uint64(boxes.box[X + lane] + boxes.box[Y + lane] * given.bins_x), lane
        while lane < lanes and np.uint64(boxes.box[X + lane] + boxes.box[Y + lane] * given.bins_x) == b:
            at = np.uint64(used + lane)
            pairs[at, 0], pairs[at, 1] = b, boxes.entry[lane]
            lane += 1
        if events is not None:
            first = (number << 32) | (counts[b] * ENTRY_BYTES >> given.segment_log2)
            last = (number << 32) | ((counts[b] + lane - start - 1) * ENTRY_BYTES >> given.segment_log2)
            stores += last - first + (scratch.stamp[0, b] != first)
            distinct += scratch.stamp[0, b] >> 32 != number
            scratch.stamp[0, b] = last
        counts[b] += lane - start
    if events is not None:
        events[BinRasterEvent.SINGLE_LOOPS] += distinct
        _count_emits(given, lanes, stores, events)
    return used + lanes


@kernel(lent=True)
def _count_emits(given: BinInput, emits: int, stores: int, events: Any) -> None:
    events[BinRasterEvent.EMITS] += emits
    events[BinRasterEvent.STORE_TRANSACTIONS] += stores
    events[BinRasterEvent.STORE_BYTES] += stores * given.segment_bytes


@kernel(lent=True)
def _emit_warp(
    given: BinInput,
    path: int,
    boxes: WarpBoxes,
    lanes: int,
    scratch: BinScratch,
    counts: Any,
    pairs: Any,
    used: int,
    events: Any,
) -> int:
    """List a warp's triangles with the bins that they touch; count the segments that this writes, and note its votes.

    Returns the pairs in use.
    """
    start, stores, number = used, 0, scratch.warps[0]
    for lane in range(lanes):
        x, y = np.int64(boxes.box[X + lane]), np.int64(boxes.box[Y + lane])
        step, columns = 0, np.int64(boxes.box[COLUMNS + lane])
        width = columns if path == SLOW else 2
        for row in range(np.int64(boxes.box[ROWS + lane])):
            for column in range(columns):
                if path != SLOW or touches(boxes, lane, column, row):
                    b = x + column + (y + row) * given.bins_x
                    pairs[used, 0], pairs[used, 1] = b, boxes.entry[lane]
                    if events is not None:
                        mark = (number << 32) | (counts[b] * ENTRY_BYTES >> given.segment_log2)
                        stores += scratch.stamp[step, b] != mark
                        scratch.stamp[step, b] = mark
                        boxes.vote[(row * width + column) * WARP + (b & (WARP - 1))] += 1
                    counts[b] += 1
                    used += 1
                step += 1
    if events is not None:
        _count_emits(given, used - start, stores, events)
    return used


@kernel(lent=True)
def _count_warp(
    given: BinInput, path: int, largest: int, area: int, indirect: bool, boxes: WarpBoxes, lanes: int, events: Any
) -> None:
    """Count what a warp's loads, its path and the walk to its queues cost; its votes are in."""
    ors, replays = (0, 0) if path == SINGLE else count_votes(boxes, largest if path == SLOW else 4)
    events[BinRasterEvent.BOX_BINS] += area
    events[BinRasterEvent.INDIRECT_WARPS] += indirect
    if path == SINGLE:
        events[BinRasterEvent.SINGLE_WARPS] += 1
        events[BinRasterEvent.SINGLE_LANES] += lanes
    elif path == FAST:
        events[BinRasterEvent.FAST_WARPS] += 1
        events[BinRasterEvent.FAST_LANES] += lanes
    else:
        events[BinRasterEvent.SLOW_WARPS] += 1
        events[BinRasterEvent.SLOW_LANES] += lanes
        events[BinRasterEvent.SLOW_STEPS] += largest
        events[BinRasterEvent.SLOW_LANE_STEPS] += area
        events[BinRasterEvent.ROW_ENDS] += row_ends(boxes, lanes, largest)
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
    scratch, boxes = _new_scratch(counts.size), new_boxes()
    read = write = np.int64(0)  # literals that change in a loop have their callees compiled twice
    while True:
        while write - read < BLOCK and first < end:
            first, write = _read_step(given, scratch.ring, read, write, first, end, events)
        m: Any = min(BLOCK, write - read)
        longest, steps, paths = 0, 0, 0
        for start in range(read, read + m, WARP):
            lanes = min(WARP, read + m - start)
            path, largest, area, indirect = _load_warp(given, scratch.ring, start, lanes, boxes)
            _ready_stamps(scratch, largest)
            if used + area > len(pairs):
                pairs = with_room(pairs, used, area)
            if path == SINGLE:
                used = _emit_single(given, boxes, lanes, scratch, counts, pairs, used, events)
            else:
                used = _emit_warp(given, path, boxes, lanes, scratch, counts, pairs, used, events)
            if events is not None:
                longest, paths = max(longest, largest), paths | (1 << path)
                steps = max(steps, largest if path == SLOW else 0)
                _count_warp(given, path, largest, area, indirect, boxes, lanes, events)
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
