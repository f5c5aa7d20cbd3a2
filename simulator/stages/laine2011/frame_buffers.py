"""Pixels of a frame in memory, and a tile of them on its way into shared memory and back (fine raster's ends)."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.coalescing import smallest_transaction_bytes
from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.laine2011.fine_raster_queue import PIXELS, TILE, Draw, FineRasterEvent, Tile
from tilestamp.simulator.stages.laine2011.fine_raster_shade import shade
from tilestamp.simulator.stages.laine2011.lanes import write_reversed
from tilestamp.simulator.stages.laine2011.subtriangle import DEPTH_MAX, DEPTH_MIN
from tilestamp.simulator.stages.laine2011.triangle_setup_paths import Setup
from tilestamp.simulator.stages.prefetch import prefetch


class FrameBuffers(NamedTuple):
    """Pixels of a frame, whole tiles, row 0 the lowest row; samples first."""

    color: NDArray[np.uint32]  # (samples, height, width) RGBA from the low byte up
    depth: NDArray[np.uint32]  # fixed point, smaller is nearer
    ids: NDArray[np.int32]  # input triangle, -1 where nothing was drawn


@kernel(lent=True)
def load_tile(buffers: Any, draw: Draw, tile: Tile, x: int, y: int) -> None:
    """Clear a tile, or take its pixels from earlier draws."""
    tile.owner[:] = -1
    for sample in range(1 << draw.log_samples):
        for line in range(y, y + TILE):
            prefetch(buffers.ids[sample, line], x)
            prefetch(buffers.depth[sample, line], x)
            prefetch(buffers.color[sample, line], x)
    if draw.clear:
        tile.depth[:] = draw.clear_depth
        tile.color[:] = draw.clear_color
        return
    for sample in range(1 << draw.log_samples):
        for p in range(PIXELS):
            at, i, j = p + PIXELS * sample, x + 7 - (p & 7), y + (p >> 3)
            tile.depth[at], tile.color[at] = buffers.depth[sample, j, i], buffers.color[sample, j, i]


@kernel(lent=True)
def load_layer(behind: Any, tile: Tile, x: int, y: int) -> None:
    """Depths of the layer before, for depth peeling; nothing shows where they end."""
    for p in range(PIXELS):
        i, j = x + 7 - (p & 7), y + (p >> 3)
        tile.zmax[p] = behind[j, i] if j < behind.shape[0] and i < behind.shape[1] else DEPTH_MAX


@kernel(lent=True)
def store_tile(buffers: Any, setup: Setup, colors: Any, draw: Draw, tile: Tile, x: int, y: int) -> None:
    """Write what a tile has, shaded where its fragments are shaded late; its records become input triangles."""
    for at in range(PIXELS << draw.log_samples):
        p, record = at % PIXELS, np.int64(tile.owner[at])
        i, j = x + 7 - (p & 7), y + (p >> 3)
        if record >= 0:
            tile.owner[at] = setup.inputs[record]
            if draw.shade_late:
                tile.color[at] = shade(setup.planes, record, colors, i, j, -1, draw)
        elif not draw.clear:
            tile.owner[at] = buffers.ids[at // PIXELS, j, i]
    for at in range(0, PIXELS << draw.log_samples, TILE):
        sample, line = at // PIXELS, y + (at % PIXELS >> 3)
        write_reversed(tile.owner, at, buffers.ids[sample, line], x)
        write_reversed(tile.depth, at, buffers.depth[sample, line], x)
        write_reversed(tile.color, at, buffers.color[sample, line], x)


@kernel(lent=True)
def count_tile(draw: Draw, row: Any) -> None:
    """Count what every tile costs: its draw from the counter, and its pixels read and written, 8 rows of 32 bytes.

    Surfaces are laid out in two dimensions, so that a row of a tile is one 32-byte segment on every machine. Samples
    stay in memory: with several of them the clear writes the tile, and nothing else here does.
    """
    row[FineRasterEvent.ATOMIC] += 1
    row[FineRasterEvent.ATOMIC_LANES] += 1
    row[FineRasterEvent.ATOMIC_REQUESTS] += 1
    row[FineRasterEvent.ATOMIC_DEPTH] += 1
    row[FineRasterEvent.LOAD_TRANSACTIONS] += 2  # the tile's number and its first segment
    row[FineRasterEvent.LOAD_BYTES] += 2 * smallest_transaction_bytes(draw.coalescing)
    surfaces = (1 if draw.write_color or draw.later_wins else 0) + 1
    rows = surfaces * TILE << draw.log_samples
    if not draw.clear and draw.log_samples == 0:
        row[FineRasterEvent.TILE_LOADS] += 1
        row[FineRasterEvent.LOAD_TRANSACTIONS] += rows
        row[FineRasterEvent.LOAD_BYTES] += 32 * rows
    if draw.clear or draw.log_samples == 0:
        row[FineRasterEvent.TILE_STORES] += 1
        row[FineRasterEvent.STORE_TRANSACTIONS] += rows
        row[FineRasterEvent.STORE_BYTES] += 32 * rows


def new_buffers(width: int, height: int, samples: int = 1, *, cleared: bool = True) -> FrameBuffers:
    """Allocate the pixels of a frame, whole tiles, cleared to black and far where asked for."""
    shape = (samples, -(-height // TILE) * TILE, -(-width // TILE) * TILE)
    if not cleared:
        return FrameBuffers(np.empty(shape, np.uint32), np.empty(shape, np.uint32), np.empty(shape, np.int32))
    return FrameBuffers(np.zeros(shape, np.uint32), np.full(shape, DEPTH_MAX, np.uint32), np.full(shape, -1, np.int32))


def clear_depth_value(depth: float) -> int:
    """Fixed-point depth that a clear to ``depth`` in 0..1 writes; 1 is the far plane."""
    whole = min(int(depth * 2**32), 2**32 - 1)
    return int(whole / (2**32 - 1) * (DEPTH_MAX - DEPTH_MIN) + DEPTH_MIN)
