"""What a worker does, in this process or another, on this computer or another: execute once, price on many machines.

A worker raises nothing that it could say: what a cell cannot do (a block that the machine cannot launch) is the cell's
problem, and is stored; what is wrong with the worker itself ends the study with a sentence.
"""

import time
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import NamedTuple

from tilestamp.experiments.harness.sources import sources_digest
from tilestamp.experiments.studies.parameters import Execution, Pricing
from tilestamp.experiments.studies.record import Number, Recorded
from tilestamp.models.errors import TilestampError
from tilestamp.models.machine import Machine
from tilestamp.models.price import Fidelity
from tilestamp.simulator.manifest import scene_digest
from tilestamp.simulator.prices import Prices
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


class Result(NamedTuple):
    """What came of a cell: its values, or its problem, or (an error of ours) its fault."""

    values: dict[str, Number] | None = None
    problem: str = ""
    fault: str = ""


@dataclass
class Outcome:
    """What came of a task."""

    number: int
    results: list[Result] = field(default_factory=list)
    """Of each pricing."""
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
    worker = _Worker(task, scene, outcome)
    worker.price()
    outcome.results = [worker.results[place] for place in range(len(task.pricings))]
    outcome.pricing_seconds = time.perf_counter() - begin - outcome.execution_seconds
    return outcome


def prices(run: Run, machines: Sequence[Machine], fidelity: Fidelity) -> Prices:
    """Price one run on many machines."""
    return run.on(run.machine, fidelity).prices(machines, skip=True)


class _Worker:
    """One task at work."""

    def __init__(self, task: Task, scene: Scene, outcome: Outcome) -> None:
        self.task, self.scene, self.outcome = task, scene, outcome
        self.results: dict[int, Result] = {}

    def price(self) -> None:
        """Give each pricing its result."""
        groups: dict[Fidelity, dict[int, Machine]] = {}
        for place, pricing in enumerate(self.task.pricings):
            with self._said(place):
                groups.setdefault(pricing.fidelity, {})[place] = pricing.altered()
        for fidelity, machines in groups.items():
            self._price(fidelity, machines)

    def _price(self, fidelity: Fidelity, machines: dict[int, Machine]) -> None:
        """Price on machines of one fidelity: execute on the first that can launch what is to be executed."""
        run = None
        for place, machine in machines.items():
            with self._said(place):
                run = _run(self.task.execution, machine, self.scene, self.outcome)
                break
        left = {place: machine for place, machine in machines.items() if place not in self.results}
        if run is None or not left:
            return
        try:
            priced = prices(run, list(left.values()), fidelity)
        except Exception as error:  # noqa: BLE001 - as in _said
            self.results |= dict.fromkeys(left, Result(fault=_fault(error)))
            return
        for row, place in enumerate(left):
            with self._said(place):
                self.results[place] = Result(self._recorded(run, priced, row, fidelity), priced.refusals.get(row, ""))

    def _recorded(self, run: Run, priced: Prices, row: int, fidelity: Fidelity) -> dict[str, Number] | None:
        """Values of one cell."""
        if row in priced.refusals:
            return None
        recorded = Recorded(run.on(run.machine, fidelity), priced, row)
        values = recorded.values(self.task.record)
        if None in values.values() and not self.outcome.known:
            self.outcome.known = recorded.known()
        return values

    @contextmanager
    def _said(self, place: int) -> Iterator[None]:
        """Keep what goes wrong as the result of a cell: one cell's fault ends no other."""
        try:
            yield
        except TilestampError as error:
            self.results[place] = Result(problem=str(error))
        except Exception as error:  # noqa: BLE001 - whatever it is
            self.results[place] = Result(fault=_fault(error))


def _fault(error: Exception) -> str:
    place = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__}: {error} ({Path(place.filename).name}:{place.lineno})"


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
        camera=ModelToClip(execution.matrix), picture=False, **execution.options,
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
    if digest != execution.scene_digest:  # as it was for a study before
        _loaded.cache_clear()
        scene, digest = _loaded(execution.scene)
    if digest != execution.scene_digest:
        raise TilestampError(f"the scene {execution.scene} is another one than when the study began: run it again")
    return scene


@cache
def _loaded(source: str | Path) -> tuple[Scene, str]:
    scene = load_scene(source)
    return scene, scene_digest(scene)
