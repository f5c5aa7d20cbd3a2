"""Tiles in two scales: coarse tiles by bucketing, fine ones by masks in shared memory or by a second bucket pass.

"Larger and hierarchical tiles" are future work of Eisenacher & Loop 2010. HiGS (2026) has them for splats: binning and
sorting are cheap at large tiles, blending is at small ones, and both together were 1.8 to 2.2 times as fast as the best
single level. Micropolygons are sorted by one pass of atomics, and most of a frame is the raster: does it pay here?
"""

from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from tilestamp.experiments.exploration.ways import SIZE, Way, other_pixels
from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Figure, Result, reported
from tilestamp.experiments.studies_shipped.finding import finding
from tilestamp.models.errors import TilestampError
from tilestamp.reports.choice_map import choice_map
from tilestamp.reports.heatmap import heat_map
from tilestamp.reports.plots import lines
from tilestamp.simulator.run import Run

QUESTION = "Do tiles in two scales pay for micropolygons, on which GPU, at which bound?"
SLOW = True  # runs when it is named: tilestamp reproduce exploration
ALIKE = {"gtx280": ("gtx280",), "h200": ("rtx4090", "h200", "b200")}  # counted alike: executed once
BOUNDS = (2.0, 4.0, 8.0, 16.0)  # pixels
PAIRS = ((16, 4), (16, 8), (32, 8))  # coarse and fine tiles
Ways = dict[str, dict[str, Any]]
SINGLE: Ways = {f"tile {tile}": {"tile": tile} for tile in (4, 8, 16)}
MASKS: Ways = {f"masks, {fine} in {coarse}": {"coarse": coarse, "tile": fine} for coarse, fine in PAIRS}
BUCKETS: Ways = {
    f"buckets, {fine} in 32": {"coarse": 32, "tile": fine, "second_level": "buckets"} for fine in (4, 8)
}  # fmt: skip
FAMILIES = {"one level": SINGLE, "masks": MASKS, "buckets": BUCKETS}
RASTER = "tile_raster"
WORTH = 1.02  # times as fast: less is no gain that the model can tell


SURE = (
    "Counts are executed; the prices of masks and of the second pass are derived by hand. Before compute capability 9"
    " the mix has no chain of dependent instructions for quads: there unequal lists of warps cost nothing, and the gain"
    " of masks is at most what is shown."
)


@cache
def way(name: str, bound: float) -> Way:
    """One way to draw at a bound."""
    return Way(name, {**{k: v for family in FAMILIES.values() for k, v in family.items()}[name], "bound": bound})


def run(progress: Progress) -> Result:
    """Draw with every pair of tiles at every bound, and price on every machine."""
    table = pd.DataFrame(_rows(progress))
    best = pd.DataFrame([_best(rows) for _, rows in table.groupby(["machine", "bound"], sort=False)])
    lists = way("masks, 8 in 32", BOUNDS[1]).run("h200").frame.maps["atomics"]
    figures = [
        Figure("gain", lambda path: _plot(best, path)),
        Figure("best", lambda path: _map(best, path)),
        Figure("lists", lambda path: _lists(lists, path)),
    ]
    cells = [
        reported(row["machine"], f"{family}, bound {row['bound']:g}", "ms", row[family])
        for row in best.to_dict("records")
        for family in FAMILIES
    ]
    title = f"Tiles in two scales: the teapot at {SIZE[0]}x{SIZE[1]}"
    return finding(
        "two_scale", title, cells, figures, _notes(table, best), {"ways": table, "best": best}, folder="exploration"
    )


def _rows(progress: Progress) -> Iterator[dict[str, Any]]:
    for bound in BOUNDS:
        progress(f"exploration/two_scale: bound {bound:g}")
        for family, ways in FAMILIES.items():
            for name in ways:
                for counted, machines in ALIKE.items():
                    found = _run(name, bound, counted)
                    if found:
                        differ = other_pixels(found, way("tile 8", bound).run(counted))
                        yield from (_row(found.on(m), m, bound, family, name) | {"differ": differ} for m in machines)


def _run(name: str, bound: float, machine: str) -> Run | None:
    """A frame, if the machine can launch its blocks."""
    try:
        return way(name, bound).run(machine)
    except TilestampError:
        return None


def _row(run: Run, machine: str, bound: float, family: str, name: str) -> dict[str, Any]:
    stages = run.stages
    return {
        "machine": machine,
        "bound": bound,
        "family": family,
        "way": name,
        "ms": run.milliseconds,
        "buckets_ms": float(stages["milliseconds"].filter(regex="bucket").sum()),
        "raster_ms": float(stages["milliseconds"][RASTER]),
        "held_by": stages["bound"][RASTER],
        "quad_warps": run.counts[f"{RASTER}.QUAD_WARPS"],
        "entries": run.frame.facts["patches_written"],
    }


def _best(rows: pd.DataFrame) -> dict[str, Any]:
    """The best way of each family at one bound on one machine, and by how much the best of two scales gains."""
    of_family = {family: rows[rows.family == family].ms.min() for family in FAMILIES}
    two = min(of_family["masks"], of_family["buckets"])
    ordered = rows.sort_values("ms")
    return {
        "machine": rows.machine.iloc[0],
        "bound": rows.bound.iloc[0],
        **of_family,
        "gain": of_family["one level"] / two,
        "best": ordered.way.iloc[0],
        "margin": ordered.ms.iloc[1] / ordered.ms.iloc[0] - 1,
    }


def _notes(table: pd.DataFrame, best: pd.DataFrame) -> list[str]:
    """Where two scales pay, and why not elsewhere."""
    gains = "; ".join(
        f"{machine} {', '.join(f'{gain:.2f}' for gain in rows.gain)}"
        for machine, rows in best.groupby("machine", sort=False)
    )
    won = best[best.gain >= WORTH].best.value_counts()
    how = ", ".join(f"{name} {count} times" for name, count in won.items()) or "none"
    bounds = ", ".join(f"{bound:g}" for bound in BOUNDS)
    answer = (
        f"The best two scales are so many times as fast as the best single level, at bounds of {bounds} pixels:"
        f" {gains}. Where they gain {100 * (WORTH - 1):.0f} % or more the best way is: {how}."
        " HiGS has 1.8 to 2.2 for splats."
    )
    return [
        answer,
        *(_why(table[(table.machine == m) & (table.bound == BOUNDS[1])], m) for m in ALIKE),
        f"{table.differ.sum()} pixels of all pictures differ from those of one level of 8x8 tiles. {SURE}",
    ]


def _why(rows: pd.DataFrame, machine: str) -> str:
    """What masks and buckets change at the paper's bound."""
    one = rows[rows.family == "one level"].sort_values("ms").iloc[0]
    masks = rows[rows.family == "masks"].sort_values("ms").iloc[0]
    buckets = rows[rows.family == "buckets"].sort_values("ms").iloc[0]
    return (
        f"{machine}, bound {one.bound:g}: of {one.ms:.3g} ms with {one.way} bucketing is"
        f" {100 * one.buckets_ms / one.ms:.0f} %; {buckets.way}: that takes {buckets.buckets_ms / one.buckets_ms:.1f}"
        f" times as long, as fewer counters are contended for. {masks.way.capitalize()}: warps look at"
        f" {masks.quad_warps / one.quad_warps:.2f} times the quads, and the raster takes"
        f" {masks.raster_ms / one.raster_ms:.2f} times the time (held by {masks.held_by}; one level by {one.held_by})."
    )


def _plot(best: pd.DataFrame, path: Path) -> None:
    lines(
        best, path, x="bound", y="gain", by="machine", log_x=True, title="Best two scales over the best single level",
        x_label="bound [pixels]", y_label="times as fast",
    )  # fmt: skip


def _map(best: pd.DataFrame, path: Path) -> None:
    choice_map(
        best.assign(scene="teapot"), path, x="bound", y="machine", panel="scene", title="The fastest way",
        legend="tiles",
    )  # fmt: skip


def _lists(lists: NDArray[np.int64], path: Path) -> None:
    busy = lists[lists > 0]
    title = f"Grids in the list of each 32x32 tile: {busy.max()} at most, {np.mean(busy):.0f} in the mean"
    heat_map(lists, path, title=title, unit="grids", size=SIZE, tile=32)
