"""Field of view at 180 degrees and beyond: who still shows a closed room without a hole.

A flat picture is 2 tan(fov / 2) wide: it ends below 180 degrees. A bent one goes on, but an edge around the seam of the
picture, or the point behind the eye, has its ends on both sides, and no halving brings them together. A line of sight
knows no seam. A hole is a pixel that shows nothing where lines of sight in float64, which are those of fractions
(``tests/test_nonlinear.py``), meet a wall.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd

from tilestamp.experiments.exploration.nonlinear import EYE, room
from tilestamp.experiments.harness.result import Figure, Result
from tilestamp.experiments.stability.boundary import Boundary, atlas_result, bisect, bracket
from tilestamp.experiments.stability.methods import MACHINE
from tilestamp.reports.plots import lines
from tilestamp.simulator.run import Run
from tilestamp.simulator.simulation import simulate

SLOW = True  # with what it needs compiled, more than the first run should take
QUESTION = "How wide may a picture's field of view be?"
PIXELS, SIDE = 96, 3  # of a side of the picture; squares along each wall
FOVS = (60.0, 120.0, 179.0, 181.0, 240.0, 300.0, 345.0, 359.0)  # degrees
SIGHT: dict[str, Any] = {"double": False}
CHORDS: dict[str, Any] = {"method": "tessellated", "tolerance": 0.25, "double": False}
METHODS: dict[str, dict[str, Any]] = {
    f"{kind}, {words}": {"projection": kind, **options}
    for kind in ("fisheye", "paraboloid", "cylindrical")
    for words, options in (("lines of sight", SIGHT), ("tessellated", CHORDS))
}


def draw(fov: float, **options: Any) -> Run:
    """Draw the room."""
    return simulate(room(SIDE), "nonlinear", MACHINE, width=PIXELS, height=PIXELS, camera=EYE, fov=fov, **options)


def holes(name: str, fov: float) -> int:
    """Pixels that show nothing where there is a wall."""
    exact = METHODS[name] | {"method": "rays", "double": True}
    shown, wall = (draw(fov, **options).depth < 1 for options in (METHODS[name], exact))
    return int(np.count_nonzero(wall & ~shown))


def run(progress: Callable[[str], None]) -> Result:
    """Widen each picture; bisect."""
    rows, boundaries = [], []
    for name in METHODS:
        progress(f"field of view: {name}")
        swept = [holes(name, fov) for fov in FOVS]
        rows += [{"method": name, "fov": fov, "holes": count} for fov, count in zip(FOVS, swept, strict=True)]
        found = boundary(name, bracket(FOVS, [count > 0 for count in swept]))
        words = "holes in a closed room: edges around the seam, or behind the eye, cannot be straight"
        cost = _cost(name) if found[1] else ""
        boundaries.append(Boundary(name, "field of view", "degrees", *found, words, "lines of sight", cost))
    table = pd.DataFrame(rows)
    figure = Figure(
        "fov",
        lambda path: lines(
            table, path, x="fov", y="holes", by="method", title="Holes in a closed room, by field of view",
            x_label="field of view [degrees]", y_label="pixels that show nothing",
        ),
    )  # fmt: skip
    note = f"Walls of {SIDE}x{SIDE} squares, {PIXELS}x{PIXELS} pixels; edges within {CHORDS['tolerance']} pixel."
    title = "Field of view at 180 degrees and beyond"
    return atlas_result("stability/field_of_view", title, boundaries, [figure], [note], {"holes": table})


def boundary(name: str, ends: tuple[float, float] = (FOVS[0], FOVS[-1])) -> tuple[float | None, float | None]:
    """Angle that holds, and angle that breaks."""
    return bisect(lambda fov: holes(name, fov) > 0, *ends, scale="linear", tolerance=0.05)


def _cost(name: str) -> str:
    """Time of lines of sight over that of the edges, at 180 degrees."""
    chords, sight = (
        draw(180.0, **METHODS[name] | {"method": method}).milliseconds for method in ("tessellated", "rays")
    )
    return f"{sight / chords:.2g} times the time of the edges at 180 degrees on the {MACHINE}"
