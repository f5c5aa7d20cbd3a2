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
from tilestamp.simulator.stages.fatahalian2009.micropolygon_cover import STEP, in_box, new_setup, set_edges, snap
from tilestamp.simulator.stages.fatahalian2009.micropolygon_samples import (
    Samples,
    draw_in_parts,
    hit_sample,
    pixel_box,
    units_of,
)
from tilestamp.simulator.stages.fatahalian2009.motion import (
    STEPS,
    BlurPattern,
    MotionEvent,
    MovingMicropolygons,
    begin_warp,
    count_atomic,
    motion_table,
    motion_work,
    put,
)


def motion_interleaved(
    polygons: MovingMicropolygons, pattern: BlurPattern, samples: Samples, simt: Simt
) -> StageResult[Samples]:
    """Draw moving polygons by interleaving; a row of work for each warp of polygons."""
    simt = Simt(*map(int, simt))
    table = motion_table(polygons, simt)
    draw_in_parts(_motion_interleaved, len(table), samples, *polygons, pattern, simt, table)
    return StageResult(samples, (motion_work("interleaved", table, polygons, samples, simt),))


@kernel
def _motion_interleaved(
    part: int, parts: int, samples: Samples, start: Any, end: Any, blur: Any, pattern: BlurPattern, simt: Simt,
    table: Any,
) -> None:  # fmt: skip
    scratch = new_setup(), np.empty(start.shape[1:], np.float32)
    steps = np.zeros(STEPS, np.int64), np.empty((STEPS, simt.warp), np.int64)  # hits, and their addresses
    _draw_warps(units_of(part, parts, len(table)), start, end, blur, pattern, samples, simt, scratch, steps, table)


@kernel(lent=True)
def _draw_warps(
    units: Any, start: Any, end: Any, blur: Any, pattern: BlurPattern, samples: Samples, simt: Simt, scratch: Any,
    steps: Any, table: Any,
) -> None:  # fmt: skip
    tile, _, spp, _ = pattern.place.shape
    for unit in units:
        row, first = table[unit], unit * simt.warp
        last = min(first + simt.warp, len(start))
        begin_warp(first, last, start.shape[1], simt, row)
        row[MotionEvent.BOX_WARPS] += tile * tile * spp
        row[MotionEvent.BOXES] += tile * tile * spp * (last - first)
        for i in range(tile):
            for j in range(tile):
                for s in range(spp):
                    begin, more = 0, True
                    while more:
                        most = 0
                        for p in range(first, last):
                            left = _walk(start, end, blur, p, pattern, samples, i, j, s, begin, scratch, steps)
                            row[MotionEvent.SAMPLE_TESTS] += min(left, STEPS)
                            most = max(most, left)
                        row[MotionEvent.TEST_WARPS] += min(most, STEPS)
                        for step in range(min(most, STEPS)):
                            count_atomic(samples, steps[1][step], steps[0][step], simt, row)
                            steps[0][step] = 0
                        begin, more = begin + STEPS, most > STEPS


@kernel(lent=True)
def _walk(
    start: Any, end: Any, blur: Any, p: int, pattern: BlurPattern, samples: Samples, i: int, j: int, s: int, begin: int,
    scratch: Any, steps: Any,
) -> int:  # fmt: skip
    """Place a polygon, and test its one sample of each tile from step ``begin`` on; returns the steps left from there.

    Where it hits stands in ``steps``.
    """
    (edges, boxes, depths, snapped), polygon = scratch
    hits, addresses = steps
    tile, time_lens = pattern.place.shape[0], pattern.time_lens
    put(start, end, blur, p, time_lens[i, j, s, 0], time_lens[i, j, s, 1], time_lens[i, j, s, 2], polygon)
    snap(polygon, boxes, snapped)
    x0, y0, x1, y1 = pixel_box(boxes, samples.width, samples.height)
    x0, y0 = x0 + (j - x0) % tile, y0 + (i - y0) % tile
    if x1 < x0 or y1 < y0:
        return 0
    wide = (x1 - x0) // tile + 1
    left = wide * ((y1 - y0) // tile + 1) - begin
    x, y = x0 + begin % wide * tile, y0 + begin // wide * tile
    ready = False
    for step in range(min(left, STEPS)):
        samples.tests[y, x] += 1
        at_x, at_y = x * STEP + pattern.place[i, j, s, 0], y * STEP + pattern.place[i, j, s, 1]
        if in_box(boxes, at_x, at_y):
            if not ready:
                set_edges(polygon, edges, boxes, depths, snapped)
                ready = True
            addresses[step, hits[step]] = hit_sample(edges, depths, samples, x, y, s, at_x, at_y, p)
            hits[step] += addresses[step, hits[step]] >= 0
        x += tile
        if x > x1:
            x, y = x0, y + tile
    return int(max(left, 0))
