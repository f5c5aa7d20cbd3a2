"""Views of a study: a line, a card for a notebook, and plots of its table."""

from typing import TYPE_CHECKING, Literal

from tilestamp.experiments.studies.design import Design
from tilestamp.models.errors import TilestampError
from tilestamp.models.nearest_name import did_you_mean

if TYPE_CHECKING:
    from collections.abc import Callable

    import pandas as pd
    from matplotlib.axes import Axes

    from tilestamp.reports.card import CardTable
    from tilestamp.reports.style import Into

Kind = Literal["lines", "map"]
SHOWN = 12  # rows of a table in a card


def heading(study: Design) -> str:
    """Say in a line how many cells of which axes it has."""
    try:
        axes = ", ".join(f"{name} ({len(values)})" for name, values in study.axes.items())
        told = f"{len(study):,} cells over {axes}" if axes else "one cell"
    except TilestampError as error:  # to say what a study is never fails
        told = str(error)
    return f"{study.title}: {told}" if study.title else told


def card(study: Design, stored: "Callable[[], pd.DataFrame]") -> str:
    """Its heading and the first rows that are stored, as HTML; what is wrong with it instead."""
    from tilestamp.reports.card import card as html

    try:
        table = stored()
    except TilestampError as error:
        return html(heading(study), [], [str(error)])
    return html(heading(study), [table_card(table)] if len(table) else [], () if len(table) else ["nothing is stored"])


def table_card(table: "pd.DataFrame") -> "CardTable":
    """The first rows of a table."""
    from tilestamp.reports.card import CardTable

    rows = [[_text(value) for value in row] for row in table.head(SHOWN).itertuples(index=False)]
    title = f"{len(table):,} rows" if len(table) <= SHOWN else f"The first {SHOWN} of {len(table):,} rows"
    return CardTable(title, [str(name) for name in table.columns], rows)


def _text(value: object) -> str:
    if value is None or value != value:  # noqa: PLR0124 - not-a-number
        return ""
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def draw(study: Design, table: "pd.DataFrame", kind: str, number: str, x: str, into: "Into") -> "Axes":
    """Draw a number of a study's table; see ``Study.plot``."""
    views = {"lines": _lines, "map": _map}
    if kind not in views:
        raise TilestampError(f"a study has no plot {kind!r}{did_you_mean(str(kind), views)}; it has {', '.join(views)}")
    if not len(table):
        raise TilestampError("no cell of this study is stored: run() it first")
    if number not in table:
        raise TilestampError(f"the table has no {number}{did_you_mean(number, list(table.columns))}: record it")
    axes = list(study.axes)
    if x and x not in axes:
        raise TilestampError(f"the study has no axis {x}{did_you_mean(x, axes)}; it has {', '.join(axes)}")
    along = x or next((name for name in axes if table[name].dtype.kind in "iuf"), axes[0])
    return views[kind](table, along, [name for name in axes if name != along], number, heading(study), into)


def _lines(table: "pd.DataFrame", x: str, others: list[str], number: str, title: str, into: "Into") -> "Axes":
    from tilestamp.reports.plots import lines

    places = [", ".join(f"{name} {_text(row[name])}" for name in others) for row in table.to_dict("records")]
    return lines(table.assign(place=places), into, x=x, y=number, by="place", title=title, x_label=x, y_label=number)


def _map(table: "pd.DataFrame", x: str, others: list[str], number: str, title: str, into: "Into") -> "Axes":
    from tilestamp.reports.maps import value_map

    if len(others) != 1:
        raise TilestampError(f"a map has two axes, and this study {1 + len(others)}: draw lines, or take its table")
    found = table.pivot_table(number, others[0], x, sort=False)
    top = float(found.max().max())
    return value_map(found, into, title=title, unit=number, x_label=x, y_label=others[0], top=top)
