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
    """Events of one block."""

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
    lanes = np.full(blocks, block, np.int64)
    lanes[-1] = items - (blocks - 1) * block
    warps = -(-lanes // simt.warp)
    table = np.zeros((blocks, len(ThreadEvent)), np.int64)
    table[:, ThreadEvent.WARPS] = warps
    table[:, ThreadEvent.WARP_LANES] = lanes
    table[:, ThreadEvent.BLOCKS] = 1
    table[:, ThreadEvent.IDLE_WARPS] = -(-block // simt.warp) - warps
    streams = []
    moves: tuple[tuple[Literal["load", "store"], tuple[Access, ...]], ...] = (("load", loads), ("store", stores))
    for op, accesses in moves:
        for access in accesses:
            count, size = record_transactions(access, simt)
            table[:, ThreadEvent[f"{op.upper()}_TRANSACTIONS"]] += warps * count
            table[:, ThreadEvent[f"{op.upper()}_BYTES"]] += warps * size
            footprint = items * access.stride
            moved = int(warps.sum()) * size
            if not access.scattered:
                moved = min(moved, max(footprint, items * access.words * access.word_bytes))
            lines = partial_lines(access, simt.warp) if op == "store" else 0
            streams.append(Stream(access.buffer, op, moved, footprint, partial_lines=lines * int(warps.sum())))
    idle = np.zeros((idle_blocks, len(ThreadEvent)), np.int64)
    idle[:, ThreadEvent.IDLE_WARPS] = -(-block // simt.warp)
    table = np.concatenate([table, idle])
    return Work(
        stage=stage,
        kernel=kernel,
        events=ThreadEvent,
        table=table,
        grid=len(table),
        block=block,
        streams=tuple(streams),
        variant=variant,
    )


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


def partial_lines(access: Access, warp: int) -> int:
    """Lines that the memory instructions of a whole warp on consecutive records fill in part."""
    if access.stride == access.word_bytes:
        return 0
    lanes = np.arange(warp, dtype=np.int64)[:, None] * access.stride
    lines = (lanes + np.arange(access.words) * access.word_bytes) // LINE_BYTES
    return sum(len(np.unique(word)) for word in lines.T)
