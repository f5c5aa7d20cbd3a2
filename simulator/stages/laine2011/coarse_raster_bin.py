"""One bin of coarse raster: merge, rounds of 512 and the three cases (Laine & Karras 2011, section 5).

A bin is what a block draws from its queue. Its streams are merged segment by segment into input order; a round takes
512 entries, and each warp sets the bits of the tiles that its triangles touch by the cheapest of three ways. As in
bin raster pairs of a tile and an entry are listed first, and put in their places when all bins have been counted.
"""

from typing import Any, NamedTuple

import numpy as np

from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.laine2011.bin_raster_cover import (
    COLUMNS,
    ROWS,
    TILE_SIDE_LOG2,
    WARP,
    WarpBoxes,
    X,
    Y,
    find_slots,
    lane_edges,
    new_boxes,
    touches,
    warp_boxes,
    with_room,
)
from tilestamp.simulator.stages.laine2011.coarse_raster_count import (
    BIN_TILES,
    BLOCK,
    CASE_A,
    CASE_B,
    CASE_C,
    TILES,
    CoarseInput,
    WarpCase,
    count_atomic,
    count_case,
    count_emits,
    count_merge,
    count_tails,
)
from tilestamp.simulator.stages.laine2011.coarse_raster_events import CoarseRasterEvent


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
    """Boxes of a warp's triangles; returns what ``count_case`` takes, tiles of all boxes last."""
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
        count_merge(given, b, events)
        events[CoarseRasterEvent.BINS] += 1
        events[CoarseRasterEvent.TRIANGLES] += end - start
        count_atomic(events, 2)  # its draw, and room among the active tiles
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
                count_case(given, way, area, boxes, lanes, events)
        if events is not None:
            events[CoarseRasterEvent.ROUNDS] += 1
            events[CoarseRasterEvent.LONGEST_B] += longest_b
            events[CoarseRasterEvent.LONGEST_C] += longest_c
            events[CoarseRasterEvent.CASE_A_ROUNDS] += cases & 1
            events[CoarseRasterEvent.WIDE_ROUNDS] += cases >> 1
            events[CoarseRasterEvent.ROUND_WARPS] += (m + WARP - 1) // WARP
            count_emits(given, counts, before, tails, events)
    if events is not None:
        count_tails(given, counts, tails, events)
    return pairs[:used]
