"""Run a study: what is missing, group by group, by workers; each cell is stored as its group comes back."""

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from itertools import islice

from tilestamp.experiments.harness.pool import Pool, pool
from tilestamp.experiments.harness.telling import duration, so_far
from tilestamp.experiments.studies.axes import shown
from tilestamp.experiments.studies.cells import MOST_LISTED, missing, rows
from tilestamp.experiments.studies.design import Design
from tilestamp.experiments.studies.forecast import Forecast, count, forecast_of
from tilestamp.experiments.studies.forecast import forecast as forecast_study
from tilestamp.experiments.studies.names import Names
from tilestamp.experiments.studies.parameters import Resolver
from tilestamp.experiments.studies.plan import Group
from tilestamp.experiments.studies.values import PRICED, SHARED
from tilestamp.experiments.studies.work import Outcome, Task, perform
from tilestamp.models.errors import TilestampError

WINDOW = 400  # groups that are listed at once
FEWEST = 25  # cells of a group that is taken apart, so that all processes have work
OFTEN = 0.5  # seconds between two words on how far it is


@dataclass
class Summary:
    """What a run did."""

    cells: int = 0
    new: int = 0
    executions: int = 0
    seconds: float = 0.0
    saved_executions: int = 0
    saved_seconds: float = 0.0
    """What the priced cells would have taken, had each been executed."""
    problems: int = 0
    faults: list[str] = field(default_factory=list)
    changed: list[str] = field(default_factory=list)
    """Inputs that are not those of when the store was last used."""

    def sentences(self) -> list[str]:
        """Say it."""
        done = f"{self.new:,} run by {count(self.executions, 'execution')} in {duration(self.seconds)}"
        said = [f"{count(self.cells, 'cell')}: {done}"]
        if self.saved_executions > 0:
            about = f", about {duration(self.saved_seconds)}" if self.saved_seconds else ""
            said[0] += f"; repricing saved {count(self.saved_executions, 'execution')}{about}"
        if self.problems:
            said.append(f"no time: {count(self.problems, 'cell')}; the column problem says why")
        return said + [f"failed: {fault}" for fault in dict.fromkeys(self.faults)]


def run_study(
    study: Design, jobs: int | None, cluster: str | None, say: Callable[[str], None], resolver: Resolver
) -> Summary:
    """Run what is not stored; see ``Study.run``."""
    begin = time.perf_counter()
    summary = Summary(cells=len(study))
    groups, expected = _missing(study, resolver, jobs)
    summary.changed = _changed(study, resolver)
    if expected.todo:
        with pool(jobs or expected.jobs, cluster, say) as workers:
            _Runner(study, workers, summary, say, expected.todo, resolver).run(groups)
    summary.seconds = time.perf_counter() - begin
    return summary


def _missing(study: Design, resolver: Resolver, jobs: int | None) -> tuple[Iterable[Group], Forecast]:
    """Groups that are missing, and what is expected of them."""
    if len(study) > MOST_LISTED:
        return missing(study, resolver), forecast_study(study, resolver, jobs)
    groups = list(missing(study, resolver))
    return groups, forecast_of(study, groups, jobs)


def _changed(study: Design, resolver: Resolver) -> list[str]:
    """Say which inputs changed since the store was last used."""
    said = {"sources": "the sources of the pipeline", "scene": "the scene", "machine": "the machine"}
    return [
        f"{said[kind]} {name} changed since this store was last used: its cells are run again"
        for kind, name in study.kept.changed_inputs(resolver.inputs)
    ]


class _Runner:
    """Hands groups to workers, and stores what comes back."""

    def __init__(
        self, study: Design, workers: Pool, summary: Summary, say: Callable[[str], None], todo: int, resolver: Resolver
    ) -> None:
        self.study, self.workers, self.summary, self.todo = study, workers, summary, todo
        self._say = say
        self._begin = self._said = time.perf_counter()
        self._executed = 0.0  # seconds
        self._names = Names(
            study.record, study.pipelines, lambda: (stored.numbers for _, stored in rows(study, resolver))
        )

    def run(self, groups: Iterable[Group]) -> None:
        """Run some groups."""
        stream = self._split(groups)
        while window := list(islice(stream, WINDOW)):
            tasks = [
                Task(number, group.execution, [cell.pricing for cell in group.cells], tuple(self.study.record))
                for number, group in enumerate(window)
            ]
            for outcome in self.workers.map(perform, tasks):
                self._store(window[outcome.number], outcome)

    def _split(self, groups: Iterable[Group]) -> Iterator[Group]:
        """Take large groups apart where there are several workers and few groups."""
        share = -(-self.todo // (4 * self.workers.jobs))
        most = max(share, FEWEST) if self.workers.jobs > 1 else self.todo or FEWEST
        for group in groups:
            for start in range(0, len(group.cells), most):
                yield group._replace(cells=group.cells[start : start + most])

    def _store(self, group: Group, outcome: Outcome) -> None:
        """Store all cells of a group, one commit each."""
        if outcome.ending:
            raise TilestampError(outcome.ending)
        study, execution = self.study, group.execution
        for cell, result in zip(group.cells, outcome.results, strict=True):
            if result.fault:
                self.summary.faults.append(result.fault)
                continue
            parameters = SHARED | PRICED | dict(study.fixed) | group.parameters | cell.shown | cell.pricing.changes
            parameters["machine"] = cell.pricing.machine.name
            told = {name: shown(value) for name, value in parameters.items()}
            study.kept.put(cell.key, told, study.record, result.values or {}, result.problem)
            self.summary.new += 1
            self.summary.problems += bool(result.problem)
        self._account(group, outcome)
        done = [result.values for result in outcome.results if result.values is not None]
        if done:
            self._names.saw(execution.pipeline, done, outcome.known)

    def _account(self, group: Group, outcome: Outcome) -> None:
        """Add up what was done and saved, and say how far it is."""
        summary, execution = self.summary, group.execution
        times = outcome.executions, outcome.execution_seconds, len(outcome.results), outcome.pricing_seconds
        self.study.kept.note_times(execution.pipeline, execution.width * execution.height, *times)
        summary.executions += outcome.executions
        priced = sum(result.values is not None for result in outcome.results)
        summary.saved_executions += priced - outcome.executions
        self._executed += outcome.execution_seconds
        if summary.executions:
            summary.saved_seconds = summary.saved_executions * self._executed / summary.executions
        now = time.perf_counter()
        if now - self._said >= OFTEN and summary.new < self.todo:
            self._said = now
            self._say(so_far(summary.new, self.todo, now - self._begin, " cells"))
