"""Figure 5: time of each stage over the area of the triangles, synthetic sweep, GTX 480 (Laine & Karras 2011)."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from tilestamp.experiments.harness.published import published
from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Cell, CellFigure, Result, reported
from tilestamp.experiments.laine2011.sweep import (
    PUBLISHED_AREAS,
    SOURCE,
    STAGES,
    VARIABLE,
    areas,
    draw,
    fitted_areas,
    fitted_entries,
    frame_name,
    nanoseconds,
    published_ns,
)
from tilestamp.reports.fitted_lines import fitted_lines

QUESTION = "How long does each stage take as triangles grow?"
WORST_AIM, MEDIAN_AIM = 0.25, 0.08
COUNTER_AIM = 0.005  # the reference is rounded, and says that its last digits may move


def run(progress: Progress) -> Result:
    """Draw the areas that are asked for, and price them."""
    cells: list[Cell] = []
    rows = []
    for area in areas():
        progress(f"laine2011/figure5: {area:g} pixels a triangle")
        made, triangles = draw(area)
        for stage, ns in nanoseconds(made, triangles).items():
            asked = published_ns()[area, stage]
            frame = frame_name(area)
            cells.append(
                Cell(f"{area:g} px", stage, "ns/triangle", published=asked, ours=ns, aim=WORST_AIM, frame=frame)
            )
            bound = str(made.stages.loc[stage, "bound"])
            rows.append({"area": area, "stage": stage, "ns": ns, "published": asked, "bound": bound})
        cells += counter_cells(area, made.frame.facts["counters"], triangles)
    table = pd.DataFrame(rows)
    return Result(
        name="laine2011-figure5",
        title="Figure 5: synthetic sweep, 1024x768, neither depth test nor interpolation, GTX 480",
        source=SOURCE,
        cells=[*_summary(cells), *cells],
        answer=_answer(rows),
        figures=[CellFigure("sweep", _draw)],
        notes=_notes(),
        tables={"sweep": table},
    )


def _answer(rows: list[dict[str, Any]]) -> str:
    """All stages together at the smallest and the largest area."""
    said = []
    for area in (rows[0]["area"], rows[-1]["area"]):
        ours, theirs = (sum(row[name] for row in rows if row["area"] == area) for name in ("ns", "published"))
        said.append(f"{ours:.2f} ns ({theirs:.2f} published) for a triangle of {area:g} pixels")
    return f"The four stages take {' and '.join(said)}."


def counter_cells(area: float, counters: dict[str, float], triangles: int) -> list[Cell]:
    """Events of one area beside the reference for re-implementations, rounded as it is."""
    reference = published(__file__, "sweep_counters")
    ours = {**counters, "triangles": float(triangles)}
    cell = partial(Cell, f"{area:g} px", status="reproduced", aim=COUNTER_AIM, frame=frame_name(area))
    return [
        cell(row.counter, "", published=float(row.value), ours=round(ours[row.counter], _digits(row.value)))
        for row in reference[reference["area"] == area].itertuples()
    ]


def _digits(value: float) -> int:
    """Digits behind the point that a printed number has."""
    return len(f"{value:g}".partition(".")[2])


def _summary(cells: list[Cell]) -> list[Cell]:
    """Median and worst error of the times of each stage at areas that no number was fitted on: the figure's aim."""
    summary = []
    fitted = {frame_name(area) for area in fitted_areas()}
    for stage in STAGES:
        errors = [abs(c.error or 0.0) for c in cells if c.column == stage and c.frame not in fitted]
        if errors:
            found = {
                f"median error (aim {MEDIAN_AIM:.0%})": float(np.median(errors)),
                f"worst error (aim {WORST_AIM:.0%})": max(errors),
            }
            summary += [reported("predicted", f"{stage}: {name}", "%", 100 * e) for name, e in found.items()]
    return summary


def _notes() -> list[str]:
    fitted = ", ".join(f"{area:g}" for area in fitted_areas())
    return [
        (
            f"Fitted: {fitted_entries()} numbers of simulator/mixes/cudaraster/cc2.toml, named there, on the areas "
            f"{fitted} ({len(fitted_areas())} of {len(PUBLISHED_AREAS)}). All other instructions are operations of the "
            "kernels, counted by hand."
        ),
        (
            f"{len(areas())} of {len(PUBLISHED_AREAS)} areas were drawn; {VARIABLE}=all draws all of them, "
            f"{VARIABLE}=0.5,3,17 some."
        ),
        "Published times are rounded to 0.01 ns: at area 0 coarse raster is 0.03 ns, a third of which is rounding.",
        (
            "Each area starts the generator anew; the authors' ran on through all areas, so that their triangles lie "
            "elsewhere. Counters are no predictions: their reference was computed as ours are, and they reproduce it."
        ),
    ]


def _draw(cells: Sequence[Cell], path: Path) -> None:
    measured = pd.DataFrame([{"area": area, "stage": stage, "ns": ns} for (area, stage), ns in published_ns().items()])
    times = [c for c in cells if c.kind == "time"]
    rows = [{"area": float(c.row.split()[0]), "stage": c.column, "ns": c.ours, "status": c.status} for c in times]
    labels = ("area of a triangle [pixels]", "time for a triangle [ns]")
    title = "Time of each stage, synthetic sweep, GTX 480"
    fitted_lines(pd.DataFrame(rows), measured, path, x="area", y="ns", by="stage", title=title, labels=labels)
