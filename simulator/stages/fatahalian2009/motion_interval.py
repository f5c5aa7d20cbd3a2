"""Stochastic rasterization with interval bounds, data-parallel (Fatahalian et al. 2009, the second algorithm).

Sample s of every pixel lies in interval s of time and lens. For each interval a polygon's box over all of the interval
is bounded, and sample s of the pixels in it is tested: the polygon is placed at the sample's own time and lens point.
Brute force is the same with the bounds of the whole shutter and the whole lens: the reference.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kernel import kernel
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.fatahalian2009.micropolygon_cover import STEP, new_setup
from tilestamp.simulator.stages.fatahalian2009.micropolygon_samples import Samples
from tilestamp.simulator.stages.fatahalian2009.motion import (
    CHUNK,
    BlurPattern,
    MotionEvent,
    MovingMicropolygons,
    set_up_at,
    test_sample,
)
from tilestamp.simulator.work import Work

EVERYTHING = (0.0, 1.0, -1.0, 1.0, -1.0, 1.0)  # time, lens u, lens v
MARGIN = 1.0 / 64.0  # pixels: covers the rounding of placed vertices to float32
BLOCK = 128


def intervals_of(pattern: BlurPattern) -> NDArray[np.float64]:
    """Bounds of time, u and v of each sample number, (spp, 6)."""
    low, high = pattern.time_lens.min(axis=(0, 1)), pattern.time_lens.max(axis=(0, 1))
    return np.ascontiguousarray(np.stack([low, high], axis=2).reshape(-1, 6))


def motion_interval(polygons: MovingMicropolygons, pattern: BlurPattern, samples: Samples) -> StageResult[Samples]:
    """Draw moving polygons by intervals; a row of work for each 256 polygons."""
    return _draw("interval", polygons, pattern, samples, intervals_of(pattern))


def motion_brute_force(polygons: MovingMicropolygons, pattern: BlurPattern, samples: Samples) -> StageResult[Samples]:
    """Draw moving polygons by testing every sample of every pixel that the whole blur might reach."""
    return _draw("brute force", polygons, pattern, samples, np.array([EVERYTHING] * pattern.place.shape[2]))


def _draw(
    kernel: str, polygons: MovingMicropolygons, pattern: BlurPattern, samples: Samples, intervals: NDArray[np.float64]
) -> StageResult[Samples]:
    table = np.zeros((-(-len(polygons.start) // CHUNK), len(MotionEvent)), np.int64)
    _motion_interval(polygons.start, polygons.end, polygons.blur, pattern, samples, intervals, table)
    return StageResult(
        samples,
        (Work(stage="motion", kernel=kernel, events=MotionEvent, table=table, grid=max(1, len(table)), block=BLOCK),),
    )


@kernel
def _motion_interval(
    start: Any, end: Any, blur: Any, pattern: BlurPattern, samples: Samples, intervals: Any, table: Any
) -> None:
    setup = new_setup()
    polygon = np.empty(start.shape[1:], np.float32)
    tile = pattern.place.shape[0]
    for p in range(len(start)):
        row = table[p // CHUNK]
        row[MotionEvent.POLYGONS] += 1
        for s in range(len(intervals)):
            x0, y0, x1, y1 = _bound(start, end, blur, p, intervals[s], samples)
            row[MotionEvent.BOUNDS] += 1
            for y in range(y0, y1 + 1):
                for x in range(x0, x1 + 1):
                    i, j = y % tile, x % tile
                    set_up_at(start, end, blur, p, pattern.time_lens[i, j, s], polygon, setup)
                    at_x, at_y = x * STEP + pattern.place[i, j, s, 0], y * STEP + pattern.place[i, j, s, 1]
                    row[MotionEvent.SETUPS] += 1
                    row[MotionEvent.SAMPLE_TESTS] += 1
                    row[MotionEvent.SAMPLE_HITS] += test_sample(p, setup, samples, x, y, s, at_x, at_y)


@kernel
def _bound(start: Any, end: Any, blur: Any, p: int, interval: Any, samples: Samples) -> tuple[int, int, int, int]:
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
