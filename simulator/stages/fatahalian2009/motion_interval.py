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
from tilestamp.simulator.stages.fatahalian2009.micropolygon_cover import STEP, in_box, new_setup, set_edges, snap
from tilestamp.simulator.stages.fatahalian2009.micropolygon_samples import Samples, draw_in_parts, hit_sample, units_of
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
    polygons: MovingMicropolygons, pattern: BlurPattern, samples: Samples, simt: Simt, intervals: int | None = None,
    *, counting: bool = True,
) -> StageResult[Samples]:  # fmt: skip
    """Draw moving polygons by intervals; a row of work for each warp of polygons.

    Parameters
    ----------
    polygons, pattern, samples, simt
        ``samples`` is written.
    intervals : int, optional
        At most the samples of a pixel, and as many by default.
    counting : bool
        Fill the work table.
    """
    return _draw("interval", polygons, pattern, samples, simt, intervals_of(pattern, intervals), counting)


def motion_brute_force(
    polygons: MovingMicropolygons, pattern: BlurPattern, samples: Samples, simt: Simt
) -> StageResult[Samples]:
    """Draw moving polygons by testing every sample of every pixel that the whole blur might reach."""
    return _draw("brute force", polygons, pattern, samples, simt, np.array([EVERYTHING]), True)


def _draw(
    kernel: str,
    polygons: MovingMicropolygons,
    pattern: BlurPattern,
    samples: Samples,
    simt: Simt,
    intervals: NDArray[np.float64],
    counting: bool,
) -> StageResult[Samples]:
    simt = Simt(*map(int, simt))
    table = motion_table(polygons, simt)
    entries = np.zeros(len(table), np.int64)
    counted = (table, entries) if counting else (None, None)
    draw_in_parts(
        _motion_interval, len(table), samples, polygons.start, polygons.end, polygons.blur, pattern, intervals, simt,
        *counted,
    )  # fmt: skip
    if not counting:
        return StageResult(samples, ())
    footprint = ENTRY_BYTES * pattern.place.shape[2] * pattern.place.shape[0] ** 2
    stream = Stream("pattern", "load", int(entries.sum()), footprint)
    return StageResult(samples, (motion_work(kernel, table, polygons, samples, simt, stream),))


@kernel
def _motion_interval(
    part: int, parts: int, samples: Samples, start: Any, end: Any, blur: Any, pattern: BlurPattern, intervals: Any,
    simt: Simt, table: Any, read: Any,
) -> None:  # fmt: skip
    """Draw a share of the warps; ``read``: bytes of the pattern that each warp reads."""
    lanes = (np.empty((simt.warp, 4), np.int64), np.empty((simt.warp, 3), np.int64), np.empty((simt.warp, 10)))
    steps = (
        np.full((STEPS, simt.warp), -1, np.int64),  # what each lane reads of the pattern
        np.zeros(STEPS, np.int64),  # hits
        np.empty((STEPS, simt.warp), np.int64),  # their addresses
    )
    scratch = new_setup(), np.empty(start.shape[1:], np.float32)
    units = units_of(part, parts, (len(start) + simt.warp - 1) // simt.warp)
    _draw_warps(units, start, end, blur, pattern, intervals, samples, simt, lanes, steps, scratch, table, read)


@kernel(lent=True)
def _draw_warps(
    units: Any, start: Any, end: Any, blur: Any, pattern: BlurPattern, intervals: Any, samples: Samples, simt: Simt,
    lanes: Any, steps: Any, scratch: Any, table: Any, read: Any,
) -> None:  # fmt: skip
    boxes, walk, reach = lanes
    spp, count = pattern.place.shape[2], len(intervals)
    for unit in units:
        first = unit * simt.warp
        last = min(first + simt.warp, len(start))
        if table is not None:
            begin_warp(first, last, start.shape[1], simt, table[unit])
            table[unit, MotionEvent.BOX_WARPS] += count
            table[unit, MotionEvent.BOXES] += count * (last - first)
        for p in range(first, last):
            _reach(start, end, blur, p, reach[p - first])
        for n in range(count):
            low, high = n * spp // count, (n + 1) * spp // count
            left = 0
            for p in range(first, last):
                x0, y0, x1, y1 = bound(start, end, blur, p, intervals[n], samples)
                boxes[p - first, 0], boxes[p - first, 1], boxes[p - first, 2], boxes[p - first, 3] = x0, y0, x1, y1
                walk[p - first, 0], walk[p - first, 1], walk[p - first, 2] = x0, y0 if x1 >= x0 else y1 + 1, low
                left = max(left, max(x1 - x0 + 1, 0) * max(y1 - y0 + 1, 0) * (high - low))
            while left > 0:
                for p in range(first, last):
                    _walk(
                        start, end, blur, p, p - first, boxes, walk, reach[p - first], low, high, pattern, samples,
                        scratch, steps, table is not None,
                    )  # fmt: skip
                if table is not None:
                    read[unit] += _count(steps, min(left, STEPS), last - first, samples, simt, table[unit])
                steps[1][:] = 0
                left -= STEPS


@kernel(lent=True)
def _reach(start: Any, end: Any, blur: Any, p: int, reach: Any) -> None:
    """Least and greatest x, y, way in x and in y, and blur, of the vertices of a polygon."""
    for d in range(5):
        reach[2 * d], reach[2 * d + 1] = np.inf, -np.inf
    for k in range(start.shape[1]):
        for d in range(2):
            _widen(reach, 2 * d, start[p, k, d])
            _widen(reach, 4 + 2 * d, end[p, k, d] - start[p, k, d])
        _widen(reach, 8, blur[p, k])


@kernel(lent=True, inline=True)
def _widen(reach: Any, at: int, value: Any) -> None:
    reach[at], reach[at + 1] = min(reach[at], np.float64(value)), max(reach[at + 1], np.float64(value))


@kernel(lent=True)
def _walk(
    start: Any, end: Any, blur: Any, p: int, lane: int, boxes: Any, walk: Any, reach: Any, low: int, high: int,
    pattern: BlurPattern, samples: Samples, scratch: Any, steps: Any, counting: bool,
) -> None:  # fmt: skip
    """Step one lane through the next samples of its box; where it hits and what it reads of the pattern, by step."""
    tile, _, spp, _ = pattern.place.shape
    entries, hits, addresses = steps
    setup, polygon = scratch
    box = boxes[lane]
    x, y, s = walk[lane, 0], walk[lane, 1], walk[lane, 2]
    i, j, left = y % tile, x % tile, box[0] % tile  # of the pattern
    for step in range(STEPS):
        if y > box[3]:
            break
        if counting:
            entries[step, lane] = ((i * tile + j) * spp + s) * ENTRY_BYTES
        samples.tests[y, x] += 1
        time, u, v = pattern.time_lens[i, j, s, 0], pattern.time_lens[i, j, s, 1], pattern.time_lens[i, j, s, 2]
        at_x, at_y = x * STEP + pattern.place[i, j, s, 0], y * STEP + pattern.place[i, j, s, 1]
        if not (_beyond(at_x / STEP, time, u, reach, 0) or _beyond(at_y / STEP, time, v, reach, 2)):
            put(start, end, blur, p, time, u, v, polygon)
            snap(polygon, setup[1], setup[3])
            if in_box(setup[1], at_x, at_y):
                set_edges(polygon, setup[0], setup[1], setup[2], setup[3])
                addresses[step, hits[step]] = hit_sample(setup[0], setup[2], samples, x, y, s, at_x, at_y, p)
                hits[step] += addresses[step, hits[step]] >= 0
        s += 1
        if s == high:
            s, x, j = low, x + 1, j + 1 if j + 1 < tile else 0
            if x > box[2]:
                x, y, i, j = box[0], y + 1, i + 1 if i + 1 < tile else 0, left
    walk[lane, 0], walk[lane, 1], walk[lane, 2] = x, y, s


@kernel(lent=True, inline=True)
def _beyond(at: Any, time: Any, lens: Any, reach: Any, d: int) -> bool:
    """Whether all vertices certainly lie to one side of a place on x (``d`` 0) or y (2), at a time and lens point."""
    least, most = (reach[8], reach[9]) if lens >= 0 else (reach[9], reach[8])
    return bool(
        reach[d] + time * reach[4 + d] + lens * least > at + MARGIN
        or reach[d + 1] + time * reach[5 + d] + lens * most < at - MARGIN
    )


@kernel(lent=True)
def _count(steps: Any, most: int, lanes: int, samples: Samples, simt: Simt, row: Any) -> int:
    """Count some steps of the lanes of a warp; returns bytes of pattern read."""
    entries, hits, addresses = steps
    read = 0
    row[MotionEvent.TEST_WARPS] += most
    for step in range(most):
        for lane in range(lanes):
            row[MotionEvent.SAMPLE_TESTS] += entries[step, lane] >= 0
        count_atomic(samples, addresses[step], hits[step], simt, row)
        number, size = transactions(entries[step], lanes, ENTRY_BYTES, simt.coalescing)
        row[MotionEvent.LOAD_TRANSACTIONS] += number
        read += size
        entries[step] = -1
    row[MotionEvent.LOAD_BYTES] += read
    return read


@kernel(lent=True)
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
