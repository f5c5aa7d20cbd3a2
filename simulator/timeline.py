"""Timeline: a run in time, launch after launch, unit by unit, as plain arrays for a trace or a picture."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.events import INSTRUCTION_CLASSES, MachineEvent
from tilestamp.models.launch import Launch, PipeLaunch
from tilestamp.models.spans import Spans, spans
from tilestamp.models.timing import Timing
from tilestamp.models.traffic import Traffic, traffic
from tilestamp.simulator.work import FixedFunctionWork, Work

if TYPE_CHECKING:
    from tilestamp.simulator.priced_frame import PricedFrame

BINS = 500  # of the counters of a launch that takes the whole frame
LEAST = 12  # of those of a short one
Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LaunchTimeline:
    """One launch; times in microseconds from the beginning of the frame.

    Parameters
    ----------
    stage, kernel, bound : str
    begin, units_begin, units_end, end : float
        It begins; its overhead is over; its last unit ends; it ends, as memory and the atomic units have served all.
    start, stop : ndarray, (units,), float64
        Of each unit; of length 0 where the launch was not scheduled.
    sm, slot : ndarray, (units,), int64
        The SM that it is on, and which of the SM's places.
    holds : ndarray, (units,), int64
        What takes longest of the unit's own costs: an index of ``models.spans.OWN``.
    items : ndarray, (units,), int64
        How much it has to do, in ``what``.
    what, unit : str
        What is counted in ``items``, and what a unit is: a block, or an item that is drawn.
    sms : int
        That the machine has.
    slots : int
        Places of an SM.
    counters : dict of str to (times, values)
        Each the mean until the next time.
    """

    stage: str
    kernel: str
    bound: str
    begin: float
    units_begin: float
    units_end: float
    end: float
    sms: int
    start: Floats = field(default_factory=lambda: np.empty(0))
    stop: Floats = field(default_factory=lambda: np.empty(0))
    sm: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))
    slot: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))
    holds: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))
    items: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))
    what: str = ""
    unit: str = "block"
    slots: int = 1
    counters: dict[str, tuple[Floats, Floats]] = field(default_factory=dict)


def timeline(run: "PricedFrame") -> Iterator[LaunchTimeline]:
    """Give the launches of a run in time, one after another.

    Raises
    ------
    TilestampError
        A run without times.
    """
    if run.fidelity == "counts" or not run.counted:
        raise TilestampError("counts alone have no time line; ask for another fidelity")
    now, frame = 0.0, run.milliseconds * 1e3
    moved = traffic(run.launches, run.machine)
    for work, launch, timing, bytes_ in zip(run.frame.works, run.launches, run.timings, moved, strict=True):
        yield _launch(run, work, launch, timing, bytes_, now, frame)
        now += timing.milliseconds * 1e3


def _launch(
    run: "PricedFrame",
    work: Work | FixedFunctionWork,
    launch: Launch | PipeLaunch,
    timing: Timing,
    bytes_: Traffic,
    now: float,
    frame: float,
) -> LaunchTimeline:
    end = now + timing.milliseconds * 1e3
    clock, sms = run.machine.sm.clock_mhz, run.machine.sm.count
    if timing.fidelity != "schedule" or isinstance(launch, PipeLaunch) or isinstance(work, FixedFunctionWork):
        begin = min(end, now + timing.term_cycles.get("launch", 0.0) / clock)
        return LaunchTimeline(timing.stage, timing.kernel, timing.bound, now, begin, begin, end, sms)
    found = spans(launch, run.machine, bytes_)
    what, items = _items(work, launch)
    bins = max(LEAST, round(BINS * (end - now) / frame)) if frame else LEAST
    return LaunchTimeline(
        stage=launch.stage,
        kernel=launch.kernel,
        bound=timing.bound,
        begin=now,
        units_begin=now + found.units_begin / clock,
        units_end=now + found.units_end / clock,
        end=end,
        sms=sms,
        start=now + found.start / clock,
        stop=now + found.end / clock,
        sm=found.place % found.sms,
        slot=found.place // found.sms,
        holds=found.holds,
        items=items,
        what=what,
        unit="block" if launch.dispatch == "blocks" else "item",
        slots=-(-found.places // found.sms),
        counters=_counters(found, launch, bytes_, run.machine.sm.warp_size, bins, now, clock),
    )


def _items(work: Work, launch: Launch) -> tuple[str, NDArray[np.int64]]:
    """How much each unit has to do: the event that its stage declares the distribution or else the sum of, first."""
    kinds = sorted(work.counters, key=lambda counter: counter.kind != "distribution")
    for counter in kinds:
        if counter.kind in ("distribution", "count"):
            return counter.name, work.table[:, work.events[counter.event]]
    return "instructions", launch.events[:, list(INSTRUCTION_CLASSES)].sum(axis=1).round().astype(np.int64)


def _counters(
    found: Spans, launch: Launch, bytes_: Traffic, warp: int, bins: int, now: float, clock: float
) -> dict[str, tuple[Floats, Floats]]:
    """Warps that are resident, bandwidths, and the backlog of the fullest atomic unit, over ``bins`` equal times.

    What a unit moves is spread evenly over its time.
    """
    edges = np.linspace(found.units_begin, max(found.units_end, found.units_begin + 1.0), bins + 1)
    step, times = float(edges[1] - edges[0]), now + edges / clock
    warps = 1 if launch.dispatch == "warp_queue" else -(-launch.block // warp)
    per_byte = clock * 1e-3 / step  # bytes in a step to GB/s
    share = _shares(launch.columns[MachineEvent.LOAD_BYTES] + launch.columns[MachineEvent.STORE_BYTES])
    values = {"resident warps": np.diff(_spread(found, warps * (found.end - found.start), edges)) / step}
    for name, total in (("DRAM GB/s", bytes_.dram_bytes), ("L2 GB/s", bytes_.l2_bytes)):
        if total:
            values[name] = np.diff(_spread(found, share * total, edges)) * per_byte
    if found.queue:
        waiting = _shares(launch.columns[MachineEvent.ATOMIC_REQUESTS]) * found.queue
        ahead = _spread(found, waiting, edges) - (edges - edges[0])  # less what it could have served
        values["atomic backlog us"] = (ahead - np.minimum.accumulate(np.minimum(ahead, 0.0)))[:-1] / clock
    return {name: (times, np.append(series, 0.0)) for name, series in values.items()}


def _shares(amounts: Floats) -> Floats:
    """Each unit's share of a total; equal shares of nothing."""
    total = amounts.sum()
    return amounts / total if total else np.full(len(amounts), 1.0 / max(1, len(amounts)))


def _spread(found: Spans, amounts: Floats, edges: Floats) -> Floats:
    """Sum until each edge of amounts, each spread evenly from its unit's start to its end."""
    rate = amounts / np.maximum(found.end - found.start, 1e-9)
    times = np.concatenate([found.start, found.end])
    order = np.argsort(times, kind="stable")
    slopes = np.cumsum(np.concatenate([rate, -rate])[order])
    until = np.concatenate([[0.0], np.cumsum(slopes[:-1] * np.diff(times[order]))])
    summed: Floats = np.interp(edges, times[order], until)
    return summed
