"""StreamingToFrameBuffer: float colours to bytes in the window's buffer (Zhang 2025). One thread a pixel, 256 a block.

After optimization a thread stores one 4-byte word, before it four single bytes.
"""

import numpy as np
from numpy.typing import NDArray

from models.simt import Simt
from simulator.stages.thread_per_item import Access, thread_per_item
from simulator.work import Work

BLOCK = 256  # threads


def streaming_to_frame_buffer(
    target: NDArray[np.float32], simt: Simt, *, optimized: bool
) -> tuple[NDArray[np.uint8], Work]:
    """Convert the render target.

    Parameters
    ----------
    target : ndarray, (H, W, 4), float32
        Rows from the bottom.
    simt : Simt
    optimized : bool

    Returns
    -------
    image : ndarray, (H, W, 3), uint8
        Row 0 is the top row.
    work : Work
    """
    image = (np.clip(target[::-1, :, :3], 0.0, 1.0) * np.float32(255.0)).astype(np.uint8)
    loads = (Access("target", 16, 1, 16),)
    stores = (Access("window", 4, 1) if optimized else Access("window", 4, 4, 1),)
    kernel = "StreamingToFrameBuffer" if optimized else "StreamingToFrameBuffer_before"
    pixels = target.shape[0] * target.shape[1]
    return image, thread_per_item("StreamingToFrameBuffer", kernel, pixels, BLOCK, simt, loads, stores)
