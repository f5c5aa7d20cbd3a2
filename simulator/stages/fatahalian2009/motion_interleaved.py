"""Interleaved sampling in time and lens (Keller & Heidrich 2001; Fatahalian et al. 2009, the third algorithm).

A tile of pixels has as many distinct times and lens points as it has samples. For each of them a polygon stands still:
it is placed, set up once, and tested like a static one, at the one sample of each tile that has this time and lens
point. How far it moves makes no difference; there are as many set-ups as distinct times and lens points. All lanes of a
warp take the same time and lens point, which constant memory hands to them.
"""

from typing import Any

import numpy as np

from tilestamp.models.kernel import kernel
from tilestamp.models.simt import Simt
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.fatahalian2009.micropolygon_cover import STEP
from tilestamp.simulator.stages.fatahalian2009.micropolygon_samples import Samples, pixel_box
from tilestamp.simulator.stages.fatahalian2009.motion import (
    BlurPattern,
    MotionEvent,
    MovingMicropolygons,
    begin_warp,
    end_test,
    motion_table,
    motion_work,
    set_up_at,
    test_sample,
)


def motion_interleaved(
    polygons: MovingMicropolygons, pattern: BlurPattern, samples: Samples, simt: Simt
) -> StageResult[Samples]:
    """Draw moving polygons by interleaving; a row of work for each warp of polygons."""
    simt = Simt(*map(int, simt))
    table = motion_table(polygons, simt)
    _motion_interleaved(polygons.start, polygons.end, polygons.blur, pattern, samples, simt, table)
    return StageResult(samples, (motion_work("interleaved", table, polygons, samples, simt),))


@kernel
def _motion_interleaved(
    start: Any, end: Any, blur: Any, pattern: BlurPattern, samples: Samples, simt: Simt, table: Any
) -> None:
    edges, boxes = np.zeros((simt.warp, 6, 4), np.int64), np.zeros((simt.warp, 3, 4), np.int64)
    depths, snapped = np.zeros((simt.warp, 2, 3)), np.zeros((4, 2), np.int64)
    polygon = np.empty(start.shape[1:], np.float32)
    walk = np.empty((simt.warp, 4), np.int64)  # of a lane: first x and y, pixels in a row, pixels
    tile, _, spp, _ = pattern.place.shape
    for unit in range(len(table)):
        row, first = table[unit], unit * simt.warp
        last = min(first + simt.warp, len(start))
        begin_warp(first, last, start.shape[1], simt, row)
        for i in range(tile):
            for j in range(tile):
                for s in range(spp):
                    row[MotionEvent.BOX_WARPS] += 1
                    row[MotionEvent.BOXES] += last - first
                    for p in range(first, last):
                        setup = (edges[p - first], boxes[p - first], depths[p - first], snapped)
                        set_up_at(start, end, blur, p, pattern.time_lens[i, j, s], polygon, setup)
                        _own_pixels(setup[1], samples, tile, i, j, walk[p - first])
                    _walk(first, last, (edges, boxes, depths, snapped), walk, pattern, samples, simt, row, i, j, s)


@kernel
def _own_pixels(boxes: Any, samples: Samples, tile: int, i: int, j: int, walk: Any) -> None:
    """Pixels of a polygon's box whose place in their tile is row i, column j."""
    x0, y0, x1, y1 = pixel_box(boxes, samples.width, samples.height)
    walk[0], walk[1] = x0 + (j - x0) % tile, y0 + (i - y0) % tile
    walk[2] = max((x1 - walk[0]) // tile + 1, 0)
    walk[3] = walk[2] * max((y1 - walk[1]) // tile + 1, 0)


@kernel
def _walk(
    first: int, last: int, setups: Any, walk: Any, pattern: BlurPattern, samples: Samples, simt: Simt, row: Any,
    i: int, j: int, s: int,
) -> None:  # fmt: skip
    """Lanes step through their pixels together, each testing its one sample of a tile."""
    addresses = np.empty(simt.warp, np.int64)
    tile = pattern.place.shape[0]
    for step in range(walk[: last - first, 3].max()):
        active, hits = 0, 0
        for lane in range(last - first):
            if step >= walk[lane, 3]:
                continue
            active += 1
            x, y = walk[lane, 0] + step % walk[lane, 2] * tile, walk[lane, 1] + step // walk[lane, 2] * tile
            at_x, at_y = x * STEP + pattern.place[i, j, s, 0], y * STEP + pattern.place[i, j, s, 1]
            setup = (setups[0][lane], setups[1][lane], setups[2][lane], setups[3])
            addresses[hits] = test_sample(first + lane, setup, samples, x, y, s, at_x, at_y)
            hits += addresses[hits] >= 0
        end_test(samples, active, addresses, hits, simt, row)
