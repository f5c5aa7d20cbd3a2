"""Prices: what one run takes on many machines, an array row a machine, a column a launch."""

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.launch import Launch, PipeLaunch
from tilestamp.models.machine import Machine, altered, load_machine
from tilestamp.models.occupancy import holding_of
from tilestamp.models.price import Fidelity, Times, check_prices, no_times, prices, taken
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
    machines : tuple of Machine
    stages, kernels : tuple of str
        Of each launch, in launch order.
    milliseconds, low, high : ndarray, (machines, launches), float64
        Time of each launch and its spread (``tilestamp.models.timing``); NaN on a machine that was refused.
    bounds : ndarray, (machines, launches), str
        The term that holds; ``""`` on a machine that was refused.
    refusals : dict of int to str
        By place among ``machines``: why the run has no price there.
    """

    machines: tuple[Machine, ...]
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


def variants(machine: Machine, numbers: Mapping[str, ArrayLike]) -> list[Machine]:
    """Machines that differ from one in some numbers.

    Parameters
    ----------
    machine : Machine
    numbers : mapping of str to array, (machines,)
        By dotted name (``sm.clock_mhz``); a DataFrame with such columns will do. A lone number is that of all.

    Raises
    ------
    TilestampError
        Columns of unequal length, or what ``altered`` refuses.
    """
    columns = {key: np.atleast_1d(np.asarray(column)) for key, column in numbers.items()}
    lengths = {len(column) for column in columns.values()} - {1}
    if len(lengths) > 1 or any(column.ndim != 1 for column in columns.values()):
        told = ", ".join(f"{key} {column.shape}" for key, column in columns.items())
        raise TilestampError(f"numbers of many machines need one length, not {told}")
    rows = zip(*np.broadcast_arrays(*columns.values()), strict=True) if columns else ()
    return [altered(machine, dict(zip(columns, row, strict=True))) for row in rows]


def machines_of(machines: Machines, base: Machine) -> list[Machine]:
    """Machines as ``Run.prices`` takes them."""
    if isinstance(machines, Mapping) or hasattr(machines, "columns"):
        return variants(base, machines)  # type: ignore[arg-type]  # a DataFrame has items, as a mapping
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
    groups: dict[int, tuple[Launches, list[int]]] = {}
    refusals: dict[int, str] = {}
    known: dict[Hashable, Launches] = {}
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
    shape = len(machines), len(works)
    times = no_times(shape, "")
    for launches, places in groups.values():
        _fill(times, launches, [machines[place] for place in places], np.array(places), fidelity)
    stages, kernels = tuple(work.stage for work in works), tuple(work.kernel for work in works)
    return Prices(tuple(machines), stages, kernels, *times, refusals)


def _launching(machine: Machine) -> Hashable:
    """All of a machine that its launches, and whether they have a price there, depend on."""
    pipe = machine.fixed_function
    return machine.simt, machine.compute_capability, holding_of(machine), pipe and tuple(pipe.per_clock)


def _fill(
    times: Times, launches: Launches, machines: list[Machine], places: NDArray[np.intp], fidelity: Fidelity
) -> None:
    """Price machines of one mix in parts, side by side."""
    machines = taken(machines)

    def price_part(part: int, parts: int) -> None:
        some = slice(part * len(machines) // parts, (part + 1) * len(machines) // parts)
        for into, found in zip(times, prices(launches, machines[some], fidelity), strict=True):
            into[places[some]] = found

    for_parts(price_part, parts_of(len(machines), TOGETHER))
