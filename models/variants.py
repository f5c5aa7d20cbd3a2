"""Variants: machines that differ from one in some numbers, each made when it is looked at.

Making a machine takes longer than pricing a small frame on it. So where only prices depend on the numbers, and a
machine can have them, they stay columns, of which prices need no more.
"""

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, get_args, get_type_hints, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.fitted import moved
from tilestamp.models.machine import SECTIONS, Machine, altered
from tilestamp.models.machine_numbers import within
from tilestamp.models.numbers import Number, key_of, numbers_of
from tilestamp.models.used import collecting

Columns = dict[str, NDArray[Any]]
NOT_ZERO = "latency.l2_cycles", "memory.l2_bytes_per_clock"  # on a machine with an L2


class Variants(Sequence[Machine]):
    """Machines that differ from one in numbers that only prices depend on.

    Parameters
    ----------
    base : Machine
    columns : dict of str to array, (machines,)
        Numbers that a machine can have, by dotted name.
    """

    def __init__(self, base: Machine, columns: Columns) -> None:
        self.base, self._columns = base, columns

    def __repr__(self) -> str:
        """How many, of which machine, and what differs."""
        return f"{len(self)} machines: {self.base.name} with other {', '.join(self._columns)}"

    def __len__(self) -> int:
        """How many machines."""
        return len(next(iter(self._columns.values())))

    @overload
    def __getitem__(self, place: int) -> Machine: ...
    @overload
    def __getitem__(self, place: slice | NDArray[np.intp]) -> "Variants": ...
    def __getitem__(self, place: int | slice | NDArray[np.intp]) -> "Machine | Variants":
        """Make one, or choose some."""
        chosen = {key: column[place] for key, column in self._columns.items()}
        return Variants(self.base, chosen) if isinstance(place, slice | np.ndarray) else altered(self.base, chosen)

    @property
    def numbers(self) -> NDArray[np.float64]:
        """Priced numbers, (machines, len(Number)), float64."""
        numbers = np.tile(numbers_of([self.base]), (len(self), 1))
        for key, column in self._columns.items():
            numbers[:, _priced()[key]] = column
        return numbers


def variants(machine: Machine, numbers: Mapping[str, ArrayLike]) -> Sequence[Machine]:
    """Machines that differ from one in some numbers.

    Parameters
    ----------
    machine : Machine
    numbers : mapping of str to array, (machines,)
        By dotted name (``sm.clock_mhz``); a DataFrame with such columns will do. A lone number is that of all.

    Returns
    -------
    sequence of Machine
        Of some numbers each is made when it is looked at.

    Raises
    ------
    TilestampError
        Columns of unequal length, or what ``altered`` refuses.
    """
    columns = {key: np.atleast_1d(np.array(column)) for key, column in numbers.items()}  # its owner may change it later
    lengths = {len(column) for column in columns.values()} - {1}
    if len(lengths) > 1 or any(column.ndim != 1 for column in columns.values()):
        told = ", ".join(f"{key} {column.shape}" for key, column in columns.items())
        raise TilestampError(f"numbers of many machines need one length, not {told}")
    if not columns:
        return []
    columns = dict(zip(columns, np.broadcast_arrays(*columns.values()), strict=True))
    if not (moved() or collecting()) and all(_only_priced(machine, key, column) for key, column in columns.items()):
        return Variants(machine, columns)
    return [altered(machine, dict(zip(columns, row, strict=True))) for row in zip(*columns.values(), strict=True)]


def some_of(machines: Sequence[Machine], places: NDArray[np.intp]) -> Sequence[Machine]:
    """Choose some of many machines."""
    return machines[places] if isinstance(machines, Variants) else [machines[place] for place in places]


@cache
def _priced() -> dict[str, Number]:
    """Numbers that nothing but prices depends on: those that may be fractions."""
    keys = {key_of(number): number for number in Number}
    kinds = {name: get_type_hints(struct) for name, struct in SECTIONS.items()}
    return {key: number for key, number in keys.items() if kinds[key.split(".")[0]].get(key.split(".")[1]) is float}


def _only_priced(machine: Machine, key: str, column: NDArray[Any]) -> bool:
    """Whether only prices depend on a column, and a machine can have its numbers."""
    if key not in _priced() or column.dtype.kind not in "if" or not column.size:
        return False
    if key in NOT_ZERO and machine.memory.l2_bytes and not column.all():
        return False
    section, name = key.split(".")
    limits = get_args(get_type_hints(SECTIONS[section], include_extras=True)[name])[1]
    return all(within(float(end), limits) for end in (column.min(), column.max()))  # NaN is both, and not within
