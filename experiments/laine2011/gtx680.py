"""The sweep of Figure 5 on a GTX 680 beside a GTX 480: the same mixes, another machine file (a prediction)."""

from pathlib import Path

import pandas as pd

from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Cell, Figure, Result, reported
from tilestamp.experiments.laine2011.sweep import MACHINE, SOURCE, STAGES, areas, draw, nanoseconds
from tilestamp.reports.plots import lines

QUESTION = "How would the sweep of Figure 5 run on a GTX 680?"
SLOW = True  # with what it needs compiled, more than the first run should take

OTHER = "gtx680"


def run(progress: Progress) -> Result:
    """Price the drawn areas on both machines."""
    cells: list[Cell] = []
    rows = []
    for area in areas():
        progress(f"laine2011/gtx680: {area:g} pixels a triangle")
        made, triangles = draw(area)
        there, _ = draw(area, OTHER)
        old, new = nanoseconds(made, triangles), nanoseconds(there, triangles)
        for stage in STAGES:
            cells.append(reported(f"{area:g} px", stage, f"ns/triangle, {OTHER}", new[stage]))
            cells.append(reported(f"{area:g} px", stage, f"{OTHER} : {MACHINE}", new[stage] / old[stage]))
            bound = str(there.stages.loc[stage, "bound"])
            rows.append(
                {"area": area, "stage": stage, "ns": new[stage], "ratio": new[stage] / old[stage], "bound": bound}
            )
    table = pd.DataFrame(rows)
    title = "The sweep on a GTX 680, by the mixes of the GTX 480"
    answer = f"In {table['ratio'].min():.2f} to {table['ratio'].max():.2f} times a GTX 480's time, by stage."
    figures = [Figure("ratio", lambda path: _draw(table, path))]
    notes = [
        (
            "A prediction without a measured cell here: nothing is fitted to a GTX 680, and its machine file is "
            "made of published parameters. Only the machine file differs; code compiled for 3.0 would differ too."
        ),
        "Stages that wait for dependent instructions have 8 SMs instead of 15, and shorter latencies on each.",
    ]
    return Result(
        "laine2011-gtx680", title, SOURCE, cells, answer, figures=figures, notes=notes, tables={"sweep": table}
    )


def _draw(table: pd.DataFrame, path: Path) -> None:
    lines(
        table, path, x="area", y="ratio", by="stage",
        title="Time on a GTX 680 over time on a GTX 480, synthetic sweep (model)",
        x_label="area of a triangle [pixels]", y_label="time on GTX 680 : GTX 480",
    )  # fmt: skip
