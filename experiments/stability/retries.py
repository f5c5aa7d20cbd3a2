"""CudaRaster's queues: what outgrows the room of the first attempt, and what drawing again costs (Laine & Karras 2011).

Section 7: queues begin with room by the number of triangles; where one is too small the draw is repeated with larger
buffers, so that nothing is lost but time. Three queues can overflow: sub-triangles, where many triangles are clipped;
segments of bins and of tiles, where few triangles cover many of them.
"""

from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Figure, Result
from tilestamp.experiments.stability.boundary import Boundary, atlas_result, bisect
from tilestamp.experiments.stability.patch_frames import milliseconds, simt_of
from tilestamp.reports.plots import lines
from tilestamp.simulator.run import Run
from tilestamp.simulator.scenes.scene import Mesh, Scene
from tilestamp.simulator.simulation import simulate
from tilestamp.simulator.stages.laine2011 import bin_raster as bins
from tilestamp.simulator.stages.laine2011 import coarse_raster as tiles
from tilestamp.simulator.stages.laine2011.triangle_setup import SLACK, triangle_setup
from tilestamp.simulator.work import Work

QUESTION = "When do CudaRaster's queues overflow, and what does drawing again cost?"
SIZE = 512  # pixels a side: 16 bins, 4096 tiles
MACHINE = "gtx480"
COUNTS = (16, 32, 64, 128, 256, 512)  # triangles over the whole screen
SHAPES = {"sub-triangles": "clipped", "bin segments": "screen, bins only", "tile segments": "screen"}
MOST = {"sub-triangles": 8192, "bin segments": 32768, "tile segments": 512}  # triangles


class Attempt(NamedTuple):
    """What a draw needs and has, by queue, and the works that a retry repeats."""

    needed: dict[str, int]
    room: dict[str, int]
    works: tuple[Work, ...]

    def overflows(self, queue: str) -> bool:
        """Whether a queue is too small."""
        return self.needed[queue] > self.room[queue]


@cache
def attempt(count: int, shape: str = "screen") -> Attempt:
    """Set up, bin and queue ``count`` triangles that cover the screen, or are clipped by all planes (``clipped``)."""
    positions = _clipped() if shape == "clipped" else _screen()
    triangles = np.tile(np.arange(3, dtype=np.int32), (count, 1))
    given: dict[str, Any] = {"width": SIZE, "height": SIZE, "simt": simt_of(MACHINE), "release": "1.1"}
    setup, (setup_work,), facts = triangle_setup(positions, triangles, **given, capacity=8 * count + SLACK)
    queues, (bin_work,), bin_facts = bins.bin_raster(setup, **given)
    needed = {"sub-triangles": facts["numSubtris"], "bin segments": bin_facts["num_bin_segments"]}
    room = {"sub-triangles": count + SLACK, "bin segments": bins.initial_capacity(count, SIZE, SIZE)}
    works = [setup_work, bin_work]
    if shape == "screen":
        _, (tile_work,), tile_facts = tiles.coarse_raster(queues, setup, deferred_clear=True, **given)
        needed["tile segments"] = tile_facts["num_tile_segments"]
        room["tile segments"] = tiles.initial_capacity(count, SIZE, SIZE)
        works.append(tile_work)
    return Attempt(needed, room, tuple(works))


def _screen() -> NDArray[np.float32]:
    """A triangle that just holds the screen."""
    return np.array([[-1, -1, 0, 1], [3, -1, 0, 1], [-1, 3, 0, 1]], np.float32)


def _clipped() -> NDArray[np.float32]:
    """A triangle that leaves the guard band on all sides, and both depth planes: a polygon of many corners."""
    return np.array([[-60, -55, -2, 1], [70, -40, 2, 1], [-5, 65, 0.3, 1]], np.float32)


def boundary(queue: str) -> tuple[float | None, float | None]:
    """Triangles that fit, and triangles that need a retry."""
    return bisect(
        lambda count: attempt(int(count), SHAPES[queue]).overflows(queue), COUNTS[0], MOST[queue], scale="integer"
    )


def run(progress: Progress) -> Result:
    """Add triangles until a queue is full."""
    rows = []
    for count in COUNTS:
        progress(f"stability/retries: {count} triangles")
        made = attempt(count)
        rows += [
            {"triangles": count, "queue": queue, "needed": made.needed[queue], "room": made.room[queue]}
            for queue in made.needed
        ]
    table = pd.DataFrame(rows).assign(full=lambda t: t.needed / t.room)
    progress("stability/retries: boundaries")
    boundaries = [_boundary(queue) for queue in ("sub-triangles", "bin segments", "tile segments")]
    figures = [Figure("queues", partial(
        lines, table, x="triangles", y="full", by="queue",
        title="Room that CudaRaster needs over the room of its first attempt",
        x_label=f"triangles over the whole screen of {SIZE}x{SIZE} pixels", y_label="needed / room", log_x=True,
        log_y=True,
    ))]  # fmt: skip
    return atlas_result(
        "stability/retries", "CudaRaster's queues overflow and the draw is repeated", boundaries, figures, [],
        {"queues": table},
    )  # fmt: skip


def _boundary(queue: str) -> Boundary:
    holds, breaks = boundary(queue)
    what = "triangles clipped by all planes" if queue == "sub-triangles" else "triangles over the whole screen"
    cost = "" if breaks is None else _cost(queue, int(breaks))
    wrong = "the queue is too small for the first attempt; nothing is lost"
    cure = "draw again with more room" if cost else ""
    return Boundary(f"cudaraster, {queue} at {SIZE}x{SIZE}", what, "", holds, breaks, wrong, cure, cost)


def _cost(queue: str, count: int) -> str:
    """What the first attempt took, which was for nothing; of a whole frame where that is drawn in seconds."""
    if queue == "tile segments":
        run = frame(count)
        failed = run.timings[:-4]
        took, of_frame = sum(timing.milliseconds for timing in failed), f" of a frame of {run.milliseconds:.3g} ms"
        stages = [timing.stage for timing in failed]
    else:
        works = attempt(count, SHAPES[queue]).works[: 1 if queue == "sub-triangles" else 2]
        took, of_frame, stages = milliseconds(works, MACHINE, "cudaraster"), "", [work.stage for work in works]
    return f"{took:.4g} ms{of_frame} are for {', '.join(stages)} of the attempt that fails"


@cache
def frame(count: int) -> Run:
    """Draw ``count`` triangles that cover the screen, with what retries it takes."""
    triangles = np.tile(np.arange(3, dtype=np.int32), (count, 1))
    scene = Scene("screen", mesh=Mesh(_screen(), triangles, clip_space=True))
    return simulate(
        scene, "cudaraster", MACHINE, width=SIZE, height=SIZE, camera=np.eye(4), picture=False, first_frame=True
    )
