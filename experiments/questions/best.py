"""Best: which value of an axis is the best at each place of a plane, by how much, and where that changes."""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.experiments.questions.space import numbers
from tilestamp.models.errors import TilestampError
from tilestamp.models.nearest_name import did_you_mean

if TYPE_CHECKING:
    import pandas as pd


class Boundary(NamedTuple):
    """Where the best changes along the numbers of an axis."""

    place: dict[str, Any]
    """On all other axes."""
    before: Any
    after: Any
    at: float
    """Where both take as long, by a straight line between the logarithms of their ratio."""


def check_axes(axes: Sequence[str], *names: str) -> None:
    """Refuse a name that is no axis, or that is there twice."""
    for name in names:
        if name not in axes:
            known = ", ".join(axes)
            raise TilestampError(f"the study has no axis {name}{did_you_mean(name, axes)}; it has {known}")
    if len(set(names)) < len(names):
        raise TilestampError("the axes of a plane, and the one whose best value is wanted, are different ones")


def best_values(
    table: "pd.DataFrame", axis: str, others: Sequence[str], number: str = "milliseconds"
) -> "pd.DataFrame":
    """Find the best value of an axis, the one of the least number, at each place on the other axes.

    Parameters
    ----------
    table : DataFrame
        Of a study.
    axis : str
    others : sequence of str
        All other axes.
    number : str

    Returns
    -------
    DataFrame
        A row a place: the ``others``, ``best``, its ``number``, the ``second`` best, and the ``margin`` over it as a
        share (NaN where nothing else has a number).
    """
    import pandas as pd

    known = table.assign(**{number: numbers(table, [number])[:, 0]}).dropna(subset=number)
    rows = []
    for place, group in known.groupby(list(others), sort=False) if others else [((), known)]:
        ranked = group.sort_values(number, kind="stable")
        values, least = list(ranked[axis]), list(ranked[number])
        second, margin = (values[1], least[1] / least[0] - 1.0) if len(values) > 1 and least[0] else (None, math.nan)
        row = dict(zip(others, place, strict=True))
        rows.append(row | {"best": values[0], number: least[0], "second": second, "margin": margin})
    return pd.DataFrame(rows, columns=[*others, "best", number, "second", "margin"])


def boundaries(
    table: "pd.DataFrame", axis: str, along: str, others: Sequence[str], number: str = "milliseconds"
) -> list[Boundary]:
    """Find where the best value of an axis changes along another one, whose values are numbers.

    Parameters
    ----------
    table, axis, number
        As of ``best``.
    along : str
    others : sequence of str
        All axes beside these two.
    """
    found = []
    for place, group in table.groupby(list(others), sort=False) if others else [((), table)]:
        lines = group.pivot_table(number, along, axis).sort_index().dropna(how="all")
        at, winners = lines.index.to_numpy(np.float64), list(lines.idxmin(axis=1))
        for one in np.flatnonzero([a != b for a, b in pairwise(winners)]):
            before, after = winners[one], winners[one + 1]
            ratio = np.log(lines[before] / lines[after]).to_numpy()[one : one + 2]
            where = _zero(at[one : one + 2], ratio)
            found.append(Boundary(dict(zip(others, place, strict=True)), before, after, where))
    return found


def _zero(at: NDArray[np.float64], ratio: NDArray[np.float64]) -> float:
    """Place between two numbers where a ratio's logarithm crosses 0; the middle where one has none."""
    share = ratio[0] / (ratio[0] - ratio[1]) if np.isfinite(ratio).all() and ratio[0] != ratio[1] else 0.5
    if at[0] > 0:
        return float(at[0] * (at[1] / at[0]) ** share)
    return float(at[0] + share * (at[1] - at[0]))


def are_numbers(values: Sequence[Any]) -> bool:
    """Whether the values of an axis are numbers, so that there is something between them."""
    return all(isinstance(value, int | float) and not isinstance(value, bool) for value in values)
