"""Loaded: one launch on one machine, taken apart as ``models.launch_prices`` puts it together."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.batch import Batch
from tilestamp.models.bounds import Fact, bound_terms
from tilestamp.models.demand import Demand, demand
from tilestamp.models.events import MachineEvent as E
from tilestamp.models.launch import Launch, Shape
from tilestamp.models.machine import Machine
from tilestamp.models.numbers import Number
from tilestamp.models.schedule import Loads, load_units, loads
from tilestamp.models.traffic import Traffic


class Loaded(NamedTuple):
    """What the time of a launch follows from.

    Parameters
    ----------
    shape : Shape
    demand : Demand
        Of each unit.
    loads : Loads
        What the units load the SMs with.
    terms : ndarray, (len(Term),)
    way : float
        Cycles before the first request of the chip's servers and after the last.
    machine : ndarray, (len(Number),)
    facts : ndarray, (len(Fact),)
    """

    shape: Shape
    demand: Demand
    loads: Loads
    terms: NDArray[np.float64]
    way: float
    machine: NDArray[np.float64]
    facts: NDArray[np.float64]

    @property
    def begun(self) -> float:
        """Cycles before persistent blocks draw their first units."""
        return float(self.machine[Number.LATENCY_BLOCK_LAUNCH_CYCLES]) if self.shape.drawn else 0.0


def loaded(launch: Launch, machine: Machine, moved: Traffic) -> Loaded:
    """Take a launch apart.

    Raises
    ------
    TilestampError
        A block that the machine cannot launch.
    """
    batch = Batch([machine])
    row, facts = batch.numbers[0], batch.facts(launch, [moved])[0]
    units = demand(launch, machine, facts[Fact.LOAD_MISS])
    sm, alone = np.empty(len(launch.events)), np.empty(len(launch.events))
    load_units(units, sm, alone)
    terms = bound_terms(launch.shape, units, launch.totals, row, facts)
    found = loads(launch.shape, sm, alone, launch.columns[E.ATOMIC_REQUESTS], terms, row, facts)
    way = float(units.chain.min()) if len(sm) else 0.0
    return Loaded(launch.shape, units, found, terms, way, row, facts)
