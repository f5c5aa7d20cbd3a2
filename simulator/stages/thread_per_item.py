"""Kernels of one thread an item, the same work for each: vertex shading, copies, clears. Their work table by block."""

from enum import IntEnum
from functools import cache
from typing import Literal, NamedTuple

import numpy as np

from tilestamp.models.coalescing import transactions
from tilestamp.models.launch import LINE_BYTES, Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.work import Work


class ThreadEvent(IntEnum):
    """Events of one block, in the order in which ``thread_per_item`` writes them."""

    WARPS = 0  # warps that run the body
    WARP_LANES = 1  # their lanes that have an item
    LOAD_TRANSACTIONS = 2
    STORE_TRANSACTIONS = 3
    LOAD_BYTES = 4
    STORE_BYTES = 5
    BLOCKS = 6  # 1: what a dependent chain is priced on
    IDLE_WARPS = 7  # that find no item and return


class Access(NamedTuple):
    """How the items of a kernel touch one buffer.

    Parameters
    ----------
    buffer : str
    stride : int
        Bytes from one item's record to the next one's.
    words : int
        Memory instructions that read or write the record.
    word_bytes : int
        Bytes of each: 4, 8 or 16.
    scattered : bool
        Whether the segment of each word leaves L1 by itself, as stores to records that lie far apart do.
    """

    buffer: str
    stride: int
    words: int
    word_bytes: int = 4
    scattered: bool = False


def thread_per_item(
    stage: str,
    kernel: str,
    items: int,
    block: int,
    simt: Simt,
    loads: tuple[Access, ...] = (),
    stores: tuple[Access, ...] = (),
    idle_blocks: int = 0,
    variant: str = "",
) -> Work:
    """Make the work table of a kernel whose thread i handles item i.

    The streams hold each record once: further words of a segment that a warp has just touched come from its L1 or L2.

    Parameters
    ----------
    stage, kernel : str
    items : int
    block : int
        Threads in a block.
    simt : Simt
    loads, stores : tuple of Access
    idle_blocks : int
        Further blocks of the launch, whose threads find no item.
    variant : str
        As in ``Work``.

    Returns
    -------
    Work
        One row a block.
    """
    blocks = max(1, -(-items // block))
    most = -(-block // simt.warp)  # warps of a block
    lanes = block, items - (blocks - 1) * block  # of a full block, and of the last one
    warps = most, -(-lanes[1] // simt.warp)
    launched = (blocks - 1) * most + warps[1]
    moving = [0] * 4  # transactions, then bytes, of a warp's loads and stores
    streams = []
    moves: tuple[tuple[Literal["load", "store"], tuple[Access, ...]], ...] = (("load", loads), ("store", stores))
    for op, accesses in moves:
        for access in accesses:
            count, size = record_transactions(access._replace(buffer=""), simt)
            moving[op == "store"] += count
            moving[2 + (op == "store")] += size
            footprint = items * access.stride
            moved = launched * size
            if not access.scattered:
                moved = min(moved, max(footprint, items * access.words * access.word_bytes))
            lines = partial_lines(access._replace(buffer=""), simt.warp) if op == "store" else 0
            streams.append(Stream(access.buffer, op, moved, footprint, partial_lines=lines * launched))
    rows = [[warps[i], lanes[i], *(warps[i] * moved for moved in moving), 1, most - warps[i]] for i in range(2)]
    table = np.empty((blocks + idle_blocks, len(ThreadEvent)), np.int64)
    table[: blocks - 1], table[blocks - 1] = rows
    table[blocks:] = [0] * ThreadEvent.IDLE_WARPS + [most]
    return Work(stage, ThreadEvent, table, block, kernel=kernel, streams=tuple(streams), variant=variant)


@cache
def record_transactions(access: Access, simt: Simt) -> tuple[int, int]:
    """Transactions of a whole warp on consecutive records, and their bytes."""
    count = total = 0
    for word in range(access.words):
        addresses = np.arange(simt.warp, dtype=np.int64) * access.stride + word * access.word_bytes
        n, size = transactions(addresses, simt.warp, access.word_bytes, int(simt.coalescing))
        count += n
        total += size
    return count, total


@cache
def partial_lines(access: Access, warp: int) -> int:
    """Lines that the memory instructions of a whole warp on consecutive records fill in part."""
    if access.stride == access.word_bytes:
        return 0
    lanes = np.arange(warp, dtype=np.int64)[:, None] * access.stride
    lines = (lanes + np.arange(access.words) * access.word_bytes) // LINE_BYTES
    return access.words + int(np.count_nonzero(np.diff(lines, axis=0)))
