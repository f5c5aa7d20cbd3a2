"""Parallel bucketing, second half: bucket write (Eisenacher & Loop 2010, section 3.2).

One thread a patch again: for each tile that the patch overlaps, ``LISTS[START[tile] + IDX] = patch``.
"""

from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.bits import active_lanes, lowest_bit, popcount
from tilestamp.models.coalescing import touched_lines, transactions
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.eisenacher2010.bucket_count import (
    BLOCK,
    BOX_BYTES,
    WORD_BYTES,
    patch_traffic,
)
from tilestamp.simulator.stages.eisenacher2010.tile_range import Tiles, slot_tiles
from tilestamp.simulator.work import Work


class BucketWriteEvent(IntEnum):
    """Events of one block."""

    PATCH_WARPS = 0  # warps that have a patch: load its box and IDX, find its tiles
    PATCH_LANES = 1
    SLOT_WARPS = 2  # tests whether a slot holds a tile
    DIVERGENT_WARPS = 3  # of those, tests that split the warp
    WRITE_WARPS = 4  # slots written: load START, store the patch
    WRITE_LANES = 5
    LOAD_TRANSACTIONS = 6
    LOAD_BYTES = 7
    STORE_TRANSACTIONS = 8
    STORE_BYTES = 9
    BOX_BYTES = 10  # of LOAD_BYTES: boxes
    IDX_BYTES = 11  # of LOAD_BYTES: IDX
    LAST_WRITE_WARPS = 12  # of WRITE_WARPS: the last slot, which compilers branch around and do not predicate
    LAST_WRITE_LANES = 13
    STORE_LINES = 14  # lines of 128 bytes that the stores touch


_E = BucketWriteEvent


@kernel(lent=True)
def _write_slot(tile: Any, first: int, lanes: int, slot: int, start: Any, idx: Any, lists: Any, addresses: Any) -> None:
    """Fill LISTS from one slot of one warp; leaves where: a byte address a lane, -1 where it writes nothing."""
    addresses[:lanes] = -1
    active = active_lanes(tile, 0, lanes)
    while active != np.uint64(0):
        lane = lowest_bit(active)
        active &= active - np.uint64(1)
        place = np.int64(start[tile[lane]]) + np.int64(idx[first + lane, slot])
        lists[place] = first + lane
        addresses[lane] = place * WORD_BYTES


@kernel(lent=True)
def _count_slot(tile: Any, lanes: int, last: bool, coalescing: Any, counters: Any, addresses: Any, row: Any) -> None:
    """Count loads of START and stores to LISTS of one slot in one warp, at their real addresses."""
    active = popcount(active_lanes(tile, 0, lanes))
    row[_E.SLOT_WARPS] += 1
    if active == 0:
        return
    row[_E.DIVERGENT_WARPS] += active < lanes
    row[_E.WRITE_WARPS] += 1
    if last:
        row[_E.LAST_WRITE_WARPS] += 1
        row[_E.LAST_WRITE_LANES] += active
    row[_E.WRITE_LANES] += active
    for lane in range(lanes):
        counters[lane] = max(tile[lane] * WORD_BYTES, -1)
    count, size = transactions(counters, lanes, WORD_BYTES, coalescing)
    row[_E.LOAD_TRANSACTIONS] += count
    row[_E.LOAD_BYTES] += size
    count, size = transactions(addresses, lanes, WORD_BYTES, coalescing)
    row[_E.STORE_TRANSACTIONS] += count
    row[_E.STORE_BYTES] += size
    row[_E.STORE_LINES] += touched_lines(addresses, lanes)


@kernel(lent=True)
def _write_part(
    part: int, parts: int, boxes: Any, tiles: Tiles, warp: int, start: Any, idx: Any, coalescing: Any, lists: Any,
    table: Any, slots: Any, corners: Any, addresses: Any, counters: Any,
) -> None:  # fmt: skip
    """``_write_blocks``, with scratch for one warp."""
    patches = boxes.shape[0]
    blocks = (patches + BLOCK - 1) // BLOCK
    traffic = patch_traffic(0, warp, patches, tiles.slots, coalescing, addresses)
    for block in range(part * blocks // parts, (part + 1) * blocks // parts):
        for first in range(block * BLOCK, min((block + 1) * BLOCK, patches), warp):
            lanes = min(warp, patches - first)
            slot_tiles(boxes, first, lanes, tiles, corners, slots)
            if table is not None:
                row = table[block]
                if lanes < warp or tiles.slots > 2:  # else as aligned as every full warp
                    traffic = patch_traffic(first, lanes, patches, tiles.slots, coalescing, addresses)
                row[_E.PATCH_WARPS] += 1
                row[_E.PATCH_LANES] += lanes
                row[_E.LOAD_TRANSACTIONS] += traffic[0] + traffic[2]  # IDX is read as it was written
                row[_E.LOAD_BYTES] += traffic[1] + traffic[3]
                row[_E.BOX_BYTES] += traffic[1]
                row[_E.IDX_BYTES] += traffic[3]
            for slot in range(tiles.slots**2):
                _write_slot(slots[slot], first, lanes, slot, start, idx, lists, addresses)
                if table is not None:
                    last = slot == tiles.slots**2 - 1
                    _count_slot(slots[slot], lanes, last, coalescing, counters, addresses, table[block])


@kernel
def _write_blocks(
    part: int, parts: int, boxes: Any, tiles: Tiles, warp: int, start: Any, idx: Any, coalescing: Any, lists: Any,
    table: Any,
) -> None:  # fmt: skip
    """Fill LISTS from the blocks of one part, and count their events."""
    slots, corners = np.empty((tiles.slots**2, warp), np.int64), np.empty((4, warp), np.int64)
    addresses, counters = np.empty(warp, np.int64), np.empty(warp, np.int64)
    _write_part(
        part, parts, boxes, tiles, warp, start, idx, coalescing, lists, table, slots, corners, addresses, counters
    )


def bucket_write(
    boxes: NDArray[np.float32],
    tiles: Tiles,
    count: NDArray[np.uint32],
    start: NDArray[np.uint32],
    idx: NDArray[np.uint32],
    simt: Simt,
    *,
    counting: bool = True,
) -> StageResult[NDArray[np.uint32]]:
    """Write the list of patches of each tile.

    Parameters
    ----------
    boxes : ndarray, (N, 4), float32
        As for ``bucket_count``.
    tiles : Tiles
    count, start : ndarray, (tiles,), uint32
        COUNT and START.
    idx : ndarray, (N, slots**2), uint32
        IDX.
    simt : Simt
    counting : bool
        Without it no works come back.

    Returns
    -------
    outputs : ndarray, (sum of count,), uint32
        LISTS: patches of tile t at start[t]..start[t]+count[t]-1.
    works : one, a row a block
    """
    lists = np.empty(int(count.sum(dtype=np.int64)), np.uint32)
    blocks, coalescing = -(-len(boxes) // BLOCK), int(simt.coalescing)
    table = np.zeros((blocks, len(_E)), np.int64) if counting else None
    for_parts(_write_blocks, parts_of(blocks), boxes, tiles, simt.warp, start, idx, coalescing, lists, table)
    if table is None:
        return StageResult(lists)
    streams = _streams(table, len(boxes), tiles, count)
    work = Work("bucket_write", _E, table, BLOCK, streams=streams, variant=tiles.variant)
    return StageResult(lists, (work,))


def _streams(table: NDArray[np.int64], patches: int, tiles: Tiles, count: NDArray[np.uint32]) -> tuple[Stream, ...]:
    """Buffers that the kernel touches, from the rows of its blocks."""
    total = table.sum(axis=0)
    written, entries = int(total[_E.STORE_BYTES]), int(count.sum(dtype=np.int64))
    own = int(total[_E.LOAD_BYTES] - total[_E.BOX_BYTES] - total[_E.IDX_BYTES])
    return (
        Stream("boxes", "load", int(total[_E.BOX_BYTES]), patches * BOX_BYTES),
        Stream("IDX", "load", int(total[_E.IDX_BYTES]), patches * tiles.slots**2 * WORD_BYTES),
        Stream("START", "load", own, int(np.count_nonzero(count)) * WORD_BYTES),
        Stream("LISTS", "store", written, entries * WORD_BYTES, partial_lines=int(total[_E.STORE_LINES])),
    )
