"""The answer to one question: published cells beside ours, figures, notes."""

import math
from dataclasses import KW_ONLY, dataclass, field
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    import pandas as pd

Status = Literal["predicted", "partly fitted", "fitted", "stand-in", "reproduced", "reported"]
Kind = Literal["time", "count", "order"]
NEVER_MISSED = {"fitted", "stand-in", "reported"}
TIME_UNITS = ("s", "ms", "us", "ns")


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
    status : {"predicted", "partly fitted", "fitted", "stand-in", "reproduced", "reported"}
        An experiment says that there is no aim (``reported``), that what is published was computed like ours and not
        measured (``reproduced``), or that another scene stands in for the published one (``stand-in``). How fitted any
        other cell is, is computed (``tilestamp.experiments.harness.fit``); so is whether its frame shows the stand-in
        for a model that is not here.
    aim : float or None
        Relative error aimed at.
    frame : str
        Scene, view and size that it was drawn at, as fitted numbers name theirs (``killeroo 1600x1200``).
    of : tuple of (row, column)
        Cells of the same table that this one is made of: where an error of theirs is averaged, this one's is not again.
    share : float
        Of a change of the fitted numbers of its frame, the part that it follows.
    fitted_by : tuple of (str, float)
        The numbers, with the part of each.
    """

    row: str
    column: str
    unit: str
    _: KW_ONLY
    published: float | str | None
    ours: float | str
    status: Status = "predicted"
    aim: float | None = None
    frame: str = ""
    of: tuple[tuple[str, str], ...] = ()
    share: float = 0.0
    fitted_by: tuple[tuple[str, float], ...] = ()

    @property
    def error(self) -> float | None:
        """Relative error, None where there are no two numbers to compare, or none to divide by."""
        if isinstance(self.published, str) or isinstance(self.ours, str) or not self.published:
            return None
        error = self.ours / self.published - 1.0
        return error if math.isfinite(error) else None

    @property
    def missed(self) -> bool:
        """Whether a cell that says something of the model lies outside its aim, or is another word than published."""
        if self.status in NEVER_MISSED or self.published is None or _nothing(self.published):
            return False
        if isinstance(self.published, str) or isinstance(self.ours, str) or not math.isfinite(self.ours):
            return self.published != self.ours
        if self.published == 0:
            return self.aim is not None and self.ours != 0
        return self.aim is not None and abs(self.ours / self.published - 1.0) > self.aim

    @property
    def kind(self) -> Kind:
        """A word (an order, a winner) is an ``order``; a time has a unit of time; all else are counts and shares."""
        if isinstance(self.published, str) or (self.published is None and isinstance(self.ours, str)):
            return "order"
        return "time" if self.unit.partition("/")[0].partition(",")[0] in TIME_UNITS else "count"


def reported(
    row: str, column: str, unit: str, ours: float | str, frame: str = "", published: float | str | None = None
) -> Cell:
    """A cell without an aim: mostly nothing is published beside it."""
    return Cell(row, column, unit, published=published, ours=ours, status="reported", frame=frame)


def _nothing(published: float | str) -> bool:
    """Whether a table read from a file has no number here."""
    return isinstance(published, float) and math.isnan(published)


@dataclass(frozen=True)
class Figure:
    """A plot to draw: a file name and the function that draws it there."""

    name: str
    draw: "Callable[[Path], object]"


@dataclass(frozen=True)
class CellFigure:
    """A plot of the cells, which are known when all of the result is: how fitted each is, too."""

    name: str
    draw: "Callable[[Sequence[Cell], Path], None]"


@dataclass(frozen=True, kw_only=True)
class Chart:
    """A plot of one of a result's tables that a visitor of the page explores; drawn from the table as it is written.

    Parameters
    ----------
    name, title, alt : str
        ``alt`` says what it shows to who cannot see it.
    kind : {"front", "lines", "sliders", "tiles"}
        Cost against error, lines by colour, bars of the row that sliders point at, or a map
        (``tilestamp.reports.chart_kinds``).
    table : str
        One of the result's tables.
    of : dict
        What the table's columns are: arguments of the function of that kind.
    """

    name: str
    kind: Literal["front", "lines", "sliders", "tiles"]
    table: str
    title: str
    alt: str
    of: "dict[str, Any]"


@dataclass(frozen=True)
class Result:
    """What one experiment found.

    Parameters
    ----------
    name : str
        As fitted numbers name it.
    title, source : str
        Of its table.
    cells : list of Cell
    answer : str
        To the question of its module (``QUESTION``), in a sentence with numbers of this run; where it is left out, the
        sentence says how far the cells are off (``tilestamp.experiments.harness.texts.answer``).
    figures : sequence of Figure or CellFigure
    notes : list of str
    warnings : list of str
        Stand-ins and what was left out: shown above the table.
    tables : dict of DataFrame
        Further tidy tables, written as CSV.
    experiment : str
        What ``tilestamp reproduce`` calls it; filled in by who runs it.
    """

    name: str
    title: str
    source: str
    cells: list[Cell]
    answer: str = ""
    _: KW_ONLY
    figures: "Sequence[Figure | CellFigure]" = ()
    charts: "Sequence[Chart]" = ()
    notes: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    tables: dict[str, "pd.DataFrame"] = field(default_factory=dict)
    experiment: str = ""

    def compared(self, status: Status, kind: Kind) -> list[Cell]:
        """The cells of one status and kind that have an error, but for those made of others that have one."""
        chosen = {(c.row, c.column) for c in self.cells if c.status == status and c.error is not None}
        once = (c for c in self.cells if c.status == status and not chosen.intersection(c.of))
        return [cell for cell in once if cell.error is not None and cell.kind == kind]


@dataclass(frozen=True)
class Outcome:
    """What became of one experiment: a result, or a sentence on why there is none."""

    name: str
    result: Result | None = None
    failure: str = ""
