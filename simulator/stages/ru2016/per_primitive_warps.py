"""The warps of the per-primitive raster: what their blocks count, and where they stand."""

from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np

from tilestamp.models.counters import shown
from tilestamp.simulator.stages.sample_tests import SAMPLE_COUNTERS

BLOCK = 128  # threads


@shown(*SAMPLE_COUNTERS)
class PerPrimitiveEvent(IntEnum):
    """Events of one block."""

    WARPS = 0
    WARP_LANES = 1
    CULLED = 2
    BOX_STEPS = 3  # warp steps over the pixels of the boxes: one barycentric test each
    SAMPLE_TESTS = 4  # lanes in them
    SAMPLE_HITS = 5
    ATOMIC = 6
    ATOMIC_LANES = 7
    ATOMIC_REQUESTS = 8
    ATOMIC_CONFLICTS = 9
    ATOMIC_DEPTH = 10
    WRITES = 11  # warp steps in which a lane computes and writes its fragment
    WRITE_LANES = 12
    STORE_TRANSACTIONS = 13
    STORE_BYTES = 14
    LOAD_TRANSACTIONS = 15
    LOAD_BYTES = 16
    LONGEST = 17  # most steps of a warp: the dependent chain of the block
    LONGEST_HITS = 18  # most steps of a warp in which a lane hits
    LONGEST_WRITES = 19  # most steps of a warp in which a lane writes
    FRONT_WARPS = 20  # warps with a triangle that is not culled
    FRONT_LANES = 21
    COLUMN_STEPS = 22  # warp steps in which a lane ends a column of pixels
    COLUMN_LANES = 23
    TEXTURED_WRITES = 24  # warp steps in which a lane writes a fragment with a texture
    TEXTURED_LANES = 25
    LONGEST_COLUMNS = 26  # most steps of a warp in which a lane ends a column
    LONGEST_TEXTURED = 27  # most steps of a warp in which a lane writes a fragment with a texture
    BLOCKS = 28  # 1: what the start and end of a block's chain are priced on


class Walkers(NamedTuple):
    """The resident warps, W of L lanes.

    Parameters
    ----------
    boxes : ndarray, (W, L, 7), int64
        Of each lane: left column, columns, lowest row (rows count down), rows, triangle; column and row that it is at.
    shapes : ndarray, (W, L, 10), float32
        Of each lane's triangle: corners, one over its area, depths.
    steps : ndarray, (W,), int64
        That the warp takes.
    seen : ndarray, (W, 5), int64
        Steps so far, those with a hit, with a write, with one with a texture, with the end of a column.
    pixels, who, wins : ndarray, (L,), int64, int64, bool
        Of each lane that hits now: its pixel, its number, whether it lowered the depth.
    """

    boxes: Any
    shapes: Any
    steps: Any
    seen: Any
    pixels: Any
    who: Any
    wins: Any


def walkers(warps: int, lanes: int) -> Walkers:
    """Make room for the resident warps."""
    return Walkers(
        np.zeros((warps, lanes, 7), np.int64),
        np.zeros((warps, lanes, 10), np.float32),
        np.zeros(warps, np.int64),
        np.zeros((warps, 5), np.int64),
        np.zeros(lanes, np.int64),
        np.zeros(lanes, np.int64),
        np.zeros(lanes, np.bool_),
    )
