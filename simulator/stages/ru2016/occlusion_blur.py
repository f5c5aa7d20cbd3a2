"""Blur of the occlusion (Ru 2016, "SSAO"): the mean of 4x4 pixels, as wide as the noise, through shared memory.

A block of 12x12 threads loads a word of each fragment of 8x8 pixels and of two around them, waits, and the inner 8x8
threads sum sixteen words of shared memory. The shape of the launch, the sixteen reads and the bytes are those of his
kernel as an H200 counts them; that the window reaches two pixels back and one ahead, and ends with the picture, is
assumed.
"""

from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.coalescing import transactions
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.ru2016.tiled_raster import FRAGMENT_BYTES
from tilestamp.simulator.work import Work

SIDE = 8  # pixels that a block blurs
HALO = 2  # pixels that it loads around them
WINDOW = 4  # pixels on a side, the noise's period
THREADS = SIDE + 2 * HALO  # on a side
BLOCK = THREADS * THREADS
SHARED_BYTES = 4 * BLOCK
SECTOR_BYTES = 32


class OcclusionBlurEvent(IntEnum):
    """Events of one block."""

    BLOCKS = 0  # 1: what the dependent chain is priced on
    WARPS = 1  # load a word each thread, and wait
    WARP_LANES = 2
    BLUR_WARPS = 3  # warps with a thread that sums
    BLUR_LANES = 4
    LOAD_TRANSACTIONS = 5
    LOAD_BYTES = 6
    STORE_TRANSACTIONS = 7
    STORE_BYTES = 8


@kernel(lent=True)
def _blur_rows(part: int, parts: int, light: Any, out: Any) -> None:
    """Mean over the window of a share of the rows, as far as it lies in the picture."""
    height, width = light.shape
    for y in range(part * height // parts, (part + 1) * height // parts):
        for x in range(width):
            total, count = np.float32(0.0), 0
            for j in range(max(y - HALO, 0), min(y - HALO + WINDOW, height)):
                for i in range(max(x - HALO, 0), min(x - HALO + WINDOW, width)):
                    total += light[j, i]
                    count += 1
            out[y, x] = total / np.float32(count)


def occlusion_blur(light: NDArray[np.float32], simt: Simt) -> StageResult[NDArray[np.float32]]:
    """Blur what ambient occlusion leaves.

    Parameters
    ----------
    light : ndarray, (H, W), float32
    simt : Simt

    Returns
    -------
    outputs : ndarray, (H, W), float32
    works : one, a row a block
    """
    out = np.empty_like(light)
    for_parts(_blur_rows, parts_of(len(light)), light, out)
    blocks = -(-light.shape[0] // SIDE) * -(-light.shape[1] // SIDE)
    table = np.tile(_block(light.shape[1], simt), (blocks, 1))
    loaded, stored, footprint = BLOCK * blocks, SIDE * SIDE * blocks, SECTOR_BYTES * light.size
    streams = (
        Stream("fragments", "load", SECTOR_BYTES * loaded, footprint, pair_bytes=FRAGMENT_BYTES * light.size),
        Stream("fragments", "store", SECTOR_BYTES * stored, footprint),
    )
    work = Work(
        "occlusion_blur", OcclusionBlurEvent, table, BLOCK, grid=blocks, shared_bytes=SHARED_BYTES, streams=streams
    )
    return StageResult(out, (work,))


def _block(width: int, simt: Simt) -> NDArray[np.int64]:
    """Events of a block that lies inside the picture."""
    event = OcclusionBlurEvent
    row = np.zeros(len(event), np.int64)
    row[event.BLOCKS], row[event.WARP_LANES], row[event.BLUR_LANES] = 1, BLOCK, SIDE * SIDE
    for first in range(0, BLOCK, simt.warp):
        thread = np.arange(first, first + simt.warp)
        y, x = thread // THREADS, thread % THREADS
        inner = (y >= HALO) & (y < HALO + SIDE) & (x >= HALO) & (x < HALO + SIDE)
        address = (y * width + x) * FRAGMENT_BYTES
        row[event.WARPS] += 1
        row[event.BLUR_WARPS] += inner.any()
        for active, name in ((thread < BLOCK, "LOAD"), (inner, "STORE")):
            count, size = transactions(np.where(active, address, -1), simt.warp, 4, int(simt.coalescing))
            row[event[f"{name}_TRANSACTIONS"]] += count
            row[event[f"{name}_BYTES"]] += size
    return row
