"""One huge triangle under FreePipe: a thread that scans all of it, alone (Liu et al. 2010).

One thread draws one triangle: its time grows with the box of the triangle, and no other thread helps. A pipeline of
tiles divides the same pixels among all blocks, at the price of its four kernels.
"""

from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd

from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Figure, Result
from tilestamp.experiments.stability.boundary import Boundary, atlas_result, bisect
from tilestamp.reports.plots import lines
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.simulation import simulate

QUESTION = "How large may one triangle be before FreePipe waits for it alone?"
SIDE = 1024  # pixels of the screen
AREAS = tuple(float(2**k) for k in range(1, 20, 2))  # pixels
MACHINE = "gtx480"  # both pipelines were written for it
PIPELINES = ("freepipe", "cudaraster", "hardware")
TWICE = 2.0


@cache
def milliseconds(pipeline: str, area: float, copies: int = 1) -> float:
    """Modelled time of right triangles of ``area`` pixels, one on top of the other."""
    leg = 2 * np.sqrt(2 * area) / SIDE
    corners = np.array([[-1, -1, 0, 1], [leg - 1, -1, 0, 1], [-1, leg - 1, 0, 1]], np.float32)
    triangles = np.tile(np.arange(3, dtype=np.int32), (copies, 1))
    scene = Scene.from_clip_space(corners, triangles, f"{area:g} pixels")
    return simulate(scene, pipeline, MACHINE, width=SIDE, height=SIDE).milliseconds


def overtaken(rival: str) -> tuple[float | None, float | None]:
    """Area up to which FreePipe is not slower than a rival, and the one from which it is."""
    return bisect(
        lambda area: milliseconds("freepipe", area) > milliseconds(rival, area), AREAS[0], AREAS[-1], tolerance=0.1
    )


def run(progress: Progress) -> Result:
    """Let one triangle grow."""
    rows = []
    for pipeline in PIPELINES:
        progress(f"stability/huge_triangle: {pipeline}")
        rows += [{"pipeline": pipeline, "area": area, "ms": milliseconds(pipeline, area)} for area in AREAS]
    table = pd.DataFrame(rows)
    boundaries = [_boundary(rival) for rival in PIPELINES[1:]]
    title = "One huge triangle under FreePipe"
    figures = [Figure("time", lambda path: _plot(table, path))]
    return atlas_result("stability/huge_triangle", title, boundaries, figures, _notes(), {"areas": table})


def _boundary(rival: str) -> Boundary:
    small, large = AREAS[0], AREAS[-1]
    slow, fast = milliseconds("freepipe", large), milliseconds(rival, large)
    method = f"freepipe against {rival}"
    wrong = f"one thread scans it: at {large:g} pixels {slow:.4g} ms, {slow / fast:.0f} times {rival}'s"
    cost = f"{milliseconds(rival, small) - milliseconds('freepipe', small):+.4f} ms for a triangle of {small:g} pixels"
    return Boundary(method, "area of one triangle", "pixels", *overtaken(rival), wrong, f"draw it by {rival}", cost)


def _notes() -> list[str]:
    first, last = AREAS[-2], AREAS[-1]
    growth = {p: milliseconds(p, last) / milliseconds(p, first) for p in PIPELINES}
    return [
        f"From {first:g} to {last:g} pixels time grows "
        + ", ".join(f"{ratio:.2f} times in {name}" for name, ratio in growth.items())
        + f", the area {last / first:g} times."
    ]


def _plot(table: pd.DataFrame, path: Path) -> None:
    lines(
        table, path, x="area", y="ms", by="pipeline", title=f"One triangle on {MACHINE}, {SIDE}x{SIDE} pixels",
        x_label="area of the triangle [pixels]", y_label="time [ms]", log_x=True, log_y=True,
    )  # fmt: skip
