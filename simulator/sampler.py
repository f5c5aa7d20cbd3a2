"""The sampler of a run: it has a stage execute part of its units, and more of them until the answer is close enough."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.demand import demand
from tilestamp.models.events import INSTRUCTION_CLASSES
from tilestamp.models.launch import Stream
from tilestamp.models.machine import Machine
from tilestamp.models.traffic import Traffic
from tilestamp.simulator.estimate import Floats, Integers
from tilestamp.simulator.mix import load_mix
from tilestamp.simulator.sampling import enlarged, expanded, totals
from tilestamp.simulator.strata import Sample, drawn, make_strata, pilot
from tilestamp.simulator.work import Work

ROUNDS = 6  # enlargements at most; then everything runs
SMALLEST = (
    60_000  # primitives of a frame; below, drawing a sample and pricing it costs more than running all (measured)
)


@dataclass
class Sampler:
    """What a run asks of its samples, and what they did.

    Parameters
    ----------
    error : float
        Largest half-width of a stage's time, instructions, sample tests and hits, over their value.
    seed : int
    pipeline : str
        Whose mix says what an instruction is.
    machine : Machine
    """

    error: float
    seed: int
    pipeline: str
    machine: Machine
    executed: dict[str, tuple[int, int]] = field(default_factory=dict)  # units run, and all, by kernel
    stages: int = 0  # so far
    seconds_saved: float = 0.0  # CPU seconds of the stages sampled, had all units cost alike by size
    finish: dict[int, Callable[[Work], Work]] = field(default_factory=dict)  # of each sample, by its id: run the rest

    def pays(self, primitives: int) -> bool:
        """Whether a frame of so many sub-patches or triangles is worth a sample."""
        return primitives >= SMALLEST

    def stage(
        self,
        size: NDArray[Any],
        execute: Callable[[Integers], Work],
        streams: Callable[[Integers], tuple[Stream, ...]] = lambda _: (),
        more: Sequence[NDArray[Any]] = (),
        *,
        key: int | None = None,
    ) -> Work:
        """Run a stage on a part of its units.

        Parameters
        ----------
        size : ndarray, (units,)
            What is known of each unit: the work that it will be, up to a factor.
        execute : callable
            Runs the units of the given indices; its ``Work`` has a row for each.
        streams : callable
            The buffers touched, by the rows of all units.
        more : sequence of ndarray, (units,)
            Further things known, of which some events may be proportional.
        key : int, optional
            Stages with the same key and sizes draw the same units first.

        Returns
        -------
        Work
            With a row for every unit, and the ``sample``.
        """
        strata = make_strata(size, [self.seed, self.stages if key is None else key], *more)
        taken = pilot(strata)
        begin = time.process_time()
        work = execute(drawn(strata, taken))
        sample = Sample(strata, taken, work.table)
        for left in reversed(range(ROUNDS)):
            if self.precise(sample, work):
                break
            taken = enlarged(sample, self.measures(work, sample.rows), self.error) if left else strata.units
            sample = _grown(sample, taken, execute)
        spent = time.process_time() - begin
        known = strata.known[:, 1]
        ran, all_sizes = known[drawn(strata, sample.taken)].sum(), known.sum()
        saved = spent * (all_sizes / ran - 1) if ran else 0.0
        self._note(work.kernel, int(sample.taken.sum()), len(strata.order), saved)
        self.stages += 1

        def finish(estimated: Work) -> Work:
            """Run the units that are left."""
            whole = _grown(sample, strata.units, execute)
            self._note(work.kernel, int((strata.units - sample.taken).sum()), 0, -saved)
            rows = expanded(whole)
            return replace(estimated, table=rows, streams=streams(rows) or estimated.streams, sample=whole)

        self.finish[id(sample)] = finish
        table = expanded(sample)
        grid = len(table) if work.dispatch == "blocks" else work.grid
        return replace(work, table=table, grid=grid, streams=streams(table), sample=sample)

    def _note(self, kernel: str, ran: int, units: int, saved: float) -> None:
        """Add to what was executed, of how many, and to the seconds saved."""
        ran_before, units_before = self.executed.get(kernel, (0, 0))
        self.executed[kernel] = ran_before + ran, units_before + units
        self.seconds_saved += saved

    def finished(self, work: Work) -> Work:
        """Run all units of a stage of which part had run."""
        if work.sample is None:
            return work
        whole = self.finish[id(work.sample)](work)
        self.finish[id(work.sample)] = lambda _: whole  # a launch that is tried again is run once
        return whole

    def precise(self, sample: Sample, work: Work) -> bool:
        """Whether all that the run asks for is known within the error."""
        found = totals(sample, self.measures(work, sample.rows))
        return bool((found.half_width <= self.error * np.abs(found.value)).all())

    def measures(self, work: Work, rows: Integers) -> Floats:
        """What the answer is made of, of each unit: instructions, cycles, counts declared; (units, quantities)."""
        launch = load_mix(self.pipeline, self.machine.compute_capability).launch(
            replace(work, table=rows, streams=()), self.machine.sm.warp_size
        )
        asked = demand(launch, self.machine, Traffic(0.0, 0.0, 1.0))
        counts = [rows[:, work.events[counter.event]] for counter in work.counters if counter.kind == "count"]
        instructions = launch.events[:, list(INSTRUCTION_CLASSES)].sum(axis=1)
        return np.stack([instructions, asked.issue, asked.chain, *counts], axis=1).astype(np.float64)


def _grown(sample: Sample, taken: Integers, execute: Callable[[Integers], Work]) -> Sample:
    """Execute what ``taken`` has more than the sample."""
    strata = sample.strata
    old, new = drawn(strata, sample.taken), drawn(strata, taken)
    place = np.full(len(strata.order), -1, np.int64)
    place[old] = np.arange(len(old))
    fresh = new[place[new] < 0]
    rows = np.empty((len(new), sample.rows.shape[1]), np.int64)
    rows[place[new] >= 0] = sample.rows[place[new][place[new] >= 0]]
    if len(fresh):
        rows[place[new] < 0] = execute(fresh).table
    return Sample(strata, taken, rows)
