"""Stochastic rasterization with interval bounds, data-parallel (Fatahalian et al. 2009, the second algorithm).

The samples of a pixel are shared out to intervals of time and lens, one each or some neighbours each. For each interval
a polygon's box over all of the interval is bounded, and those samples of the pixels in it are tested: the polygon is
placed at the sample's own time and lens point. Brute force is the same with one interval, the whole shutter and the
whole lens: the reference.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.coalescing import transactions
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.fatahalian2009.micropolygon_cover import STEP, new_setup
from tilestamp.simulator.stages.fatahalian2009.micropolygon_samples import Samples
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

EVERYTHING = (0.0, 1.0, -1.0, 1.0, -1.0, 1.0)  # time, lens u, lens v
MARGIN = 1.0 / 64.0  # pixels: covers the rounding of placed vertices to float32
ENTRY_BYTES = 16  # of the table of samples: time, u and v, and the place in the pixel in 16 bits each


def intervals_of(pattern: BlurPattern, count: int | None = None) -> NDArray[np.float64]:
    """Bounds of time, u and v of the samples of ``count`` intervals, (count, 6); by default one for each sample."""
    low, high = pattern.time_lens.min(axis=(0, 1)), pattern.time_lens.max(axis=(0, 1))
    spp = len(low)
    count = count or spp
    shares = [slice(n * spp // count, (n + 1) * spp // count) for n in range(count)]
    ends = [np.stack([low[share].min(axis=0), high[share].max(axis=0)], axis=1).ravel() for share in shares]
    return np.array(ends)


def motion_interval(
    polygons: MovingMicropolygons, pattern: BlurPattern, samples: Samples, simt: Simt, intervals: int | None = None
) -> StageResult[Samples]:
    """Draw moving polygons by intervals; a row of work for each warp of polygons.

    Parameters
    ----------
    polygons, pattern, samples, simt
        ``samples`` is written.
    intervals : int, optional
        At most the samples of a pixel, and as many by default.
    """
    return _draw("interval", polygons, pattern, samples, simt, intervals_of(pattern, intervals))


def motion_brute_force(
    polygons: MovingMicropolygons, pattern: BlurPattern, samples: Samples, simt: Simt
) -> StageResult[Samples]:
    """Draw moving polygons by testing every sample of every pixel that the whole blur might reach."""
    return _draw("brute force", polygons, pattern, samples, simt, np.array([EVERYTHING]))


def _draw(
    kernel: str,
    polygons: MovingMicropolygons,
    pattern: BlurPattern,
    samples: Samples,
    simt: Simt,
    intervals: NDArray[np.float64],
) -> StageResult[Samples]:
    simt = Simt(*map(int, simt))
    table = motion_table(polygons, simt)
    entries = np.zeros(1, np.int64)
    _motion_interval(polygons.start, polygons.end, polygons.blur, pattern, samples, intervals, simt, table, entries)
    footprint = ENTRY_BYTES * pattern.place.shape[2] * pattern.place.shape[0] ** 2
    stream = Stream("pattern", "load", int(entries[0]), footprint)
    return StageResult(samples, (motion_work(kernel, table, polygons, samples, simt, stream),))


@kernel
def _motion_interval(
    start: Any, end: Any, blur: Any, pattern: BlurPattern, samples: Samples, intervals: Any, simt: Simt, table: Any,
    entries: Any,
) -> None:  # fmt: skip
    boxes = np.empty((simt.warp, 4), np.int64)
    spp, count = pattern.place.shape[2], len(intervals)
    for unit in range(len(table)):
        row, first = table[unit], unit * simt.warp
        last = min(first + simt.warp, len(start))
        begin_warp(first, last, start.shape[1], simt, row)
        for n in range(count):
            row[MotionEvent.BOX_WARPS] += 1
            row[MotionEvent.BOXES] += last - first
            for p in range(first, last):
                boxes[p - first, :] = bound(start, end, blur, p, intervals[n], samples)
            low, high = n * spp // count, (n + 1) * spp // count
            entries[0] += _walk(start, end, blur, first, last, boxes, pattern, samples, simt, row, low, high)


@kernel
def _walk(
    start: Any, end: Any, blur: Any, first: int, last: int, boxes: Any, pattern: BlurPattern, samples: Samples,
    simt: Simt, row: Any, low: int, high: int,
) -> int:  # fmt: skip
    """Lanes step through samples low..high-1 of the pixels of their boxes together; returns bytes of pattern read."""
    addresses, entries = np.empty(simt.warp, np.int64), np.empty(simt.warp, np.int64)
    setup, polygon = new_setup(), np.empty(start.shape[1:], np.float32)
    tile, _, spp, _ = pattern.place.shape
    each, step, moved = high - low, 0, 0
    while True:
        active, hits = 0, 0
        for p in range(first, last):
            x0, y0, x1, y1 = boxes[p - first, 0], boxes[p - first, 1], boxes[p - first, 2], boxes[p - first, 3]
            wide = max(x1 - x0 + 1, 0)
            if step >= wide * max(y1 - y0 + 1, 0) * each:
                entries[p - first] = -1
                continue
            s, pixel = low + step % each, step // each
            x, y = x0 + pixel % wide, y0 + pixel // wide
            i, j = y % tile, x % tile
            entries[p - first] = ((i * tile + j) * spp + s) * ENTRY_BYTES
            active += 1
            set_up_at(start, end, blur, p, pattern.time_lens[i, j, s], polygon, setup)
            at_x, at_y = x * STEP + pattern.place[i, j, s, 0], y * STEP + pattern.place[i, j, s, 1]
            addresses[hits] = test_sample(p, setup, samples, x, y, s, at_x, at_y)
            hits += addresses[hits] >= 0
        if active == 0:
            return moved
        end_test(samples, active, addresses, hits, simt, row)
        number, size = transactions(entries, last - first, ENTRY_BYTES, simt.coalescing)
        row[MotionEvent.LOAD_TRANSACTIONS] += number
        row[MotionEvent.LOAD_BYTES] += size
        moved += size
        step += 1


@kernel
def bound(start: Any, end: Any, blur: Any, p: int, interval: Any, samples: Samples) -> tuple[int, int, int, int]:
    """Pixels x0, y0, x1, y1 that the polygon may reach in an interval, on screen."""
    low_x, low_y, high_x, high_y = np.inf, np.inf, -np.inf, -np.inf
    for k in range(start.shape[1]):
        for t in range(2):
            x = start[p, k, 0] + interval[t] * (end[p, k, 0] - start[p, k, 0])
            y = start[p, k, 1] + interval[t] * (end[p, k, 1] - start[p, k, 1])
            low_x = min(low_x, x + blur[p, k] * interval[2])
            high_x = max(high_x, x + blur[p, k] * interval[3])
            low_y = min(low_y, y + blur[p, k] * interval[4])
            high_y = max(high_y, y + blur[p, k] * interval[5])
    return (
        max(int(np.floor(low_x - MARGIN)), 0),
        max(int(np.floor(low_y - MARGIN)), 0),
        min(int(np.floor(high_x + MARGIN)), samples.width - 1),
        min(int(np.floor(high_y + MARGIN)), samples.height - 1),
    )
