"""Parallel bucketing, first half: init and address calculation (Eisenacher & Loop 2010, section 3.2).

COUNT is set to zero. Then one thread a patch adds one to the counter of each tile that the patch overlaps, by
``atomicAdd``; the value returned is the patch's place in that tile's list and is kept in IDX.

We let the warps run in the order of the patch queue, one after the other. A real machine is free to mix them; the
picture depends on it only where two samples have the same depth. Conflicts do not depend on it: they are counted warp
by warp, slot by slot, on the real tiles. Options that the paper lacks: counters some words apart, and one atomic for
all lanes of a warp that want the same tile.
"""

from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numba import get_num_threads
from numpy.typing import NDArray

from tilestamp.models.atomics import CHUNK_BYTES
from tilestamp.models.bits import active_lanes, lowest_bit, popcount
from tilestamp.models.coalescing import contiguous, transactions
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.parallel import for_parts
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.eisenacher2010.bucket_conflicts import (
    AtomicRule,
    atomic_rule,
    count_wanted,
    keep_leaders,
)
from tilestamp.simulator.stages.eisenacher2010.tile_range import Tiles, slot_tiles
from tilestamp.simulator.work import Work

BLOCK = 256  # threads: one a patch
WORD_BYTES = 4
BOX_BYTES = 16  # x0, y0, x1, y1 of a patch


class BucketInitEvent(IntEnum):
    """Events of one block of the init kernel."""

    STORE_WARPS = 0  # one word set to zero a lane
    STORE_LANES = 1
    STORE_TRANSACTIONS = 2
    STORE_BYTES = 3


class BucketCountEvent(IntEnum):
    """Events of one block of the address calculation."""

    PATCH_WARPS = 0  # warps that have a patch: load its box, find its tiles, store IDX
    PATCH_LANES = 1
    SLOT_WARPS = 2  # tests whether a slot holds a tile
    DIVERGENT_WARPS = 3  # of those, tests that split the warp
    ATOMIC = 4  # atomic instructions: slots that hold a tile in at least one lane
    ATOMIC_LANES = 5
    ATOMIC_REQUESTS = 6
    ATOMIC_CONFLICTS = 7  # lanes at a counter that an earlier lane of the instruction wants
    ATOMIC_DEPTH = 8  # sum over instructions of the lanes at the most wanted counter
    GROUP_DEPTH = 9  # the same for the lanes that arrive together: half-warps on 1.x
    LOCK_DEPTH = 10  # the same by 32-byte chunk (the width of a GT200 lock), for the lanes that arrive together
    ATOMIC_SECTORS = 11  # distinct 32-byte chunks, summed over instructions
    SLOT_LANES = 12  # patches in tiles: what is written to the lists
    LOAD_TRANSACTIONS = 13
    LOAD_BYTES = 14
    STORE_TRANSACTIONS = 15
    STORE_BYTES = 16


_E = BucketCountEvent


@kernel(lent=True)
def _place(tile: Any, lanes: int, first: int, slot: int, count: Any, idx: Any) -> None:
    """COUNT and IDX of one slot in one warp: the lowest lane first."""
    active = active_lanes(tile, 0, lanes)
    while active != np.uint64(0):
        lane = np.uint64(lowest_bit(active))
        active &= active - np.uint64(1)
        here = np.uint64(tile[lane])
        idx[np.uint64(first) + lane, slot] = count[here]
        count[here] += 1


@kernel(lent=True)
def _count_atomic(
    tile: Any, lanes: int, rule: AtomicRule, aggregate: bool, row: Any, chunk_requests: Any, leaders: Any, words: Any
) -> None:
    """Events of one slot in one warp."""
    active = popcount(active_lanes(tile, 0, lanes))
    row[_E.SLOT_WARPS] += 1
    if active == 0:
        return
    row[_E.DIVERGENT_WARPS] += active < lanes
    row[_E.SLOT_LANES] += active
    if aggregate:
        keep_leaders(tile, lanes, leaders)
        tile = leaders
        active = popcount(active_lanes(tile, 0, lanes))
    counters, chunks, depth, group_depth, lock_depth, sent = count_wanted(tile, lanes, rule, words, chunk_requests)
    row[_E.ATOMIC] += 1
    row[_E.ATOMIC_LANES] += active
    row[_E.ATOMIC_REQUESTS] += sent
    row[_E.ATOMIC_CONFLICTS] += active - counters
    row[_E.ATOMIC_DEPTH] += depth
    row[_E.GROUP_DEPTH] += group_depth
    row[_E.LOCK_DEPTH] += lock_depth
    row[_E.ATOMIC_SECTORS] += chunks


@kernel(lent=True)
def patch_traffic(
    first: int, lanes: int, patches: int, slots: int, coalescing: Any, addresses: Any
) -> tuple[int, int, int, int]:
    """Load of the boxes and store of IDX by one warp: transactions and bytes of each.

    Four words a patch at once for 2x2 slots, else an array a slot.
    """
    for lane in range(lanes):
        addresses[lane] = (first + lane) * BOX_BYTES
    loads, load_bytes = transactions(addresses, lanes, BOX_BYTES, coalescing)
    if slots == 2:
        return loads, load_bytes, loads, load_bytes
    stores = store_bytes = 0
    for slot in range(slots**2):
        count, size = contiguous((slot * patches + first) * WORD_BYTES, lanes * WORD_BYTES, coalescing)
        stores += count
        store_bytes += size
    return loads, load_bytes, stores, store_bytes


@kernel(lent=True)
def _count_part(
    part: int, parts: int, boxes: Any, tiles: Tiles, rule: AtomicRule, coalescing: Any, aggregate: bool, count: Any,
    idx: Any, table: Any, chunk_requests: Any, slots: Any, corners: Any, addresses: Any, words: Any,
) -> None:  # fmt: skip
    """``_count_blocks``, with its own row of counts and requests, and scratch for one warp."""
    patches = boxes.shape[0]
    blocks = (patches + BLOCK - 1) // BLOCK
    traffic = patch_traffic(0, rule.warp, patches, tiles.slots, coalescing, addresses)
    for block in range(part * blocks // parts, (part + 1) * blocks // parts):
        for first in range(block * BLOCK, min((block + 1) * BLOCK, patches), rule.warp):
            lanes = min(rule.warp, patches - first)
            slot_tiles(boxes, first, lanes, tiles, corners, slots)
            for slot in range(tiles.slots**2):
                _place(slots[slot], lanes, first, slot, count, idx)
            if table is not None:
                row = table[block]
                if lanes < rule.warp or tiles.slots > 2:  # else as aligned as every full warp
                    traffic = patch_traffic(first, lanes, patches, tiles.slots, coalescing, addresses)
                row[_E.PATCH_WARPS] += 1
                row[_E.PATCH_LANES] += lanes
                row[_E.LOAD_TRANSACTIONS] += traffic[0]
                row[_E.LOAD_BYTES] += traffic[1]
                row[_E.STORE_TRANSACTIONS] += traffic[2]
                row[_E.STORE_BYTES] += traffic[3]
                for slot in range(tiles.slots**2):
                    _count_atomic(slots[slot], lanes, rule, aggregate, row, chunk_requests, addresses, words)


@kernel
def _count_blocks(
    part: int, parts: int, boxes: Any, tiles: Tiles, rule: AtomicRule, coalescing: Any, aggregate: bool, counts: Any,
    idx: Any, table: Any, requests: Any,
) -> None:  # fmt: skip
    """COUNT and IDX as the blocks of one part alone make them, and their events; ``counts`` has a row a part."""
    slots, corners = np.empty((tiles.slots**2, rule.warp), np.int64), np.empty((4, rule.warp), np.int64)
    addresses, words = np.empty(rule.warp, np.int64), np.empty(rule.warp, np.int64)
    _count_part(
        part, parts, boxes, tiles, rule, coalescing, aggregate, counts[part], idx, table, requests[part], slots,
        corners, addresses, words,
    )  # fmt: skip


@kernel(lent=True)
def _add_part(
    part: int, parts: int, boxes: Any, tiles: Tiles, warp: int, before: Any, idx: Any, slots: Any, corners: Any
) -> None:
    """``_add_before``, with scratch for one warp."""
    patches, owner, owners = boxes.shape[0], 0, before.shape[0]
    blocks = (patches + BLOCK - 1) // BLOCK
    begin = blocks // owners  # nothing is before the first part
    for block in range(begin + (blocks - begin) * part // parts, begin + (blocks - begin) * (part + 1) // parts):
        while (owner + 1) * blocks // owners <= block:
            owner += 1
        for first in range(block * BLOCK, min((block + 1) * BLOCK, patches), warp):
            lanes = min(warp, patches - first)
            slot_tiles(boxes, first, lanes, tiles, corners, slots)
            mine = idx[first : first + lanes]
            for slot in range(tiles.slots**2):
                for lane in range(lanes):
                    if slots[slot, lane] >= 0:
                        mine[lane, slot] += before[owner, slots[slot, lane]]


@kernel
def _add_before(part: int, parts: int, boxes: Any, tiles: Tiles, warp: int, before: Any, idx: Any) -> None:
    """Add to each place what the parts of ``_count_blocks`` before its own have put into the tile, a row a part."""
    slots, corners = np.empty((tiles.slots**2, warp), np.int64), np.empty((4, warp), np.int64)
    _add_part(part, parts, boxes, tiles, warp, before, idx, slots, corners)


class Counted(NamedTuple):
    """What the first half of bucketing leaves."""

    counts: NDArray[np.uint32]  # (tiles,) COUNT: patches in each tile
    idx: NDArray[np.uint32]  # (N, slots**2) IDX: place in the list of each slot's tile; 0 where it holds none


def bucket_count(
    boxes: NDArray[np.float32],
    tiles: Tiles,
    simt: Simt,
    *,
    padding: int = 1,
    aggregate: bool = False,
    counting: bool = True,
) -> StageResult[Counted]:
    """Count the patches of each tile and give each patch its place.

    Parameters
    ----------
    boxes : ndarray, (N, 4), float32
        x0, y0, x1, y1 of the 16 diced vertices, pixels, y down, in the order of the patch queue.
    tiles : Tiles
    simt : Simt
    padding : int
        Words from one counter to the next (not in the paper).
    aggregate : bool
        One atomic for all lanes of a warp that want the same tile (not in the paper).
    counting : bool
        Without it no events are counted and no works come back.

    Returns
    -------
    outputs : Counted
    works : init and address calculation, a row a block
    """
    rule = atomic_rule(simt, padding)
    blocks, parts = -(-len(boxes) // BLOCK), get_num_threads()
    table = np.zeros((blocks, len(_E)), np.int64) if counting else None
    chunks = -(-tiles.total * padding * WORD_BYTES // CHUNK_BYTES) if counting else 0
    requests = np.zeros((parts, chunks), np.int64)
    coalescing = int(simt.coalescing)
    counts = np.zeros((parts, tiles.total), np.uint32)
    idx = np.zeros((len(boxes), tiles.slots**2), np.uint32)
    for_parts(_count_blocks, parts, boxes, tiles, rule, coalescing, aggregate, counts, idx, table, requests)
    ends = np.cumsum(counts, axis=0, dtype=np.uint32)
    count = ends[-1]
    for_parts(_add_before, parts, boxes, tiles, rule.warp, ends - counts, idx)
    if table is None:
        return StageResult(Counted(count, idx))
    works = _init_work(tiles, padding, simt), _address_work(len(boxes), tiles, table, requests.sum(axis=0), aggregate)
    return StageResult(Counted(count, idx), works)


def _init_work(tiles: Tiles, padding: int, simt: Simt) -> Work:
    """Work of setting COUNT to zero."""
    words = tiles.total * padding
    sizes = np.full(-(-words // BLOCK), BLOCK)
    sizes[-1] = words - BLOCK * (len(sizes) - 1)
    table = np.zeros((len(sizes), len(BucketInitEvent)), np.int64)
    table[:, BucketInitEvent.STORE_WARPS] = -(-sizes // simt.warp)
    table[:, BucketInitEvent.STORE_LANES] = sizes
    for rows in (slice(-1), slice(-1, None)):  # all blocks but the last are alike
        size = int(sizes[rows.start or 0])
        stores = contiguous(0, size * WORD_BYTES, int(simt.coalescing))
        table[rows, [BucketInitEvent.STORE_TRANSACTIONS, BucketInitEvent.STORE_BYTES]] = stores
    stream = Stream(
        "COUNT", "store", int(table[:, BucketInitEvent.STORE_BYTES].sum()), words * WORD_BYTES, partial_lines=0
    )
    return Work("bucket_count", BucketInitEvent, table, BLOCK, kernel="bucket_init", grid=len(sizes), streams=(stream,))


def _address_work(
    patches: int,
    tiles: Tiles,
    table: NDArray[np.int64],
    requests: NDArray[np.int64],
    aggregate: bool,
) -> Work:
    """Work of the address calculation, from the rows of its blocks and the atomic requests by chunk."""
    total = table.sum(axis=0)
    streams = (
        Stream("boxes", "load", int(total[_E.LOAD_BYTES]), patches * BOX_BYTES),
        Stream("IDX", "store", int(total[_E.STORE_BYTES]), patches * tiles.slots**2 * WORD_BYTES, partial_lines=0),
        Stream(
            "COUNT",
            "atomic",
            int(total[_E.ATOMIC_REQUESTS]) * CHUNK_BYTES,
            int(np.count_nonzero(requests)) * CHUNK_BYTES,
        ),
    )
    return Work(
        "bucket_count",
        _E,
        table,
        BLOCK,
        kernel="address_calculation",
        streams=streams,
        atomic_requests=requests,
        variant=tiles.variant + " aggregated" * aggregate,
    )
