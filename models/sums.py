"""Sums of counts: products with matrices of which most is empty, a block of units at a time."""

from typing import Any

from tilestamp.models.kernel import kernel

TOGETHER = 500  # units whose counts stay in the cache of this computer; no power of 2, whose rows would collide there


@kernel(lent=True)
def sum_up(matrix: Any, counts: Any, first: int, last: int, sums: Any, place: int) -> None:
    """Fill in ``matrix @ counts`` of some units; nothing is added for what is 0 in the matrix.

    Parameters
    ----------
    matrix : ndarray, (rows, columns), float64
    counts : ndarray, (columns, units), float64
    first, last : int
        The units.
    sums : ndarray, (at least rows, units), float64
        Filled in from ``place`` on.
    """
    units = last - first
    for row in range(len(matrix)):
        into = sums[row, place : place + units]
        into[:] = 0.0
        for column in range(len(counts)):
            rate = matrix[row, column]
            if rate:
                each = counts[column, first:last]
                for i in range(units):
                    into[i] += rate * each[i]
