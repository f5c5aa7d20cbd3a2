"""Intervals of a run: what its samples say of each stage and of the frame."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from tilestamp.models.demand import demand
from tilestamp.models.events import INSTRUCTION_CLASSES
from tilestamp.models.launch import Launch
from tilestamp.models.machine import Machine
from tilestamp.models.timing import Timing
from tilestamp.models.traffic import Traffic
from tilestamp.simulator.sampling.estimate import Estimate, Totals
from tilestamp.simulator.sampling.totals import totals
from tilestamp.simulator.work import FixedFunctionWork, Work

UNPLAYED = 0.45  # of the time beyond the roofline: measured over seeds (killeroo and teapot on a GTX 280)
TERMS = {  # of a launch's time, that differ from unit to unit: column of Demand
    "issue": "issue",
    "shared": "shared",
    "l1": "l1",
    "latency": "chain",
    "dram": "dram",
    "l2": "l2",
    "atomic": "atomic",
    "queue": "queue",
    "balance": "alone",
    "tail": "alone",
}


def add(estimates: Sequence[Estimate]) -> Estimate:
    """Sum of numbers that were sampled independently of each other."""
    value = float(sum(e.value for e in estimates))
    half = float(np.sqrt(sum(e.half_width**2 for e in estimates)))
    return Estimate(value, value - half, value + half)


def exactly(value: float) -> Estimate:
    """Give a number that was not sampled its interval, which has no width."""
    return Estimate(float(value), float(value), float(value))


def around(value: float, half: float) -> Estimate:
    """Give a number the half-width of its interval; no count and no time is below 0."""
    return Estimate(float(value), max(0.0, float(value - half)), float(value + half))


def count_intervals(work: Work | FixedFunctionWork) -> dict[str, Estimate]:
    """Every event of one launch."""
    counts = work.counts()
    if not isinstance(work, Work) or work.sample is None:
        return {name: exactly(count) for name, count in counts.items()}
    half = totals(work.sample, work.sample.rows.astype(np.float64)).half_width
    return {event.name: around(counts[event.name], half[event]) for event in work.events}


def instructions(work: Work, launch: Launch, sampled: Launch | None) -> Estimate:
    """Warp instructions of one launch; ``sampled`` prices the rows that ran."""
    value = float(launch.events[:, list(INSTRUCTION_CLASSES)].sum())
    if sampled is None or work.sample is None:
        return exactly(value)
    ran = sampled.events[:, list(INSTRUCTION_CLASSES)].sum(axis=1, keepdims=True)
    return around(value, float(totals(work.sample, ran).half_width[0]))


def milliseconds(timing: Timing, work: Any, sampled: Launch | None, machine: Machine) -> Estimate:
    """Time of one launch: it is as uncertain as the cycles, of all units together, of the term that holds.

    Overheads are known, and the longest units ran. Where the longest term is not the one that holds, the wider counts.
    What balance and tail add to the roofline hangs on which unit meets which: change all by a percent, and it changes
    by a third (measured over seeds). So ``UNPLAYED`` of it is uncertain.
    """
    if sampled is None or not np.isfinite(timing.milliseconds):
        return exactly(timing.milliseconds)
    found = _terms(sampled, work, machine)
    value, half = found.value, found.half_width
    names = list(TERMS)
    held = {timing.bound, max(timing.term_cycles, key=lambda name: timing.term_cycles[name])}
    relative = [half[names.index(n)] / value[names.index(n)] for n in held if n in TERMS and value[names.index(n)] > 0]
    roof = max(cycles for name, cycles in timing.term_cycles.items() if name != "launch") + timing.term_cycles["launch"]
    unplayed = UNPLAYED * max(0.0, 1 - roof / timing.cycles) if timing.cycles else 0.0
    return around(timing.milliseconds, timing.milliseconds * float(np.hypot(max(relative, default=0.0), unplayed)))


def _terms(sampled: Launch, work: Work, machine: Machine) -> Totals:
    """Cycles by term of all units; bytes and requests are each unit's own."""
    asked = demand(sampled, machine, Traffic(0.0, 0.0, 1.0))
    columns = {name: getattr(asked, column) for name, column in TERMS.items()}
    columns["dram"] = columns["l2"] = asked.l1  # moved bytes, in other units
    columns["queue"] = asked.atomic
    assert work.sample is not None  # noqa: S101 - there are sampled rows
    return totals(work.sample, np.stack(list(columns.values()), axis=1))
