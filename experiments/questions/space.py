"""The space of a study: what its axes range over, of which any point can be run and not just those of the grid."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tilestamp.experiments.studies.axes import Axis, Sample, at_shares, is_range, merged
from tilestamp.experiments.studies.places import place
from tilestamp.experiments.studies.study import Study
from tilestamp.experiments.studies.values import is_whole
from tilestamp.models.errors import TilestampError

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Space:
    """Axes of a study, each a side of the unit cube: a range in its scale, a list in equal parts.

    Parameters
    ----------
    study : Study
        Its grid and the axes of its sample; axes that are walked together have no points between their own.

    Raises
    ------
    TilestampError
        No axis, or a zip.
    """

    study: Study

    def __post_init__(self) -> None:
        if self.study.zip:
            with place("zip"):
                raise TilestampError("axes that are walked together are no space: name variants in [grid] instead")
        if not self.axes:
            raise TilestampError("a space needs an axis: a range or a list in [grid] or [sample.axes]")

    @property
    def axes(self) -> dict[str, Axis]:
        """Ranges (without points) and lists, by the name of the axis."""
        sample = self.study.sample
        sampled = sample.axes if isinstance(sample, Sample) else (sample or {}).get("axes", {})
        every = {**self.study.grid, **sampled}
        return {name: _open(axis) if is_range(axis) else axis for name, axis in every.items()}

    @property
    def names(self) -> list[str]:
        """Of the axes."""
        return list(self.axes)

    def length(self, name: str) -> int:
        """Values of a list; 0 of a range."""
        axis = self.axes[name]
        return 0 if is_range(axis) else len(axis)

    def points(self, shares: ArrayLike) -> list[dict[str, Any]]:
        """Parameters at points of the unit cube.

        Parameters
        ----------
        shares : array-like, (points, axes)
            0 to 1.
        """
        shares = np.asarray(shares, np.float64)
        columns = []
        for column, (name, axis) in enumerate(self.axes.items()):
            with place(name):
                whole = is_whole(name, self.study.pipelines)
                columns.append(at_shares(name, axis, shares[:, column], whole))
        return [merged(row).parameters for row in zip(*columns, strict=True)]


def _open(axis: Axis) -> Mapping[str, Any]:
    """A range without its points: all numbers between its ends."""
    return {key: value for key, value in dict(axis).items() if key != "points"}


def recording(study: Study, names: Sequence[str]) -> Study:
    """The study with the numbers that a question asks for, beside its own; names of axes are in its table anyway."""
    wanted = [name for name in names if name not in study.axes]
    return replace(study, record=tuple(dict.fromkeys([*study.record, *wanted])), store=study.kept)


def values_at(
    study: Study, points: Sequence[Mapping[str, Any]], names: Sequence[str]
) -> tuple[NDArray[np.float64], list[str]]:
    """Run points, those that are not stored, and give some numbers of each.

    Returns
    -------
    ndarray, (points, names), float64
        NaN where a cell has no such number.
    list of str
        Why it has none, ``""`` where it has.

    Raises
    ------
    TilestampError
        Cells failed through a fault, or a number is none.
    """
    table = recording(study, names).at(points)
    if len(table) != len(points):
        raise TilestampError(f"{len(points) - len(table)} of {len(points)} cells failed; those that did not are stored")
    problems = list(table["problem"]) if "problem" in table else [""] * len(table)
    return numbers(table, names), [str(problem) for problem in problems]


def numbers(table: "pd.DataFrame", names: Sequence[str]) -> NDArray[np.float64]:
    """Columns of a table as numbers, (rows, names).

    Raises
    ------
    TilestampError
        A column is not there, or of words.
    """
    columns = []
    for name in names:
        if name not in table and "problem" in table:  # of all cells
            columns.append(np.full(len(table), np.nan))
            continue
        if name not in table:
            raise TilestampError(f"no cell has a number {name}")
        try:
            columns.append(table[name].to_numpy(np.float64, na_value=np.nan))
        except (TypeError, ValueError):
            raise TilestampError(f"{name} is no number") from None
    return np.stack(columns, axis=1)


def extra(library: str) -> TilestampError:
    """What is said where an optional library is missing."""
    return TilestampError(f"this question needs {library}: python -m pip install 'tilestamp[study]'")
