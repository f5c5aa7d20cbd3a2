"""One bin of coarse raster: merge, rounds of 512 and the three cases (Laine & Karras 2011, section 5).

A bin is what a block draws from its queue. Its streams are merged segment by segment into input order; a round takes
512 entries, and each warp sets the bits of the tiles that its triangles touch by the cheapest of three ways. As in
bin raster pairs of a tile and an entry are listed first, and put in their places when all bins have been counted.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.laine2011.bin_raster_cover import (
    COLUMNS,
    ROWS,
    TILE_SIDE_LOG2,
    WARP,
    WarpBoxes,
    X,
    Y,
    count_corners,
    count_votes,
    find_slots,
    header_load,
    lane_edges,
    new_boxes,
    touches,
    warp_boxes,
    with_room,
)
from tilestamp.simulator.stages.laine2011.coarse_raster_events import CoarseRasterEvent

BLOCK = 512  # threads, and entries of a round
BIN_SEGMENT = 512  # entries
TILE_SEGMENT = 32  # entries
ENTRY_BYTES = 4
BIN_TILES = 16  # in each axis
TILES = BIN_TILES * BIN_TILES
MASK_ROW = TILES + 1  # words: one warp's masks in shared memory
CASE_A, CASE_B, CASE_C = 0, 1, 2  # of a warp: small boxes, boxes close together, boxes far apart


class CoarseInput(NamedTuple):
    """What bin raster and triangle setup leave, and the grid of tiles."""

    starts: NDArray[np.int64]
    entries: NDArray[np.int32]
    batch_counts: NDArray[np.int64]
    headers: NDArray[np.int16]
    misc: NDArray[np.uint32]
    half_x: int  # sub-pixels from the lower-left corner to the centre of the viewport
    half_y: int
    bins_x: int
    tiles_x: int
    tiles_y: int
    segment_bytes: int  # of the machine's memory transactions
    segment_log2: int


class WarpCase(NamedTuple):
    """Which way a warp goes, and what decides it."""

    case: int
    indirect: bool  # whether an entry is not its triangle's own slot
    largest: int  # tiles of the largest box
    union: int  # tiles, and rows of tiles, of the box around all, but in case A
    rows: int


class Place(NamedTuple):
    """One bin in the frame."""

    first_tile_x: int
    first_tile_y: int
    last_x: int  # last tile of the bin that lies in the frame
    last_y: int
    move_x: int  # from centre-relative sub-pixels to the bin's corner
    move_y: int


@kernel(lent=True)
def _place(given: CoarseInput, b: int) -> Any:
    bx, by = b % given.bins_x, b // given.bins_x
    return Place(
        bx * BIN_TILES,
        by * BIN_TILES,
        min(given.tiles_x - bx * BIN_TILES, BIN_TILES) - 1,
        min(given.tiles_y - by * BIN_TILES, BIN_TILES) - 1,
        given.half_x - bx * BIN_TILES * (1 << TILE_SIDE_LOG2),
        given.half_y - by * BIN_TILES * (1 << TILE_SIDE_LOG2),
    )


@kernel(lent=True)
def _load_warp(given: CoarseInput, place: Place, first: int, lanes: int, boxes: WarpBoxes) -> Any:
    """Boxes of a warp's triangles; returns what ``_count_warp`` takes, tiles of all boxes last."""
    indirect = find_slots(given.entries[first : first + lanes], given.misc, boxes)
    largest, area, side = warp_boxes(
        boxes,
        lanes,
        given.headers,
        place.move_x,
        place.move_y,
        TILE_SIDE_LOG2,
        place.last_x,
        place.last_y,
    )
    if side <= 2:
        return WarpCase(CASE_A, indirect, largest, 0, 0), area
    low_x, low_y, high_x, high_y = BIN_TILES, BIN_TILES, 0, 0
    for lane in range(lanes):
        x, y = boxes.box[X + lane], boxes.box[Y + lane]
        low_x, low_y = min(low_x, x), min(low_y, y)
        high_x, high_y = max(high_x, x + boxes.box[COLUMNS + lane]), max(high_y, y + boxes.box[ROWS + lane])
    union, rows = (high_x - low_x) * (high_y - low_y), high_y - low_y
    for lane in range(lanes):
        lane_edges(boxes, lane, place.move_x, place.move_y, TILE_SIDE_LOG2)
    return WarpCase(CASE_B if union * 4 <= largest * 8 else CASE_C, indirect, largest, union, rows), area


@kernel(lent=True, inline=True)
def _emit(tile: Any, slot: Any, touched: Any, counts: Any, pairs: Any, used: Any) -> Any:
    """List a tile that is touched; what is listed of another is overwritten by the next."""
    pairs[used, 0], pairs[used, 1] = tile, slot
    counts[tile] += touched
    return used + np.uint64(touched)


@kernel(lent=True)
def _emit_small(boxes: WarpBoxes, lanes: int, counts: Any, pairs: Any, used: int, events: Any) -> Any:
    """``_emit_warp`` of boxes that are at most 2 x 2: all of them is touched. No branch: sizes cannot be foretold."""
    box, end, last = boxes.box, np.uint64(used), np.uint64(TILES - 1)
    for lane in range(lanes):
        tile, slot = np.uint64(box[X + lane] + box[Y + lane] * BIN_TILES), boxes.slot[lane]
        wide, high = box[COLUMNS + lane] > 1, box[ROWS + lane] > 1
        end = _emit(tile, slot, True, counts, pairs, end)
        end = _emit((tile + np.uint64(1)) & last, slot, wide, counts, pairs, end)
        end = _emit((tile + np.uint64(BIN_TILES)) & last, slot, high, counts, pairs, end)
        end = _emit((tile + np.uint64(BIN_TILES + 1)) & last, slot, wide & high, counts, pairs, end)
        if events is not None:
            boxes.corners[tile & np.uint64(WARP - 1)] += 1 | wide << 8 | high << 16 | (wide & high) << 24
    return np.int64(end)


@kernel(lent=True)
def _emit_warp(boxes: WarpBoxes, lanes: int, counts: Any, pairs: Any, used: int, events: Any) -> int:
    """List a warp's triangles with the tiles that they touch, and note its votes; returns the pairs in use."""
    for lane in range(lanes):
        x, y = np.int64(boxes.box[X + lane]), np.int64(boxes.box[Y + lane])
        columns = np.int64(boxes.box[COLUMNS + lane])
        for row in range(np.int64(boxes.box[ROWS + lane])):
            for column in range(columns):
                if touches(boxes, lane, column, row):
                    tile = x + column + (y + row) * BIN_TILES
                    pairs[used, 0], pairs[used, 1] = tile, boxes.slot[lane]
                    used += 1
                    counts[tile] += 1
                    if events is not None:
                        boxes.vote[(row * columns + column) * WARP + (tile & (WARP - 1))] += 1
    return used


@kernel(lent=True)
def _count_warp(
    given: CoarseInput, way: WarpCase, area: int, boxes: WarpBoxes, lanes: int, events: Any
) -> None:  # fmt: skip
    """Count what a warp's loads and its case cost; its votes are in."""
    events[CoarseRasterEvent.BOX_TILES] += area
    events[CoarseRasterEvent.INDIRECT_WARPS] += way.indirect
    ors, replays = count_corners(boxes.corners) if way.case == CASE_A else count_votes(boxes, way.largest)
    if way.case == CASE_A:
        events[CoarseRasterEvent.CASE_A_WARPS] += 1
    elif way.case == CASE_B:
        events[CoarseRasterEvent.CASE_B_WARPS] += 1
        events[CoarseRasterEvent.CASE_B_STEPS] += way.union
        events[CoarseRasterEvent.CASE_B_ROWS] += way.rows
        events[CoarseRasterEvent.CASE_B_LANE_STEPS] += area
        events[CoarseRasterEvent.CASE_B_LANE_ROWS] += way.rows * lanes
        ors, replays = 0, 0  # lanes hand their tiles on without an atomic
    else:
        events[CoarseRasterEvent.CASE_C_WARPS] += 1
        events[CoarseRasterEvent.CASE_C_STEPS] += way.largest
        events[CoarseRasterEvent.CASE_C_LANE_STEPS] += area
    events[CoarseRasterEvent.SHARED_ATOMIC] += ors
    events[CoarseRasterEvent.BANK_REPLAYS] += replays
    _count_load(events, 1, *header_load(boxes, lanes, given.segment_bytes))


@kernel(lent=True)
def _count_load(events: Any, loads: int, segments: int, size: int) -> None:
    events[CoarseRasterEvent.LOAD] += loads
    events[CoarseRasterEvent.LOAD_TRANSACTIONS] += segments
    events[CoarseRasterEvent.LOAD_BYTES] += size


@kernel(lent=True)
def _count_atomic(events: Any, executed: int) -> None:
    """One thread's global atomic."""
    events[CoarseRasterEvent.ATOMIC] += executed
    events[CoarseRasterEvent.ATOMIC_LANES] += executed
    events[CoarseRasterEvent.ATOMIC_REQUESTS] += executed
    events[CoarseRasterEvent.ATOMIC_DEPTH] += executed


@kernel(lent=True)
def _count_emits(given: CoarseInput, counts: Any, before: Any, tails: Any, events: Any) -> None:
    """Count a round's tiles, new segments and writes: the block writes the emits in tile order, 32 a warp."""
    fresh, touched, emits, stores = 0, 0, 0, 0
    for warp in range(0, counts.size, WARP):
        linked, opened, most = 0, 0, 0
        for tile in range(warp, warp + WARP):
            place, end = before[tile], counts[tile]
            if place == end:
                continue
            new = (end + TILE_SEGMENT - 1) // TILE_SEGMENT - (place + TILE_SEGMENT - 1) // TILE_SEGMENT
            linked, opened, most = linked + (new > 0), opened + (new > 0 and place == 0), max(most, end - place)
            before[tile] = end
            touched += 1
            fresh += new
            if new > 0:
                tails[TILES] += new
                tails[tile] = tails[TILES]
            while place < end:  # the part of a tile's emits that one warp writes
                part = min(end - place, WARP - emits % WARP)
                first, last = place * ENTRY_BYTES, (place + part) * ENTRY_BYTES - 1
                stores += (last >> given.segment_log2) - (first >> given.segment_log2) + 1
                place, emits = place + part, emits + part
        events[CoarseRasterEvent.LINK_WARPS] += linked > 0
        events[CoarseRasterEvent.FIRST_WARPS] += opened > 0
        events[CoarseRasterEvent.SCAN_WARPS] += most > 1
        stores += linked - opened + ((opened * ENTRY_BYTES + given.segment_bytes - 1) >> given.segment_log2)
    events[CoarseRasterEvent.TILES_TOUCHED] += touched
    events[CoarseRasterEvent.EMITS] += emits
    events[CoarseRasterEvent.EMIT_STEPS] += (emits + BLOCK - 1) // BLOCK
    events[CoarseRasterEvent.EMIT_WARPS] += (emits + WARP - 1) // WARP
    events[CoarseRasterEvent.EMIT_BLOCK_WARPS] += min((emits + WARP - 1) // WARP, BLOCK // WARP)
    events[CoarseRasterEvent.SEGMENT_WARPS] += (fresh + WARP - 1) // WARP
    stores += 2 * ((fresh * ENTRY_BYTES + given.segment_bytes - 1) >> given.segment_log2)  # links and counts
    events[CoarseRasterEvent.SEGMENTS] += fresh
    events[CoarseRasterEvent.ALLOC_ROUNDS] += fresh > 0
    events[CoarseRasterEvent.STORE_TRANSACTIONS] += stores
    events[CoarseRasterEvent.STORE_BYTES] += stores * given.segment_bytes
    _count_atomic(events, fresh > 0)


@kernel(lent=True)
def _count_tails(given: CoarseInput, counts: Any, tails: Any, events: Any) -> None:
    """Count the writes that end the tiles' lists: the last segment's link, and its count where it is not full.

    ``tails`` numbers the last segment of each tile in the order of allocation.
    """
    links, sizes = -1, -1
    for tile in range(TILES):
        if tile % WARP == 0:
            links, sizes = -1, -1
        here, stores = tails[tile] * ENTRY_BYTES >> given.segment_log2, 0
        if counts[tile] > 0:
            stores, links = int(here != links), here
        if counts[tile] % TILE_SEGMENT:
            stores, sizes = stores + (here != sizes), here
        events[CoarseRasterEvent.STORE_TRANSACTIONS] += stores
        events[CoarseRasterEvent.STORE_BYTES] += stores * given.segment_bytes


@kernel(lent=True)
def _count_merge(given: CoarseInput, b: int, events: Any) -> None:
    """Count the merges: a round takes whole segments until more than 512 entries wait, or none is left."""
    write, read, batch, taken = 0, 0, 0, 0
    total = given.starts[b + 1] - given.starts[b]
    while read < total:
        while write - read <= BLOCK:
            events[CoarseRasterEvent.MERGES] += 1
            while batch < given.batch_counts.shape[0] and taken == given.batch_counts[batch, b]:
                batch, taken = batch + 1, 0
            if batch == given.batch_counts.shape[0]:
                break
            events[CoarseRasterEvent.STREAM_READS] += 1
            size = min(given.batch_counts[batch, b] - taken, BIN_SEGMENT)
            taken, write = taken + size, write + size
            warps = (size + WARP - 1) // WARP
            events[CoarseRasterEvent.MERGE_WARPS] += warps
            _count_load(events, 2, 2, 2 * given.segment_bytes)  # its count and the link to the next
            segments = (size * ENTRY_BYTES + given.segment_bytes - 1) >> given.segment_log2
            _count_load(events, warps, segments, segments * given.segment_bytes)
        read += min(BLOCK, write - read)


@kernel
def play_bin(given: CoarseInput, b: int, counts: Any, events: Any) -> Any:
    """Find the tiles of a bin's entries; fills ``counts`` (256,) by tile, returns pairs, (n, 2).

    A pair is a tile of the bin and a slot; those of a tile come in their order.
    """
    boxes, place = new_boxes(), _place(given, b)
    before, tails = np.zeros(TILES, np.int64), np.zeros(TILES + 1, np.int64)
    start, end = given.starts[b], given.starts[b + 1]
    pairs, used = np.empty((2 * (end - start), 2), np.int32), np.int64(0)
    if events is not None:
        _count_merge(given, b, events)
        events[CoarseRasterEvent.BINS] += 1
        events[CoarseRasterEvent.TRIANGLES] += end - start
        _count_atomic(events, 2)  # its draw, and room among the active tiles
    for read in range(start, end, BLOCK):
        m = min(BLOCK, end - read)
        longest_b, longest_c, cases = 0, 0, 0
        for first in range(read, read + m, WARP):
            lanes = min(WARP, read + m - first)
            way, area = _load_warp(given, place, first, lanes, boxes)
            if used + area >= len(pairs):
                pairs = with_room(pairs, used, area + 1)
            if way.case == CASE_A:
                used = _emit_small(boxes, lanes, counts, pairs, used, events)
            else:
                used = _emit_warp(boxes, lanes, counts, pairs, used, events)
            if events is not None:
                longest_b = max(longest_b, way.union if way.case == CASE_B else 0)
                longest_c = max(longest_c, way.largest if way.case == CASE_C else 0)
                cases |= 1 if way.case == CASE_A else 2
                _count_warp(given, way, area, boxes, lanes, events)
        if events is not None:
            events[CoarseRasterEvent.ROUNDS] += 1
            events[CoarseRasterEvent.LONGEST_B] += longest_b
            events[CoarseRasterEvent.LONGEST_C] += longest_c
            events[CoarseRasterEvent.CASE_A_ROUNDS] += cases & 1
            events[CoarseRasterEvent.WIDE_ROUNDS] += cases >> 1
            events[CoarseRasterEvent.ROUND_WARPS] += (m + WARP - 1) // WARP
            _count_emits(given, counts, before, tails, events)
    if events is not None:
        _count_tails(given, counts, tails, events)
    return pairs[:used]
