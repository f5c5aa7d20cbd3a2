"""Plots from plain tables. Each takes a DataFrame and column names, and writes one PNG."""

from pathlib import Path
from typing import TYPE_CHECKING

from tilestamp.reports.style import PALETTE, PUBLISHED, figure

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

    from tilestamp.reports.style import Into

HATCHES = {"partly fitted": "//", "fitted": "//////"}  # of bars, by status
MOST_INSIDE = 4  # series whose legend stands inside the axes; that of more would hide lines


def lines(
    table: "pd.DataFrame",
    into: "Into",
    *,
    x: str,
    y: str,
    by: str,
    title: str,
    x_label: str,
    y_label: str,
    published: str | None = None,
    log_x: bool = False,
    log_y: bool = False,
) -> "Axes":
    """Draw one line for each value of ``by``; column ``published`` as hollow diamonds of the line's colour.

    Parameters
    ----------
    table : DataFrame
        A row a point.
    into : Path, Axes or None
        Where it goes (``tilestamp.reports.style``).
    x, y, by, published : str
        Columns.
    """
    with figure(into, title) as axes:
        for color, (name, group) in zip(PALETTE * 4, table.groupby(by, sort=False), strict=False):
            rows = group.sort_values(x)
            axes.plot(rows[x], rows[y], marker="o", markersize=4, color=color, label=str(name))
            if published is not None and rows[published].notna().any():
                axes.plot(rows[x], rows[published], **{**PUBLISHED, "markeredgecolor": color})
        if published is not None:
            axes.plot([], [], label="published", **PUBLISHED)
        axes.set(xlabel=x_label, ylabel=y_label)
        axes.set_xscale("log" if log_x else "linear")
        axes.set_yscale("log" if log_y else "linear")
        if not log_y:
            axes.set_ylim(bottom=0)
        if len(axes.get_legend_handles_labels()[0]) > MOST_INSIDE:
            axes.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))
        else:
            axes.legend()
    drawn: Axes = axes
    return drawn


def paired_bars(
    table: "pd.DataFrame",
    path: Path,
    *,
    label: str,
    ours: str,
    published: str,
    status: str,
    title: str,
    y_label: str,
    known: str = "published",
) -> None:
    """Draw a bar for each row, solid where predicted, hatched where fitted; the published value is a diamond.

    Parameters
    ----------
    table : DataFrame
        A row a cell; columns ``label``, ``ours``, ``published``, ``status``.
    path : Path
        PNG to write.
    known : str
        What the diamonds are: published, or measured.
    """
    with figure(path, title, figsize=(max(7.2, 0.42 * len(table)), 4.4)) as axes:
        positions = range(len(table))
        bars = axes.bar(positions, table[ours], color=PALETTE[0], width=0.62)
        for bar, kind in zip(bars, table[status], strict=True):
            if kind in HATCHES:
                bar.set(facecolor="white", edgecolor=PALETTE[0], hatch=HATCHES[kind])
        (points,) = axes.plot(positions, table[published], **PUBLISHED)
        kinds = {known: points} | dict(zip(table[status], bars, strict=True))
        axes.set_xticks(list(positions), table[label], rotation=45, ha="right", fontsize=8)
        axes.set(ylabel=y_label)
        axes.legend(kinds.values(), kinds.keys())


def stacked_bars(table: "pd.DataFrame", path: Path, *, title: str, y_label: str) -> None:
    """Draw a stacked bar for each row of ``table``, a segment for each column."""
    with figure(path, title, figsize=(max(7.2, 0.9 * len(table)), 4.4)) as axes:
        base = [0.0] * len(table)
        for color, column in zip(PALETTE * 3, table.columns, strict=False):
            heights = table[column].fillna(0.0).tolist()
            axes.bar(range(len(table)), heights, bottom=base, color=color, label=str(column), width=0.62)
            base = [low + high for low, high in zip(base, heights, strict=True)]
        axes.set_xticks(range(len(table)), [str(name) for name in table.index], rotation=30, ha="right")
        axes.margins(y=0.08)
        axes.set(ylabel=y_label)
        axes.legend(fontsize=8)
