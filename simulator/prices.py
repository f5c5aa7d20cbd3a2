"""Prices: what one run takes on many machines, an array row a machine, a column a launch."""

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.launch import Launch, PipeLaunch
from tilestamp.models.machine import Machine, load_machine
from tilestamp.models.occupancy import holding_of
from tilestamp.models.price import Fidelity, Times, check_prices, no_times, prices, taken
from tilestamp.models.variants import Variants, some_of, variants
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.work import FixedFunctionWork, Work

if TYPE_CHECKING:
    import pandas as pd

Launches = list[Launch | PipeLaunch]
TOGETHER = 64  # machines at least that a thread prices at a time
Machines = Iterable[Machine | str | Path] | Mapping[str, ArrayLike]


@dataclass(frozen=True, eq=False)
class Prices:
    """Times of one run on many machines.

    Parameters
    ----------
    machines : sequence of Machine
    stages, kernels : tuple of str
        Of each launch, in launch order.
    milliseconds, low, high : ndarray, (machines, launches), float64
        Time of each launch and its spread (``tilestamp.models.timing``); NaN on a machine that was refused.
    bounds : ndarray, (machines, launches), str
        The term that holds; ``""`` on a machine that was refused.
    refusals : dict of int to str
        By place among ``machines``: why the run has no price there.
    """

    machines: Sequence[Machine]
    stages: tuple[str, ...]
    kernels: tuple[str, ...]
    milliseconds: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    bounds: NDArray[np.str_]
    refusals: dict[int, str] = field(default_factory=dict)

    @property
    def frame(self) -> NDArray[np.float64]:
        """Milliseconds of the frame on each machine, (machines,), float64: its launches one after another."""
        total: NDArray[np.float64] = self.milliseconds.sum(axis=1)
        return total

    def table(self) -> "pd.DataFrame":
        """Tidy table: a row for each machine (by place) and stage, in milliseconds."""
        import pandas as pd

        names = list(dict.fromkeys(self.stages))
        member = np.array([[stage == name for name in names] for stage in self.stages], dtype=np.float64)
        rows: dict[str, NDArray[np.generic]] = {"machine": np.repeat(np.arange(len(self.machines)), len(names))}
        rows["stage"] = np.tile(np.array(names, dtype=object), len(self.machines))
        for column, values in (("milliseconds", self.milliseconds), ("low", self.low), ("high", self.high)):
            rows[column] = (values @ member.reshape(len(self.stages), len(names))).ravel()
        return pd.DataFrame(rows)


def machines_of(machines: Machines, base: Machine) -> Sequence[Machine]:
    """Machines as ``Run.prices`` takes them."""
    if isinstance(machines, Mapping) or hasattr(machines, "columns"):
        return variants(base, machines)  # type: ignore[arg-type]  # a DataFrame has items, as a mapping
    if isinstance(machines, Variants):
        return machines
    if isinstance(machines, Machine | str | Path):
        return [load_machine(machines)]
    return [load_machine(machine) for machine in machines]


def prices_of(
    works: Sequence[Work | FixedFunctionWork],
    machines: Sequence[Machine],
    launches_on: Callable[[Machine], Launches],
    fidelity: Fidelity,
    *,
    skip: bool,
) -> Prices:
    """Price works on many machines, on all threads; see ``Run.prices``.

    Parameters
    ----------
    works : sequence of Work or FixedFunctionWork
    machines : sequence of Machine
    launches_on : callable
        Launches on a machine: the same list for all machines of one mix.
    fidelity : {"counts", "bounds", "schedule"}
    skip : bool
        Whether a machine without a price is left out.
    """
    groups, refusals = _groups(machines, launches_on, skip=skip)
    shape = len(machines), len(works)
    times = no_times(shape, "")
    for launches, places in groups:
        _fill(times, launches, some_of(machines, places), places, fidelity)
    stages, kernels = tuple(work.stage for work in works), tuple(work.kernel for work in works)
    machines = machines if isinstance(machines, Variants) else tuple(machines)
    return Prices(machines, stages, kernels, *times, refusals)


def _groups(
    machines: Sequence[Machine], launches_on: Callable[[Machine], Launches], *, skip: bool
) -> tuple[list[tuple[Launches, NDArray[np.intp]]], dict[int, str]]:
    """Launches, and the places of machines that have them; why others have none, by place."""
    groups: dict[int, tuple[Launches, list[int]]] = {}
    refusals: dict[int, str] = {}
    known: dict[Hashable, Launches] = {}
    if isinstance(machines, Variants) and machines:
        with suppress(TilestampError):  # with what each of them is called
            launches = launches_on(machines[0])
            check_prices(launches, machines[0])
            return [(launches, np.arange(len(machines)))], refusals
    for place, machine in enumerate(machines):
        try:
            key = _launching(machine)
            if key not in known:
                launches = launches_on(machine)
                check_prices(launches, machine)
                known[key] = launches
        except TilestampError as error:
            if not skip:
                raise
            refusals[place] = str(error)
        else:
            groups.setdefault(id(known[key]), (known[key], []))[1].append(place)
    return [(launches, np.array(places)) for launches, places in groups.values()], refusals


def _launching(machine: Machine) -> Hashable:
    """All of a machine that its launches, and whether they have a price there, depend on."""
    pipe = machine.fixed_function
    return machine.simt, machine.compute_capability, holding_of(machine), pipe and tuple(pipe.per_clock)


def _fill(
    times: Times, launches: Launches, machines: Sequence[Machine], places: NDArray[np.intp], fidelity: Fidelity
) -> None:
    """Price machines of one mix in parts, side by side."""
    machines = taken(machines)

    def price_part(part: int, parts: int) -> None:
        some = slice(part * len(machines) // parts, (part + 1) * len(machines) // parts)
        for into, found in zip(times, prices(launches, machines[some], fidelity), strict=True):
            into[places[some]] = found

    for_parts(price_part, parts_of(len(machines), TOGETHER))
