"""Schedule: when units of work start, who is in whose way, and how long the last ones take.

The machine hands units to places in order: to the place that is free first, a block not sooner than the block launch
rate allows. A unit takes its place until three things are over:

*Its own time.* What it takes alone (``Demand.alone``), and what its neighbours on the SM add: both want the SM at the
same time for at most the smaller of its own work there and theirs, and of two that want the same each goes first as
often as the other. So half of the smaller is waited for. Neighbours' work is that of all units, less the longest one of
each SM, a share an SM.

*Its SM.* Schedulers, execution units, shared memory and load path (the fullest) serve units in order, as many at a time
as there are SMs. A block's first request comes a block start after it got its place.

*What it draws from.* An item of a queue begins when the draws before it have passed the fullest atomic unit.

Then three things go on side by side: this schedule of the SMs, the bytes of DRAM or L2 (the fuller), and the atomic
units of the chip. The longest holds. A launch is in step with itself as it begins, so its units want the other two
together, and by the same reasoning half is waited for: half of the smaller of what holds and the others, at most of a
unit's own time, since units fall out of step as they end.

So the time is a sum, a maximum or the lowest of a list of costs all the way: **no cost that falls makes it longer, and
a cost that changes by 1 % changes it by at most 1 %** (it is monotone, and of the first degree in all costs together).
One more SM or place only adds an entry to the lists. Two residents can be in each other's way where one could not, so
the time is never above that of one resident an SM. Equal units take whole rounds (``ceil(units / places)``): that step
is real, and it softens as units differ.

The halves are expectations. ``low`` and ``high`` are the times at which nobody or everybody is in the way, where each
unit waits for the mean share of its time: which one ends last may change, and they stay continuous.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.bounds import Pricing, longest, pricing_of, slots, timing
from tilestamp.models.launch import Launch
from tilestamp.models.list_schedule import list_schedule
from tilestamp.models.machine import Machine
from tilestamp.models.timing import Timing
from tilestamp.models.traffic import Traffic

EXCESS = 1.15  # times the largest term: from here on balance or tail is what holds
IN_THE_WAY = 0.5  # of what two want at the same time: each goes first as often as the other


def schedule(launch: Launch, machine: Machine, traffic: Traffic) -> Timing:
    """Price one launch by its units' starts and ends; parameters and errors as of ``pricing_of``.

    Returns
    -------
    Timing
        Never below ``bounds``. ``details`` has ``busy_sms`` (SMs that got a unit) and ``tail_cycles`` (from the start
        of the last unit to the end).
    """
    pricing = pricing_of(launch, machine, traffic)
    return played(pricing, loads(pricing))


class Loads(NamedTuple):
    """What the units of a launch load the machine with; arrays have a row a unit, in cycles.

    Parameters
    ----------
    sm : ndarray, (units,)
        Of its SM.
    alone : ndarray, (units,)
        What it takes by itself.
    draws : ndarray, (units,)
        Of the fullest atomic unit, where units are drawn from a queue; else of length 0.
    places : int
        Units that the machine holds together.
    sms : int
        SMs that get any.
    interval : float
        Cycles from one start to the next; 0 where units are drawn from a queue.
    start : float
        Cycles from a free place to the first instruction of the block put there; 0 where units are drawn.
    begun : float
        Cycles before persistent blocks draw their first units.
    memory, atomic : float
        Cycles of the fuller of DRAM and L2, and of the atomic units; draws are not among them.
    way : float
        Cycles before their first request and after their last.
    """

    sm: NDArray[np.float64]
    alone: NDArray[np.float64]
    draws: NDArray[np.float64]
    places: int
    sms: int
    interval: float
    start: float
    begun: float
    memory: float
    atomic: float
    way: float


def loads(pricing: Pricing) -> Loads:
    """What the units of a launch load the machine with."""
    launch, machine, units = pricing.launch, pricing.machine, pricing.units
    blocks = launch.dispatch == "blocks"
    places = slots(launch, machine, pricing.residency)
    sm = np.maximum(np.maximum(units.issue, units.shared), units.l1)
    start = machine.latency.block_launch_cycles if len(sm) else 0.0
    return Loads(
        sm=sm,
        alone=np.maximum(np.maximum(units.alone, sm), 1.0),
        draws=np.empty(0) if blocks else units.queue,
        places=int(places.sum()),
        sms=max(1, int(np.count_nonzero(places))),
        interval=pricing.terms["start"] / max(1, len(sm)),
        start=start if blocks else 0.0,
        begun=0.0 if blocks else start,
        memory=max(pricing.terms["dram"], pricing.terms["l2"]),
        atomic=max(pricing.terms["atomic"], pricing.terms["queue"] if blocks else 0.0),
        way=float(units.chain.min()) if len(sm) else 0.0,
    )


def played(pricing: Pricing, units: Loads) -> Timing:
    """Price it."""
    terms = pricing.terms
    least = longest(terms, pricing.units)
    low, end, high, started = ends(units)
    sooner, expected, later = (
        together(units, units.begun + e, s) for e, s in ((low, 0.0), (end, IN_THE_WAY), (high, 1.0))
    )
    cycles = max(expected, least)
    tail = max(0.0, cycles - units.begun - started)
    return timing(
        pricing,
        terms["launch"] + cycles,
        _holds(terms, cycles, tail, units.sms < pricing.machine.sm.count),
        "schedule",
        (terms["launch"] + max(least, sooner), terms["launch"] + max(least, later)),
        busy_sms=float(min(len(units.alone), units.sms)),
        tail_cycles=tail,
    )


def together(units: Loads, end: float, share: float) -> float:
    """Cycles of the SMs, memory and atomic units side by side, for a share of the smaller in each other's way."""
    if not end:
        return 0.0
    own, served = float(units.alone.mean()), float(units.sm.sum()) / units.sms
    sides = (
        (end, 0.0, units.memory + units.atomic),
        (units.memory, units.way, units.atomic + served),
        (units.atomic, units.way, units.memory + served),
    )
    return max(time + trip + share * min(time, others, own) for time, trip, others in sides)


def ends(units: Loads) -> tuple[float, float, float, float]:
    """Cycles to the end of the last unit: at least, expected, at most; and to its start."""
    extra = crowd(units)
    own, more = float(units.alone.sum()), float(extra.sum())
    end, started = _ends(units, units.alone + extra, units.places)
    waited = end * more / (own + more) if more else 0.0
    if more and own / units.sms < end + waited:
        lonely, lonely_started = _ends(units, units.alone, units.sms)
        started = lonely_started if lonely < end else started
        return min(lonely, end - waited), min(lonely, end), min(lonely, end + waited), started
    return end - waited, end, end + waited, started


def _ends(units: Loads, alone: NDArray[np.float64], places: int) -> tuple[float, float]:
    result: tuple[float, float] = list_schedule(
        units.sm, alone, units.draws, places, units.sms, units.interval, units.start
    )
    return result


def crowd(units: Loads) -> NDArray[np.float64]:
    """Cycles that each unit waits for its neighbours."""
    count, sms = len(units.sm), units.sms
    if min(count, units.places) <= sms:
        return np.zeros(count)
    neighbours = np.partition(units.sm, count - sms)[: count - sms].sum() / sms
    waited: NDArray[np.float64] = IN_THE_WAY * np.minimum(units.sm, neighbours)
    return waited


def _holds(terms: dict[str, float], played: float, tail: float, some_idle: bool) -> str:
    """Name what holds: a term, or the lack of balance that the terms do not see."""
    largest = max(terms, key=lambda name: terms[name])
    if largest == "launch" and terms["launch"] > played:
        return largest
    roof = max(value for name, value in terms.items() if name != "launch")
    if played <= EXCESS * roof:
        return max((name for name in terms if name != "launch"), key=lambda name: terms[name])
    if some_idle:
        return "balance"
    return "tail" if tail > (played - roof) / 2 else largest
