"""What a worker does, in this process or another, on this computer or another: execute once, price on many machines.

A worker raises nothing that it could say: what a cell cannot do (a block that the machine cannot launch) is the cell's
problem, and is stored; what is wrong with the worker itself ends the study with a sentence.
"""

import time
import traceback
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import NamedTuple

from tilestamp.experiments.studies.parameters import Execution, Pricing
from tilestamp.experiments.studies.record import Number, Recorded
from tilestamp.experiments.studies.sources import sources_digest
from tilestamp.models.errors import TilestampError
from tilestamp.models.machine import Machine
from tilestamp.models.price import Fidelity
from tilestamp.simulator.manifest import scene_digest
from tilestamp.simulator.run import Run
from tilestamp.simulator.scenes import ModelToClip, Scene, load_scene
from tilestamp.simulator.simulation import simulate

KEPT = 2  # runs that a process keeps: groups of one execution follow each other
_runs: dict[tuple[object, ...], Run] = {}


class Task(NamedTuple):
    """A group of cells, as it goes to a worker: a plain tuple, which dask sends with the task."""

    number: int
    execution: Execution
    pricings: list[Pricing]
    record: tuple[str, ...]


@dataclass
class Outcome:
    """What came of a task: for each cell its values, or its problem, or (an error of ours) its fault."""

    number: int
    values: list[dict[str, Number] | None] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)
    executions: int = 0
    execution_seconds: float = 0.0
    pricing_seconds: float = 0.0
    known: list[str] = field(default_factory=list)
    """Names that could have been recorded, where one that was asked for could not."""
    ending: str = ""
    """Why the study cannot go on."""


def perform(task: Task) -> Outcome:
    """Do a task."""
    outcome = Outcome(task.number)
    try:
        scene = _scene(task.execution)
    except TilestampError as error:
        outcome.ending = str(error)
        return outcome
    begin = time.perf_counter()
    for pricing in task.pricings:
        values, problem, fault = None, "", ""
        try:
            values = _priced(task, pricing, scene, outcome)
        except TilestampError as error:
            problem = str(error)
        except Exception as error:  # noqa: BLE001 - one cell's fault ends no other
            place = traceback.extract_tb(error.__traceback__)[-1]
            fault = f"{type(error).__name__}: {error} ({Path(place.filename).name}:{place.lineno})"
        outcome.values.append(values)
        outcome.problems.append(problem)
        outcome.faults.append(fault)
    outcome.pricing_seconds = time.perf_counter() - begin - outcome.execution_seconds
    return outcome


def prices(run: Run, machines: Sequence[tuple[Machine, Fidelity]]) -> Iterator[Run]:
    """Price one run on many machines."""
    for machine, fidelity in machines:
        yield run.on(machine, fidelity)


def _priced(task: Task, pricing: Pricing, scene: Scene, outcome: Outcome) -> dict[str, Number]:
    """Values of one cell."""
    machine = pricing.altered()
    run = next(prices(_run(task.execution, machine, scene, outcome), [(machine, pricing.fidelity)]))
    if run.sampled and run.error and run.milliseconds_interval.relative > run.error:  # sampled for another machine
        run = _executed(task.execution, machine, scene, outcome)
        run = next(prices(run, [(machine, pricing.fidelity)]))
    recorded = Recorded(run)
    values = recorded.values(task.record)
    if None in values.values() and not outcome.known:
        outcome.known = recorded.known()
    return values


def _run(execution: Execution, machine: Machine, scene: Scene, outcome: Outcome) -> Run:
    """Give the execution on a machine of this shape, a kept one if there is."""
    shape = machine.simt if execution.persistent else machine.simt._replace(sms=0)
    key = execution.digest, shape
    if key not in _runs:
        run = _executed(execution, machine, scene, outcome)
        while len(_runs) >= KEPT:
            del _runs[next(iter(_runs))]
        _runs[key] = run
    return _runs[key]


def _executed(execution: Execution, machine: Machine, scene: Scene, outcome: Outcome) -> Run:
    begin = time.perf_counter()
    run = simulate(
        scene, execution.pipeline, machine, width=execution.width, height=execution.height,
        camera=ModelToClip(execution.matrix), error=execution.error, seed=execution.seed, picture=False,
        **execution.options,
    )  # fmt: skip
    outcome.executions += 1
    outcome.execution_seconds += time.perf_counter() - begin
    return run


def _scene(execution: Execution) -> Scene:
    """Load the scene, and see that scene and sources are those of the study."""
    if sources_digest(execution.pipeline) != execution.sources:
        raise TilestampError("a worker runs other sources of tilestamp than this process: install the same on both")
    if isinstance(execution.scene, Scene):
        return execution.scene
    scene, digest = _loaded(execution.scene)
    if digest != execution.scene_digest:
        _loaded.cache_clear()
        raise TilestampError(f"the scene {execution.scene} is another one than when the study began: run it again")
    return scene


@cache
def _loaded(source: str | Path) -> tuple[Scene, str]:
    scene = load_scene(source)
    return scene, scene_digest(scene)
