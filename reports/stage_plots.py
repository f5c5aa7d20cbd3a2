"""The stages of a frame: how long each takes, and what each limit alone would take."""

from typing import TYPE_CHECKING

import numpy as np

from tilestamp.reports.style import PALETTE, figure

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

    from tilestamp.reports.style import Into

DARK = 0.6  # share from which the text of a cell is white


def stage_bars(table: "pd.DataFrame", into: "Into", *, title: str) -> "Axes":
    """Draw a bar for each stage, with its spread and what bounds it.

    Parameters
    ----------
    table : DataFrame, indexed by stage
        ``milliseconds``; ``low``, ``high``: ends of its spread; ``bound``.
    into : Path, Axes or None
        Where it goes (``tilestamp.reports.style``).
    title : str
    """
    places, times = np.arange(len(table)), table["milliseconds"]
    with figure(into, title, figsize=(8.0, 0.42 * len(table) + 1.3)) as axes:
        axes.barh(places, times, color=PALETTE[0], height=0.62)
        axes.hlines(places, table["low"], table["high"], color="black", linewidth=1.0)
        for place, (_, row) in zip(places, table.iterrows(), strict=True):
            said = f" {row['bound']}, {row['milliseconds'] / times.sum():.0%}"
            axes.text(max(row["milliseconds"], row["high"]), place, said, va="center", fontsize=8)
        axes.set_yticks(places, list(table.index), fontsize=9)
        axes.invert_yaxis()
        axes.margins(x=0.2)
        axes.set(xlabel="milliseconds", xlim=(0.0, None))
        axes.grid(visible=False, axis="y")
    drawn: Axes = axes
    return drawn


def term_matrix(terms: "pd.DataFrame", times: "pd.Series[float]", into: "Into", *, title: str) -> "Axes":
    """Draw what each term alone would take in each stage, the darker the nearer to the stage's time.

    Parameters
    ----------
    terms : DataFrame, indexed by stage
        Milliseconds, a column a term.
    times : Series, indexed by stage
        Milliseconds of each stage.
    into : Path, Axes or None
        Where it goes (``tilestamp.reports.style``).
    title : str
    """
    values = terms.to_numpy(np.float64)
    shares = values / times.to_numpy(np.float64)[:, None]
    with figure(into, title, figsize=(0.62 * len(terms.columns) + 2.2, 0.36 * len(terms) + 1.6)) as axes:
        axes.imshow(shares, cmap="Blues", vmin=0.0, vmax=1.0, aspect="auto")
        for (row, column), value in np.ndenumerate(values):
            if value > 0:
                color = "white" if shares[row, column] > DARK else "black"
                axes.text(column, row, f"{value:.2g}", ha="center", va="center", fontsize=7, color=color)
        axes.set_xticks(range(len(terms.columns)), list(terms.columns), rotation=45, ha="right", fontsize=8)
        axes.set_yticks(range(len(terms)), list(terms.index), fontsize=8)
        axes.grid(visible=False)
    drawn: Axes = axes
    return drawn
