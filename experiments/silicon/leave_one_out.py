"""One scene left out: what fitted constants are worth on a scene that they never saw.

The mixes of CudaRaster and FreePipe are read from machine code; a few numbers in them are fitted
(``cudaraster_mix.FITTED``, ``freepipe_mix``). Here each scene is left out in turn, the instructions of the fitted
events are fitted anew to the others, and the scene is predicted with them; chains are fitted anew by one factor a
kernel. Narrow screens only, unless ``TILESTAMP_LEAVE_OUT_WIDTH`` says how wide. Ru's tiled raster is another file's
(``leave_one_out_tiled``).
"""

import os
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.experiments.calibration import cudaraster_mix, freepipe_mix
from tilestamp.experiments.harness.result import Cell, Result
from tilestamp.experiments.silicon.h200 import SOURCE
from tilestamp.experiments.silicon.inputs import write_inputs
from tilestamp.experiments.silicon.leave_one_out_tiled import tiled_cells
from tilestamp.experiments.silicon.seen_scenes import SEEN, seen_scenes
from tilestamp.experiments.validation.quantities import SHORTEST_US, TIME_METRIC, warm_microseconds
from tilestamp.experiments.validation.stored import CUDARASTER, FREEPIPE, cudaraster_works, freepipe_works, read
from tilestamp.models.errors import MissingInputError
from tilestamp.models.events import INSTRUCTION_CLASSES
from tilestamp.models.events import MachineEvent as E
from tilestamp.models.launch import Launch
from tilestamp.models.machine import Machine, load_machine
from tilestamp.simulator.mix import load_mix
from tilestamp.simulator.work import Work

QUESTION = "How well do fitted constants predict a scene that was left out of their fit?"
SLOW = True  # counts every scene

WIDTH = "TILESTAMP_LEAVE_OUT_WIDTH"
FITTED = cudaraster_mix.FITTED | freepipe_mix.FITTED
FACTORS = np.linspace(0.8, 1.25, 10)  # of all chains of a kernel, beside those of the mix
INSTRUCTIONS = "smsp__inst_executed.sum"
AIM_INSTRUCTIONS, AIM_TIME = 0.02, 0.40


def run(progress: Callable[[str], None]) -> Result:
    """Leave each scene out of the fits in turn."""
    machine = load_machine("h200")
    with TemporaryDirectory() as folder:
        left_out = write_inputs(Path(folder), seen_scenes())
        rows = list(_rows(machine, progress, Path(folder)))
    cells = []
    for kernel in FITTED:
        mine = [row for row in rows if row["kernel"] == kernel]
        for scene in {row["scene"]: None for row in mine}:
            seen = [row for row in mine if row["scene"] != scene]
            left = [row for row in mine if row["scene"] == scene]
            factor = _factor(seen)
            costs = refit(kernel, seen)
            for row in left:
                label = f"{scene} {row['W']}"
                ours = _disassembled(kernel, row) + float(row["counts"] @ costs)
                published = row["instructions"]
                cells.append(
                    Cell(label, f"{kernel} instructions", "", published=published, ours=ours, aim=AIM_INSTRUCTIONS)
                )
                if row["us"] > SHORTEST_US:
                    cells.append(
                        Cell(label, f"{kernel} time", "us", published=row["us"], ours=_at(row, factor), aim=AIM_TIME)
                    )
    try:
        cells += tiled_cells(progress)
    except MissingInputError as missing:
        left_out.append(str(missing))
    title = "H200, one scene left out of the fit"
    return Result("silicon-leave_one_out", title, SOURCE, cells, notes=_notes(cells), warnings=left_out)


def _rows(machine: Machine, say: Callable[[str], None], inputs: Path) -> Iterator[dict[str, Any]]:
    """Measured and counted, a kernel of a scene each."""
    widest = int(os.environ.get(WIDTH, "512"))
    for name, works in ((CUDARASTER, cudaraster_works), (FREEPIPE, freepipe_works)):
        measured = read(SEEN / name)
        mix = load_mix("cudaraster" if name == CUDARASTER else "freepipe", machine.compute_capability)
        for key, work in works(SEEN, machine, say, widest, inputs):
            if key[4] in FITTED and (*key, INSTRUCTIONS) in measured and (*key, TIME_METRIC) in measured:
                launch = mix.launch(work, machine.sm.warp_size)
                yield {
                    "scene": key[0],
                    "W": key[1],
                    "kernel": key[4],
                    "instructions": measured[(*key, INSTRUCTIONS)],
                    "us": measured[(*key, TIME_METRIC)],
                    "ours": float(launch.events[:, list(INSTRUCTION_CLASSES)].sum()),
                    "counts": _counts(key[4], work),
                    "times": np.array([warm_microseconds(_stretched(launch, f), machine) for f in FACTORS]),
                }


def _counts(kernel: str, work: Work) -> NDArray[np.float64]:
    """How often the fitted events of a kernel happened."""
    return np.array([work.total(work.events[event]) for event in FITTED[kernel]], np.float64)


def _stretched(launch: Launch, factor: float) -> Launch:
    """The launch with longer arithmetic chains."""
    events = launch.events.copy()
    events[:, E.CHAIN_ALU] *= factor
    return replace(launch, events=events)


def _disassembled(kernel: str, row: dict[str, Any]) -> float:
    """Instructions without those of the fit."""
    costs = np.array([count for count, _ in FITTED[kernel].values()])
    return float(row["ours"] - row["counts"] @ costs)


def refit(kernel: str, rows: list[dict[str, Any]]) -> NDArray[np.float64]:
    """Instructions of each fitted event, least squares of relative errors."""
    measured = np.array([row["instructions"] for row in rows])
    rest = np.array([_disassembled(kernel, row) for row in rows])
    counts = np.stack([row["counts"] for row in rows])
    costs: NDArray[np.float64] = np.linalg.lstsq(counts / measured[:, None], 1.0 - rest / measured, rcond=None)[0]
    return costs


def _factor(rows: list[dict[str, Any]]) -> int:
    """Which factor of the chains fits the times of some scenes best."""
    errors = np.stack([row["times"] / row["us"] - 1.0 for row in rows if row["us"] > SHORTEST_US] or [FACTORS - 1.0])
    return int(np.argmin((errors**2).sum(axis=0)))


def _at(row: dict[str, Any], factor: int) -> float:
    return float(row["times"][factor])


def _notes(cells: list[Cell]) -> list[str]:
    """Mean and worst error by kernel and quantity."""
    notes = []
    for column in {cell.column: None for cell in cells}:
        errors = [abs(cell.error or 0.0) for cell in cells if cell.column == column]
        mean, worst = 100 * float(np.mean(errors)), 100 * max(errors)
        notes.append(f"{column}: {len(errors)} cells, mean error {mean:.1f} %, worst {worst:.1f} %.")
    return notes
