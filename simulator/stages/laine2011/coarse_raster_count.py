"""What one bin of coarse raster counts: merges, loads, the three cases of a warp, emits and segments (section 5)."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.laine2011.bin_raster_cover import (
    WARP,
    WarpBoxes,
    count_corners,
    count_votes,
    header_load,
)
from tilestamp.simulator.stages.laine2011.coarse_raster_events import CoarseRasterEvent

BLOCK = 512  # threads, and entries of a round
BIN_SEGMENT = 512  # entries
TILE_SEGMENT = 32  # entries
ENTRY_BYTES = 4
BIN_TILES = 16  # in each axis
TILES = BIN_TILES * BIN_TILES
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


@kernel(lent=True)
def count_case(given: CoarseInput, way: WarpCase, area: int, boxes: WarpBoxes, lanes: int, events: Any) -> None:
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
def count_atomic(events: Any, executed: int) -> None:
    """One thread's global atomic."""
    events[CoarseRasterEvent.ATOMIC] += executed
    events[CoarseRasterEvent.ATOMIC_LANES] += executed
    events[CoarseRasterEvent.ATOMIC_REQUESTS] += executed
    events[CoarseRasterEvent.ATOMIC_DEPTH] += executed


@kernel(lent=True)
def count_emits(given: CoarseInput, counts: Any, before: Any, tails: Any, events: Any) -> None:
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
    count_atomic(events, fresh > 0)


@kernel(lent=True)
def count_tails(given: CoarseInput, counts: Any, tails: Any, events: Any) -> None:
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
def count_merge(given: CoarseInput, b: int, events: Any) -> None:
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
