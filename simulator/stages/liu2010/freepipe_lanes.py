"""FreePipe, what the lanes of a warp keep between steps, and the frame buffer as they address it."""

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
    unroll: int  # pixels in a turn of the inner loop


class Lanes(NamedTuple):
    """One warp: scratch space of a worker."""

    piece: NDArray[np.int64]  # (32,) the triangle that each lane scans, -1: none
    row: NDArray[np.int64]  # (32, 9) edge functions at the row's first pixel, and their steps
    pixel: NDArray[np.int64]  # (32, 3) edge functions at the pixel
    row_depth: NDArray[np.float32]  # (32,)
    depth: NDArray[np.float32]  # (32,)
    address: NDArray[np.int64]  # (32,) of the lanes that hit, side by side
    value: NDArray[np.uint64]  # (32,)
    row_lane: NDArray[np.int64]  # (32,) the lanes that have the row in hand, side by side ...
    row_pixel: NDArray[np.int64]  # (32,) ... the first pixel of each one's box in it ...
    row_columns: NDArray[np.int64]  # (32,) ... how many there are ...
    row_rest: NDArray[np.int64]  # (32,) ... and how many beyond whole turns
    seen: NDArray[np.int64]  # (2, 64) hash tables of the addresses and of the chunks of an instruction, -1: free
    most: NDArray[np.int64]  # (2, 64) lanes at the address so far; the most at any address of the chunk
    slot: NDArray[np.int64]  # (32, 2) where each hit stands in the two tables, to free them


@kernel
def new_lanes() -> Any:
    """Scratch space of one worker."""
    return Lanes(
        np.empty(WARP, np.int64),
        np.empty((WARP, 9), np.int64),
        np.empty((WARP, 3), np.int64),
        np.empty(WARP, np.float32),
        np.empty(WARP, np.float32),
        np.empty(WARP, np.int64),
        np.empty(WARP, np.uint64),
        np.empty(WARP, np.int64),
        np.empty(WARP, np.int64),
        np.empty(WARP, np.int64),
        np.empty(WARP, np.int64),
        np.full((2, SLOTS), -1, np.int64),
        np.empty((2, SLOTS), np.int64),
        np.empty((WARP, 2), np.int64),
    )
