"""CoarseRasterizer: subdivide bins into 8x8-pixel tiles, tile cover and hierarchical z (Zhang 2025, stage 6).

One block of 16x16 threads a bin. In rounds of 256 primitives, each thread walks all 256 tiles of the bin for its
primitive: box, three edges at the tile's nearest corner, then Hi-Z, a depth a tile in shared memory that a primitive
lowers (atomicMin) where it covers the whole tile. 256 ballots transpose the masks; each thread then owns a tile and
appends serially to its queue, in chunks of 512 entries from one global atomicAdd a round.

A warp walks the tiles in lockstep, so its lanes read a tile's Hi-Z before any of them lowers it. The original rejects
where the stored depth is not greater; here by a margin of 4 units of 24 bits, so that rounding rejects nothing visible.
"""

from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from models.launch import Stream
from models.simt import Simt
from simulator.stages.zhang2025.primitive_binning import BIN, BINS_A_ROW, BinQueues
from simulator.stages.zhang2025.triangle_setup import DEPTH, SETUP_BYTES, TriangleSetupData
from simulator.work import Work

BLOCK = 256  # threads, and primitives a round
TILE = 8  # pixels
TILES_A_ROW = BIN // TILE
CHUNK = 512  # queue entries
SHARED_BYTES = 4 * (256 + 256 + 8 * 257 + 32 + 8)
DEPTH_STEPS = np.float32(2**24 - 1)
HI_Z_MARGIN = 4
NO_DEPTH = 2**32 - 1
_ZERO = np.float32(0.0)
_ONE = np.float32(1.0)


class CoarseRasterizerEvent(IntEnum):
    """Events of one block, that is of one bin."""

    ROUNDS = 0
    WARPS = 1  # warps with a primitive, over the rounds: each tests 256 boxes and runs 256 ballots and appends
    WARP_LANES = 2
    EDGE_STEPS = 3  # warp executions of the edge tests
    EDGE_LANES = 4
    HI_Z_STEPS = 5  # warp executions of the depth test
    HI_Z_LANES = 6
    HI_Z_REJECTED = 7
    HI_Z_UPDATES = 8  # lanes that lower a tile's depth
    APPEND_STEPS = 9  # warp steps of the serial append in which a lane writes
    ENTRIES = 10
    SHARED_ATOMIC = 11
    BANK_REPLAYS = 12
    ATOMIC = 13
    ATOMIC_LANES = 14
    ATOMIC_REQUESTS = 15
    ATOMIC_DEPTH = 16
    LOAD_TRANSACTIONS = 17
    LOAD_BYTES = 18
    STORE_TRANSACTIONS = 19
    STORE_BYTES = 20
    SUB_QUEUES = 21  # of the binning blocks, read one after another


class TileQueues(NamedTuple):
    """Primitives by tile, in order.

    Parameters
    ----------
    starts : ndarray, (tiles + 1,), int64
        Tile x + columns * y, rows from the bottom.
    entries : ndarray, int32
    columns : int
    """

    starts: NDArray[np.int64]
    entries: NDArray[np.int32]
    columns: int


@njit(cache=True, nogil=True, error_model="numpy")
def depth_24_bit(z: Any) -> int:
    """Round a depth in [0, 1] as the original keeps it."""
    return int(min(max(z, _ZERO), _ONE) * DEPTH_STEPS)


@njit(cache=True, nogil=True, error_model="numpy")
def _corner(edge: Any, left: Any, bottom: Any, far: bool) -> Any:
    """Evaluate an edge function at the tile's corner that lies farthest inside, or farthest outside."""
    side = np.float32(TILE)
    x = left + side if (edge[0] >= _ZERO) != far else left
    y = bottom + side if (edge[1] >= _ZERO) != far else bottom
    return edge[0] * x + edge[1] * y + edge[2]


@njit(cache=True, nogil=True, error_model="numpy")
def _depth_range(plane: Any, left: Any, bottom: Any) -> tuple[int, int]:
    """Least and greatest depth of a plane over a tile, in 24 bits."""
    side = np.float32(TILE)
    x0, x1 = plane[0] * left, plane[0] * (left + side)
    y0, y1 = plane[1] * bottom, plane[1] * (bottom + side)
    return depth_24_bit(min(x0, x1) + min(y0, y1) + plane[2]), depth_24_bit(max(x0, x1) + max(y0, y1) + plane[2])


@njit(cache=True, nogil=True, error_model="numpy")
def _tile_of_warp(
    edges: Any, planes: Any, boxes: Any, listed: Any, left: Any, bottom: Any, hi_z: Any, tile: int, masks: Any, row: Any
) -> None:
    """All lanes of a warp at one tile; sets the lanes' bits in ``masks``."""
    side = np.float32(TILE)
    tested = 0
    passed = 0
    updates = 0
    cached = hi_z[tile]
    for lane in range(len(listed)):
        p = listed[lane]
        if max(boxes[p, 0], left) >= min(boxes[p, 2], left + side):
            continue
        if max(boxes[p, 1], bottom) >= min(boxes[p, 3], bottom + side):
            continue
        tested += 1
        outside = False
        covers = True
        for k in range(3):
            outside |= _corner(edges[p, k], left, bottom, False) < _ZERO
            covers &= _corner(edges[p, k], left, bottom, True) > _ZERO
        if outside:
            continue
        passed += 1
        low, high = _depth_range(planes[p, DEPTH], left, bottom)
        if cached + HI_Z_MARGIN < low:
            row[7] += 1  # HI_Z_REJECTED
            continue
        if covers:
            updates += 1
            hi_z[tile] = min(hi_z[tile], high)
        masks[tile, lane] = True
    row[3] += tested > 0
    row[4] += tested
    row[5] += passed > 0
    row[6] += passed
    row[8] += updates
    row[11] += updates > 0  # SHARED_ATOMIC
    row[12] += max(0, updates - 1)  # BANK_REPLAYS: one address


@njit(cache=True, nogil=True, error_model="numpy")
def _bin(
    edges: Any, planes: Any, boxes: Any, queue: Any, origin_x: int, origin_y: int, warp: int, use_hi_z: bool,
    counts: Any, entries: Any, cursors: Any, row: Any,
) -> None:  # fmt: skip
    """One bin: fill ``counts`` (256,) where ``entries`` is None, else the queues."""
    hi_z = np.full(TILES_A_ROW * TILES_A_ROW, NO_DEPTH, np.int64)
    masks = np.zeros((TILES_A_ROW * TILES_A_ROW, warp), np.bool_)
    for first in range(0, len(queue), warp):
        listed = queue[first : first + warp]
        if first % BLOCK == 0:
            row[0] += 1  # ROUNDS
        row[1] += 1
        row[2] += len(listed)
        low_x, low_y, high_x, high_y = _tiles_of(boxes, listed, origin_x, origin_y)
        for y in range(low_y, high_y + 1):
            for x in range(low_x, high_x + 1):
                tile = y * TILES_A_ROW + x
                left, bottom = np.float32(origin_x + x * TILE), np.float32(origin_y + y * TILE)
                _tile_of_warp(edges, planes, boxes, listed, left, bottom, hi_z, tile, masks, row)
                for lane in range(len(listed)):
                    if masks[tile, lane]:
                        masks[tile, lane] = False
                        row[10] += 1  # ENTRIES
                        if entries is not None:
                            entries[cursors[tile]] = listed[lane]
                            cursors[tile] += 1
                        else:
                            counts[tile] += 1
                if not use_hi_z:
                    hi_z[tile] = NO_DEPTH


@njit(cache=True, nogil=True, error_model="numpy")
def _tiles_of(boxes: Any, listed: Any, origin_x: int, origin_y: int) -> tuple[int, int, int, int]:
    """Tiles of the bin that the boxes of a warp's primitives span: the others fail every box test."""
    low_x, low_y, high_x, high_y = TILES_A_ROW - 1, TILES_A_ROW - 1, 0, 0
    for p in listed:
        low_x = min(low_x, (int(boxes[p, 0]) - origin_x) // TILE)
        low_y = min(low_y, (int(boxes[p, 1]) - origin_y) // TILE)
        high_x = max(high_x, (int(boxes[p, 2]) - origin_x) // TILE)
        high_y = max(high_y, (int(boxes[p, 3]) - origin_y) // TILE)
    last = TILES_A_ROW - 1
    return max(low_x, 0), max(low_y, 0), min(high_x, last), min(high_y, last)


@njit(cache=True, nogil=True, error_model="numpy", parallel=True)
def _coarse_rasterizer(
    edges: Any, planes: Any, boxes: Any, starts: Any, queue: Any, columns: int, warp: int, use_hi_z: bool,
    counts: Any, entries: Any, cursors: Any, events: Any,
) -> None:  # fmt: skip
    for i in prange(len(events)):
        x, y = i % columns, i // columns
        b = x + y * BINS_A_ROW
        listed = queue[starts[b] : starts[b + 1]]
        _bin(edges, planes, boxes, listed, x * BIN, y * BIN, warp, use_hi_z, counts[i], entries, cursors[i], events[i])


def coarse_rasterizer(
    data: TriangleSetupData, bins: BinQueues, width: int, height: int, simt: Simt, *, hi_z: bool, unrolled: bool
) -> tuple[TileQueues, Work]:
    """Make the tile queues.

    Parameters
    ----------
    data : TriangleSetupData
    bins : BinQueues
    width, height : int
        Pixels.
    simt : Simt
    hi_z : bool
        Whether Hi-Z rejects (not with transparency).
    unrolled : bool
        The optimized kernel: the same work with the loops unrolled.

    Returns
    -------
    TileQueues, Work
        One row of work a bin.
    """
    columns, rows = -(-width // BIN), -(-height // BIN)
    tiles = TILES_A_ROW * TILES_A_ROW
    shape = (*data[:3], bins.starts, bins.entries, columns, simt.warp, hi_z)
    counts = np.zeros((columns * rows, tiles), np.int64)
    events = np.zeros((columns * rows, len(CoarseRasterizerEvent)), np.int64)
    cursors = np.zeros((columns * rows, tiles), np.int64)
    _coarse_rasterizer(*shape, counts, None, cursors, events)
    by_row = counts.reshape(rows, columns, TILES_A_ROW, TILES_A_ROW).swapaxes(1, 2)
    starts = np.concatenate([[0], np.cumsum(by_row.ravel())]).astype(np.int64)
    firsts = starts[:-1].reshape(by_row.shape).swapaxes(1, 2).reshape(columns * rows, tiles)
    entries = np.empty(int(starts[-1]), np.int32)
    _coarse_rasterizer(*shape, counts, entries, np.ascontiguousarray(firsts), np.zeros_like(events))
    _add_costs(events, counts, -(-len(data.ids) // BLOCK), simt)
    total = events.sum(axis=0)
    streams = (
        Stream("setup", "load", 160 * int(total[CoarseRasterizerEvent.WARP_LANES]), len(data.ids) * SETUP_BYTES),
        Stream("tile_queue", "store", int(total[CoarseRasterizerEvent.STORE_BYTES]), 4 * len(entries)),
    )
    kernel = "CoarseRasterizer" if unrolled else "CoarseRasterizer_before"
    return TileQueues(starts, entries, columns * TILES_A_ROW), Work(
        "CoarseRasterizer", kernel, CoarseRasterizerEvent, events, len(events), BLOCK, SHARED_BYTES, streams=streams
    )


def _add_costs(events: NDArray[np.int64], counts: NDArray[np.int64], sub_queues: int, simt: Simt) -> None:
    """Add what follows from the counts: appends, one atomicAdd a round, memory."""
    event = CoarseRasterizerEvent
    segment = 128 if simt.coalescing == 2 else 32
    appended = counts.reshape(len(counts), -1, simt.warp)
    events[:, event.APPEND_STEPS] = appended.max(axis=2).sum(axis=1)  # at least: lanes of a warp seldom share a step
    for name in (event.ATOMIC, event.ATOMIC_LANES, event.ATOMIC_REQUESTS, event.ATOMIC_DEPTH):
        events[:, name] = events[:, event.ROUNDS]
    events[:, event.SUB_QUEUES] = sub_queues
    loads = events[:, event.WARP_LANES] * (SETUP_BYTES // 4 + 1)
    events[:, event.LOAD_TRANSACTIONS] = loads
    events[:, event.LOAD_BYTES] = loads * segment
    events[:, event.STORE_TRANSACTIONS] = events[:, event.ENTRIES]
    events[:, event.STORE_BYTES] = events[:, event.ENTRIES] * segment
