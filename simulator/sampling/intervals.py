"""Intervals of a run: what its samples say of each stage and of the frame."""

from collections.abc import Callable, Sequence

import numpy as np

from tilestamp.models.events import INSTRUCTION_CLASSES
from tilestamp.models.launch import Launch
from tilestamp.models.timing import Timing
from tilestamp.simulator.sampling.estimate import Estimate, Floats, t_quantile
from tilestamp.simulator.sampling.expansion import replicas
from tilestamp.simulator.sampling.totals import totals
from tilestamp.simulator.work import FixedFunctionWork, Work

LEAST = 5e-4  # of a time: no half-width below it is claimed, for single units beside the longest weigh more than others
REPLICAS = 8  # samples like the one drawn, whose times are compared


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


def milliseconds(timing: Timing, work: Work, price: Callable[[Floats], float]) -> Estimate:
    """Time of one launch: as sure as the times of samples like this one are alike.

    Parameters
    ----------
    timing : Timing
    work : Work
    price : callable
        Milliseconds, were the rows of the units that did not run changed by (units, events).
    """
    sample = work.sample
    if sample is None or sample.complete or not np.isfinite(timing.milliseconds):
        return exactly(timing.milliseconds)
    changes = replicas(sample, sample.sampled.astype(np.float64), REPLICAS)
    square = np.mean([(price(change) - timing.milliseconds) ** 2 for change in changes])
    quantile = t_quantile(np.full(1, REPLICAS, np.float64))[0]
    half = max(float(quantile * np.sqrt(square)), LEAST * timing.milliseconds)
    return around(timing.milliseconds, half)
