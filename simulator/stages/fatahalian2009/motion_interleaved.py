"""Interleaved sampling in time and lens (Keller & Heidrich 2001; Fatahalian et al. 2009, the third algorithm).

A tile of pixels has as many distinct times and lens points as it has samples. For each of them a polygon stands still:
it is placed, set up once, and tested like a static one, at the one sample of each tile that has this time and lens
point. How far it moves makes no difference; there are as many set-ups as distinct times and lens points.
"""

from typing import Any

import numpy as np

from tilestamp.models.kernel import kernel
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.fatahalian2009.micropolygon_cover import STEP, new_setup
from tilestamp.simulator.stages.fatahalian2009.micropolygon_samples import Samples, pixel_box
from tilestamp.simulator.stages.fatahalian2009.motion import (
    CHUNK,
    BlurPattern,
    MotionEvent,
    MovingMicropolygons,
    set_up_at,
    test_sample,
)
from tilestamp.simulator.work import Work

BLOCK = 128


def motion_interleaved(polygons: MovingMicropolygons, pattern: BlurPattern, samples: Samples) -> StageResult[Samples]:
    """Draw moving polygons by interleaving; a row of work for each 256 polygons."""
    table = np.zeros((-(-len(polygons.start) // CHUNK), len(MotionEvent)), np.int64)
    _motion_interleaved(polygons.start, polygons.end, polygons.blur, pattern, samples, table)
    return StageResult(
        samples,
        (
            Work(
                stage="motion",
                kernel="interleaved",
                events=MotionEvent,
                table=table,
                grid=max(1, len(table)),
                block=BLOCK,
            ),
        ),
    )


@kernel
def _motion_interleaved(start: Any, end: Any, blur: Any, pattern: BlurPattern, samples: Samples, table: Any) -> None:
    setup = new_setup()
    polygon = np.empty(start.shape[1:], np.float32)
    tile, _, spp, _ = pattern.place.shape
    for p in range(len(start)):
        row = table[p // CHUNK]
        row[MotionEvent.POLYGONS] += 1
        for i in range(tile):
            for j in range(tile):
                for s in range(spp):
                    set_up_at(start, end, blur, p, pattern.time_lens[i, j, s], polygon, setup)
                    row[MotionEvent.SETUPS] += 1
                    x0, y0, x1, y1 = pixel_box(setup[1], samples.width, samples.height)
                    for y in range(y0 + (i - y0) % tile, y1 + 1, tile):
                        for x in range(x0 + (j - x0) % tile, x1 + 1, tile):
                            at_x, at_y = x * STEP + pattern.place[i, j, s, 0], y * STEP + pattern.place[i, j, s, 1]
                            row[MotionEvent.SAMPLE_TESTS] += 1
                            row[MotionEvent.SAMPLE_HITS] += test_sample(p, setup, samples, x, y, s, at_x, at_y)
