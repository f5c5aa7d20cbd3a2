"""Schedule: when units of work start, who is in whose way, and how long the last ones take.

The machine hands units to places in order: to the place that is free first, a block not sooner after the one before it
than the block launch rate allows. So while long blocks fill all places nothing starts, and that time is lost: empty
blocks behind them have to be started one by one. A unit takes its place until four things are over:

*Its own time.* What it takes alone (``Demand.alone``), and what its neighbours on the SM add: both want a scheduler, or
the SM, at the same time for at most the smaller of its own work there and theirs, and of two that want the same each
goes first as often as the other. So half of the smaller is waited for. Neighbours' work is that of all units, less the
longest one of each SM, a share an SM. Loops take turns (``models.turns``).

*Its SM.* Schedulers, execution units, shared memory and load path (the fullest) serve units in order, as many at a time
as there are SMs. A block's first request comes a block start after it got its place.

*Memory.* DRAM or L2, the fuller of the two, serves the bytes of blocks in order. So blocks that find nothing to do
start only when those before them, which have, leave their places. Blocks that start together want it together and
leave together, so that it idles while the next ones start: until it has served all, a block that waited for its place
goes on more slowly by itself (``Pace.slower``, measured: 1 where it was not).

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

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.bounds import TAIL, Result, Term, longest, places_of
from tilestamp.models.demand import IN_THE_WAY, Demand
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Shape
from tilestamp.models.list_schedule import Pace, Record, list_schedule, list_schedules, record_of, total
from tilestamp.models.numbers import Number as M
from tilestamp.models.partition import partitioned
from tilestamp.models.turns import at_least, in_turn, rest_of

EXCESS = 1.15  # times the largest term: from here on balance or tail is what holds


class Loads(NamedTuple):
    """What the units of a launch load the machine with; arrays of costs have a row a kind of unit, in cycles.

    Parameters
    ----------
    which : ndarray, (units,)
        Kind of each unit (``models.kinds``).
    sm : ndarray, (kinds,)
        Of its SM.
    own : ndarray, (kinds,)
        Of the schedulers that it has a warp on; as ``sm`` where it has one on each, or where something else is fuller.
    alone : ndarray, (kinds,)
        What it takes by itself.
    draws : ndarray, (kinds,)
        Of the fullest atomic unit, where units are drawn from a queue; else of length 0.
    moves : ndarray, (kinds,)
        Of the fuller of DRAM and L2, where units are blocks of the grid; else of length 0.
    places : int
        Units that the machine holds together.
    sms : int
        SMs that get any.
    pace : Pace
        In cycles; ``interval`` and ``start`` are 0 where units are drawn from a queue.
    begun : float
        Cycles before persistent blocks draw their first units.
    memory, atomic : float
        Cycles of the fuller of DRAM and L2, and of the atomic units; draws are not among them.
    way : float
        Cycles before their first request and after their last: one round trip of the shortest chain.
    loop : bool
        As in ``Launch``.
    """

    which: NDArray[np.uint32]
    sm: NDArray[np.float64]
    own: NDArray[np.float64]
    alone: NDArray[np.float64]
    draws: NDArray[np.float64]
    moves: NDArray[np.float64]
    places: int
    sms: int
    pace: Pace
    begun: float
    memory: float
    atomic: float
    way: float
    loop: bool


class Played(NamedTuple):
    """How the SMs work the units off, in cycles.

    Parameters
    ----------
    low, end, high : float
        End of the last unit: at least, expected, at most.
    started : float
        When the unit that ends last got its place.
    own : float
        What a unit takes by itself, in the mean.
    served : float
        What an SM serves in all, in the mean.
    held : float
        What all units together hold their places.
    """

    low: float
    end: float
    high: float
    started: float
    own: float
    served: float
    held: float


@kernel(lent=True)
def load_units(units: Demand, sm: Any, own: Any, alone: Any) -> None:
    """Fill in ``Loads.sm``, ``Loads.own`` and ``Loads.alone``."""
    for i in range(len(sm)):
        busy = max(max(units.issue[i], units.shared[i]), units.l1[i])
        sm[i], own[i] = busy, max(busy, units.scheduler[i])
        alone[i] = max(max(units.alone[i], busy), 1.0)


@kernel
def loads(
    launch: Shape, which: Any, costs: Any, amounts: Any, terms: Any, way: float, machine: Any, facts: Any
) -> Loads:
    """What the units of a launch load the machine with.

    Parameters
    ----------
    launch : Shape
    which : ndarray, (units,)
    costs : tuple of three ndarrays, (kinds,)
        ``Loads.sm``, ``Loads.own`` and ``Loads.alone``.
    amounts : ndarray, (kinds,)
        Of what serves all units one after another: atomic requests where they are drawn from a queue, else bytes.
    terms : ndarray, (len(Term),)
    way : float
        The shortest chain.
    machine : ndarray, (len(Number),)
    facts : ndarray, (len(Fact),)
    """
    count, (sm, own, alone), nothing = launch.units, costs, np.empty(0)
    serves = terms[Term.QUEUE] if launch.drawn else max(terms[Term.DRAM], terms[Term.L2])
    shares = _shares(amounts, which, serves)
    places, sms = places_of(launch, machine, facts)
    start = machine[M.LATENCY_BLOCK_LAUNCH_CYCLES] if count else 0.0
    memory = max(terms[Term.DRAM], terms[Term.L2])
    if launch.drawn:
        pace, atomic = Pace(0.0, 0.0, 1.0), terms[Term.ATOMIC]
        return Loads(which, sm, own, alone, shares, nothing, places, sms, pace, start, memory, atomic, way, launch.loop)
    atomic = max(terms[Term.ATOMIC], terms[Term.QUEUE])
    slower = 1.0 if launch.loop else machine[M.MEMORY_LOADED_LATENCY]  # a loop has its share of memory all along
    pace = Pace(terms[Term.START] / max(1, count), start, slower)
    if launch.loop:
        sm, own, alone = at_least(sm, sms * shares), at_least(own, sms * shares), at_least(alone, sms * shares)
    return Loads(which, sm, own, alone, nothing, shares, places, sms, pace, 0.0, memory, atomic, way, launch.loop)


@kernel
def _shares(amounts: Any, which: Any, cycles: float) -> Any:
    """Deal cycles to units by their amounts, (kinds,); alike where all are 0."""
    whole = total(amounts, which)
    return amounts * (cycles / whole) if whole > 0 else np.full(len(amounts), cycles / max(1, len(which)))


@kernel
def play(units: Loads) -> Played:
    """Work the units off."""
    count = len(units.which)
    own, work = total(units.alone, units.which), total(units.sm, units.which)
    mean, served = own / max(1, count), work / units.sms
    crowded, more = crowd(units)
    if not more or units.loop:
        end, started, held = ends(units, crowded, units.places, record_of(0))
        waited = end * more / (own + more) if more else 0.0
        return Played(end - waited, end, end + waited, started, mean, served, held)
    costs = units.which, units.sm, crowded, units.alone, units.draws, units.moves
    (end, started, held), lonely = list_schedules(*costs, units.places, units.sms, units.pace)
    waited = end * more / (own + more)
    low, high = end - waited, end + waited
    if own / units.sms < high:
        if lonely[0] < end:
            end, started, held = lonely
        low, high = min(lonely[0], low), min(lonely[0], high)
    return Played(low, end, high, started, mean, served, held)


@kernel
def ends(units: Loads, alone: Any, places: int, record: Record) -> tuple[float, float, float]:
    """``list_schedule`` of what the units load the machine with."""
    loads = units.which, units.sm, alone, units.draws, units.moves
    return list_schedule(*loads, places, units.sms, units.pace, record)  # type: ignore[no-any-return]


@kernel
def crowd(units: Loads) -> tuple[Any, float]:
    """What a unit of each kind takes by itself and waits for its neighbours, (kinds,), and the cycles that all wait."""
    count = len(units.which)
    if min(count, units.places) <= units.sms:
        return units.alone, 0.0
    rest, others, work = np.empty(0), 0.0, total(units.sm, units.which)
    if units.loop:
        rest = rest_of(units.sm, units.places, units.sms)
        others = (min(count, units.places) / units.sms - 1.0) * work / total(units.alone, units.which)
    near = 0.0 if units.loop else _neighbours(units, work)
    waits = np.empty(len(units.sm))
    for i in range(len(waits)):
        wait = in_turn(units.own[i], units.alone[i], rest[i], others) if units.loop else min(units.own[i], near)
        waits[i] = wait * IN_THE_WAY
    return units.alone + waits, total(waits, units.which)


@kernel
def _neighbours(units: Loads, work: float) -> float:
    """Work of a unit's neighbours on its SM; of more than the longest unit's own it does not matter how much."""
    count, sms, most = len(units.which), units.sms, units.own.max()
    if work >= sms * (units.sm.max() + most):
        return most  # type: ignore[no-any-return]
    return partitioned(units.sm[units.which], count - sms)[: count - sms].sum() / sms  # type: ignore[no-any-return]


@kernel(lent=True)
def schedule_launch(units: Loads, played: Played, terms: Any, some_idle: bool, row: Any) -> None:
    """Fill in a row of ``Result`` by the schedule; ``some_idle``: whether an SM gets nothing."""
    least, before = longest(terms, units.way), terms[Term.LAUNCH]
    cycles = max(least, together(units, played, units.begun + played.end, IN_THE_WAY))
    row[Result.CYCLES] = before + cycles
    row[Result.LOW] = before + max(least, together(units, played, units.begun + played.low, 0.0))
    row[Result.HIGH] = before + max(least, together(units, played, units.begun + played.high, 1.0))
    row[Result.TAIL_CYCLES] = max(0.0, cycles - units.begun - played.started)
    busy = min(len(units.which), units.sms)
    row[Result.BUSY_SMS] = busy
    if len(units.draws):  # by blocks that stay until all is drawn
        row[Result.HELD] = units.places / units.sms
    elif played.end:
        row[Result.HELD] = played.held / (busy * played.end)
    row[Result.BOUND] = holds(terms, cycles, row[Result.TAIL_CYCLES], some_idle)


@kernel(lent=True)
def together(units: Loads, played: Played, end: float, share: float) -> float:
    """Cycles of the SMs, memory and atomic units side by side, for a share of the smaller in each other's way."""
    if end == 0.0:
        return 0.0
    memory, atomic, own = units.memory, units.atomic, played.own
    sms = end + share * min(min(end, memory + atomic), own)
    dram = memory + units.way + share * min(min(memory, atomic + played.served), own)
    locks = atomic + units.way + share * min(min(atomic, memory + played.served), own)
    longest_side: float = max(max(sms, dram), locks)
    return longest_side


@kernel(lent=True)
def holds(terms: Any, played: float, tail: float, some_idle: bool) -> int:
    """Name what holds: a term, or the lack of balance that the terms do not see."""
    largest, inner = int(np.argmax(terms)), int(np.argmax(terms[: Term.LAUNCH]))
    if largest == Term.LAUNCH and terms[Term.LAUNCH] > played:
        return largest
    if played <= EXCESS * terms[inner]:
        return inner
    if some_idle:
        return Term.BALANCE
    return TAIL if tail > (played - terms[inner]) / 2 else largest
