"""The prices of one launch on many machines: demands, terms and schedule, one after another, in one kernel."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.bounds import COLUMNS, Fact, bound_machine, bound_terms
from tilestamp.models.demand import SUMS, Demand, demands, rates
from tilestamp.models.events import EVENTS
from tilestamp.models.events import MachineEvent as E
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Launch, Shape
from tilestamp.models.schedule import load_units, loads, play, schedule_machine


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


@kernel
def _price(launch: Shape, events: Any, totals: Any, machines: Any, facts: Any, scheduled: bool, prices: Any) -> None:
    """Fill in all rows; units are looked at anew where their demands, or what starts them, are others."""
    count = launch.units
    units = Demand(np.empty(count), np.empty(count), np.empty(count), np.empty(count), np.empty(count))
    sm, alone = np.empty(count), np.empty(count)
    seen = np.full((SUMS, EVENTS), np.nan)
    for k in range(len(machines)):
        machine, fact, row = machines[k], facts[k], prices[k]
        matrix = rates(launch, machine, fact[Fact.LOAD_MISS], totals)
        if (matrix != seen).any():
            demands(events, matrix, units)
            load_units(units, sm, alone)
            seen = matrix
        terms = bound_terms(launch, units, totals, machine, fact)
        row[: len(terms)] = terms
        way = units.chain.min() if count else 0.0
        if scheduled:
            played = play(loads(launch, sm, alone, events[E.ATOMIC_REQUESTS], terms, machine, fact))
            schedule_machine(launch, played, terms, way, machine, fact, row)
        else:
            bound_machine(terms, way, row)
