"""Intervals of a run: what its samples say of each stage and of the frame."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from tilestamp.models.events import INSTRUCTION_CLASSES
from tilestamp.models.launch import Launch
from tilestamp.models.timing import Timing
from tilestamp.simulator.sampling.estimate import Estimate, t_quantile
from tilestamp.simulator.sampling.totals import left, replicas, totals
from tilestamp.simulator.work import FixedFunctionWork, Work

Price = Callable[[Launch], float]
MARGIN = 1.1  # of counts: few units of a skewed count say too little of its spread (by 300 seeds of teapot and spot)
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
    half = MARGIN * totals(work.sample, work.sample.sampled.astype(np.float64)).half_width
    return {event.name: around(counts[event.name], half[event]) for event in work.events}


def instructions(work: Work, launch: Launch, sampled: Launch | None) -> Estimate:
    """Warp instructions of one launch; ``sampled`` prices the rows that ran."""
    value = float(launch.events[:, list(INSTRUCTION_CLASSES)].sum())
    if sampled is None or work.sample is None:
        return exactly(value)
    ran = sampled.events[:, list(INSTRUCTION_CLASSES)].sum(axis=1, keepdims=True)
    return around(value, MARGIN * float(totals(work.sample, ran).half_width[0]))


def milliseconds(timing: Timing, work: Any, launch: Launch, sampled: Launch | None, price: Price) -> Estimate:
    """Time of one launch, as sure as the times of samples like this one are alike.

    Parameters
    ----------
    timing : Timing
    work : Work
    launch : Launch
        All units, estimated.
    sampled : Launch or None
        The units that ran; None where all did.
    price : callable
        Milliseconds of a launch with other events.
    """
    if sampled is None or not np.isfinite(timing.milliseconds):
        return exactly(timing.milliseconds)
    rest, squares = left(work.sample), 0.0
    for change in replicas(work.sample, sampled.events, REPLICAS):
        events = launch.events.copy()
        events[rest] = np.maximum(events[rest] + change, 0.0)
        squares += (price(replace(launch, events=events)) - timing.milliseconds) ** 2
    quantile = float(t_quantile(np.array(REPLICAS))[()])
    return around(timing.milliseconds, quantile * float(np.sqrt(squares / REPLICAS)))
