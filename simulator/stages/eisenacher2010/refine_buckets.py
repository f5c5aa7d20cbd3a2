"""Buckets of fine tiles from those of coarse ones: a second bucket pass, a block a coarse tile (not in the paper).

The first pass counts and writes few entries, at few counters. A block then reads the boxes of its list twice: it counts
the grids of each of its fine tiles by atomics in shared memory, takes room for all of them from one global cursor, and
writes their lists. START is that room and a prefix sum over the block's own counters, so that no scan of the screen is
needed.
"""

from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.coalescing import contiguous, transactions
from tilestamp.models.counters import count, shown
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.eisenacher2010.bucket_conflicts import most_wanted
from tilestamp.simulator.stages.eisenacher2010.tile_range import Tiles, tile_range
from tilestamp.simulator.work import Work

BLOCK = 256  # threads
WORD_BYTES, BOX_BYTES = 4, 16
COUNT, WRITE = 0, 1  # passes over the list of a coarse tile


@shown(count("ENTRIES", "entries of lists of fine tiles"))
class RefineEvent(IntEnum):
    """Events of one block: a coarse tile."""

    WARPS = 0  # start of the kernel, prefix sum, and end
    BATCH_WARPS = 1  # warps of a batch of 256 grids in one pass: an entry and a box a lane, its fine tiles
    BATCH_LANES = 2
    SLOT_WARPS = 3  # tests whether a slot holds a fine tile of the block
    SHARED_ATOMIC = 4  # slots that hold one in at least one lane
    SLOT_LANES = 5
    BANK_REPLAYS = 6  # lanes that wait for others at the same counter
    WRITE_WARPS = 7  # slots written to the lists
    ENTRIES = 8
    BARRIER = 9
    ATOMIC_LANES = 10  # room for the lists: one of a block
    ATOMIC_REQUESTS = 11
    ATOMIC_DEPTH = 12
    LOAD_TRANSACTIONS = 13
    LOAD_BYTES = 14
    STORE_TRANSACTIONS = 15
    STORE_BYTES = 16


_E = RefineEvent


class Buckets(NamedTuple):
    """Lists of grids by fine tile."""

    counts: NDArray[np.uint32]
    start: NDArray[np.uint32]
    lists: NDArray[np.uint32]


@kernel(lent=True)
def _slots(
    boxes: Any, lists: Any, first: int, lanes: int, fine: Tiles, left: int, top: int, sides: int, slots: Any, grids: Any
) -> None:
    """Fine tile of each lane in each slot, as far as it is one of the block's; -1 where there is none."""
    for lane in range(lanes):
        grids[lane] = lists[first + lane]
        x0, y0, x1, y1 = tile_range(boxes[grids[lane]], fine)
        for j in range(fine.slots):
            for i in range(fine.slots):
                x, y = x0 + i, y0 + j
                inside = x <= x1 and y <= y1 and left <= x < left + sides and top <= y < top + sides
                slots[j * fine.slots + i, lane] = y * fine.columns + x if inside else -1


@kernel(lent=True)
def _count_slot(tile: Any, lanes: int, row: Any) -> int:
    """Events of the shared atomics of one slot; lanes that have one."""
    active = 0
    for lane in range(lanes):
        active += tile[lane] >= 0
    row[_E.SLOT_WARPS] += 1
    if active > 0:
        row[_E.SHARED_ATOMIC] += 1
        row[_E.SLOT_LANES] += active
        row[_E.BANK_REPLAYS] += most_wanted(tile, lanes) - 1
    return active


@kernel
def _refine(
    boxes: Any, coarse_count: Any, coarse_start: Any, lists: Any, coarse: Tiles, fine: Tiles, warp: int,
    coalescing: int, fine_count: Any, fine_start: Any, refined: Any, table: Any,
) -> None:  # fmt: skip
    """Two passes over the list of each coarse tile; blocks take their room one after the other."""
    sides = coarse.size // fine.size
    slots, grids = np.empty((fine.slots * fine.slots, warp), np.int64), np.empty(warp, np.int64)
    addresses = np.empty(warp, np.int64)
    taken, cursor = np.zeros(fine_count.size, np.int64), np.int64(0)
    for block in range(coarse_count.size):
        left, top = block % coarse.columns * sides, block // coarse.columns * sides
        row = table[block]
        first: Any = np.int64(coarse_start[block])
        number: Any = np.int64(coarse_count[block])
        for step in (COUNT, WRITE):
            for base in range(first, first + number, warp):
                lanes = min(warp, first + number - base)
                _slots(boxes, lists, base, lanes, fine, left, top, sides, slots, grids)
                if step == COUNT:
                    _count_loads(base, lanes, grids, coalescing, addresses, row)
                for slot in range(fine.slots * fine.slots):
                    tile = slots[slot]
                    active = _count_slot(tile, lanes, row)
                    for lane in range(lanes):
                        addresses[lane] = -1
                        if tile[lane] < 0:
                            continue
                        if step == COUNT:
                            fine_count[tile[lane]] += 1
                        else:
                            place = fine_start[tile[lane]] + taken[tile[lane]]
                            refined[place] = grids[lane]
                            taken[tile[lane]] += 1
                            addresses[lane] = place * WORD_BYTES
                    if step == WRITE and active > 0:
                        moved, size = transactions(addresses, lanes, WORD_BYTES, coalescing)
                        row[_E.WRITE_WARPS] += 1
                        row[_E.ENTRIES] += active
                        row[_E.STORE_TRANSACTIONS] += moved
                        row[_E.STORE_BYTES] += size
            if step == COUNT:
                for y in range(top, min(top + sides, fine.rows)):
                    for x in range(left, min(left + sides, fine.columns)):
                        fine_start[y * fine.columns + x] = cursor
                        cursor += np.int64(fine_count[y * fine.columns + x])


@kernel(lent=True)
def _count_loads(base: int, lanes: int, grids: Any, coalescing: int, addresses: Any, row: Any) -> None:
    """An entry and a box a lane, in both passes."""
    for lane in range(lanes):
        addresses[lane] = grids[lane] * BOX_BYTES
    entries, entry_bytes = contiguous(base * WORD_BYTES, lanes * WORD_BYTES, coalescing)
    moved, size = transactions(addresses, lanes, BOX_BYTES, coalescing)
    row[_E.BATCH_WARPS] += 2
    row[_E.BATCH_LANES] += 2 * lanes
    row[_E.LOAD_TRANSACTIONS] += 2 * (entries + moved)
    row[_E.LOAD_BYTES] += 2 * (entry_bytes + size)


def refine_buckets(
    boxes: NDArray[np.float32],
    coarse_count: NDArray[np.uint32],
    coarse_start: NDArray[np.uint32],
    lists: NDArray[np.uint32],
    coarse: Tiles,
    fine: Tiles,
    simt: Simt,
) -> StageResult[Buckets]:
    """Sort the grids of each coarse tile into the buckets of its fine tiles.

    Parameters
    ----------
    boxes : ndarray, (N, 4), float32
    coarse_count, coarse_start, lists : ndarray, uint32
        As ``bucket_write`` leaves them.
    coarse, fine : Tiles
    simt : Simt

    Returns
    -------
    outputs : Buckets
    works : one, a row a coarse tile
    """
    found, start = np.zeros(fine.total, np.uint32), np.zeros(fine.total, np.uint32)
    refined = np.empty(len(lists) * fine.slots**2, np.uint32)  # no grid is in more tiles
    table = np.zeros((coarse.total, len(_E)), np.int64)
    _refine(
        boxes, coarse_count, coarse_start, lists, coarse, fine, simt.warp, int(simt.coalescing), found, start, refined,
        table,
    )  # fmt: skip
    refined = refined[: int(found.sum(dtype=np.int64))].copy()
    warps, sides = -(-BLOCK // simt.warp), coarse.size // fine.size
    table[:, _E.WARPS] = warps
    table[:, _E.BARRIER] = 3 * warps
    table[:, [_E.ATOMIC_LANES, _E.ATOMIC_REQUESTS, _E.ATOMIC_DEPTH]] = 1
    words = contiguous(0, sides * WORD_BYTES, int(simt.coalescing))  # COUNT and START of a row of fine tiles
    table[:, [_E.STORE_TRANSACTIONS, _E.STORE_BYTES]] += np.array(words) * 2 * sides
    return StageResult(Buckets(found, start, refined), (_work(table, len(boxes), lists, refined, coarse, fine),))


def _work(
    table: NDArray[np.int64], grids: int, lists: NDArray[np.uint32], refined: NDArray[np.uint32], coarse: Tiles,
    fine: Tiles,
) -> Work:  # fmt: skip
    """Work of the kernel; the second pass finds what the first has loaded."""
    total, entries = table.sum(axis=0), len(lists) * WORD_BYTES
    words, stored = 2 * fine.total * WORD_BYTES, int(total[_E.STORE_BYTES])
    streams = (
        Stream("LISTS", "load", 2 * entries, entries + 2 * coarse.total * WORD_BYTES),
        Stream("boxes", "load", int(total[_E.LOAD_BYTES]) - 2 * entries, grids * BOX_BYTES),
        Stream("fine COUNT and START", "store", words, words, partial_lines=0),
        Stream("fine LISTS", "store", max(stored - words, 0), len(refined) * WORD_BYTES),
    )
    requests = np.array([coarse.total], np.int64)  # one cursor
    return Work(
        stage="refine_buckets", kernel="refine_buckets", events=_E, table=table, grid=len(table), block=BLOCK,
        shared_bytes=2 * (coarse.size // fine.size) ** 2 * WORD_BYTES, streams=streams, atomic_requests=requests,
    )  # fmt: skip
