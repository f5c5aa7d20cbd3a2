"""Kinds: units of a launch that have the same events cost the same, so that each cost is made once a kind."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kernel import kernel

FEW = 100  # units: to group so few costs more than their prices
PRIMES = 0x9E3779B1, 0x85EBCA77  # of 32 bits, so that no product is of more than 64


class Kinds(NamedTuple):
    """The units of a launch by kind.

    Parameters
    ----------
    events : ndarray, (EVENTS, kinds), float64
        Machine events of a unit of each kind.
    which : ndarray, (units,), uint32
        Kind of each unit, in the order in which units start.
    """

    events: NDArray[np.float64]
    which: NDArray[np.uint32]


def each_a_kind(columns: NDArray[np.float64]) -> Kinds:
    """Units of which each is a kind of its own; ``columns`` are their events, (EVENTS, units)."""
    return Kinds(columns, np.arange(columns.shape[1], dtype=np.uint32))


def kinds_of(columns: NDArray[np.float64], used: NDArray[np.intp]) -> Kinds:
    """Units with the same events made one kind.

    Parameters
    ----------
    columns : ndarray, (EVENTS, units), float64
    used : ndarray, (columns,), intp
        Those columns that are not 0 in all units.
    """
    units = columns.shape[1]
    if units < FEW:
        return each_a_kind(columns)
    which, firsts, marks = np.empty(units, np.uint32), np.empty(units, np.int64), np.zeros(units, np.uint64)
    table = np.zeros(1 << (2 * units).bit_length(), np.uint32)
    kinds = _group(columns.view(np.uint64), used, marks, table, which, firsts)
    return Kinds(np.ascontiguousarray(columns[:, firsts[:kinds]]), which)


@kernel(lent=True)
def _group(columns: Any, used: Any, marks: Any, table: Any, which: Any, firsts: Any) -> int:
    """Number kinds in the order of their first units, which are filled in; return how many there are.

    Units meet in ``table`` by a mark of all their events; the number of a kind, from 1, stands at its mark or behind.
    """
    half, low, kinds = np.uint64(32), np.uint64(0xFFFFFFFF), 0
    for column in used:
        for i in range(len(marks)):
            mixed = marks[i] ^ columns[column, i]
            mixed = (mixed & low) * np.uint64(PRIMES[0]) ^ (mixed >> half) * np.uint64(PRIMES[1])
            marks[i] = mixed ^ (mixed >> half)
    last = np.uint64(len(table) - 1)
    for i in range(len(marks)):
        slot = marks[i] & last
        while table[slot] and not _same(columns, used, marks, i, firsts[table[slot] - 1]):
            slot = (slot + np.uint64(1)) & last
        if not table[slot]:
            firsts[kinds] = i
            kinds += 1
            table[slot] = kinds
        which[i] = table[slot] - 1
    return kinds


@kernel(lent=True)
def _same(columns: Any, used: Any, marks: Any, one: int, other: int) -> bool:
    """Whether two units have the same events."""
    if marks[one] != marks[other]:
        return False
    for column in used:  # noqa: SIM110 - Numba has no generators here
        if columns[column, one] != columns[column, other]:
            return False
    return True
