"""STE by stamp size and polygon area, at random places and rotations, beside the closed form.

For a convex polygon of area A and box w x h at a random place, n x n-pixel stamps make A + n (w + h) + n^2 tests a
sample of a pixel if only stamps that the polygon reaches are tested, (w + n) (h + n) if all that touch its box are, and
A hits; at random rotation the mean of w and of h is perimeter / pi (derived: published/facts.md, section 1.2).
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pandas as pd

from tilestamp.experiments.harness.result import Cell, Figure, Result
from tilestamp.experiments.ste.setting import CONFIDENCE, random_polygons, student
from tilestamp.reports.plots import lines
from tilestamp.simulator.stages.fatahalian2009.sample_positions import sample_positions
from tilestamp.simulator.stages.fatahalian2009.stamps import stamp_shape
from tilestamp.simulator.stages.fatahalian2009.stamps_count import count_tests

QUESTION = "Does measured sample test efficiency follow the closed form?"
SLOW = True  # with what it needs compiled, more than the first run should take

AREAS = (0.25, 0.5, 1.0, 2.0, 4.0, 10.0)
STAMPS = (1, 2, 4, 8)
BATCHES = 40
POLYGONS = 2500  # a batch
PIXELS = 256


def expected(shape: str, area: float, stamp: int, touch: str) -> float:
    """STE by the closed form."""
    side = np.sqrt(area) if shape == "square" else np.sqrt(4 * area / np.sqrt(3))
    perimeter = side * (4 if shape == "square" else 3)
    if touch == "polygon":
        return float(area / (area + 2 * stamp * perimeter / np.pi + stamp**2))
    return float(area / (_mean_box(shape, side) + 2 * stamp * perimeter / np.pi + stamp**2))


def _mean_box(shape: str, side: float) -> float:
    """Mean area of the box over all rotations."""
    angles = np.linspace(0.0, 2 * np.pi, 20001)[:-1]
    corners = 4 if shape == "square" else 3
    turns = angles[:, None] + 2 * np.pi * np.arange(corners) / corners
    radius = side / (2 * np.sin(np.pi / corners))
    return float((radius**2 * np.ptp(np.cos(turns), axis=1) * np.ptp(np.sin(turns), axis=1)).mean())


def run(progress: Callable[[str], None]) -> Result:
    """Measure every cell with its interval."""
    rows: list[dict[str, Any]] = []
    for shape in ("square", "triangle"):
        for area in AREAS:
            progress(f"{shape} of {area} pixels")
            rows += _cells(shape, area)
    table = pd.DataFrame(rows)
    each, all_ = int(table.inside.sum()), int(table.inside_together.sum())
    cells = [
        Cell(
            f"{r['polygon']} {r['area']:g}",
            f"{r['stamp']}x{r['stamp']} {r['touch']}",
            "% STE",
            published=r["closed_form"],
            ours=r["ste"],
            status="reproduced",
        )
        for r in rows
    ]
    notes = [
        f"The closed form lies in the cell's own 95 % interval in {each} of {len(table)} cells (19 of 20 expected).",
        f"It lies inside the 95 % interval that holds for all cells together (Bonferroni) in {all_} of them.",
        "The 'published' column is the closed form of the stored facts, derived there, not a published measurement.",
    ]
    shown = table.query("polygon == 'square' and touch == 'box'").assign(stamp=lambda t: t.stamp.map("{0}x{0}".format))
    figure = Figure("ste", partial(
        lines, shown, x="area", y="ste", by="stamp", published="closed_form",
        title="STE of squares by stamp, all stamps of the box (diamonds: closed form)", x_label="area [pixels]",
        y_label="STE [%]", log_x=True, log_y=True,
    ))  # fmt: skip
    source = "Closed form of published/facts.md, section 1.2; definitions of Fatahalian et al. 2009"
    answer = f"Yes in {all_} of {len(table)} cells, by intervals that hold for all cells together with 95 %."
    tables = {"intervals": table}
    return Result(
        "ste/closed_form", "STE by stamp and area", source, cells, answer, figures=[figure], notes=notes, tables=tables
    )


def _cells(shape: str, area: float) -> list[dict[str, Any]]:
    """All stamps of one polygon: ratio of means over batches, Student's interval."""
    batches = [random_polygons(shape, area, POLYGONS, 1000 * k + round(100 * area)) for k in range(BATCHES)]
    rows = []
    for stamp in STAMPS:
        for touch in ("polygon", "box"):
            laid = stamp_shape(stamp, touch)
            counts = np.array([count_tests(b, PIXELS, PIXELS, sample_positions(1), laid) for b in batches], float)
            ratio = counts[:, 1].sum() / counts[:, 0].sum()
            spread = np.std(counts[:, 1] - ratio * counts[:, 0], ddof=1) / np.sqrt(BATCHES) / counts[:, 0].mean()
            form = expected(shape, area, stamp, touch)
            cells = 2 * len(AREAS) * len(STAMPS) * 2
            own, together = (student(1 - (1 - CONFIDENCE) / 2 / n, BATCHES - 1) * spread for n in (1, cells))
            rows.append(
                {
                    "polygon": shape,
                    "area": area,
                    "stamp": stamp,
                    "touch": touch,
                    "closed_form": 100 * form,
                    "ste": 100 * ratio,
                    "half_interval": 100 * own,
                    "inside": abs(ratio - form) <= own,
                    "inside_together": abs(ratio - form) <= together,
                }
            )
    return rows
