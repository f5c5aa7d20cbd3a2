"""The answer to one question: published cells beside ours, figures, notes."""

from dataclasses import KW_ONLY, dataclass, field
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    import pandas as pd

Status = Literal["predicted", "fitted", "reported"]


@dataclass(frozen=True)
class Cell:
    """One cell of a published table.

    Parameters
    ----------
    row, column, unit : str
        Where it stands and what it is in.
    published : float, str or None
        As printed; an order or a name where that is what the source says; None where it says nothing.
    ours : float or str
    status : {"predicted", "fitted", "reported"}
        ``fitted``: a parameter was chosen on this cell, so its error says nothing; ``reported``: there is no aim.
    aim : float or None
        Relative error aimed at.
    """

    row: str
    column: str
    unit: str
    _: KW_ONLY
    published: float | str | None
    ours: float | str
    status: Status = "predicted"
    aim: float | None = None

    @property
    def error(self) -> float | None:
        """Relative error, None where there is no number to compare with."""
        if isinstance(self.published, str) or isinstance(self.ours, str) or not self.published:
            return None
        return self.ours / self.published - 1.0

    @property
    def missed(self) -> bool:
        """Whether a predicted cell lies outside its aim, or names something else than the source."""
        if self.status != "predicted":
            return False
        if isinstance(self.published, str):
            return self.published != self.ours
        return self.aim is not None and abs(self.error or 0.0) > self.aim


@dataclass(frozen=True)
class Figure:
    """A plot to draw: a file name and the function that draws it there."""

    name: str
    draw: "Callable[[Path], None]"


@dataclass(frozen=True, kw_only=True)
class Result:
    """What one experiment found."""

    name: str
    title: str
    source: str
    cells: list[Cell]
    figures: list[Figure] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)  # stand-ins and the like: shown above the table
    tables: dict[str, "pd.DataFrame"] = field(default_factory=dict)  # further tidy tables, written as CSV

    @property
    def predicted_errors(self) -> list[float]:
        """Absolute relative errors of the predicted cells: the only ones that are ever averaged."""
        return [abs(c.error) for c in self.cells if c.status == "predicted" and c.error is not None]


@dataclass(frozen=True)
class Outcome:
    """What became of one experiment: a result, or a sentence on why there is none."""

    name: str
    result: Result | None = None
    failure: str = ""
