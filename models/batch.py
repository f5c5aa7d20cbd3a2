"""A batch: machines to price the same launches on, and what they have in common.

Of a launch three facts differ from machine to machine and are no number of either: the blocks that an SM holds, what
the caches move, and the fullest atomic unit. Each follows from a few numbers of a machine, its key, and is made once
for all machines that have the same. What makes it takes of a machine no more than the key, so that nothing can be
missing there.
"""

from collections.abc import Callable, Hashable, Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.atomic_units import dealing_of, fullest_unit_ns
from tilestamp.models.bounds import Fact
from tilestamp.models.launch import Launch, PipeLaunch
from tilestamp.models.launch_prices import launch_prices
from tilestamp.models.machine import Machine
from tilestamp.models.numbers import Number, numbers_of
from tilestamp.models.occupancy import holding_of, residency
from tilestamp.models.traffic import Traffic, caches_of, traffic

T = TypeVar("T")


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
        numbers = numbers_of(machines)
        self.order = np.lexsort(numbers.T[::-1])
        self.numbers, machines = numbers[self.order], [machines[place] for place in self.order]
        self.machines = machines
        self._holding, self._caches, self._dealing = (_Shared(machines, k) for k in (holding_of, caches_of, dealing_of))

    @property
    def clock_hz(self) -> NDArray[np.float64]:
        """Issue clocks in Hz, (machines,)."""
        return self.numbers[:, Number.SM_CLOCK_MHZ] * 1e6

    def traffic(self, launches: Sequence[Launch | PipeLaunch]) -> list[list[Traffic]]:
        """Bytes of each launch of a frame, a list with an entry a machine."""
        moved = [traffic(launches, machine) for machine in self._caches.machines]
        return [self._caches.each(launch) for launch in zip(*moved, strict=True)]

    def prices(self, launch: Launch, moved: Sequence[Traffic], *, scheduled: bool) -> NDArray[np.float64]:
        """Price one launch, (machines, COLUMNS); see ``launch_prices`` and ``facts``."""
        return launch_prices(launch, self.numbers, self.facts(launch, moved), scheduled=scheduled)

    def facts(self, launch: Launch, moved: Sequence[Traffic]) -> NDArray[np.float64]:
        """Facts of one launch, (machines, len(Fact)).

        Parameters
        ----------
        launch : Launch
        moved : sequence of Traffic
            Its bytes on each machine.

        Raises
        ------
        TilestampError
            A block that a machine cannot launch.
        """
        facts = np.empty((len(self.machines), len(Fact)))
        held = [residency(m, launch.block, launch.registers, launch.shared_bytes) for m in self._holding.machines]
        facts[:, Fact.RESIDENT_BLOCKS] = self._holding.each([each.blocks for each in held])
        facts[:, Fact.DRAM_BYTES : Fact.GAP_LINES + 1] = moved
        facts[:, Fact.FULLEST_NS] = 0.0
        if launch.atomic_requests is not None:
            fullest = [fullest_unit_ns(launch.atomic_requests, dealing_of(m)) for m in self._dealing.machines]
            facts[:, Fact.FULLEST_NS] = self._dealing.each(fullest)
        return facts


class _Shared:
    """What some machines have in common: one of them for each key, and who has the same."""

    def __init__(self, machines: Sequence[Machine], key: Callable[[Machine], Hashable]) -> None:
        places: dict[Hashable, int] = {}
        self._which = [places.setdefault(key(machine), len(places)) for machine in machines]
        self.machines = [machines[self._which.index(place)] for place in range(len(places))]

    def each(self, values: Sequence[T]) -> list[T]:
        """Give each machine the value of its key's."""
        return [values[place] for place in self._which]
