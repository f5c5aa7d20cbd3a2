"""What a run of a study would do, before it does: cells, executions, seconds."""

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from tilestamp.experiments.harness.telling import duration
from tilestamp.experiments.studies.cells import MOST_LISTED, missing
from tilestamp.experiments.studies.design import Design
from tilestamp.experiments.studies.parameters import Resolver
from tilestamp.experiments.studies.plan import Group
from tilestamp.experiments.studies.store import Rates, Store

GUESS = Rates(0.25, 1e6, 0.03)  # assumed, until a study has run
WORTH = 5.0  # seconds for which it pays to start processes


@dataclass(frozen=True)
class Forecast:
    """What a run would do."""

    cells: int
    stored: int
    executions: int
    """At least, where not ``exact``."""
    seconds: float
    """Of this computer, on ``jobs`` processes."""
    jobs: int
    guessed: bool
    """Whether nothing of the kind was run before with this store."""
    exact: bool

    @property
    def todo(self) -> int:
        """Cells that are to be run."""
        return self.cells - self.stored

    def sentence(self) -> str:
        """Say it."""
        if not self.todo:
            return f"{count(self.cells, 'cell')}, all stored"
        stored = f", {self.stored:,} of them stored" if self.stored else ""
        executions = f"{'' if self.exact else 'at least '}{count(self.executions, 'execution')}"
        how = "a guess: nothing like it was run with this store" if self.guessed else "as long as earlier ones took"
        return (
            f"{count(self.cells, 'cell')}{stored}; to be run: {self.todo:,}, by {executions};"
            f" about {duration(self.seconds)} in {count(self.jobs, 'process')} ({how})"
        )


def forecast(study: Design, resolver: Resolver, jobs: int | None = None) -> Forecast:
    """Say what a run would do; all names and values are checked on the way."""
    if len(study) > MOST_LISTED:
        return _large(study, resolver, jobs)
    return forecast_of(study, list(missing(study, resolver)), jobs)


def forecast_of(study: Design, groups: Sequence[Group], jobs: int | None) -> Forecast:
    """Say what running some groups would do."""
    todo = sum(len(group.cells) for group in groups)
    seconds, guessed = _seconds(groups, study.kept)
    return Forecast(
        cells=len(study),
        stored=len(study) - todo,
        executions=execution_count(groups),
        seconds=seconds / (jobs or worthwhile(seconds, groups)),
        jobs=jobs or worthwhile(seconds, groups),
        guessed=guessed,
        exact=True,
    )


def worthwhile(seconds: float, groups: Sequence[Group]) -> int:
    """Processes that pay for their start, a few seconds."""
    cells = sum(len(group.cells) for group in groups)
    return 1 if seconds < WORTH else max(min(os.cpu_count() or 1, cells), 1)


def execution_count(groups: Iterable[Group]) -> int:
    """Executions of some groups."""
    return len({(group.execution.digest, group.shape) for group in groups})


def _seconds(groups: Sequence[Group], store: Store) -> tuple[float, bool]:
    """Seconds of one process, and whether they are a guess."""
    known = {group.execution.pipeline: store.seconds(group.execution.pipeline) for group in groups}
    once = {(group.execution.digest, group.shape): group.execution for group in groups}
    rates = {pipeline: rate or GUESS for pipeline, rate in known.items()}
    executed = sum(rates[one.pipeline].execution(one.width * one.height) for one in once.values())
    priced = sum(rates[group.execution.pipeline].pricing_seconds * len(group.cells) for group in groups)
    return executed + priced, None in known.values()


def _large(study: Design, resolver: Resolver, jobs: int | None) -> Forecast:
    """Of more cells than can be looked up: from the first group on."""
    first = next(missing(study, resolver))
    rate = study.kept.seconds(first.execution.pipeline)
    jobs = jobs or os.cpu_count() or 1
    seconds = (rate or GUESS).pricing_seconds * len(study) / jobs
    return Forecast(len(study), 0, 1, seconds, jobs, guessed=rate is None, exact=False)


def count(number: int, noun: str) -> str:
    """Say a number of things: ``1 cell``, ``1,200 cells``."""
    plural = f"{noun}es" if noun.endswith("s") else f"{noun}s"
    return f"{number:,} {noun if number == 1 else plural}"
