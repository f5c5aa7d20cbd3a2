"""H200: hardware counters and times of CudaRaster, FreePipe and the micropolygon back end beside the model's."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple, cast

import pandas as pd

from tilestamp.experiments.harness.result import Cell, Figure, Result, Status
from tilestamp.experiments.silicon.inputs import write_inputs
from tilestamp.experiments.silicon.seen_scenes import SEEN, seen_scenes
from tilestamp.experiments.validation.quantities import SHORTEST_US, TIME, WALL
from tilestamp.experiments.validation.stored import Execution, compare, executions
from tilestamp.experiments.validation.summary import by_kernel, by_scene, fastest_tiles
from tilestamp.models.fitted import names_cell
from tilestamp.models.machine import load_machine
from tilestamp.models.used import FITTED, collect
from tilestamp.reports.bars import paired_bars

QUESTION = "How far off are times and counters on an H200, on scenes that some number was fitted to?"
SLOW = True  # with what it needs compiled, more than the first run should take

NAME = "silicon-h200"
SOURCE = "One NVIDIA H200, CUDA 13.0: experiments/silicon/measured/seen/README.md"


def run(progress: Callable[[str], None]) -> Result:
    """Predict every measured kernel."""
    executed, left_out = _executed(progress)
    with collect() as used:
        table = compare(SEEN, executed)
    walls = table[table.quantity == WALL].ours
    table = table[table.quantity != WALL].copy()
    targets = [target for cells in used[FITTED].values() for target in cells]
    table["status"] = [status(targets, _cell_of(cast("_Row", row))) for row in table.itertuples()]
    predicted = table[table.status == "predicted"]
    scenes = by_scene(predicted)
    tiles = fastest_tiles(table)
    clear = tiles[tiles.clear]
    notes = [
        (
            "Micropolygon mixes are read from machine code; two constants of their chains (an S2UR, a branch) and the "
            "machine's pipe.control are fitted, on teapot_512x512_bb4."
        ),
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
    title = "H200, model against machine"
    return Result(
        NAME, title, SOURCE, _cells(table), figures=_figures(table), notes=notes, warnings=left_out, tables=tables
    )


_kept: dict[str, tuple[list[Execution], list[str]]] = {}


def _executed(progress: Callable[[str], None]) -> tuple[list[Execution], list[str]]:
    """Execute every measured kernel, once, and say what was left out."""
    if SOURCE not in _kept:
        with TemporaryDirectory() as folder:
            left_out = write_inputs(Path(folder), seen_scenes())
            executed = executions(SEEN, load_machine("h200"), progress, inputs=Path(folder), left_out=left_out)
            _kept[SOURCE] = list(executed), left_out
    return _kept[SOURCE]


def status(targets: list[str], cell: Cell) -> Status:
    """Whether a number of the model was fitted to this quantity; of cells that are shown, more is computed."""
    place = cell.frame, NAME, cell.row, cell.column
    return "fitted" if any(names_cell(target, place) for target in targets) else "predicted"


def _cells(table: pd.DataFrame) -> list[Cell]:
    """Times of kernels over 5 microseconds, instructions, and whatever should be exact."""
    shown = table[table.quantity.isin(["instructions", "atomic instructions", TIME])]
    shown = shown[(shown.quantity != TIME) | (shown.measured > SHORTEST_US)]
    return [_cell_of(cast("_Row", row)) for row in shown.itertuples()]


class _Row(NamedTuple):
    """What a cell needs of a row of the table."""

    scene: str
    W: int
    tile: int
    spp: int
    kernel: str
    quantity: str
    ours: float
    measured: float
    aim: float | None


def _cell_of(r: _Row) -> Cell:
    label = f"{r.scene} {r.W}" + (f" tile {r.tile}" if r.tile else "") + (f" spp {r.spp}" if r.spp else "")
    unit = "us" if r.quantity == TIME else ""
    column = f"{r.kernel} {r.quantity}"
    return Cell(label, column, unit, published=r.measured, ours=r.ours, aim=r.aim, frame=f"{r.scene} {r.W}")


def _figures(table: pd.DataFrame) -> list[Figure]:
    """Times of the tile raster by tile size, a plot a scene."""
    figures = []
    rows = table[(table.quantity == TIME) & (table.kernel == "k_raster")]
    for scene, group in rows.groupby("scene", sort=False):
        bars = group.assign(label=[f"{t} px, {s} spp" for t, s in zip(group.tile, group.spp, strict=True)])
        draw = partial(paired_bars, bars, title=f"Tile raster of {scene} (H200)", unit="us", known="measured")
        figures.append(Figure(f"raster-{scene}", draw))
    return figures


def _worst(table: pd.DataFrame) -> list[str]:
    """Mean and worst error of the times of each kernel."""
    rows = by_kernel(table)
    rows = rows[rows.quantity == TIME]
    return [
        f"Time of {r.kernel}{f' at {r.spp} spp' if r.spp else ''}: {r.cells} predicted cells, "
        f"mean error {100 * m:.0f} %, worst {100 * r.worst:.0f} %."
        for r, m in zip(rows.itertuples(), rows["mean"], strict=True)
    ]
