"""What the machine does while it dices: a thread a vertex, a half-warp a sub-patch (Eisenacher & Loop 2010, 3)."""

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.coalescing import transactions
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.work import Work

BLOCK = 256  # threads, a vertex each: 16 sub-patches
VERTICES = 16  # of a grid
VERTEX_BYTES = 16
POINT_BYTES = 16  # a homogeneous control point
ENTRY_BYTES = 8  # of the patch queue
BOX_BYTES = 16


class DiceEvent(IntEnum):
    """Events of one block: 16 sub-patches, a thread a vertex."""

    VERTEX_WARPS = 0  # warps that evaluate, shade and store a vertex a lane
    VERTEX_LANES = 1
    PATCHES = 2  # sub-patches
    LOAD_TRANSACTIONS = 3  # queue entry, and each lane one control point of its patch into shared memory
    LOAD_BYTES = 4
    STORE_TRANSACTIONS = 5  # vertices, and a box a sub-patch
    STORE_BYTES = 6
    TEXTURE_LANES = 7  # texels fetched


_E = DiceEvent


def dice_work(number: int, patches: int, textured: bool, simt: Simt) -> Work:
    """Work of dicing: nothing depends on the data, but that the last block may be partly empty."""
    per_block = BLOCK // VERTICES
    grids = np.minimum(per_block, number - per_block * np.arange(-(-number // per_block)))
    table = np.zeros((len(grids), len(_E)), np.int64)
    table[:, _E.PATCHES] = grids
    table[:, _E.VERTEX_LANES] = grids * VERTICES
    table[:, _E.VERTEX_WARPS] = -(-grids * VERTICES // simt.warp)
    table[:, _E.TEXTURE_LANES] = grids * VERTICES * textured
    for count in np.unique(grids):
        loads, stores = _block_traffic(int(count), simt)
        table[np.ix_(grids == count, [_E.LOAD_TRANSACTIONS, _E.LOAD_BYTES])] = loads
        table[np.ix_(grids == count, [_E.STORE_TRANSACTIONS, _E.STORE_BYTES])] = stores
    moved, stored = int(table[:, _E.LOAD_BYTES].sum()), int(table[:, _E.STORE_BYTES].sum())
    entries, boxes = number * ENTRY_BYTES, number * BOX_BYTES
    streams = (
        Stream("queue", "load", entries, entries),
        Stream("points", "load", moved - entries, patches * VERTICES * POINT_BYTES),
        Stream("grids", "store", stored - boxes, number * VERTICES * VERTEX_BYTES),
        Stream("boxes", "store", boxes, boxes),
    )
    return Work(
        stage="dice",
        kernel="dice",
        events=_E,
        table=table,
        grid=len(table),
        block=BLOCK,
        shared_bytes=VERTICES * POINT_BYTES * per_block,
        streams=streams,
    )


def _block_traffic(grids: int, simt: Simt) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Transactions and bytes of a block's loads, and of its stores.

    Half-warps read different patches, whose 256 bytes never share a segment with another patch.
    """
    loads, stores = np.zeros(2, np.int64), np.zeros(2, np.int64)
    for first in range(0, grids * VERTICES, simt.warp):
        lanes = min(simt.warp, grids * VERTICES - first)
        lane = np.arange(first, first + lanes)
        whole = transactions(lane * VERTEX_BYTES, lanes, VERTEX_BYTES, int(simt.coalescing))
        entry = transactions(lane // VERTICES * ENTRY_BYTES, lanes, ENTRY_BYTES, int(simt.coalescing))
        box = np.where(lane % VERTICES == 0, lane // VERTICES * BOX_BYTES, -1)
        loads += np.add(whole, entry)
        stores += np.add(whole, transactions(box, lanes, BOX_BYTES, int(simt.coalescing)))
    return loads, stores
