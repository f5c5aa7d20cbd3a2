"""What the machine does while it dices: a thread a vertex, a half-warp a sub-patch (Eisenacher & Loop 2010, 3)."""

from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.coalescing import transactions
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.work import Work

BLOCK = 256  # threads, a vertex each: 16 sub-patches
VERTICES = 16  # of a grid; control points of a patch
VERTEX_BYTES = 16
POINT_BYTES = 16  # a homogeneous control point
ENTRY_BYTES = 8  # of the patch queue
BOX_BYTES = 16


class DiceEvent(IntEnum):
    """Events of one block: 16 sub-patches (fewer of larger grids), a thread a vertex."""

    VERTEX_WARPS = 0  # warps that evaluate, shade and store a vertex a lane
    VERTEX_LANES = 1
    PATCHES = 2  # sub-patches
    LOAD_TRANSACTIONS = 3  # queue entry, and each lane one control point of its urPatch into shared memory
    LOAD_BYTES = 4
    STORE_TRANSACTIONS = 5  # vertices, and a box a sub-patch
    STORE_BYTES = 6
    TEXTURE_LANES = 7  # texels fetched


_E = DiceEvent


def dice_work(patch: NDArray[np.int32], patches: int, textured: bool, simt: Simt, side: int = 4) -> Work:
    """Work of dicing: it depends on which neighbours in the queue share an urPatch, and on how full the last block is.

    Parameters
    ----------
    patch : ndarray, (N,), int32
        UrPatch of each sub-patch, in the order of the queue.
    patches : int
        UrPatches of the scene.
    textured : bool
    simt : Simt
    side : int
        Vertices a side of a grid. A block holds as many whole grids as it has threads for; of each grid 16 lanes load
        the control points, whatever its size.
    """
    number, vertices = len(patch), side**2
    per_block = BLOCK // vertices
    grids = np.minimum(per_block, number - per_block * np.arange(-(-number // per_block)))
    table = np.zeros((len(grids), len(_E)), np.int64)
    table[:, _E.PATCHES] = grids
    table[:, _E.VERTEX_LANES] = grids * vertices
    table[:, _E.VERTEX_WARPS] = -(-grids * vertices // simt.warp)
    table[:, _E.TEXTURE_LANES] = grids * vertices * textured
    loads, stores = (
        table[:, _E.LOAD_TRANSACTIONS : _E.STORE_TRANSACTIONS],
        table[:, _E.STORE_TRANSACTIONS : _E.TEXTURE_LANES],
    )
    loads[:] = _points(patch, per_block, simt)
    for rows in (slice(-1), slice(-1, None)):  # all blocks but the last are alike
        if len(grids[rows]):
            queue, stores[rows] = _block_traffic(int(grids[rows][0]), vertices, simt)
            loads[rows] += queue
    moved, stored = int(table[:, _E.LOAD_BYTES].sum()), int(table[:, _E.STORE_BYTES].sum())
    entries, boxes = number * ENTRY_BYTES, number * BOX_BYTES
    streams = (
        Stream("queue", "load", entries, entries),
        Stream("points", "load", moved - entries, patches * VERTICES * POINT_BYTES),
        Stream("grids", "store", stored - boxes, number * vertices * VERTEX_BYTES, partial_lines=0),
        Stream("boxes", "store", boxes, boxes, partial_lines=0),
    )
    return Work("dice", _E, table, BLOCK, shared_bytes=VERTICES * POINT_BYTES * per_block, streams=streams)


def _points(patch: NDArray[np.int32], per_block: int, simt: Simt) -> NDArray[np.int64]:
    """Transactions and bytes of each block's loads of control points, (blocks, 2).

    A half-warp reads the 256 bytes of its urPatch. Mostly the rest of its warp reads the same ones: neighbours in the
    queue come from one urPatch. So a warp touches the segments of as many urPatches as it has different ones.
    """
    together = max(1, simt.warp // VERTICES)
    costs = np.zeros((together + 1, together + 1, 2), np.int64)  # by grids of a warp, and different urPatches
    for number in range(1, together + 1):
        for patches in range(1, number + 1):
            costs[number, patches] = _warp_points(np.minimum(np.arange(number), patches - 1), simt)
    loads = np.zeros((-(-len(patch) // per_block), 2), np.int64)
    _add_points(patch, per_block, together, costs, loads)
    return loads


@kernel(lent=True)
def _add_points(patch: Any, per_block: int, together: int, costs: Any, loads: Any) -> None:
    """Add up the costs of the warps of each block."""
    for block in range(loads.shape[0]):
        last = min((block + 1) * per_block, patch.size)
        for first in range(block * per_block, last, together):
            grids, different = min(together, last - first), 0
            for k in range(first, first + grids):
                known = False
                for other in range(first, k):
                    known |= patch[other] == patch[k]
                different += not known
            loads[block, 0] += costs[grids, different, 0]
            loads[block, 1] += costs[grids, different, 1]


def _warp_points(patch: NDArray[np.int64], simt: Simt) -> NDArray[np.int64]:
    """Transactions and bytes of one warp's load of control points, 16 lanes a sub-patch."""
    address = (patch[:, None] * VERTICES + np.arange(VERTICES)).reshape(-1) * POINT_BYTES
    moved = np.zeros(2, np.int64)
    for first in range(0, len(address), simt.warp):
        lanes = min(simt.warp, len(address) - first)
        moved += transactions(address[first:], lanes, POINT_BYTES, int(simt.coalescing))
    return moved


def _block_traffic(grids: int, vertices: int, simt: Simt) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Transactions and bytes of a block's loads from the queue, and of its stores."""
    loads, stores = np.zeros(2, np.int64), np.zeros(2, np.int64)
    for first in range(0, grids * vertices, simt.warp):
        lanes = min(simt.warp, grids * vertices - first)
        lane = np.arange(first, first + lanes)
        entry = lane // vertices * ENTRY_BYTES
        vertex = transactions(lane * VERTEX_BYTES, lanes, VERTEX_BYTES, int(simt.coalescing))
        box = np.where(lane % vertices == 0, lane // vertices * BOX_BYTES, -1)
        loads += transactions(entry, lanes, ENTRY_BYTES, int(simt.coalescing))
        stores += np.add(vertex, transactions(box, lanes, BOX_BYTES, int(simt.coalescing)))
    return loads, stores
