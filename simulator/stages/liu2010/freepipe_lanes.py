"""FreePipe, what the lanes of a warp keep between rows and steps, and the frame buffer as they address it."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kernel import kernel

WARP = 32
SLOTS = 64  # of a hash table: twice the lanes


class FrameShape(NamedTuple):
    """The frame buffer as threads address it."""

    width: int
    word_bytes: int
    words: int  # atomics a fragment
    plane_bytes: int  # bytes from a fragment's one word to the next
    unroll_log2: int  # of the pixels in a turn of the inner loop


class Lanes(NamedTuple):
    """One warp: scratch space of a worker. A number of each lane lies side by side, to work on several at once."""

    piece: NDArray[np.int64]  # (32,) the triangle that each lane scans, -1: none
    corner: NDArray[np.int32]  # (6 * 32,) x0 y0 x1 y1 x2 y2 of it
    box: NDArray[np.int32]  # (6 * 32,) first column and row; rows, columns, columns beyond whole turns, whole turns
    edge: NDArray[np.float64]  # (9 * 32,) edge functions at the row's first pixel, their steps up, and to the left
    span: NDArray[np.int32]  # (2 * 32,) first column of the row that is covered, and the first beyond it that is not
    step: NDArray[np.uint32]  # (2 * 32,) first step of a loop that hits, and how many do
    first: NDArray[np.int64]  # (32,) pixel at which the row begins
    here: NDArray[np.int64]  # (32,) pixel of the loop's step 0
    depth: NDArray[np.float32]  # (2, 32) depth at the row's first pixel, and at the column reached
    column: NDArray[np.int64]  # (32,) that column
    address: NDArray[np.int64]  # (32,) of the lanes that hit, side by side
    value: NDArray[np.uint64]  # (32,)
    seen: NDArray[np.int64]  # (64 + 1,) hash table of an instruction's chunks: its number and theirs; then the number
    ranks: NDArray[np.uint64]  # (64,) lanes at each word of the chunk so far, a byte each


@kernel
def new_lanes() -> Any:
    """Scratch space of one worker."""
    return Lanes(
        np.empty(WARP, np.int64),
        np.zeros(6 * WARP, np.int32),
        np.zeros(6 * WARP, np.int32),
        np.zeros(9 * WARP, np.float64),
        np.empty(2 * WARP, np.int32),
        np.empty(2 * WARP, np.uint32),
        np.zeros(WARP, np.int64),
        np.empty(WARP, np.int64),
        np.empty((2, WARP), np.float32),
        np.empty(WARP, np.int64),
        np.empty(WARP, np.int64),
        np.empty(WARP, np.uint64),
        np.zeros(SLOTS + 1, np.int64),
        np.empty(SLOTS, np.uint64),
    )
