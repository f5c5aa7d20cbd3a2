"""Parallel bucketing, the scan between its halves (Eisenacher & Loop 2010, section 3.2).

START is the prefix sum of COUNT. The paper uses the parallel scan of CUDPP (Harris et al. 2008): each block sums 1024
counters, four a thread, by a tree in shared memory that is padded against bank conflicts; the sums of the blocks are
scanned in the same way, level by level, and added back. Its launches and traffic are counted from that shape; the sum
itself is NumPy's.
"""

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.coalescing import contiguous
from tilestamp.models.errors import TilestampError
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.work import Work

BLOCK = 256  # threads
ELEMENTS = 1024  # counters a block: a vector of four a thread
WORD_BYTES = 4
TREE_LEVELS = 8  # log2 of the vectors a block
SHARED_BYTES = (BLOCK + BLOCK // 16) * WORD_BYTES  # a sum a vector, padded by a word every 16
_LARGEST = 2**32 - 1  # START is 32 bits wide


class BucketScanEvent(IntEnum):
    """Events of one block, of the block scan and of the kernel that adds the sums back."""

    WARPS = 0  # warps of the block: load four counters a lane, store them
    LANES = 1  # lanes with a counter
    STEP_WARPS = 2  # warps that take part in a step of the tree, up or down
    STEP_LANES = 3
    BARRIER = 4  # warps that arrive at a barrier
    LOAD_TRANSACTIONS = 5
    LOAD_BYTES = 6
    STORE_TRANSACTIONS = 7
    STORE_BYTES = 8


_E = BucketScanEvent


def bucket_scan(count: NDArray[np.uint32], simt: Simt, *, counting: bool = True) -> StageResult[NDArray[np.uint32]]:
    """Prefix sum of COUNT.

    Parameters
    ----------
    count : ndarray, (tiles,), uint32
    simt : Simt
    counting : bool
        Without it no works come back.

    Returns
    -------
    outputs : ndarray, (tiles,), uint32
        START: patches in all tiles before.
    works : one for each launch: block scans level by level, then the sums added back from the top

    Raises
    ------
    TilestampError
        More patches in tiles than 32 bits count.
    """
    total = int(count.sum(dtype=np.int64))
    if total > _LARGEST:
        raise TilestampError(f"{total} patches in tiles are more than 32-bit lists hold: draw a smaller image")
    start = np.cumsum(count, dtype=np.uint32) - count
    if not counting:
        return StageResult(start)
    sizes = [len(count)]
    while sizes[-1] > ELEMENTS:
        sizes.append(-(-sizes[-1] // ELEMENTS))
    up = [_scan_work(level, size, simt) for level, size in enumerate(sizes)]
    down = [_add_work(level, sizes[level], simt) for level in range(len(sizes) - 2, -1, -1)]
    return StageResult(start, (*up, *down))


def tree_steps(simt: Simt) -> tuple[int, int]:
    """Warps and lanes that take part in one sweep over the tree: half as many lanes a step."""
    lanes = [BLOCK >> level for level in range(1, TREE_LEVELS + 1)]
    return sum(-(-n // simt.warp) for n in lanes), sum(lanes)


def _buffers(level: int) -> tuple[str, str]:
    """Names of what a level reads and writes."""
    return ("COUNT", "START") if level == 0 else (f"SUMS{level}", f"SUMS{level}")


def _work(kernel: str, size: int, table: NDArray[np.int64], shared_bytes: int, streams: tuple[Stream, ...]) -> Work:
    blocks = -(-size // ELEMENTS)
    return Work("bucket_scan", _E, table, BLOCK, kernel=kernel, grid=blocks, shared_bytes=shared_bytes, streams=streams)


def _blocks(size: int, simt: Simt) -> NDArray[np.int64]:
    """Rows of all blocks with what both kernels do: each lane loads and stores a vector of four words."""
    table = np.zeros((-(-size // ELEMENTS), len(_E)), np.int64)
    table[:, _E.WARPS] = -(-BLOCK // simt.warp)
    for rows in (slice(-1), slice(-1, None)):  # all blocks but the last are alike
        elements = ELEMENTS if rows.start is None else size - (len(table) - 1) * ELEMENTS
        traffic = contiguous(0, elements * WORD_BYTES, int(simt.coalescing))
        table[rows, _E.LANES] = -(-elements * BLOCK // ELEMENTS)
        table[rows, [_E.LOAD_TRANSACTIONS, _E.LOAD_BYTES]] = traffic
        table[rows, [_E.STORE_TRANSACTIONS, _E.STORE_BYTES]] = traffic
    return table


def _add_word(table: NDArray[np.int64], columns: list[_E], simt: Simt) -> None:
    """One word more a block: its sum, stored by one lane or loaded by all."""
    table[:, columns] += contiguous(0, WORD_BYTES, int(simt.coalescing))


def _scan_work(level: int, size: int, simt: Simt) -> Work:
    """Block scans of one level; each block leaves its sum to the next level."""
    table = _blocks(size, simt)
    step_warps, step_lanes = tree_steps(simt)
    table[:, _E.STEP_WARPS] = 2 * step_warps
    table[:, _E.STEP_LANES] = 2 * step_lanes
    table[:, _E.BARRIER] = (2 * TREE_LEVELS + 1) * table[:, _E.WARPS]
    source, target = _buffers(level)
    nbytes = size * WORD_BYTES
    streams = [
        Stream(source, "load", int(table[:, _E.LOAD_BYTES].sum()), nbytes),
        Stream(target, "store", int(table[:, _E.STORE_BYTES].sum()), nbytes, partial_lines=0),
    ]
    if len(table) > 1:
        before = int(table[:, _E.STORE_BYTES].sum())
        _add_word(table, [_E.STORE_TRANSACTIONS, _E.STORE_BYTES], simt)
        written = int(table[:, _E.STORE_BYTES].sum()) - before
        streams.append(Stream(f"SUMS{level + 1}", "store", written, len(table) * WORD_BYTES, partial_lines=0))
    return _work("scan_blocks", size, table, SHARED_BYTES, tuple(streams))


def _add_work(level: int, size: int, simt: Simt) -> Work:
    """Add the scanned sum of each block to its elements."""
    table = _blocks(size, simt)
    table[:, _E.BARRIER] = table[:, _E.WARPS]
    target = _buffers(level)[1]
    moved, nbytes = int(table[:, _E.LOAD_BYTES].sum()), size * WORD_BYTES
    _add_word(table, [_E.LOAD_TRANSACTIONS, _E.LOAD_BYTES], simt)
    sums = int(table[:, _E.LOAD_BYTES].sum()) - moved
    streams = (
        Stream(target, "load", moved, nbytes),
        Stream(target, "store", moved, nbytes, partial_lines=0),
        Stream(f"SUMS{level + 1}", "load", sums, len(table) * WORD_BYTES),
    )
    return _work("add_sums", size, table, WORD_BYTES, streams)
