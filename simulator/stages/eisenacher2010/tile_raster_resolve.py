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
    count = np.uint32(side * side)
    for y in range(y0, min(y0 + samples.depth.shape[0] // side, height)):
        for x in range(x0, min(x0 + samples.depth.shape[1] // side, width)):
            nearest = samples.depth[(y - y0) * side, (x - x0) * side]
            red = green = blue = hits = 0
            for j in range((y - y0) * side, (y - y0 + 1) * side):
                for i in range((x - x0) * side, (x - x0 + 1) * side):
                    color = samples.color[j, i]
                    red += color & 255
                    green += (color >> 8) & 255
                    blue += (color >> 16) & 255
                    nearest = min(nearest, samples.depth[j, i])
                    hits += samples.hits[j, i]
            image[y, x, 0] = (red + count // 2) // count
            image[y, x, 1] = (green + count // 2) // count
            image[y, x, 2] = (blue + count // 2) // count
            depth[y, x] = nearest
            if overdraw is not None:
                overdraw[y, x] = hits


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
