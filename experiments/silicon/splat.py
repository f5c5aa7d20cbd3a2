"""H200, Gaussian splats: the published kernels beside ours, on the same inputs (``splat_inputs``).

Every kernel of every configuration: five tile sizes with the published square of three sigmas, three with exact
ellipses, on two screens. A frame follows frames like it, so caches hold what the one before left.
"""

from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, cast

import pandas as pd

from tilestamp.experiments.harness.result import Cell, Figure, Result, Status
from tilestamp.experiments.silicon.splat_inputs import MEASURED, PIPELINE, Measured, measured_scenes, read_measured
from tilestamp.experiments.silicon.textured_compare import FRAME_TIME, by_kernel, entry, sentences
from tilestamp.experiments.splats.executed import executed
from tilestamp.experiments.splats.host import host_ms
from tilestamp.experiments.validation.quantities import QUANTITIES, SHORTEST_US, TIME
from tilestamp.models.launch import Launch
from tilestamp.models.machine import load_machine
from tilestamp.models.price import price
from tilestamp.reports.bars import paired_bars
from tilestamp.simulator.run import Run

QUESTION = "How far off are the splat rasterizer's kernels on an H200, and which tile is the fastest?"
SLOW = True  # draws every measured frame

NAME = "silicon-splat"
SOURCE = "One NVIDIA H200, CUDA 13.0, 2026-11-29: experiments/silicon/measured/splat/README.md"
OURS = {"project": "preprocess", "blend": "render"}  # names of the published sources, where they are others
AIMS = {TIME: 0.1, "instructions": 0.03, "load sectors": 0.05, "store sectors": 0.05}
CLEAR = 0.1  # of the fastest tile's time: measured times that differ by more are told apart


def run(progress: Callable[[str], None]) -> Result:
    """Draw and price every measured frame."""
    found: list[dict[str, Any]] = []
    scenes, missing = measured_scenes()
    for file, scene in scenes:
        name = file.name.removesuffix("_scene.json")
        for measured in read_measured(file, scene):
            progress(f"{name} {measured.label}")
            found += [{"scene": name, "config": measured.label} | row for row in compared(measured)]
    if not found:
        return Result(NAME, TITLE, SOURCE, [], warnings=missing)
    table = pd.DataFrame(found)
    tiles = fastest_tiles(table)
    clear = tiles[tiles.clear]
    right = f"Fastest tile: right in {int((clear.ours == clear.measured).sum())} of {len(clear)} clear cases (10 %)."
    figures = [
        Figure(
            f"tiles-{name}",
            partial(
                paired_bars,
                rows.assign(status="predicted", label=rows.config),
                title=f"Frames of {name} (H200)",
                unit="us",
                known="measured",
            ),
        )
        for name, rows in table[table.quantity == FRAME_TIME].groupby("scene", sort=False)
    ]
    notes = [right, *sentences(table)]
    tables = {"all": table, "kernels": by_kernel(table), "fastest-tile": tiles}
    return Result(NAME, TITLE, SOURCE, cells(table), figures=figures, notes=notes, warnings=missing, tables=tables)


TITLE = "H200, Gaussian splats, model against machine"
MADE_FROM = {path.name.removesuffix("_scene.json") for path in MEASURED.glob("*_scene.json")}
"""Scenes from whose counters the mix was made: that its instructions are theirs is no prediction."""


def compared(measured: Measured) -> Iterator[dict[str, Any]]:
    """Ours beside what was measured of each kernel: time, and counters where it was profiled; and of the frame."""
    frame = draw(measured)
    machine = load_machine("h200")
    launches = [cast("Launch", launch) for launch in frame.launches]
    timings = price([*launches, *launches], machine)[len(launches) :]
    total = 0.0
    for kernel, launch, timing in zip(kernel_names(launches), launches, timings, strict=True):
        us = 1e3 * timing.milliseconds
        total += us
        if kernel in measured.times:
            yield {"kernel": kernel, "bound": timing.bound} | entry(TIME, us, measured.times[kernel], AIMS[TIME])
        for quantity in QUANTITIES:
            parts = [measured.counters[kernel, m] for m in quantity.metrics if (kernel, m) in measured.counters]
            if parts and sum(parts) and quantity.name in AIMS:
                yield {"kernel": kernel} | entry(
                    quantity.name, quantity.ours(launch), sum(parts), AIMS[quantity.name], absolute=quantity.absolute
                )
    whole = total + 1e3 * host_ms(machine, len(launches))
    yield {"kernel": "frame"} | entry(FRAME_TIME, whole, measured.times[PIPELINE], None)


def draw(measured: Measured) -> Run:
    """Draw one configuration."""
    return executed(
        measured.scene, "h200", measured.label, width=measured.width, height=measured.height, camera=measured.camera,
        **measured.options,
    )  # fmt: skip


def kernel_names(launches: list[Launch]) -> list[str]:
    """The published names of our launches: passes of the sort are numbered."""
    seen: Counter[str] = Counter()
    names = []
    for launch in launches:
        number = f"_{seen[launch.kernel]}" if launch.kernel == "sort_onesweep" else ""
        seen[launch.kernel] += 1
        names.append(OURS.get(launch.kernel, launch.kernel) + number)
    return names


def fastest_tiles(table: pd.DataFrame) -> pd.DataFrame:
    """By scene, screen and rule: the fastest tile, ours and measured, and whether measured times tell it apart."""
    frames = table[table.quantity == FRAME_TIME].copy()
    frames[["width", "tile", "rule"]] = frames.config.str.split(" ", expand=True)
    rows = []
    for (scene, width, rule), group in frames.groupby(["scene", "width", "rule"], sort=False):
        times = group.set_index("tile")
        best, second = times.measured.nsmallest(2)
        rows.append(
            {
                "scene": scene, "width": width, "rule": rule, "ours": times.ours.idxmin(),
                "measured": times.measured.idxmin(), "clear": second > (1 + CLEAR) * best,
                "lost": times.measured[times.ours.idxmin()] / best - 1.0,
            }
        )  # fmt: skip
    return pd.DataFrame(rows)


def cells(table: pd.DataFrame) -> list[Cell]:
    """Times over 5 us, frames, and instructions."""
    shown = table[table.quantity.isin(["instructions", TIME, FRAME_TIME])]
    shown = shown[(shown.quantity != TIME) | (shown.measured > SHORTEST_US)]
    return [_cell(row) for row in cast("list[dict[str, Any]]", shown.to_dict("records"))]


def _cell(row: dict[str, Any]) -> Cell:
    unit = "us" if row["quantity"] in {TIME, FRAME_TIME} else ""
    frame, column = f"{row['scene']} {row['config']}", f"{row['kernel']} {row['quantity']}"
    status: Status = "reproduced" if row["quantity"] == "instructions" and row["scene"] in MADE_FROM else "predicted"
    return Cell(
        frame, column, unit, published=row["measured"], ours=row["ours"], aim=row["aim"], frame=frame, status=status
    )
