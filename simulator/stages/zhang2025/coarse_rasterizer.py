"""CoarseRasterizer: subdivide bins into 8x8-pixel tiles, tile cover and hierarchical z (Zhang 2025, stage 6).

One block of 16x16 threads a bin. In rounds of 256 primitives, each thread walks all 256 tiles of the bin for its
primitive: box, three edges at the tile's nearest corner, then Hi-Z, a depth a tile in shared memory that a primitive
lowers (atomicMin) where it covers the whole tile. 256 ballots transpose the masks; each thread then owns a tile and
appends serially to its queue, in chunks of 512 entries from one global atomicAdd a round.

The original rejects where the stored depth is not greater (``exact_hi_z``); here by a margin of 4 units of 24 bits, so
that rounding rejects nothing visible.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.coalescing import smallest_transaction_bytes
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.parallel import for_parts
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.zhang2025.coarse_bin import (
    BLOCK,
    CHUNK,
    TILES,
    TILES_A_ROW,
    CoarseRasterizerEvent,
    most_entries,
    rasterize_bin,
)
from tilestamp.simulator.stages.zhang2025.primitive_binning import BIN, BINS_A_ROW, BinQueues
from tilestamp.simulator.stages.zhang2025.triangle_setup import SETUP_BYTES, TriangleSetupData
from tilestamp.simulator.work import Work

HI_Z_MARGIN, EXACT, NO_HI_Z = 4, -1, 1 << 40  # units of 24 bits by which a depth may lie behind and is not rejected
SETUP_WORDS = 16  # that are read of a primitive: box, edges, depth
SHARED_BYTES = 4 * (256 + 256 + 8 * 257 + 32 + 7)  # primitives, Hi-Z, masks of each warp and tile, a scan, cursors


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


@kernel(error_model="numpy", lent=True)
def _most_entries(boxes: Any, starts: Any, queue: Any, columns: int, most: Any) -> None:
    """Room for the entries of each bin."""
    for i in range(len(most)):
        x, y = i % columns, i // columns
        b = x + y * BINS_A_ROW
        most[i] = most_entries(boxes, queue[starts[b] : starts[b + 1]], x * BIN, y * BIN)


@kernel(error_model="numpy", lent=True)
def _coarse_rasterizer(
    part: int, parts: int, edges: Any, planes: Any, boxes: Any, starts: Any, queue: Any, columns: int, warp: int,
    margin: int, counts: Any, rooms: Any, appended: Any, events: Any,
) -> None:  # fmt: skip
    for i in range(part * len(events) // parts, (part + 1) * len(events) // parts):
        x, y = i % columns, i // columns
        b = x + y * BINS_A_ROW
        listed = queue[starts[b] : starts[b + 1]]
        room = appended[rooms[i] : rooms[i + 1]]
        rasterize_bin(edges, planes, boxes, listed, x * BIN, y * BIN, warp, margin, counts[i], room, events[i])


@kernel(lent=True)
def _place(counts: Any, rooms: Any, appended: Any, cursors: Any, entries: Any) -> None:
    """Put the entries of each bin into the queues of their tiles."""
    for i in range(len(counts)):
        for n in range(rooms[i], rooms[i] + counts[i].sum()):
            entries[cursors[i, appended[n, 0]]] = appended[n, 1]
            cursors[i, appended[n, 0]] += 1


def coarse_rasterizer(
    data: TriangleSetupData,
    bins: BinQueues,
    width: int,
    height: int,
    simt: Simt,
    *,
    hi_z: bool,
    unrolled: bool,
    exact_hi_z: bool = False,
) -> StageResult[TileQueues]:
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
    exact_hi_z : bool
        Without a margin, as the original.

    Returns
    -------
    outputs : TileQueues
    works : one, a row a bin
    """
    columns, rows = -(-width // BIN), -(-height // BIN)
    margin = (EXACT if exact_hi_z else HI_Z_MARGIN) if hi_z else NO_HI_Z
    counts = np.zeros((columns * rows, TILES), np.int64)
    events = np.zeros((columns * rows, len(CoarseRasterizerEvent)), np.int64)
    rooms = np.zeros(len(events) + 1, np.int64)
    _most_entries(data.boxes, *bins, columns, rooms[1:])
    rooms = np.cumsum(rooms)
    appended = np.empty((rooms[-1], 2), np.int32)
    for_parts(
        _coarse_rasterizer, len(events), *data[:3], *bins, columns, simt.warp, margin, counts, rooms, appended, events
    )
    by_row = counts.reshape(rows, columns, TILES_A_ROW, TILES_A_ROW).swapaxes(1, 2)
    starts = np.concatenate([[0], np.cumsum(by_row.ravel())]).astype(np.int64)
    firsts = starts[:-1].reshape(by_row.shape).swapaxes(1, 2).reshape(columns * rows, TILES)
    entries = np.empty(int(starts[-1]), np.int32)
    _place(counts, rooms, appended, firsts.copy(), entries)  # of one bin, a view would move the starts
    events[:, CoarseRasterizerEvent.FILLS] = _fills(bins, columns, rows)
    _add_costs(events, counts, -(-len(data.ids) // BLOCK), simt)
    total = events.sum(axis=0)
    streams = (
        Stream("setup", "load", 160 * int(total[CoarseRasterizerEvent.WARP_LANES]), len(data.ids) * SETUP_BYTES),
        Stream("tile_queue", "store", int(total[CoarseRasterizerEvent.STORE_BYTES]), 4 * len(entries)),
    )
    work = coarse_work(events, streams, unrolled=unrolled)
    return StageResult(TileQueues(starts, entries, columns * TILES_A_ROW), (work,))


def coarse_work(events: NDArray[np.int64], streams: tuple[Stream, ...] = (), *, unrolled: bool) -> Work:
    """Launch of the stage."""
    return Work(
        "CoarseRasterizer",
        CoarseRasterizerEvent,
        events,
        BLOCK,
        kernel="CoarseRasterizer" if unrolled else "CoarseRasterizer_before",
        shared_bytes=SHARED_BYTES,
        streams=streams,
    )


def _fills(bins: BinQueues, columns: int, rows: int) -> NDArray[np.int64]:
    """Sub-queues, of 256 primitives each, that have primitives of a bin; by bin."""
    fills = np.zeros((rows, columns), np.int64)
    for y in range(rows):
        for x in range(columns):
            b = x + y * BINS_A_ROW
            listed = bins.entries[bins.starts[b] : bins.starts[b + 1]] // BLOCK  # in order
            fills[y, x] = np.count_nonzero(np.diff(listed)) + (len(listed) > 0)
    return fills.ravel()


def _add_costs(events: NDArray[np.int64], counts: NDArray[np.int64], sub_queues: int, simt: Simt) -> None:
    """Add what follows from the counts: one atomicAdd a round, memory.

    Two tiles share a sector of numbers of chunks, which are stored, loaded, and corrected in the end; depths of tiles
    are loaded and stored whole.
    """
    event = CoarseRasterizerEvent
    segment = smallest_transaction_bytes(int(simt.coalescing))
    events[:, event.BLOCKS] = 1
    for name in (event.ATOMIC, event.ATOMIC_LANES, event.ATOMIC_REQUESTS, event.ATOMIC_DEPTH):
        events[:, name] = events[:, event.ROUNDS]
    events[:, event.SUB_QUEUES] = sub_queues
    depths = 4 * counts.shape[1] // segment
    pairs = (counts.reshape(len(counts), -1, 2) > 0).any(axis=2).sum(axis=1)
    chunks = (-(-counts // CHUNK)).reshape(len(counts), -1, 2).max(axis=2).sum(axis=1)
    queue = -(-4 * events[:, event.WARP_LANES] // segment)
    events[:, event.LOAD_TRANSACTIONS] = (
        events[:, event.WARP_LANES] * SETUP_WORDS
        + queue
        + 2 * events[:, event.CHUNK_SECTORS]
        + 2 * sub_queues
        + pairs
        + depths
        + BLOCK // simt.warp
    )
    events[:, event.LOAD_BYTES] = events[:, event.LOAD_TRANSACTIONS] * segment
    events[:, event.STORE_TRANSACTIONS] = events[:, event.ENTRIES] + 2 * chunks + pairs + depths
    events[:, event.STORE_BYTES] = events[:, event.STORE_TRANSACTIONS] * segment
