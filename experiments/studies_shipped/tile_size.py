"""Tile size against zoom and bound, on all machines: which tile of the micropolygon pipeline is the fastest where."""

from typing import Any

import pandas as pd

from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Chart, Figure, Result, reported
from tilestamp.experiments.questions import answers
from tilestamp.experiments.studies.study import Study
from tilestamp.experiments.studies_shipped.finding import finding, table_of
from tilestamp.models.machine import list_machines

QUESTION = "Which tile size is the fastest, on which machine, at which zoom and bound?"
SLOW = True  # runs when it is named: tilestamp reproduce studies
TILES, BOUNDS = [4, 8, 16], [2.0, 8.0]
ZOOM = {"from": 0.5, "to": 8, "points": 4, "scale": "log"}
FIXED = {"scene": "teapot", "size": "640x480", "bound_rule": "pixel_extent"}

CHART = Chart(
    name="zoom", kind="lines", table="grid", title="Time of a frame by tile size, on one machine.",
    alt="Lines: time of a frame over zoom, a line for each tile size, for a machine and a bound chosen from lists.",
    of={"x": "zoom", "y": "milliseconds", "color": "tile", "pick": {"machine": "Machine", "bound": "Bound [pixels]"},
        "titles": ["zoom", "time of a frame [ms]"]},
)  # fmt: skip


def run(progress: Progress) -> Result:
    """Price three tiles at four zooms and two bounds, on every machine there is."""
    grid: dict[str, Any] = {"tile": TILES, "bound": BOUNDS, "zoom": ZOOM, "machine": list(list_machines())}
    study = Study(title="tile size", fixed=FIXED, grid=grid)
    table = table_of(study, progress)
    found = answers.best(study, "tile", ["zoom", "machine"])
    best = found.table
    cells = [
        reported(str(machine), f"bound {bound:g}: best tile, far to near", "", " ".join(map(str, rows["best"])))
        for (machine, bound), rows in best.groupby(["machine", "bound"], sort=False)
    ]
    title = "Tile size against zoom and bound: the fastest tile of the micropolygon pipeline, teapot, 640x480"
    figures = [Figure("map", found.draw)]
    return finding(
        "tile_size", title, cells, figures, notes(best, table), {"grid": table, "best": best}, charts=[CHART]
    )


def notes(best: pd.DataFrame, table: pd.DataFrame) -> list[str]:
    """Say which tile is the best where, and what the wrong one costs."""
    counts = best["best"].value_counts()
    told = ", ".join(f"{tile}x{tile} at {count}" for tile, count in counts.items())
    return [
        f"Of {len(best)} places the fastest tile is {told}.",
        *(_where(best, tile) for tile in counts.index[1:]),
        *(_cost(best, table, tile) for tile in TILES),
    ]


def _where(best: pd.DataFrame, tile: int) -> str:
    """Where a tile that is not the usual one is the best."""
    rows = best[best["best"] == tile]
    clear = rows.loc[rows["margin"].idxmax()]
    bounds = " and ".join(f"{bound:g}" for bound in sorted(set(rows["bound"])))
    zooms = f"{rows['zoom'].min():.3g} to {rows['zoom'].max():.3g}"
    machines = ", ".join(f"{name} ({count})" for name, count in rows["machine"].value_counts().items())
    return (
        f"{tile}x{tile} is the fastest at bound {bounds}, zoom {zooms}, on {machines}; most clearly on"
        f" {clear['machine']} (zoom {clear['zoom']:.3g}, bound {clear['bound']:g}), where"
        f" {clear['second']}x{clear['second']} takes {clear['margin']:.0%} longer."
    )


def _cost(best: pd.DataFrame, table: pd.DataFrame, tile: int) -> str:
    """What it costs to take one tile everywhere."""
    places = ["bound", "zoom", "machine"]
    joined = table[table["tile"] == tile].merge(best, on=places, suffixes=("", "_best"))
    ratio = (joined["milliseconds"] / joined["milliseconds_best"]).dropna()
    return f"{tile}x{tile} everywhere: {ratio.median():.2f} times the best in the median, {ratio.max():.2f} at worst."
