"""Our kernels in CUDA on the GPU at hand, timed and counted, beside the model's prediction of the same launches."""

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.experiments.validation.gpu import BUSY, in_a_graph, microseconds, spread
from tilestamp.experiments.validation.gpu_cases import SCENE, WIDTH, GpuCase, gpu_cases
from tilestamp.experiments.validation.profiler import counters
from tilestamp.experiments.validation.quantities import QUANTITIES, TIME, TIME_AIM, warm_microseconds
from tilestamp.models.launch import Launch
from tilestamp.models.machine import Machine
from tilestamp.simulator.mix import load_mix

if TYPE_CHECKING:
    import pandas as pd

COPIES = 20  # launches in a graph, so that a short kernel's time is not the time of a launch
UNLIKE, UNLIKE_AIM = "results unlike ours", 0.001


def compare_here(machine: Machine, say: Callable[[str], None]) -> tuple["pd.DataFrame", list[str]]:
    """Run our kernels; check what they leave; compare times, and counters where a profiler can read them.

    Returns
    -------
    table : DataFrame
        Columns scene, W, tile, spp, kernel, quantity, ours, measured, error, aim.
    remarks : list of str
        What a reader has to know: a busy GPU, no counters.

    Raises
    ------
    TilestampError
        No CuPy, no GPU, or too little memory.
    """
    import pandas as pd

    rows: list[dict[str, Any]] = []
    launches: list[tuple[GpuCase, Launch]] = []
    busy = []
    for case in gpu_cases(machine.simt, say):
        launch = load_mix(case.pipeline, machine.compute_capability).launch(case.work, machine.sm.warp_size)
        launches.append((case, launch))
        times = _times(case)
        if spread(times) > BUSY:
            busy.append(f"{case.kernel} at tile {case.tile}")
        rows += _timed(case, launch, machine, float(np.median(times)))
    say("counters")
    counted, why = counters()
    if counted and len(counted) != len(launches):
        counted, why = [], f"no counters: the profiler saw {len(counted)} of {len(launches)} launches"
    for (case, launch), found in zip(launches, counted, strict=False):
        rows += _counted(case, launch, found)
    remarks = [why] if why else []
    if busy:
        remarks.append(f"repeats disagree ({', '.join(busy)}): is something else running on this GPU?")
    return pd.DataFrame(rows), remarks


def _times(case: GpuCase) -> NDArray[np.float64]:
    """Time of one launch in a row of them, what resets it taken off, in microseconds."""
    reset = case.reset
    if reset is None:
        return microseconds(in_a_graph(case.start, COPIES)) / COPIES

    def both() -> None:
        reset()
        case.start()

    alone = float(np.median(microseconds(in_a_graph(reset, COPIES))))
    return (microseconds(in_a_graph(both, COPIES)) - alone) / COPIES


def _timed(case: GpuCase, launch: Launch, machine: Machine, measured: float) -> Iterator[dict[str, Any]]:
    """Time beside ours, and how much of the result differs."""
    if case.reset is not None:
        case.reset()
    case.start()
    unlike = case.unlike()
    ours = warm_microseconds(launch, machine)
    yield _entry(case, TIME, ours, measured, ours / measured - 1.0, TIME_AIM)
    yield _entry(case, UNLIKE, 0.0, unlike, unlike, UNLIKE_AIM)


def _counted(case: GpuCase, launch: Launch, found: dict[str, float]) -> Iterator[dict[str, Any]]:
    """Counters beside ours."""
    for quantity in QUANTITIES:
        theirs = sum(found.get(metric, 0.0) for metric in quantity.metrics)
        ours = quantity.ours(launch)
        if theirs or ours:
            error = ours - theirs if quantity.absolute else ours / theirs - 1.0 if theirs else 1.0
            yield _entry(case, quantity.name, ours, theirs, error, quantity.aim)


def _entry(
    case: GpuCase, quantity: str, ours: float, measured: float, error: float, aim: float | None
) -> dict[str, Any]:
    return {
        "scene": SCENE, "W": WIDTH, "tile": case.tile, "spp": case.spp, "kernel": case.kernel, "quantity": quantity,
        "ours": ours, "measured": measured, "error": error, "aim": aim,
    }  # fmt: skip
