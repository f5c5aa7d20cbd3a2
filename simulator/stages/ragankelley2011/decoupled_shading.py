"""Decoupled shading: visible samples share what was shaded where their point lies when nothing moves or blurs.

Each visible sample of a moving, defocused polygon is taken back to where its point of the polygon lies as the shutter
opens, seen through the middle of the lens; there a grid of shading cells says which samples share a colour. What has
been shaded is kept in a cache, the least recently used cell of which gives way (Ragan-Kelley et al. 2011: a hash from
visibility to shading samples, and a buffer to memoize them). Multisampling is the same with the cell of the sample's
own pixel, and so has a cell in every pixel that a polygon sweeps over.

Polygons come in input order, samples are tested for depth before. A warp has a batch of polygons and a cache of its
own, in shared memory: 32 visible samples find their cells, look them up, and what is missing is shaded by whole warps.
"""

from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.coalescing import contiguous
from tilestamp.models.counters import count, ratio, shown
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.fatahalian2009.micropolygon_cover import (
    STEP,
    covering_triangle,
    new_setup,
)
from tilestamp.simulator.stages.fatahalian2009.micropolygon_samples import Samples, hit_sample
from tilestamp.simulator.stages.fatahalian2009.motion import BlurPattern, MovingMicropolygons, set_up_at
from tilestamp.simulator.stages.fatahalian2009.motion_interval import EVERYTHING, bound
from tilestamp.simulator.stages.fatahalian2009.warp_queue import warp_queue

BATCH = 256  # polygons that a warp takes from the queue together
SAMPLE_BYTES = (
    16  # of a visible sample: polygon, place, time and lens: written by the rasterizer, read here; counted here
)
CELL_BYTES = 16  # of the cache: polygon, cell, colour
COLOR_BYTES = 4


@shown(
    count("VISIBLE", "samples that pass the depth test"),
    ratio("shades", "SHADES", "VISIBLE", "shades a visible sample"),
)
class DecoupledEvent(IntEnum):
    """Events of one batch of polygons."""

    BATCHES = 0  # 1: a warp that takes its batch
    VISIBLE = 1
    KEY_WARPS = 2  # warp executions that take samples back and look their cells up
    HITS = 3  # samples whose cell is in the cache
    SHADES = 4  # cells shaded
    SHADE_WARPS = 5
    LOAD_TRANSACTIONS = 6
    LOAD_BYTES = 7
    STORE_TRANSACTIONS = 8
    STORE_BYTES = 9


class Shading(NamedTuple):
    """How samples share what is shaded.

    Parameters
    ----------
    rate : float
        Shading cells along a pixel.
    cache : int
        Cells that are kept.
    decoupled : bool
        Cells of the polygon at rest; or of the pixel that the sample lies in.
    """

    rate: float
    cache: int
    decoupled: bool


class ShadedSamples(NamedTuple):
    """Where each visible sample is shaded.

    Parameters
    ----------
    point : ndarray, (H * W * spp, 2), float64
        Where its point lies at rest, pixels.
    cell : ndarray, (H * W * spp, 2), int64
        Its shading cell.
    """

    point: NDArray[np.float64]
    cell: NDArray[np.int64]


def decoupled_shading(
    polygons: MovingMicropolygons, pattern: BlurPattern, samples: Samples, shading: Shading, simt: Simt
) -> StageResult[ShadedSamples]:
    """Shade the visible samples of moving polygons.

    Parameters
    ----------
    polygons, pattern
    samples : Samples
        Empty buffers; filled as any rasterizer fills them.
    shading : Shading
    simt : Simt

    Returns
    -------
    outputs : ShadedSamples
    works : one, a row for each batch of 256 polygons
    """
    table = np.zeros((-(-len(polygons.start) // BATCH), len(DecoupledEvent)), np.int64)
    count_ = len(samples.polygon)
    made = ShadedSamples(np.zeros((count_, 2)), np.zeros((count_, 2), np.int64))
    _decoupled_shading(*polygons, pattern, samples, shading, np.array(EVERYTHING), made, table)
    _add_costs(table, simt)
    moved = int(table[:, DecoupledEvent.LOAD_BYTES].sum())
    colors = int(table[:, DecoupledEvent.STORE_BYTES].sum()) - moved
    streams = (
        Stream("visible", "load", moved, moved),
        Stream("visible", "store", moved, moved),
        Stream("colors", "store", colors, min(colors, COLOR_BYTES * count_)),
    )
    work = warp_queue(
        "decoupled_shading", DecoupledEvent, table, simt, shared_bytes=CELL_BYTES * shading.cache, streams=streams
    )
    return StageResult(made, (work,))


@kernel
def _decoupled_shading(
    start: Any, end: Any, blur: Any, pattern: BlurPattern, samples: Samples, shading: Shading, everything: Any,
    made: ShadedSamples, table: Any,
) -> None:  # fmt: skip
    cache = np.full((shading.cache, 3), -1, np.int64)  # polygon and cell, the last used first; no batch finds another's
    setup, polygon, key = new_setup(), np.empty(start.shape[1:], np.float32), np.zeros(3, np.int64)
    tile, _, spp, _ = pattern.place.shape
    for batch in range(len(table)):
        row = table[batch]
        row[DecoupledEvent.BATCHES] = 1
        for p in range(batch * BATCH, min(len(start), (batch + 1) * BATCH)):
            x0, y0, x1, y1 = bound(start, end, blur, p, everything, samples)
            for pixel in range(max(x1 - x0 + 1, 0) * max(y1 - y0 + 1, 0)):
                x, y = x0 + pixel % (x1 - x0 + 1), y0 + pixel // (x1 - x0 + 1)
                for s in range(spp):
                    set_up_at(start, end, blur, p, pattern.time_lens[y % tile, x % tile, s], polygon, setup)
                    at_x = x * STEP + pattern.place[y % tile, x % tile, s, 0]
                    at_y = y * STEP + pattern.place[y % tile, x % tile, s, 1]
                    if _visible(p, setup, samples, x, y, s, at_x, at_y):
                        at = (y * samples.width + x) * spp + s
                        _point(start[p], setup[0], at_x, at_y, made.point[at])
                        _cell(shading, made.point[at], x, y, made.cell[at])
                        key[0], key[1], key[2] = p, made.cell[at, 0], made.cell[at, 1]
                        row[DecoupledEvent.VISIBLE] += 1
                        row[DecoupledEvent.HITS] += _look_up(cache, key)


@kernel
def _visible(p: int, setup: Any, samples: Samples, x: int, y: int, s: int, at_x: Any, at_y: Any) -> bool:
    """Whether the polygon that is set up covers a sample and is the nearest there so far; it is noted then."""
    hit = hit_sample(setup[0], setup[2], samples, x, y, s, at_x, at_y, p) >= 0
    return bool(hit and samples.polygon[(y * samples.width + x) * len(samples.offsets) + s] == p)


@kernel
def _point(corners: Any, edges: Any, x: Any, y: Any, point: Any) -> None:
    """Where the polygon's point at a covered sample lies at rest: the same weights of its corners there."""
    triangle = covering_triangle(edges, x, y)
    first, total = 3 * triangle, 0.0
    point[:] = 0.0
    for n in range(3):  # the edge from corner n - 1 to n lies opposite corner n + 1
        row = first + n
        weight = float(edges[row, 0] * x + edges[row, 1] * y + edges[row, 2] + edges[row, 3])
        corner = 0 if n == 1 else triangle + (1 if n == 2 else 2)
        total += weight
        for d in range(2):
            point[d] += weight * corners[corner, d]
    point /= total


@kernel
def _cell(shading: Shading, point: Any, x: int, y: int, cell: Any) -> None:
    """Shading cell of a sample: by its point at rest, or of its pixel."""
    for d in range(2):
        where = point[d] if shading.decoupled else (x if d == 0 else y) + 0.5
        cell[d] = int(np.floor(where * shading.rate))


@kernel
def _look_up(cache: Any, key: Any) -> bool:
    """Look a cell up and bring it to the front, where it is put if it is missing; whether it was there."""
    found = len(cache)
    for i in range(len(cache)):
        if cache[i, 0] == key[0] and cache[i, 1] == key[1] and cache[i, 2] == key[2]:
            found = i
            break
    for i in range(min(found, len(cache) - 1), 0, -1):
        cache[i] = cache[i - 1]
    if len(cache) > 0:
        cache[0] = key
    return found < len(cache)


def _add_costs(table: NDArray[np.int64], simt: Simt) -> None:
    """Add what follows from the samples of each batch."""
    event = DecoupledEvent
    table[:, event.SHADES] = table[:, event.VISIBLE] - table[:, event.HITS]
    table[:, event.KEY_WARPS] = -(-table[:, event.VISIBLE] // simt.warp)
    table[:, event.SHADE_WARPS] = -(-table[:, event.SHADES] // simt.warp)
    for row in table:
        number, size = contiguous(0, int(row[event.VISIBLE]) * SAMPLE_BYTES, int(simt.coalescing))
        row[event.LOAD_TRANSACTIONS] = row[event.STORE_TRANSACTIONS] = number
        row[event.LOAD_BYTES] = row[event.STORE_BYTES] = size
    table[:, event.STORE_TRANSACTIONS] += table[:, event.VISIBLE]  # colours of samples lie as the polygons do
    table[:, event.STORE_BYTES] += COLOR_BYTES * table[:, event.VISIBLE]
