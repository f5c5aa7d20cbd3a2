"""Scan: inclusive sums of the tile counts, in one pass with look-back (Merrill & Garland 2016, as CUB launches it)."""

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.coalescing import contiguous, smallest_transaction_bytes
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.thread_per_item import Access, ThreadEvent, thread_per_item
from tilestamp.simulator.work import Work

BLOCK = 128  # threads
ITEMS = 24  # a thread, which a block reads and writes one behind another
SHARED_BYTES = 12304
LOOK_BACK_LOADS, LOOK_BACK_STORES = 18, 2  # transactions of a block, as on an H200 in the mean: sums of those before it
_E = ThreadEvent


def scan(counts: NDArray[np.uint32], simt: Simt, *, counting: bool = True) -> StageResult[NDArray[np.int64]]:
    """Sum up the counts.

    Parameters
    ----------
    counts : ndarray, (N,), uint32
    simt : Simt
    counting : bool

    Returns
    -------
    outputs : ndarray, (N,), int64
        The sum of each and all before.
    works : two: a kernel that clears the state of the blocks, and one that sums
    """
    ends = np.cumsum(counts, dtype=np.int64)
    return StageResult(ends, scan_works(len(counts), simt) if counting else ())


def scan_works(count: int, simt: Simt) -> tuple[Work, Work]:
    """Works of both kernels."""
    blocks = -(-count // (BLOCK * ITEMS))
    clear = thread_per_item("scan", "scan_init", blocks, BLOCK, simt, (), (Access("scan_state", 8, 1, 8),))
    threads = thread_per_item("scan", "scan", -(-count // ITEMS), BLOCK, simt)
    table = threads.table
    sizes = np.full(blocks, 4 * BLOCK * ITEMS, np.int64)
    sizes[-1] = 4 * (count - (blocks - 1) * BLOCK * ITEMS)
    for k in {0, blocks - 1}:
        moved = contiguous(0, int(sizes[k]), int(simt.coalescing))
        rows = slice(None) if k == 0 else slice(k, None)
        table[rows, [_E.LOAD_TRANSACTIONS, _E.LOAD_BYTES]] = moved
        table[rows, [_E.STORE_TRANSACTIONS, _E.STORE_BYTES]] = moved
    segment = smallest_transaction_bytes(int(simt.coalescing))
    table[:, [_E.LOAD_TRANSACTIONS, _E.LOAD_BYTES]] += np.multiply(LOOK_BACK_LOADS, (1, segment))
    table[:, [_E.STORE_TRANSACTIONS, _E.STORE_BYTES]] += np.multiply(LOOK_BACK_STORES, (1, segment))
    total = 4 * count
    streams = (
        Stream("tiles", "load", total, total),
        Stream("scan_state", "load", 8 * blocks, 8 * blocks),
        Stream("offsets", "store", total, total, partial_lines=0),
    )
    summed = Work("scan", _E, table, BLOCK, grid=blocks, shared_bytes=SHARED_BYTES, streams=streams)
    return clear, summed
