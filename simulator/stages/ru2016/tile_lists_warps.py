"""The warps that fill the tile lists: what their blocks count, and where they stand."""

from enum import IntEnum
from typing import Any, Final, NamedTuple

import numpy as np

BLOCK = 128  # threads
COUNTER_WORD = 4  # bytes of a tile's counter, and of a list entry
SEPARATED_BY_NONE: Final = 4  # more than a triangle has edges
_HASH = 2654435761  # Knuth's multiplier


class TileListEvent(IntEnum):
    """Events of one block."""

    WARPS = 0  # warps that load their triangles and cull
    WARP_LANES = 1
    CULLED = 2  # lanes whose triangle faces away
    BOX_STEPS = 3  # warp steps over the tiles of the boxes: one separating axis test each
    BOX_LANES = 4
    APPENDS = 5  # warp steps in which a lane appends
    APPEND_LANES = 6
    ATOMIC = 7
    ATOMIC_LANES = 8
    ATOMIC_REQUESTS = 9
    ATOMIC_CONFLICTS = 10
    ATOMIC_DEPTH = 11
    LOAD_TRANSACTIONS = 12
    LOAD_BYTES = 13
    STORE_TRANSACTIONS = 14
    STORE_BYTES = 15
    LONGEST = 16  # most steps of a warp: the dependent chain of the block
    LONGEST_APPENDS = 17  # most steps of a warp in which a lane appends, and waits for its place
    FRONT_WARPS = 18  # warps with a triangle that is not culled
    FRONT_LANES = 19
    ROW_STEPS = 20  # rows of tiles that a warp begins
    ROW_LANES = 21
    EDGE_STEPS = 22  # edges of triangles that a warp tries: up to three a step, while a lane is not yet separated
    EDGE_LANES = 23
    LONGEST_ROWS = 24  # most rows, and most edges, of a warp
    LONGEST_EDGES = 25
    BLOCKS = 26  # 1: what the start and end of a block's chain are priced on


class TileWalkers(NamedTuple):
    """The resident warps, W of L lanes.

    Parameters
    ----------
    boxes : ndarray, (W, L, 5), int64
        Of each lane: left column, columns, lowest row (rows count down), rows, triangle.
    place : ndarray, (W, 7), int64
        Column and row that the warp is at, columns of the row, rows; steps, appends and edges so far.
    order : ndarray, (W,), int64
        In which the warps of a round append.
    addresses, places : ndarray, (L,), int64
        Of each lane: counter that it adds to, and place in the list, in bytes; -1 where it does not.
    """

    boxes: Any
    place: Any
    order: Any
    addresses: Any
    places: Any


def walkers(warps: int, lanes: int) -> TileWalkers:
    """Make room for the resident warps."""
    return TileWalkers(
        np.zeros((warps, lanes, 5), np.int64),
        np.zeros((warps, 7), np.int64),
        np.argsort(np.arange(warps, dtype=np.uint64) * _HASH % 2**32, kind="stable"),
        np.empty(lanes, np.int64),
        np.empty(lanes, np.int64),
    )
