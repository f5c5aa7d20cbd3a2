"""Bars from plain tables: ours beside what is published, and stages that add up."""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.reports.style import PALETTE, PUBLISHED, figure, legend_beside

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

    from tilestamp.reports.style import Into

BLUE = PALETTE[0]
LOOKS: dict[str, dict[str, Any]] = {  # of bars, by status; solid where it is not here
    "partly fitted": {"facecolor": "white", "edgecolor": BLUE, "hatch": "//"},
    "fitted": {"facecolor": "white", "edgecolor": BLUE, "hatch": "//////"},
    "stand-in": {"facecolor": "#d9dde2", "edgecolor": "#8a929b", "linestyle": ":"},
}
ROOM = 1.06  # over the longest bar


def paired_bars(table: "pd.DataFrame", into: "Into", *, title: str, unit: str, known: str = "published") -> "Axes":
    """Draw a bar for each row: solid where predicted, hatched where fitted, grey where a stand-in was drawn.

    Parameters
    ----------
    table : DataFrame
        A row a cell; columns ``label``, ``ours``, ``status``, and the one that ``known`` names (a diamond).
    into : Path, Axes or None
        Where it goes (``tilestamp.reports.style``).
    unit : str
        What the bars are long in.
    known : str
        What the diamonds are: published, or measured.
    """
    with figure(into, title, figsize=(8.0, 0.24 * len(table) + 1.3)) as axes:
        places = np.arange(len(table))
        bars = axes.barh(places, table["ours"], color=BLUE, height=0.66)
        for bar, kind in zip(bars, table["status"], strict=True):
            bar.set(**LOOKS.get(kind, {}))
        (points,) = axes.plot(table[known], places, **PUBLISHED)
        axes.set_yticks(places, table["label"], fontsize=8)
        axes.set(xlabel=unit, xlim=(0.0, ROOM * max(table["ours"].max(), table[known].max())))
        axes.invert_yaxis()
        axes.grid(visible=False, axis="y")
        legend_beside(axes, {known: points, **dict(zip(table["status"], bars, strict=True))})
    drawn: Axes = axes
    return drawn


def stacked_bars(
    table: "pd.DataFrame", into: "Into", *, title: str, unit: str, published: "pd.DataFrame | None" = None
) -> "Axes":
    """Draw a stacked bar for each row of ``table``, a segment for each column.

    Parameters
    ----------
    table : DataFrame
    into : Path, Axes or None
        Where it goes (``tilestamp.reports.style``).
    unit : str
        What the bars are high in.
    published : DataFrame, optional
        What is known of some rows and columns: a pale bar below the other, in the same colours. A column that
        ``table`` has not is drawn in black: a total of which the parts are not known.
    """
    height = 0.62 if published is None else 0.34
    shift = 0.0 if published is None else 0.19
    colors = dict(zip(table.columns, PALETTE * 3, strict=False))
    with figure(into, title, figsize=(8.0, max(0.62 * len(table) + 1.5, 0.24 * len(colors) + 1.5))) as axes:
        places = np.arange(len(table))
        ends = [_stack(axes, table, places - shift, height, colors, filled=True)]
        if published is not None:
            known = published.reindex(table.index)[
                sorted(published.columns, key=lambda name: [*colors, name].index(name))
            ]
            ends.append(_stack(axes, known, places + shift, height, colors, filled=False))
            axes.barh([], [], facecolor="#dddddd", edgecolor="black", label="published (pale)")
        axes.set_yticks(places, [str(name) for name in table.index])
        axes.set(xlabel=unit, xlim=(0.0, ROOM * max(end.max() for end in ends)))
        axes.invert_yaxis()
        axes.grid(visible=False, axis="y")
        legend_beside(axes)
    drawn: Axes = axes
    return drawn


def _stack(
    axes: "Axes",
    table: "pd.DataFrame",
    places: NDArray[np.floating],
    height: float,
    colors: dict[str, str],
    *,
    filled: bool,
) -> NDArray[np.float64]:
    """Draw the segments of bars; give their ends."""
    left = np.zeros(len(table))
    for column in table.columns:
        lengths, color = table[column].fillna(0.0).to_numpy(np.float64), colors.get(column, "black")
        look: dict[str, Any] = {"facecolor": color, "alpha": 1.0 if filled else 0.4}
        look |= {"label": str(column)} if filled or column not in colors else {}
        axes.barh(places, lengths, left=left, height=height, **look)
        left += lengths
    return left
