"""PrimitiveBinning: assign primitives to 128x128-pixel bins by their boxes (Zhang 2025, stage 5).

One thread a primitive, 256 a block. A mask of 256 bins a thread is transposed by 256 ballots a warp; each thread then
owns a bin, scans the block's counts, and one thread takes room in the queue by one global atomicAdd a block, in chunks
of 64 entries. The queue of a bin keeps the order of the primitives.

In the original a thread reads the queue's base, which another thread of its block writes, with no barrier between: in
some orders of threads entries go astray, and with them those of tiles. None of 1,000 frames on an H200 showed it; here
the barrier is there.
"""

from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.coalescing import smallest_transaction_bytes
from tilestamp.models.errors import TilestampError
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.zhang2025.triangle_setup import launched_blocks
from tilestamp.simulator.work import Work

BLOCK = 256  # threads, and primitives a sub-queue
BIN = 128  # pixels
BINS_A_ROW = 16
MAX_BINS = 256
CHUNK = 64  # queue entries
A_SECTOR = 8  # words of 32 bytes
SHARED_BYTES = 4 * (2 * 8 * 257 + 32 + 1)  # counts and masks of each warp and bin, a scan


class PrimitiveBinningEvent(IntEnum):
    """Events of one block."""

    WARPS = 0  # each runs 256 ballots and the scans
    WARP_LANES = 1
    BIN_STEPS = 2  # warp steps over the bins of the boxes
    ENTRIES = 3  # queue entries written
    CHUNKS = 4  # of 64 entries, taken from the allocator
    ATOMIC = 5
    ATOMIC_LANES = 6
    ATOMIC_REQUESTS = 7
    ATOMIC_DEPTH = 8
    LOAD_TRANSACTIONS = 9
    LOAD_BYTES = 10
    STORE_TRANSACTIONS = 11
    STORE_BYTES = 12
    LIVE_WARPS = 13  # warps with a primitive
    BIN_LANES = 14
    BASE_SECTORS = 15  # of the queues' bases, that the lanes of a step read
    ENTRY_SECTORS = 16  # that they write


class BinQueues(NamedTuple):
    """Primitives by bin, in order.

    Parameters
    ----------
    starts : ndarray, (257,), int64
        Bin x + 16 y holds entries starts[bin]..starts[bin + 1] - 1.
    entries : ndarray, int32
    """

    starts: NDArray[np.int64]
    entries: NDArray[np.int32]


@kernel(error_model="numpy", lent=True)
def _bins(box: Any, columns: int, rows: int) -> tuple[int, int, int, int]:
    """First and last bin of a box in each direction."""
    left = min(max(int(box[0]) // BIN, 0), columns - 1)
    bottom = min(max(int(box[1]) // BIN, 0), rows - 1)
    right = min(max(int(box[2]) // BIN, 0), columns - 1)
    top = min(max(int(box[3]) // BIN, 0), rows - 1)
    return left, right, bottom, top


@kernel(error_model="numpy")
def _count(boxes: Any, columns: int, rows: int, warp: int, counts: Any, events: Any) -> None:
    """Entries by sub-queue and bin, ``counts`` (blocks, 256), and the steps of each warp over the bins of its boxes."""
    spans = np.empty((warp, 4), np.int64)  # left and lowest bin of each lane's box, bins across, bins in all
    ranks = np.empty((MAX_BINS, warp), np.int64)  # of a lane at a step in its bin
    last = np.full(MAX_BINS, -1, np.int64)  # sector of a queue that was written last, and in which step
    for first in range(0, len(boxes), warp):
        row, queues = events[first // BLOCK], counts[first // BLOCK]
        lanes = min(warp, len(boxes) - first)
        steps = 1
        for lane in range(lanes):
            left, right, bottom, top = _bins(boxes[first + lane], columns, rows)
            wide = right - left + 1
            many = wide * (top - bottom + 1)
            spans[lane, 0], spans[lane, 1], spans[lane, 2], spans[lane, 3] = left, bottom, wide, many
            steps = max(steps, many)
            for step in range(many):
                b = left + step % wide + (bottom + step // wide) * BINS_A_ROW
                ranks[step, lane] = queues[b]
                queues[b] += 1
        row[PrimitiveBinningEvent.LIVE_WARPS] += 1
        row[PrimitiveBinningEvent.BIN_STEPS] += steps
        for step in range(steps):
            bases = 0  # sectors of the queues' bases, a bit each
            for lane in range(lanes):
                if step >= spans[lane, 3]:
                    continue
                b = spans[lane, 0] + step % spans[lane, 2] + (spans[lane, 1] + step // spans[lane, 2]) * BINS_A_ROW
                sector = ranks[step, lane] // A_SECTOR + (first * MAX_BINS + step) * MAX_BINS  # ranks in a bin rise
                row[PrimitiveBinningEvent.BIN_LANES] += 1
                row[PrimitiveBinningEvent.BASE_SECTORS] += 1 - (bases >> b // A_SECTOR & 1)
                row[PrimitiveBinningEvent.ENTRY_SECTORS] += sector != last[b]
                bases |= 1 << b // A_SECTOR
                last[b] = sector


@kernel(error_model="numpy", lent=True)
def _fill(boxes: Any, columns: int, rows: int, cursor: Any, entries: Any) -> None:
    """Write the queues; ``cursor`` (256,) runs ahead in each bin."""
    for p in range(len(boxes)):
        left, right, bottom, top = _bins(boxes[p], columns, rows)
        for y in range(bottom, top + 1):
            for x in range(left, right + 1):
                b = x + y * BINS_A_ROW
                entries[cursor[b]] = p
                cursor[b] += 1


def primitive_binning(
    boxes: NDArray[np.float32], width: int, height: int, simt: Simt, *, triangles: int = 0
) -> StageResult[BinQueues]:
    """Bin all primitives.

    Parameters
    ----------
    boxes : ndarray, (P, 4), float32
        Left, bottom, right, top in pixels.
    width, height : int
        Pixels: at most 16 bins each way.
    simt : Simt
    triangles : int
        Triangles of the model: the original launches blocks for twice as many primitives, and blocks without one
        run the ballots and scans too.

    Raises
    ------
    TilestampError
        A picture of more than 2048 pixels on a side.
    """
    columns, rows = -(-width // BIN), -(-height // BIN)
    if max(columns, rows) > BINS_A_ROW:
        raise TilestampError(
            f"the binned pipeline has 16x16 bins of 128 pixels: {width}x{height} does not fit in 2048x2048"
        )
    work_blocks = max(1, -(-len(boxes) // BLOCK))
    blocks = max(work_blocks, launched_blocks(triangles))
    events = np.zeros((blocks, len(PrimitiveBinningEvent)), np.int64)
    counts = np.zeros((work_blocks, MAX_BINS), np.int64)
    _count(boxes, columns, rows, simt.warp, counts, events)
    starts = np.concatenate([[0], np.cumsum(counts.sum(axis=0))]).astype(np.int64)
    entries = np.empty(int(starts[-1]), np.int32)
    _fill(boxes, columns, rows, starts[:-1].copy(), entries)
    _add_costs(events, counts, len(boxes), simt)
    stored = int(events[:, PrimitiveBinningEvent.STORE_BYTES].sum())
    streams = (
        Stream("compacted", "load", 3 * 32 * len(boxes), 3 * 32 * len(boxes)),
        Stream("bin_queue", "store", stored, 4 * len(entries) + 8 * MAX_BINS * work_blocks),
    )
    stage = "PrimitiveBinning"
    work = Work(stage, PrimitiveBinningEvent, events, BLOCK, grid=blocks, shared_bytes=SHARED_BYTES, streams=streams)
    return StageResult(BinQueues(starts, entries), (work,))


def _add_costs(events: NDArray[np.int64], counts: NDArray[np.int64], primitives: int, simt: Simt) -> None:
    """Add what follows from the counts: chunks, one atomicAdd a block, memory."""
    event = PrimitiveBinningEvent
    segment = smallest_transaction_bytes(int(simt.coalescing))
    working = events[: len(counts)]
    lanes = np.clip(primitives - BLOCK * np.arange(len(events)), 0, BLOCK)
    events[:, event.WARPS] = BLOCK // simt.warp
    events[:, event.WARP_LANES] = lanes
    working[:, event.ENTRIES] = counts.sum(axis=1)
    working[:, event.CHUNKS] = (-(-counts // CHUNK)).sum(axis=1)
    for name in (event.ATOMIC, event.ATOMIC_LANES, event.ATOMIC_REQUESTS, event.ATOMIC_DEPTH):
        events[:, name] = 1
    events[:, event.LOAD_TRANSACTIONS] = 6 * lanes + events[:, event.BASE_SECTORS] + events[:, event.WARPS]
    events[:, event.LOAD_BYTES] = events[:, event.LOAD_TRANSACTIONS] * segment  # corners lie 112 bytes apart
    events[:, event.STORE_TRANSACTIONS] = events[:, event.ENTRY_SECTORS] + 2 * BLOCK * 4 // segment
    events[:, event.STORE_BYTES] = events[:, event.STORE_TRANSACTIONS] * segment
