"""The prices of one launch on many machines: demands, terms and schedule, one after another, in one kernel."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.bounds import TAIL, Term, bound_launch, bound_terms, moved_of
from tilestamp.models.demand import SUMS, Demand, Whole, demand_of, demands, rates
from tilestamp.models.events import EVENTS
from tilestamp.models.events import MachineEvent as E
from tilestamp.models.kernel import kernel
from tilestamp.models.kinds import Kinds, each_a_kind
from tilestamp.models.launch import Launch, Shape
from tilestamp.models.numbers import Number as M
from tilestamp.models.schedule import Loads, Played, load_units, loads, play, schedule_launch
from tilestamp.models.sums import TOGETHER


def launch_prices(
    launch: Launch,
    machines: NDArray[np.float64],
    facts: NDArray[np.float64],
    prices: NDArray[np.float64],
    *,
    scheduled: bool,
) -> None:
    """Price one launch on many machines.

    Parameters
    ----------
    launch : Launch
    machines : ndarray, (machines, len(Number)), float64
        Of ``tilestamp.models.numbers``.
    facts : ndarray, (machines, len(Fact)), float64
    prices : ndarray, (machines, COLUMNS), float64
        Filled in: cycles of each ``Term``, and each ``Result``.
    scheduled : bool
        By the schedule of its units, else by the roofline.
    """
    _price(launch.shape, launch.kinds, launch.totals, machines, facts, scheduled, prices)


class Opened(NamedTuple):
    """What the price of one launch on one machine is made of.

    Parameters
    ----------
    units : Demand
    terms : ndarray, (len(Term),)
        Cycles.
    loads : Loads
    """

    units: Demand
    terms: NDArray[np.float64]
    loads: Loads


def launch_loads(launch: Launch, machine: NDArray[np.float64], facts: NDArray[np.float64]) -> Opened:
    """What the price of one launch on one machine is made of; parameters as a row of those of ``launch_prices``."""
    units, matrix = each_a_kind(launch.columns), np.empty((SUMS, EVENTS))
    found, costs = demand_of(len(launch.events)), np.empty((3, len(launch.events)))
    rates(launch.shape, machine, moved_of(facts), launch.totals, matrix)
    whole = demands(units, matrix, np.empty((SUMS, TOGETHER)), found)
    load_units(found, *costs)
    terms = np.empty(TAIL)
    bound_terms(launch.shape, whole, launch.totals, machine, facts, terms)
    amounts = amounts_of(launch.shape, units.events)
    loaded = loads(launch.shape, units.which, tuple(costs), amounts, terms, whole.way, machine, facts)
    return Opened(found, terms, loaded)


@kernel
def _price(launch: Shape, units: Kinds, totals: Any, machines: Any, facts: Any, scheduled: bool, prices: Any) -> None:
    """Fill in all rows; what units ask for, and how the SMs work them off, is made anew where it is another."""
    kinds = units.events.shape[1]
    found, amounts = demand_of(kinds), amounts_of(launch, units.events)
    sm, own, alone = np.empty(kinds), np.empty(kinds), np.empty(kinds)
    sums, matrix, seen = np.empty((SUMS, TOGETHER)), np.empty((SUMS, EVENTS)), np.full((SUMS, EVENTS), np.nan)
    whole = Whole(0.0, 0.0, 0.0, 0.0, 0.0)
    settled, played = (-1.0, 0.0, 0.0, 0.0, 0.0, 0.0), Played(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for k in range(len(machines)):
        machine, fact, row = machines[k], facts[k], prices[k]
        rates(launch, machine, moved_of(fact), totals, matrix)
        if not _alike(matrix, seen):
            whole = demands(units, matrix, sums, found)
            load_units(found, sm, own, alone)
            matrix, seen, settled = seen, matrix, (-1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        terms = row[:TAIL]
        bound_terms(launch, whole, totals, machine, fact, terms)
        if scheduled:
            loaded = loads(launch, units.which, (sm, own, alone), amounts, terms, whole.way, machine, fact)
            queue, pace = terms[Term.QUEUE] if launch.drawn else loaded.memory, loaded.pace
            now = (float(loaded.places), float(loaded.sms), pace.interval, pace.start, pace.slower, queue)
            if now != settled:
                played, settled = play(loaded), now
            schedule_launch(loaded, played, terms, loaded.sms < machine[M.SM_COUNT], row)
        else:
            bound_launch(terms, whole.way, row)


@kernel
def amounts_of(launch: Shape, events: Any) -> Any:
    """What serves all units one after another has to do for each kind: ``loads``."""
    return events[E.ATOMIC_REQUESTS] if launch.drawn else events[E.LOAD_BYTES] + events[E.STORE_BYTES]


@kernel(lent=True)
def _alike(one: Any, other: Any) -> bool:
    """Whether two matrices are the same."""
    for i in range(len(one)):
        for j in range(one.shape[1]):
            if one[i, j] != other[i, j]:
                return False
    return True
