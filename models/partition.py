"""Quickselect: ``np.partition`` as a kernel, because Numba compiles its own for 3 seconds, with sorts and messages."""

from typing import Any

from tilestamp.models.kernel import kernel


@kernel
def partitioned(values: Any, place: int) -> Any:
    """Copy values, (count,), with the one of this place in order there, no larger before it and no smaller behind."""
    found = values.copy()
    low, high = 0, len(found) - 1
    pivot = _split(found, low, high)
    while pivot != place:
        if pivot < place:
            low = pivot + 1
        else:
            high = pivot - 1
        pivot = _split(found, low, high)
    return found


@kernel(lent=True)
def _split(values: Any, low: int, high: int) -> int:
    """Split ``values[low : high + 1]`` at the median of its first, middle and last value; return where that comes."""
    middle = (low + high) >> 1
    _order(values, low, middle)
    _order(values, middle, high)
    _order(values, low, middle)
    pivot = values[middle]
    values[middle], values[high] = values[high], pivot
    i, j = low, high - 1
    while True:
        while i < high and values[i] < pivot:
            i += 1
        while j >= low and pivot < values[j]:
            j -= 1
        if i >= j:
            break
        values[i], values[j] = values[j], values[i]
        i += 1
        j -= 1
    values[i], values[high] = pivot, values[i]
    return i


@kernel(lent=True, inline=True)
def _order(values: Any, before: int, after: int) -> None:
    if values[after] < values[before]:
        values[before], values[after] = values[after], values[before]
