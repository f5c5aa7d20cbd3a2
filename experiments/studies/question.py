"""Which cells may be the answer to the question of a study, as far as is known."""

from collections.abc import Hashable, Iterable, Sequence
from typing import Any, NamedTuple


class Candidate(NamedTuple):
    """A cell that was run: its place, and the interval of its time."""

    order: int
    shown: dict[str, Any]
    low: float
    high: float

    def is_wider(self, error: float) -> bool:
        """Whether half of the interval is more than a share of its middle."""
        return self.high - self.low > error * (self.high + self.low)


def may_be_best(best: str, candidates: Sequence[Candidate], error: float) -> set[int]:
    """Places of the cells that have to be known better, to say which value of the axis ``best`` is the best.

    A cell whose interval lies above the upper end of another one's, at the same place on all other axes, cannot be the
    best; where one cell alone is left, it is the best; and what is known within ``error`` is known well enough.
    """
    rivals: dict[Hashable, list[Candidate]] = {}
    for candidate in candidates:
        place = tuple((name, value) for name, value in candidate.shown.items() if name != best)
        rivals.setdefault(place, []).append(candidate)
    return {cell.order for cells in rivals.values() for cell in _left(cells) if cell.is_wider(error)}


def _left(cells: Iterable[Candidate]) -> list[Candidate]:
    """Cells of one place that may be the best, if there is more than one."""
    bar = min(cell.high for cell in cells)
    left = [cell for cell in cells if cell.low <= bar]
    return left if len(left) > 1 else []
