"""Lines from a plain table, with what is published as hollow points, and words where lines lie on each other."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from tilestamp.reports.style import PALETTE, PUBLISHED, figure, legend_beside, plain_ticks

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from tilestamp.reports.style import Into

MARKERS = "os^vDPX"
SAME = 0.008  # of the axis, about the width of a line: lines that are nowhere further apart are drawn as one


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
    said: Sequence[tuple[float, float, str]] = (),
) -> "Axes":
    """Draw one line for each value of ``by``; column ``published`` as hollow diamonds of the line's colour.

    Lines that coincide everywhere are one line, and the legend says so; one that is zero throughout says that, too.

    Parameters
    ----------
    table : DataFrame
        A row a point.
    into : Path, Axes or None
        Where it goes (``tilestamp.reports.style``).
    x, y, by, published : str
        Columns.
    said : sequence of (x, y, text)
        Words beside points.
    """
    with figure(into, title) as axes:
        groups = {str(name): rows.sort_values(x) for name, rows in table.groupby(by, sort=False)}
        for index, (names, rows) in enumerate((groups if published else _distinct(groups, x, y, log=log_y)).items()):
            color = PALETTE[index % len(PALETTE)]
            style: dict[str, Any] = {
                "marker": MARKERS[index % len(MARKERS)],
                "markersize": 5,
                "markerfacecolor": "none",
            }
            none = ": 0 throughout" if (rows[y] == 0).all() else ""
            axes.plot(
                rows[x], rows[y], color=color, label=f"{names}{none}", clip_on=bool((rows[y] != 0).any()), **style
            )
            if published is not None and rows[published].notna().any():
                axes.plot(rows[x], rows[published], **{**PUBLISHED, "markeredgecolor": color})
        if published is not None:
            axes.plot([], [], label="published", **PUBLISHED)
        for across, up, text in said:
            axes.annotate(text, (across, up), (8, -4), textcoords="offset points", fontsize=8)
        axes.set(xlabel=x_label, ylabel=y_label)
        axes.set_xscale("log" if log_x else "linear")
        axes.set_yscale("log" if log_y else "linear")
        if not log_y:
            axes.set_ylim(bottom=0)
        plain_ticks(axes)
        legend_beside(axes)
    drawn: Axes = axes
    return drawn


def _distinct(groups: "dict[str, pd.DataFrame]", x: str, y: str, *, log: bool) -> "dict[str, pd.DataFrame]":
    """Groups that differ; those that coincide under one name."""
    heights = {name: _heights(rows[y], log=log) for name, rows in groups.items()}
    every = np.concatenate(list(heights.values()))
    near = SAME * np.ptp(every[np.isfinite(every)]) if np.isfinite(every).any() else 0.0
    kept: list[list[str]] = []
    for name, rows in groups.items():
        for names in kept:
            if list(groups[names[0]][x]) == list(rows[x]) and _coincide(heights[names[0]], heights[name], near):
                names.append(name)
                break
        else:
            kept.append([name])
    return {" = ".join(names): groups[names[0]] for names in kept}


def _heights(values: "pd.Series[float]", *, log: bool) -> "NDArray[np.float64]":
    """Values as high as they are drawn."""
    numbers: NDArray[np.float64] = values.to_numpy(np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        heights: NDArray[np.float64] = np.log10(numbers) if log else numbers
    return heights


def _coincide(one: "NDArray[np.float64]", other: "NDArray[np.float64]", near: float) -> bool:
    """Whether two lines cannot be told apart."""
    return bool(np.allclose(one, other, rtol=0.0, atol=near, equal_nan=True))
