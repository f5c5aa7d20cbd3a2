"""Overlap: coverage tests that a tile does in vain, because what it shows already lies in front of a whole grid.

"High overlap results in unnecessary coverage tests" (Eisenacher & Loop 2010, section 5). Two cures: a tile passes over
grids that are nowhere nearer than the farthest depth it shows, in the order of its list, or front to back after a sort
in shared memory. Both are tried on the teapot, and on sheets that cover the screen, one behind the other, in any order.
"""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from tilestamp.experiments.exploration.ways import MACHINES, SIZE, Way, other_pixels
from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Figure, Result, reported
from tilestamp.experiments.stability.patch_frames import flat_patch
from tilestamp.experiments.studies_shipped.finding import finding
from tilestamp.reports.heatmap import heat_map
from tilestamp.reports.plots import lines
from tilestamp.simulator.scenes.scene import Patches, Scene

QUESTION = (
    "What do coverage tests that overlap makes unnecessary cost, and what is left of that by sorting and culling?"
)
SLOW = True  # runs when it is named: tilestamp reproduce exploration
CULLS = ("none", "behind", "sorted")
TILES = (4, 8)  # pixels a side
LAYERS = (1, 2, 4, 8, 16)  # sheets one behind the other
SMALL = (192, 144)  # pixels, of the sheets
SEED = 5
ENDS = (-1.037, 1.021)  # of a sheet, in clip space
TILT = 0.4  # of the distance of two sheets
RASTER = "tile_raster"


@cache
def teapot(cull: str, tile: int) -> Way:
    """The teapot."""
    return Way(f"teapot, tile {tile}, {cull}", {"cull": cull, "tile": tile})


@cache
def sheets(cull: str, layers: int) -> Way:
    """Sheets in any order of depth, each tilted to its side, with no edge of a grid through the centre of a pixel."""
    depths = np.random.default_rng(SEED).permutation(layers) / LAYERS[-1] - 0.5
    tilts = TILT / LAYERS[-1] * (-1.0) ** np.arange(layers)
    corners = [[[[x, y, z + t * x] for x in ENDS] for y in ENDS] for z, t in zip(depths, tilts, strict=True)]
    scene = Scene(f"{layers} sheets", Patches(np.concatenate([flat_patch(corner) for corner in corners])))
    return Way(f"{layers} sheets, {cull}", {"cull": cull}, scene, SMALL)


def run(progress: Progress) -> Result:
    """Draw the teapot and the sheets with each way of culling."""
    rows = []
    for tile in TILES:
        progress(f"exploration/overlap: teapot, tile {tile}")
        rows += [_row(teapot(cull, tile), teapot("none", tile), m, cull, tile=tile) for m in MACHINES for cull in CULLS]
    for layers in LAYERS:
        progress(f"exploration/overlap: {layers} sheets")
        rows += [
            _row(sheets(cull, layers), sheets("none", layers), m, cull, layers=layers)
            for m in MACHINES
            for cull in CULLS
        ]
    table = pd.DataFrame(rows)
    ratios = _ratios(table)
    culled = 1 - teapot("sorted", 8).run("h200").frame.maps["tests"] / np.maximum(
        teapot("none", 8).run("h200").frame.maps["tests"], 1
    )
    cells = [
        reported(f"{row['scene']}, {row['what']}, {row['cull']}", f"{name}, {row['machine']}", unit, row[column])
        for row in table.to_dict("records")
        for name, column, unit in (("tests", "tests", ""), ("frame", "ms", "ms"))
    ]
    figures = [
        Figure("sheets", lambda path: _plot(ratios, path)),
        Figure("spared", lambda path: _map(100 * culled, path)),
    ]
    title = f"Overlap: the teapot at {SIZE[0]}x{SIZE[1]}, sheets at {SMALL[0]}x{SMALL[1]}"
    return finding("overlap", title, cells, figures, _notes(ratios), {"ways": table}, folder="exploration")


def _row(way: Way, plain: Way, machine: str, cull: str, tile: int = 8, layers: int = 0) -> dict[str, Any]:
    run = way.run(machine)
    counts = run.counts
    listed = counts.get(f"{RASTER}.LISTED", counts[f"{RASTER}.GRIDS"])
    return {
        "scene": "sheets" if layers else "teapot",
        "what": f"{layers} layers" if layers else f"tile {tile}",
        "layers": layers,
        "machine": machine,
        "cull": cull,
        "tests": counts[f"{RASTER}.SAMPLE_TESTS"],
        "culled_share": counts.get(f"{RASTER}.CULLED", 0) / listed,
        "sort_steps": counts.get(f"{RASTER}.SORT_STEPS", 0),
        "raster_ms": float(run.stages["milliseconds"][RASTER]),
        "ms": run.milliseconds,
        "other_pixels": other_pixels(run, plain.run(machine)),
    }


def _ratios(table: pd.DataFrame) -> pd.DataFrame:
    """Tests and times over those without culling."""
    keys = ["scene", "what", "machine"]
    plain = table[table.cull == "none"].set_index(keys)
    joined = table.join(plain[["tests", "raster_ms", "ms"]].add_suffix("_none"), on=keys)
    for column in ("tests", "raster_ms", "ms"):
        joined[f"{column}_ratio"] = joined[column] / joined[f"{column}_none"]
    return joined


def _notes(ratios: pd.DataFrame) -> list[str]:
    """What culling spares, and whether sorting is worth its price."""
    pot = ratios[ratios.scene == "teapot"].set_index(["what", "machine", "cull"])
    said = []
    for tile in TILES:
        spared = {cull: 100 * (1 - pot.tests_ratio[f"tile {tile}", "h200", cull]) for cull in CULLS[1:]}
        times = "; ".join(f"{m} {_times(pot.ms[f'tile {tile}', m])}" for m in MACHINES)
        said.append(
            f"Teapot, tiles of {tile}: culling spares {spared['behind']:.0f} % of the tests in list order and"
            f" {spared['sorted']:.0f} % sorted; frames: {times}."
        )
    deep = ratios[(ratios.scene == "sheets") & (ratios.machine == "h200")]
    said.append(
        "Sheets, h200, frame over that without culling, in list order and sorted: "
        + "; ".join(
            f"{rows.layers.iloc[0]} layers {rows.ms_ratio[rows.cull == 'behind'].iloc[0]:.2f} and"
            f" {rows.ms_ratio[rows.cull == 'sorted'].iloc[0]:.2f}"
            for _, rows in deep.groupby("what", sort=False)
        )
        + "."
    )
    differ = f"{ratios.other_pixels.sum()} pixels of all pictures differ from those without culling."
    sure = "Counts are executed; prices of votes, of the farthest depth and of the sort are derived by hand."
    return [*said, f"{differ} {sure}"]


def _times(ms: "pd.Series[float]") -> str:
    return f"{ms['none']:.3g} ms, {ms['behind']:.3g} culled in list order, {ms['sorted']:.3g} sorted"


def _plot(ratios: pd.DataFrame, path: Path) -> None:
    deep = ratios[(ratios.scene == "sheets") & (ratios.cull != "none")]
    lines(
        deep.assign(line=deep.machine + ", " + deep.cull), path, x="layers", y="ms_ratio", by="line", log_x=True,
        title="Frame time over that without culling, by depth of the scene", x_label="sheets", y_label="time over none",
    )  # fmt: skip


def _map(share: NDArray[np.float64], path: Path) -> None:
    title = "Coverage tests that sorted culling spares, by tile"
    heat_map(np.where(share > 0, share, np.nan), path, title=title, unit="tests spared [%]", size=SIZE, tile=8)
