"""Intervals of a run: what its samples say of each stage and of the frame."""

from collections.abc import Callable, Sequence

import numpy as np

from tilestamp.models.demand import UNKNOWN, demand
from tilestamp.models.events import INSTRUCTION_CLASSES
from tilestamp.models.events import MachineEvent as E
from tilestamp.models.launch import Launch
from tilestamp.models.machine import Machine
from tilestamp.models.timing import Timing
from tilestamp.simulator.sampling.estimate import Estimate, Floats
from tilestamp.simulator.sampling.expansion import left
from tilestamp.simulator.sampling.strata import Sample
from tilestamp.simulator.sampling.totals import fit_rows, product, totals
from tilestamp.simulator.work import FixedFunctionWork, Work

STEP = 0.02  # by which a slope of the time is found
LEAST = 0.001  # of a time: in which order units follow each other no sample tells (measured)
LONG = 0.1  # of a launch: a unit that takes as long may by itself decide when the launch ends, ...
UNLIKE = 2.0  # ... and may take so many standard deviations longer than foretold

Columns = tuple[E, ...]
EVERYTHING = tuple(E)
CHAIN = tuple(event for event in E if event.name.startswith("CHAIN_"))
SENT = (E.LOAD_TRANSACTIONS, E.STORE_TRANSACTIONS, E.LOAD_BYTES, E.STORE_BYTES)
ISSUED = tuple(event for event in E if event not in CHAIN + SENT)


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
    launch: Launch,
    timing: Timing,
    work: Work,
    sampled: Launch,
    machine: Machine,
    price: Callable[[Floats, Columns], Timing],
) -> Estimate:
    """Time of one launch, by the delta method: a smooth function of the costs of the units that did not run.

    Its slopes by the costs make one cost of each unit, whose total is as unsure as the time is: covariances are those
    of the units. What a total does not tell is added: a unit that takes a good part of the launch may end it.

    Parameters
    ----------
    launch : Launch
        All units, estimated.
    timing : Timing
    work : Work
    sampled : Launch
        The units that ran, without what is known of all.
    machine : Machine
    price : callable
        Time, were these machine events of each unit larger by a share, (units,).
    """
    sample = work.sample
    if sample is None or sample.complete or not np.isfinite(timing.milliseconds):
        return exactly(timing.milliseconds)
    costs, rest = _costs(sampled, machine), np.zeros(len(work.table))
    rest[left(sample)] = 1.0
    remains = totals(sample, costs).value - costs.sum(axis=0)
    steps = [price(STEP * rest, columns).milliseconds - timing.milliseconds for columns in (ISSUED, CHAIN, SENT)]
    slopes = np.where(remains > 0, np.array(steps) / STEP / np.where(remains > 0, remains, 1.0), 0.0)
    half = float(totals(sample, product(costs, slopes[:, None])).half_width[0])
    long = rest * (demand(launch, machine, UNKNOWN).alone > LONG * timing.cycles)
    unseen = _beyond(price(_unlike(sample, costs) * long, EVERYTHING)) - _beyond(timing) if long.any() else 0.0
    return around(timing.milliseconds, half + max(unseen, 0.0) + LEAST * timing.milliseconds)


def _beyond(timing: Timing) -> float:
    """Milliseconds beyond the longest term: those that single units decide."""
    return timing.milliseconds - max(time for name, time in timing.terms.items() if name != "launch")


def _unlike(sample: Sample, costs: Floats) -> float:
    """Share by which one unit may take longer than foretold."""
    drawn = costs[int(sample.taken[0]) :]
    apart, square = (fit_rows(sample, costs).apart ** 2).sum(axis=0), (drawn**2).sum(axis=0)
    return UNLIKE * float(np.sqrt((apart / np.where(square > 0, square, np.inf)).max()))


def _costs(launch: Launch, machine: Machine) -> Floats:
    """Cycles of the units of a launch by ``ISSUED``, ``CHAIN`` and ``SENT``."""
    asked = demand(launch, machine, UNKNOWN)
    start = machine.latency.block_launch_cycles if launch.dispatch == "blocks" else 0.0
    issued = asked.issue if asked.issue.sum() >= asked.shared.sum() else asked.shared
    return np.stack([issued, asked.chain - start, asked.l1], axis=1)
