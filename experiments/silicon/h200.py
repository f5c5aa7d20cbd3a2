"""H200: hardware counters and times of CudaRaster, FreePipe and the micropolygon back end beside the model's."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from tilestamp.experiments.harness.result import Cell, Figure, Result, Status
from tilestamp.experiments.silicon.inputs import write_inputs
from tilestamp.experiments.silicon.seen_scenes import SEEN, seen_scenes
from tilestamp.experiments.validation.quantities import SHORTEST_US, TIME, WALL
from tilestamp.experiments.validation.stored import compare
from tilestamp.experiments.validation.summary import by_kernel, by_scene, fastest_tiles
from tilestamp.models.machine import load_machine
from tilestamp.reports.plots import paired_bars

if TYPE_CHECKING:
    import pandas as pd

SLOW = True  # with what it needs compiled, more than the first run should take

SOURCE = "One NVIDIA H200, CUDA 13.0: experiments/silicon/measured/seen/README.md"
CONSTANTS = "teapot_512x512_bb4"  # scene whose tile raster times gave S2UR, BRANCH and pipe.control
FITTED = {  # quantities that gave a mix a number, on every scene and width: see leave_one_out for what that is worth
    "triangleSetup": {"instructions", "SIMD efficiency", TIME},
    "binRaster": {"instructions", "SIMD efficiency", TIME},
    "coarseRaster": {"instructions", "SIMD efficiency", TIME},
    "fineRaster": {"instructions", "SIMD efficiency"},
    "freepipe": {"instructions", TIME},
    "freepipe_early": {"instructions", TIME},
}


def run(progress: Callable[[str], None]) -> Result:
    """Predict every measured kernel."""
    with TemporaryDirectory() as folder:
        left_out = write_inputs(Path(folder), seen_scenes())
        table = compare(SEEN, load_machine("h200"), progress, inputs=Path(folder), left_out=left_out)
    walls = table[table.quantity == WALL].ours
    table = table[table.quantity != WALL].copy()
    table["status"] = [status(*row) for row in table[["scene", "kernel", "quantity"]].itertuples(index=False)]
    predicted = table[table.status == "predicted"]
    scenes = by_scene(predicted)
    tiles = fastest_tiles(table)
    clear = tiles[tiles.clear]
    notes = [
        f"Micropolygon mixes are read from machine code; three constants of the times are fitted, on {CONSTANTS}.",
        f"Fastest tile: right in {int((clear.ours == clear.measured).sum())} of {len(clear)} clear cases (10 %).",
        f"A prediction takes {walls.mean():.2f} s on average, {walls.max():.1f} s at most (two cores).",
        *_worst(predicted),
    ]
    tables = {
        "all": table,
        "kernels": by_kernel(predicted),
        "fitted-cells": by_kernel(table[table.status == "fitted"]),
        "left-out-scenes": scenes,
        "fastest-tile": tiles,
    }
    return Result(
        name="silicon-h200",
        title="H200, model against machine",
        source=SOURCE,
        cells=_cells(table),
        figures=_figures(table),
        notes=notes,
        warnings=left_out,
        tables=tables,
    )


def status(scene: str, kernel: str, quantity: str) -> Status:
    """Whether a number of the model was chosen on this cell."""
    if kernel.startswith("k_raster"):
        return "fitted" if scene == CONSTANTS and quantity == TIME else "predicted"
    return "fitted" if quantity in FITTED.get(kernel.removesuffix(" as published"), set()) else "predicted"


def _cells(table: "pd.DataFrame") -> list[Cell]:
    """Times of kernels over 5 microseconds, instructions, and whatever should be exact."""
    shown = table[table.quantity.isin(["instructions", "atomic instructions", TIME])]
    shown = shown[(shown.quantity != TIME) | (shown.measured > SHORTEST_US)]
    cells = []
    for r in shown.itertuples():
        label = f"{r.scene} {r.W}" + (f" tile {r.tile}" if r.tile else "") + (f" spp {r.spp}" if r.spp else "")
        unit = "us" if r.quantity == TIME else ""
        cells.append(
            Cell(label, f"{r.kernel} {r.quantity}", unit, published=r.measured, ours=r.ours, status=r.status, aim=r.aim)
        )
    return cells


def _figures(table: "pd.DataFrame") -> list[Figure]:
    """Times of the tile raster by tile size, a plot a scene."""
    figures = []
    rows = table[(table.quantity == TIME) & (table.kernel == "k_raster")]
    for scene, group in rows.groupby("scene", sort=False):
        bars = group.assign(label=[f"{t} px, {s} spp" for t, s in zip(group.tile, group.spp, strict=True)])
        figures.append(Figure(f"raster-{scene}", partial(_bars, bars, str(scene))))
    return figures


def _bars(bars: "pd.DataFrame", scene: str, path: Path) -> None:
    paired_bars(
        bars, path, label="label", ours="ours", published="measured", status="status",
        title=f"Tile raster of {scene} (H200)", y_label="us", known="measured",
    )  # fmt: skip


def _worst(table: "pd.DataFrame") -> list[str]:
    """Mean and worst error of the times of each kernel."""
    rows = by_kernel(table)
    rows = rows[rows.quantity == TIME]
    return [
        f"Time of {r.kernel}{f' at {r.spp} spp' if r.spp else ''}: {r.cells} predicted cells, "
        f"mean error {100 * m:.0f} %, worst {100 * r.worst:.0f} %."
        for r, m in zip(rows.itertuples(), rows["mean"], strict=True)
    ]
