"""A batch: machines to price the same launches on, and what they have in common.

Of a launch three facts differ from machine to machine and are no number of either: the blocks that an SM holds, what
the caches move, and the fullest atomic unit. Each follows from a few numbers of a machine, its key, and is made once
for all machines that have the same. What makes it takes of a machine no more than the key, so that nothing can be
missing there.
"""

from collections.abc import Callable, Hashable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tilestamp.models.atomic_units import Dealing, dealing_of, fullest_unit_ns
from tilestamp.models.bounds import COLUMNS, Fact
from tilestamp.models.launch import Launch, PipeLaunch
from tilestamp.models.launch_prices import launch_prices
from tilestamp.models.machine import Machine
from tilestamp.models.numbers import Number, numbers_of
from tilestamp.models.occupancy import holding_of, residency
from tilestamp.models.traffic import Traffic, caches_of, traffic
from tilestamp.models.variants import Variants, some_of


class Batch:
    """Machines, those that share work side by side.

    Parameters
    ----------
    machines : sequence of Machine

    Attributes
    ----------
    order : ndarray, (machines,)
        Place among those given of each of its machines.
    """

    def __init__(self, machines: Sequence[Machine]) -> None:
        numbers = machines.numbers if isinstance(machines, Variants) else numbers_of(machines)
        self.order = np.lexsort(numbers.T[::-1])
        self.numbers, machines = numbers[self.order], some_of(machines, self.order)
        self.machines = machines
        self._holding, self._caches, self._dealing = (_Shared(machines, k) for k in (holding_of, caches_of, dealing_of))

    @property
    def clock_hz(self) -> NDArray[np.float64]:
        """Issue clocks in Hz, (machines,)."""
        return self.numbers[:, Number.SM_CLOCK_MHZ] * 1e6

    def traffic(self, launches: Sequence[Launch | PipeLaunch]) -> NDArray[np.float64]:
        """Bytes of each launch of a frame, (launches, machines, len(Traffic))."""
        moved = [traffic(launches, machine) for machine in self._caches.machines]
        return self._caches.each(np.array(moved).reshape(len(moved), len(launches), len(Traffic._fields))).swapaxes(
            0, 1
        )

    def prices(
        self, launches: Sequence[Launch | PipeLaunch], moved: NDArray[np.float64], *, scheduled: bool
    ) -> NDArray[np.float64]:
        """Price the launches of a frame, (launches, machines, COLUMNS); see ``launch_prices`` and ``facts``.

        Passes of the fixed-function pipe are left out: their rows are 0.
        """
        prices = np.zeros((*moved.shape[:2], COLUMNS))
        for launch, facts, into in zip(launches, self.facts(launches, moved), prices, strict=True):
            if isinstance(launch, Launch):
                launch_prices(launch, self.numbers, facts, into, scheduled=scheduled)
        return prices

    def facts(self, launches: Sequence[Launch | PipeLaunch], moved: NDArray[np.float64]) -> NDArray[np.float64]:
        """Facts of the launches of a frame, (launches, machines, len(Fact)); of the fixed-function pipe: its bytes.

        Parameters
        ----------
        launches : sequence of Launch or PipeLaunch
        moved : ndarray, (launches, machines, len(Traffic))
            Their bytes on each machine.

        Raises
        ------
        TilestampError
            A block that a machine cannot launch.
        """
        facts = np.zeros((*moved.shape[:2], len(Fact)))
        facts[:, :, Fact.DRAM_BYTES : Fact.GAP_LINES + 1] = moved
        for launch, into in zip(launches, facts, strict=True):
            if isinstance(launch, Launch):
                asked = launch.block, launch.registers, launch.shared_bytes
                held = [residency(machine, *asked).blocks for machine in self._holding.machines]
                into[:, Fact.RESIDENT_BLOCKS] = self._holding.each(held)
                requests, known = launch.atomic_requests, launch.fullest_ns
                if requests is not None:
                    dealt = [_fullest_ns(requests, dealing_of(machine), known) for machine in self._dealing.machines]
                    into[:, Fact.FULLEST_NS] = self._dealing.each(dealt)
        return facts


def _fullest_ns(requests: NDArray[np.int64], dealing: Dealing, known: dict[Hashable, float]) -> float:
    """Time of the fullest atomic unit, if it is not known: finding it takes longer than the rest of a price."""
    if dealing not in known:
        known[dealing] = fullest_unit_ns(requests, dealing)
    return known[dealing]


class _Shared:
    """What some machines have in common: one of them for each key, and who has the same."""

    def __init__(self, machines: Sequence[Machine], key: Callable[[Machine], Hashable]) -> None:
        if isinstance(machines, Variants):
            self._which, self.machines = np.zeros(len(machines), np.intp), [machines[0]]
            return
        places: dict[Hashable, int] = {}
        self._which = np.array([places.setdefault(key(machine), len(places)) for machine in machines], np.intp)
        _, firsts = np.unique(self._which, return_index=True)
        self.machines = [machines[first] for first in firsts]

    def each(self, values: ArrayLike) -> NDArray[np.float64]:
        """Give each machine the value of its key's, along the first axis."""
        found: NDArray[np.float64] = np.asarray(values, np.float64)[self._which]
        return found
