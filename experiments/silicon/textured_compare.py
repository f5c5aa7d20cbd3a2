"""Frames of the two textured rasterizers, priced as they were measured, beside the measurements."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, cast

import pandas as pd

from tilestamp.experiments.harness.result import Cell, Result
from tilestamp.experiments.silicon.textured_inputs import (
    FRAME_METRIC,
    TIME_METRIC,
    Measured,
    measured_scenes,
    read_measured,
)
from tilestamp.experiments.validation.quantities import MOVED, MOVED_AIM, QUANTITIES, SHORTEST_US, TIME, TIME_AIM
from tilestamp.models.errors import MissingInputError
from tilestamp.models.launch import Launch, PipeLaunch
from tilestamp.models.price import price
from tilestamp.models.timing import Timing
from tilestamp.models.traffic import traffic
from tilestamp.simulator.run import Run

FRAME_TIME = "frame time"  # sum of the kernels and memsets
SPAN = "frame from start to end"
OCCUPANCY = "achieved occupancy"
OCCUPANCY_METRIC = "sm__warps_active.avg.pct_of_peak_sustained_active"  # of the cycles in which an SM holds any warp


@dataclass(frozen=True)
class Drawn:
    """One measured frame as we drew it.

    Parameters
    ----------
    config : str
        Of the measurement.
    run : Run
    kernels : sequence of str
        The author's name of each launch of the run; "" where there was none.
    counted_as : tuple of str
        Configurations that bear further counters of the same frame.
    """

    config: str
    run: Run
    kernels: Sequence[str]
    counted_as: tuple[str, ...] = ()

    @property
    def launched(self) -> list[tuple[str, Launch | PipeLaunch]]:
        """Launches that the author's frame has too, each with his name of it."""
        return [(kernel, launch) for kernel, launch in zip(self.kernels, self.run.launches, strict=True) if kernel]

    @property
    def timings(self) -> list[Timing]:
        """Time of each of them in a frame that follows another one, as they were measured."""
        launches = [launch for _, launch in self.launched]
        return price([*launches, *launches], self.run.machine)[len(launches) :]


def rows(measured: Measured, drawn: Drawn) -> Iterator[dict[str, Any]]:
    """Ours beside what was measured of each launch: time, and counters where it was profiled."""
    seen: Counter[str] = Counter()
    timings = drawn.timings
    for (kernel, launch), ours in zip(drawn.launched, timings, strict=True):
        instance = seen[kernel]
        seen[kernel] += 1
        about = {"scene": measured.name, "config": drawn.config, "kernel": kernel, "instance": instance}
        timed = (drawn.config, kernel, instance, TIME_METRIC)
        if timed in measured.on_gpu:
            yield (
                about | {"bound": ours.bound} | entry(TIME, 1e3 * ours.milliseconds, measured.on_gpu[timed], TIME_AIM)
            )
        for config in (drawn.config, *drawn.counted_as):
            place = (config, kernel, instance)
            if (*place, OCCUPANCY_METRIC) in measured.on_gpu:
                held = measured.on_gpu[*place, OCCUPANCY_METRIC] / 100.0
                yield about | entry(OCCUPANCY, ours.achieved, held, None, absolute=True)
            counters = {key[3]: value for key, value in measured.on_gpu.items() if key[:3] == place}
            yield from (about | counted for counted in _counters(launch, counters, drawn))
    about = {"scene": measured.name, "config": drawn.config, "kernel": "frame", "instance": 0}
    whole = 1e3 * sum(each.milliseconds for each in timings)
    yield about | entry(FRAME_TIME, whole, measured.on_gpu[drawn.config, "frame", 0, FRAME_METRIC], None)


def _counters(launch: Launch | PipeLaunch, counters: dict[str, float], drawn: Drawn) -> Iterator[dict[str, Any]]:
    """What the profiler counted of one launch."""
    if not isinstance(launch, Launch):
        return
    for quantity in QUANTITIES:
        parts = [counters[metric] for metric in quantity.metrics if metric in counters]
        if parts and (sum(parts) or quantity.aim):
            yield entry(quantity.name, quantity.ours(launch), sum(parts), quantity.aim, absolute=quantity.absolute)
    if "launch__registers_per_thread" in counters:
        yield entry("registers", float(launch.registers), counters["launch__registers_per_thread"], None)
    cold = traffic([launch], drawn.run.machine)[0]
    for moved in MOVED:
        theirs = sum(w * counters.get(metric, 0.0) for metric, w in moved.metrics)
        if moved.metrics[0][0] in counters and theirs > 0:
            yield entry(moved.name, moved.ours(launch, cold), theirs, MOVED_AIM)


def entry(quantity: str, ours: float, theirs: float, aim: float | None, *, absolute: bool = False) -> dict[str, Any]:
    """Ours beside what was measured; the error is relative unless ``absolute``."""
    error = ours - theirs if absolute else ours / theirs - 1.0 if theirs else float(ours > 0)
    return {"quantity": quantity, "ours": ours, "measured": theirs, "error": error, "aim": aim}


def by_kernel(table: pd.DataFrame) -> pd.DataFrame:
    """Ratio of ours to what was measured, mean and range, and mean and worst error, by kernel and quantity."""
    shown = table[(table.quantity != TIME) | (table.measured > SHORTEST_US)]
    shown = shown.assign(ratio=shown.ours / shown.measured, error=shown.error.abs())
    grouped = shown.groupby(["quantity", "kernel"], sort=False)
    return grouped.agg(
        cells=("ratio", "size"), least=("measured", "min"), most=("measured", "max"), ratio=("ratio", "mean"),
        lowest=("ratio", "min"), highest=("ratio", "max"), mean=("error", "mean"), worst=("error", "max"),
    ).reset_index()  # fmt: skip


def sentences(table: pd.DataFrame) -> list[str]:
    """Mean and worst error of all times, and of each kernel and quantity."""
    times = table[(table.quantity == TIME) & (table.measured > SHORTEST_US)].error.abs()
    whole = f"All {len(times)} times over 5 us: mean error {100 * times.mean():.1f} %, worst {100 * times.max():.0f} %."
    return [whole, *map(_sentence, by_kernel(table).to_dict("records"))]


def _sentence(r: dict[Any, Any]) -> str:
    """Ratio and error of one kernel and quantity."""
    ratios = f"ours over measured {r['ratio']:.2f} ({r['lowest']:.2f} to {r['highest']:.2f})"
    errors = f"mean error {100 * r['mean']:.1f} %, worst {100 * r['worst']:.0f} %"
    return f"{r['kernel']}, {r['quantity']}: {r['cells']} cells, {ratios}, {errors}."


def compared(
    name: str, title: str, source: str, system: str, rows_of: Callable[[Measured], Iterator[dict[str, Any]]]
) -> Result:
    """All frames that were measured of a system (``ru``, ``zh``) beside ours, or what is missing for that."""
    try:
        scenes = measured_scenes(system)
    except MissingInputError as missing:
        return Result(name, title, source, [], warnings=[str(missing)])
    table = pd.DataFrame([row for scene in scenes for row in rows_of(read_measured(scene))])
    tables = {"all": table, "kernels": by_kernel(table)}
    return Result(name, title, source, cells(table), notes=sentences(table), tables=tables)


def cells(table: pd.DataFrame) -> list[Cell]:
    """Times over 5 us, frames, and instructions."""
    shown = table[table.quantity.isin(["instructions", TIME, FRAME_TIME, SPAN])]
    shown = shown[(shown.quantity != TIME) | (shown.measured > SHORTEST_US)]
    return [_cell(r) for r in cast("list[dict[str, Any]]", shown.to_dict("records"))]


def _cell(r: dict[str, Any]) -> Cell:
    row, column = f"{r['scene']} {r['config']}", f"{r['kernel']} {r['instance']} {r['quantity']}"
    unit = "us" if r["quantity"] in {TIME, FRAME_TIME, SPAN} else ""
    return Cell(row, column, unit, published=r["measured"], ours=r["ours"], aim=r["aim"], frame=r["scene"])
