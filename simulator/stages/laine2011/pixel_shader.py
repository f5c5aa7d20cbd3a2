"""Pixel shader of nvdiffrast: a thread a pixel finds u, v, z/w and derivatives (``pixel_barycentrics``); its work.

Blocks of 8x8 pixels. A warp that shows a triangle reads its three indices and positions; lanes with one triangle read
the same segments.
"""

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.counters import count, shown
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.work import Work

BLOCK = 64  # threads, 8 x 8 pixels
SIDE = 8
SECTOR = 32
ID_BYTES, RAST_BYTES, INDEX_BYTES, POSITION_BYTES = 4, 16, 12, 16


@shown(count("DRAWN_LANES", "pixels shaded"))
class PixelShaderEvent(IntEnum):
    """Events of one block."""

    WARPS = 0
    DRAWN_WARPS = 1  # with a lane that shows a triangle
    DRAWN_LANES = 2
    BLOCKS = 3  # 1 where a warp is drawn: what a dependent chain is priced on
    LOAD_TRANSACTIONS = 4
    LOAD_BYTES = 5
    STORE_TRANSACTIONS = 6
    STORE_BYTES = 7


def pixel_shader_work(ids: NDArray[np.int32], triangles: NDArray[np.int32], simt: Simt) -> Work:
    """Count what the pixel shader does on one image.

    Parameters
    ----------
    ids : ndarray, (H, W), int32
        Triangle of each pixel, -1 for none.
    triangles : ndarray, (F, 3), int32
    simt : Simt

    Returns
    -------
    Work
        A row a block.
    """
    lanes = _by_warp(ids, simt.warp)
    drawn = lanes >= 0
    ordered = np.sort(lanes, axis=2)
    some = np.any(ordered >= 0, axis=2)
    distinct = (np.diff(ordered, axis=2) > 0).sum(axis=2) + some - (some & ~drawn.all(axis=2))
    E = PixelShaderEvent
    table = np.zeros((len(lanes), len(E)), np.int64)
    table[:, E.WARPS] = lanes.shape[1]
    table[:, E.DRAWN_WARPS], table[:, E.DRAWN_LANES] = some.sum(axis=1), drawn.sum(axis=(1, 2))
    table[:, E.BLOCKS] = some.any(axis=1)
    gathered = distinct.sum(axis=1) * 4  # a sector for the indices, and one for each position
    table[:, E.LOAD_TRANSACTIONS] = BLOCK * ID_BYTES // SECTOR + gathered
    table[:, E.STORE_TRANSACTIONS] = 2 * BLOCK * RAST_BYTES // SECTOR
    table[:, E.LOAD_BYTES], table[:, E.STORE_BYTES] = (
        table[:, i] * SECTOR for i in (E.LOAD_TRANSACTIONS, E.STORE_TRANSACTIONS)
    )
    seen = np.unique(ids[ids >= 0])
    corners = len(np.unique(triangles[seen]))
    pixels = len(lanes) * BLOCK
    streams = (
        Stream("ids", "load", pixels * ID_BYTES, pixels * ID_BYTES),
        Stream("triangles", "load", int(gathered.sum()) // 4 * SECTOR, len(seen) * INDEX_BYTES),
        Stream("positions", "load", int(gathered.sum()) * 3 // 4 * SECTOR, corners * POSITION_BYTES),
        Stream("rast", "store", pixels * RAST_BYTES, pixels * RAST_BYTES, partial_lines=0),
        Stream("rast_db", "store", pixels * RAST_BYTES, pixels * RAST_BYTES, partial_lines=0),
    )
    return Work("pixel_shader", PixelShaderEvent, table, BLOCK, kernel="pixelShader", streams=streams)


def _by_warp(ids: NDArray[np.int32], warp: int) -> NDArray[np.int32]:
    """Pixels as (blocks, warps, lanes); -1 beyond the image."""
    height, width = (-(-n // SIDE) * SIDE for n in ids.shape)
    whole = np.full((height, width), -1, np.int32)
    whole[: ids.shape[0], : ids.shape[1]] = ids
    blocks = whole.reshape(height // SIDE, SIDE, width // SIDE, SIDE).swapaxes(1, 2)
    return blocks.reshape(-1, BLOCK // warp, warp)
