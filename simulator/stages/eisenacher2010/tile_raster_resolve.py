"""Multisample resolve: the samples of a pixel, drawn by different threads, meet in shared memory and are averaged.

Threads of a block draw the tile sub-tile by sub-tile, neighbouring threads at neighbouring samples (Eisenacher & Loop
2010, section 3.3); each leaves its colours in shared memory and then gathers the samples of its own pixel.
"""

from typing import Any

import numpy as np

from tilestamp.models.banks import bank_passes
from tilestamp.models.kernel import kernel
from tilestamp.models.simt import Simt
from tilestamp.simulator.stages.eisenacher2010.tile_raster_samples import Samples


@kernel(lent=True)
def resolve(samples: Samples, side: int, x0: int, y0: int, image: Any, depth: Any, overdraw: Any) -> None:
    """Write the pixels of one tile that lie on the screen: mean colour, rounded; nearest depth; hits of all samples."""
    height, width = depth.shape
    for y in range(y0, min(y0 + samples.depth.shape[0] // side, height)):
        for x in range(x0, min(x0 + samples.depth.shape[1] // side, width)):
            j, i = (y - y0) * side, (x - x0) * side
            color, nearest, hits = samples.color[j, i], samples.depth[j, i], samples.hits[j, i]
            if side > 1:
                color, nearest, hits = _mean(samples, side, j, i)
            image[y, x, 0], image[y, x, 1], image[y, x, 2] = color & 255, (color >> 8) & 255, (color >> 16) & 255
            depth[y, x] = nearest
            if overdraw is not None:
                overdraw[y, x] = hits


@kernel(lent=True)
def _mean(samples: Samples, side: int, first_row: int, first_column: int) -> tuple[Any, Any, Any]:
    """Mean colour, nearest depth and hits of the samples of a pixel."""
    bits, nearest = 2 * (side >> 1), samples.depth[first_row, first_column]  # their number is 1 << bits
    red = green = blue = (side * side) >> 1
    hits = np.int32(0)
    for j in range(first_row, first_row + side):
        for i in range(first_column, first_column + side):
            color = samples.color[j, i]
            red += color & 255
            green += (color >> 8) & 255
            blue += (color >> 16) & 255
            nearest = min(nearest, samples.depth[j, i])
            hits += samples.hits[j, i]
    return np.uint32(red >> bits | green >> bits << 8 | blue >> bits << 16), nearest, np.int32(hits)


@kernel
def resolve_replays(tile: int, side: int, simt: Simt) -> int:
    """Further passes of one block's shared stores and loads in the resolve, from the words that each lane touches."""
    replays = 0
    threads = tile * tile
    stored = np.empty(simt.warp, np.int64)
    loaded = np.empty(simt.warp, np.int64)
    for first in range(0, threads, simt.warp):
        lanes = min(simt.warp, threads - first)
        groups = (lanes + simt.bank_lanes - 1) // simt.bank_lanes
        for sample in range(side * side):
            j, i = sample // side, sample % side
            for lane in range(lanes):
                y, x = (first + lane) // tile, (first + lane) % tile
                stored[lane] = (y + j * tile) * side * tile + x + i * tile
                loaded[lane] = (y * side + j) * side * tile + x * side + i
            replays += bank_passes(stored, lanes, simt) - groups
            replays += bank_passes(loaded, lanes, simt) - groups
    return replays
