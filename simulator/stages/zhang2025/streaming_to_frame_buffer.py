"""StreamingToFrameBuffer: float colours to bytes in the window's buffer (Zhang 2025). One thread a pixel, 256 a block.

After optimization a thread stores one 4-byte word, before it four single bytes.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kernel import kernel
from tilestamp.models.simt import Simt
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.thread_per_item import Access, thread_per_item
from tilestamp.simulator.stages.zhang2025.rop import Resolved

BLOCK = 256  # threads
_ZERO = np.float32(0.0)
_ONE = np.float32(1.0)
_FULL = np.float32(255.0)


@kernel(error_model="numpy", lent=True)
def _streaming(part: int, parts: int, target: Any, winners: Any, image: Any) -> None:
    """Convert a part of the rows, the last one first; where nothing was drawn the target is still clear."""
    rows = len(target)
    for y in range(part * rows // parts, (part + 1) * rows // parts):
        for x in range(target.shape[1]):
            if winners[y, x] < 0:
                image[rows - 1 - y, x, 0] = image[rows - 1 - y, x, 1] = image[rows - 1 - y, x, 2] = 0
                continue
            for c in range(3):
                image[rows - 1 - y, x, c] = np.uint8(min(max(target[y, x, c], _ZERO), _ONE) * _FULL)


def streaming_to_frame_buffer(pixels: Resolved, simt: Simt, *, optimized: bool) -> StageResult[NDArray[np.uint8]]:
    """Convert the render target.

    Parameters
    ----------
    pixels : Resolved
    simt : Simt
    optimized : bool

    Returns
    -------
    outputs : ndarray, (H, W, 3), uint8
        The picture; row 0 is the top row.
    works : one
    """
    image = np.empty((*pixels.winners.shape, 3), np.uint8)
    for_parts(_streaming, parts_of(len(image)), pixels.target, pixels.winners, image)
    loads = (Access("target", 16, 1, 16),)
    stores = (Access("window", 4, 1) if optimized else Access("window", 4, 4, 1),)
    kernel = "StreamingToFrameBuffer" if optimized else "StreamingToFrameBuffer_before"
    work = thread_per_item("StreamingToFrameBuffer", kernel, pixels.winners.size, BLOCK, simt, loads, stores)
    return StageResult(image, (work,))
