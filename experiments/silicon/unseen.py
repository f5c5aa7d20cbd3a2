"""H200, unseen: scenes that no number of the mixes was fitted to, model beside machine.

Thirteen scenes at three sizes through CudaRaster and FreePipe, five through the micropolygon back end
(``measured/unseen/README.md``). None of them gave a mix or the machine a number, so all cells are predictions.
``TILESTAMP_UNSEEN_WIDTH`` leaves out wider screens (1024: a minute; all: several).
"""

import os
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import pandas as pd

from tilestamp.experiments.harness.result import Cell, Result
from tilestamp.experiments.silicon.inputs import write_inputs
from tilestamp.experiments.silicon.unseen_scenes import unseen_scenes
from tilestamp.experiments.validation.quantities import SHORTEST_US, TIME, WALL
from tilestamp.experiments.validation.stored import compare, executions
from tilestamp.experiments.validation.summary import by_kernel, by_scene, fastest_tiles
from tilestamp.models.machine import load_machine

QUESTION = "How far off are times and counters on an H200, on scenes that no number was fitted to?"
SLOW = True  # counts 13 scenes at up to 2048 pixels

WIDTH = "TILESTAMP_UNSEEN_WIDTH"
MEASURED = Path(__file__).parent / "measured" / "unseen"
SOURCE = "One NVIDIA H200, 2026-11-22: experiments/silicon/measured/unseen/README.md"
SHOWN = ("instructions", "atomic instructions", TIME)


def run(progress: Callable[[str], None]) -> Result:
    """Predict every kernel of the unseen scenes."""
    with TemporaryDirectory() as folder:
        left_out = write_inputs(Path(folder), unseen_scenes())
        widest = int(os.environ.get(WIDTH, "2048"))
        inputs = Path(folder)
        executed = executions(
            MEASURED, load_machine("h200"), progress, inputs=inputs, widest=widest, guard_band=True, left_out=left_out
        )
        table = compare(MEASURED, executed)
    walls = table[table.quantity == WALL].ours
    table = table[table.quantity != WALL]
    kernels = by_kernel(table)
    tiles = fastest_tiles(table)
    clear = tiles[tiles.clear]
    notes = [
        f"Fastest tile: right in {int((clear.ours == clear.measured).sum())} of {len(clear)} clear cases (10 %).",
        f"A prediction takes {walls.mean():.2f} s on average, {walls.max():.1f} s at most (two cores).",
        *all_times(table),
        *sentences(kernels),
    ]
    tables = {"all": table, "kernels": kernels, "scenes": by_scene(table), "fastest-tile": tiles}
    title = "H200, scenes that nothing was fitted to"
    return Result("silicon-unseen", title, SOURCE, cells_of(table), notes=notes, warnings=left_out, tables=tables)


def all_times(table: pd.DataFrame) -> list[str]:
    """Mean and worst error of all times over 5 us."""
    times = table[(table.quantity == TIME) & (table.measured > SHORTEST_US)].error.abs()
    return [
        f"All {len(times)} times over 5 us: mean error {100 * times.mean():.1f} %, worst {100 * times.max():.0f} %."
    ]


def sentences(kernels: pd.DataFrame) -> list[str]:
    """Mean and worst error of each kernel and quantity."""
    return [
        f"{r.kernel}{f' at {r.spp} spp' if r.spp else ''}, {r.quantity}: {r.cells} cells, "
        f"mean error {100 * mean:.1f} %, worst {100 * r.worst:.1f} %."
        for r, mean in zip(kernels.itertuples(), kernels["mean"], strict=True)
    ]


def cells_of(table: pd.DataFrame) -> list[Cell]:
    """Times over 5 us, instructions, and what should be exact."""
    shown = table[table.quantity.isin(SHOWN)]
    shown = shown[(shown.quantity != TIME) | (shown.measured > SHORTEST_US)]
    cells = []
    for r in shown.itertuples():
        label = f"{r.scene} {r.W}" + (f" tile {r.tile}" if r.tile else "") + (f" spp {r.spp}" if r.spp else "")
        unit = "us" if r.quantity == TIME else ""
        column, frame = f"{r.kernel} {r.quantity}", f"{r.scene} {r.W}"
        cells.append(Cell(label, column, unit, published=r.measured, ours=r.ours, aim=r.aim, frame=frame))
    return cells
