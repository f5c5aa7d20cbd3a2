"""Intervals of a run: what its samples say of each stage and of the frame."""

from collections.abc import Callable, Sequence

import numpy as np

from tilestamp.models.demand import demand
from tilestamp.models.events import INSTRUCTION_CLASSES
from tilestamp.models.launch import Launch
from tilestamp.models.machine import Machine
from tilestamp.models.timing import Timing
from tilestamp.models.traffic import Traffic
from tilestamp.simulator.sampling.estimate import Estimate, Floats
from tilestamp.simulator.sampling.totals import totals
from tilestamp.simulator.work import FixedFunctionWork, Work

STEP = 0.02  # by which a slope of the time is found
LEAST = 0.001  # of a time, and ...
BEYOND = 0.015  # ... of what is beyond its longest term: which units follow each other no sample tells (measured)


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
    half = totals(work.sample, work.sample.sampled.astype(np.float64)).half_width
    return {event.name: around(counts[event.name], half[event]) for event in work.events}


def instructions(work: Work, launch: Launch, sampled: Launch | None) -> Estimate:
    """Warp instructions of one launch; ``sampled`` prices the rows that ran."""
    value = float(launch.events[:, list(INSTRUCTION_CLASSES)].sum())
    if sampled is None or work.sample is None:
        return exactly(value)
    ran = sampled.events[:, list(INSTRUCTION_CLASSES)].sum(axis=1, keepdims=True)
    return around(value, float(totals(work.sample, ran).half_width[0]))


def milliseconds(
    timing: Timing, work: Work, sampled: Launch, machine: Machine, price: Callable[[float], float]
) -> Estimate:
    """Time of one launch, by the delta method: it is a smooth function of costs, and the least sure one counts for all.

    Parameters
    ----------
    timing : Timing
    work : Work
    sampled : Launch
        The units that ran, without what is known of all.
    machine : Machine
    price : callable
        Milliseconds, were all that is estimated larger by a factor.
    """
    sample = work.sample
    if sample is None or sample.complete or not np.isfinite(timing.milliseconds):
        return exactly(timing.milliseconds)
    slope = abs(price(1 + STEP) - timing.milliseconds) / STEP
    found = totals(sample, _costs(sampled, machine))
    unsure = found.half_width[found.value > 0] / found.value[found.value > 0]
    roof = max(cycles for name, cycles in timing.term_cycles.items() if name != "launch")
    unseen = LEAST + BEYOND * max(0.0, 1.0 - roof / timing.cycles)
    return around(timing.milliseconds, slope * float(unsure.max(initial=0.0)) + unseen * timing.milliseconds)


def _costs(launch: Launch, machine: Machine) -> Floats:
    """Cycles and bytes of the units of a launch that the time of the whole may depend on."""
    asked = demand(launch, machine, Traffic(0.0, 0.0, 1.0))
    start = machine.latency.block_launch_cycles if launch.dispatch == "blocks" else 0.0
    return np.stack([asked.issue, asked.shared, asked.l1, asked.chain - start], axis=1)
