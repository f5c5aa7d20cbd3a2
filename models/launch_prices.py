"""The prices of one launch on many machines: demands, terms and schedule, one after another, in one kernel."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.bounds import COLUMNS, TAIL, Term, bound_launch, bound_terms, moved_of
from tilestamp.models.demand import SUMS, Demand, Whole, demands, rates
from tilestamp.models.events import EVENTS
from tilestamp.models.events import MachineEvent as E
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Launch, Shape
from tilestamp.models.numbers import Number as M
from tilestamp.models.schedule import Loads, Played, load_units, loads, play, schedule_launch


def launch_prices(
    launch: Launch, machines: NDArray[np.float64], facts: NDArray[np.float64], *, scheduled: bool
) -> NDArray[np.float64]:
    """Price one launch on many machines.

    Parameters
    ----------
    launch : Launch
    machines : ndarray, (machines, len(Number)), float64
        Of ``tilestamp.models.numbers``.
    facts : ndarray, (machines, len(Fact)), float64
    scheduled : bool
        By the schedule of its units, else by the roofline.

    Returns
    -------
    ndarray, (machines, COLUMNS), float64
        Cycles of each ``Term``, and each ``Result``.
    """
    prices = np.zeros((len(machines), COLUMNS))
    _price(launch.shape, launch.columns, launch.totals, machines, facts, scheduled, prices)
    return prices


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
    found = Demand(*np.empty((len(Demand._fields), len(launch.events))))
    units = np.empty(len(launch.events)), np.empty(len(launch.events)), np.empty(len(launch.events))
    whole = demands(launch.columns, rates(launch.shape, machine, moved_of(facts), launch.totals), found)
    load_units(found, *units)
    terms = bound_terms(launch.shape, whole, launch.totals, machine, facts)
    sizes = launch.columns[E.LOAD_BYTES] + launch.columns[E.STORE_BYTES]
    loaded = loads(launch.shape, units, launch.columns[E.ATOMIC_REQUESTS], sizes, terms, whole.way, machine, facts)
    return Opened(found, terms, loaded)


@kernel
def _price(launch: Shape, events: Any, totals: Any, machines: Any, facts: Any, scheduled: bool, prices: Any) -> None:
    """Fill in all rows; what units ask for, and how the SMs work them off, is made anew where it is another."""
    count = launch.units
    table = np.empty((6, count))
    units = Demand(table[0], table[1], table[2], table[3], table[4], table[5])
    sm, own, alone = np.empty(count), np.empty(count), np.empty(count)
    sizes = events[E.LOAD_BYTES] + events[E.STORE_BYTES]
    seen, whole = np.full((SUMS, EVENTS), np.nan), Whole(0.0, 0.0, 0.0, 0.0, 0.0)
    settled, played = (-1.0, 0.0, 0.0, 0.0, 0.0, 0.0), Played(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for k in range(len(machines)):
        machine, fact, row = machines[k], facts[k], prices[k]
        matrix = rates(launch, machine, moved_of(fact), totals)
        if (matrix != seen).any():
            whole = demands(events, matrix, units)
            load_units(units, sm, own, alone)
            seen, settled = matrix, (-1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        terms = bound_terms(launch, whole, totals, machine, fact)
        for column in range(
            TAIL
        ):  # Numba compiles row[:TAIL] = terms for a second: what it would say of unlike lengths
            row[column] = terms[column]
        if scheduled:
            loaded = loads(launch, (sm, own, alone), events[E.ATOMIC_REQUESTS], sizes, terms, whole.way, machine, fact)
            queue, pace = terms[Term.QUEUE] if launch.drawn else loaded.memory, loaded.pace
            now = (float(loaded.places), float(loaded.sms), pace.interval, pace.start, pace.slower, queue)
            if now != settled:
                played, settled = play(loaded), now
            schedule_launch(loaded, played, terms, loaded.sms < machine[M.SM_COUNT], row)
        else:
            bound_launch(terms, whole.way, row)
