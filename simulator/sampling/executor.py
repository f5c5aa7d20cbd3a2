"""The executor of a sampled run: part of the units of a stage, and more of them until the answer is close enough."""

import time
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, ParamSpec, TypeVar

import numpy as np

from tilestamp.models.demand import UNKNOWN, demand
from tilestamp.models.events import INSTRUCTION_CLASSES
from tilestamp.models.launch import Stream
from tilestamp.models.machine import Machine
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.mix import load_mix
from tilestamp.simulator.sampling.estimate import Floats, Integers
from tilestamp.simulator.sampling.expansion import expanded
from tilestamp.simulator.sampling.strata import Sample, drawn, make_strata, pilot
from tilestamp.simulator.sampling.totals import enlarged, totals
from tilestamp.simulator.stage import Divisible, StageResult
from tilestamp.simulator.work import Work

ROUNDS = 6  # enlargements at most; then everything runs
BYTES = ("LOAD_BYTES", "STORE_BYTES")
UNITS_AN_SM = 64  # below, the time depends on single units, whose neighbours no sample tells
PAYS = 0.5  # seconds of a stage, from which on drawing and pricing a sample takes less than half of it

P = ParamSpec("P")
T = TypeVar("T")


@dataclass
class Part:
    """A stage of which part of the units ran.

    Parameters
    ----------
    stage : Divisible
    inputs : dict
        By name.
    sample : Sample
    """

    stage: Any
    inputs: dict[str, Any]
    sample: Sample
    outputs: Any = None  # of the last units that ran

    def grow(self, taken: Integers) -> None:
        """Run the units that ``taken`` has more than the sample."""
        strata = self.sample.strata
        old, new = drawn(strata, self.sample.taken), drawn(strata, taken)
        fresh = np.setdiff1d(new, old)
        self.outputs, rows = self.stage.run(**self.inputs, units=fresh)
        table = np.empty((len(strata.order), *rows.shape[1:]), np.int64)
        table[fresh] = rows
        if len(old):
            table[old] = self.sample.rows
        self.sample = replace(self.sample, taken=taken, rows=table[new])

    def work(self) -> Work:
        """Work of all units: as they ran, or as those that ran foretell."""
        rows = expanded(self.sample)
        work: Work = self.stage.work(rows, **self.inputs)
        known = {work.events(event).name for event in self.sample.exact}
        streams = None if known.issuperset(BYTES) else partial(self._streams, rows.sum(axis=0))
        return replace(work, sample=replace(self.sample, streams=streams))

    def _streams(self, totals: Integers, change: Floats) -> tuple[Stream, ...]:
        """Buffers touched by units of other totals: as of one unit that does all."""
        work: Work = self.stage.work((totals + change).astype(np.int64)[None], **self.inputs)
        return work.streams


class SampledExecutor(Executor):
    """Runs part of the units of the stages that can, and no picture.

    Parameters
    ----------
    error : float
        Largest half-width of a stage's time, instructions, sample tests and hits, over their value.
    seed : int
    pipeline : str
        Whose mix says what an instruction is.
    machine : Machine
    """

    def __init__(self, error: float, seed: int, pipeline: str, machine: Machine) -> None:
        super().__init__(picture=False)
        self.error, self.seed, self.pipeline, self.machine = error, seed, pipeline, machine
        self.parts: dict[int, Part] = {}  # by place among the works
        self.spent = 0.0  # CPU seconds on samples: their units, and what is made of them
        self.too_small = False  # a stage could run in part, and was too small to

    def last(self, stage: Divisible[P, T], *inputs: P.args, **options: P.kwargs) -> StageResult[T]:
        """Run part of a stage's units: enough that all that the run asks for is known within the error."""
        begin, named = time.process_time(), stage.inputs(*inputs, **options)
        known = stage.known(**named)
        if known.seconds < PAYS or len(known.size) < UNITS_AN_SM * self.machine.sm.count:
            self.too_small = True
            return self(stage, *inputs, **options)
        strata = make_strata(known.size, [self.seed, len(self.parts)], *known.more)
        part = Part(stage, named, Sample(strata, np.zeros_like(strata.units), np.zeros((0, 0), np.int64), known.exact))
        part.grow(pilot(strata))
        for left in reversed(range(ROUNDS)):
            measured = self._measures(part)
            found = totals(part.sample, measured)
            if (found.half_width <= self.error * np.abs(found.value)).all():
                break
            part.grow(enlarged(part.sample, measured, self.error) if left else strata.units)
        self.parts[len(self.works)] = part
        self.works.append(part.work())
        self.spent += time.process_time() - begin
        return StageResult(part.outputs, (self.works[-1],))

    def _measures(self, part: Part) -> Floats:
        """What the answer is made of, of each unit that ran: instructions, cycles, counts declared."""
        rows = part.sample.rows
        work = replace(part.stage.work(rows, **part.inputs), table=rows, streams=())
        launch = load_mix(self.pipeline, self.machine.compute_capability).launch(work, self.machine.sm.warp_size)
        asked = demand(launch, self.machine, UNKNOWN)
        counts = [rows[:, work.events[counter.event]] for counter in work.counters if counter.kind == "count"]
        instructions = launch.events[:, list(INSTRUCTION_CLASSES)].sum(axis=1)
        return np.stack([instructions, asked.issue, asked.chain, *counts], axis=1).astype(np.float64)

    def finished(self, index: int) -> Work:
        """Run all units of the stage whose work stands at ``index``, of which part ran."""
        begin, part = time.process_time(), self.parts[index]
        part.grow(part.sample.strata.units)
        work = part.work()
        self.spent += time.process_time() - begin
        return work

    @property
    def units(self) -> dict[str, tuple[int, int]]:
        """Units that ran, and all, by kernel."""
        ran: dict[str, tuple[int, int]] = {}
        for index, part in self.parts.items():
            kernel, sample = self.works[index].kernel, part.sample
            before = ran.get(kernel, (0, 0))
            ran[kernel] = before[0] + int(sample.taken.sum()), before[1] + len(sample.strata.order)
        return ran
