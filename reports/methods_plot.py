"""Small multiples of cost against error, and a picture beside the true one."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.reports.frontier_plot import MARKERS
from tilestamp.reports.style import PALETTE, figure

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D

COLUMNS = 3  # panels side by side: more, and their texts cannot be read on a page
LINES: dict[str, dict[str, Any]] = {
    "front": {"color": "black", "linewidth": 0.9},
    "front of software": {"color": "#888888", "linewidth": 0.9, "linestyle": "--"},
}
AMPLIFIED = 4.0  # differences are shown so many times as large


def panels(
    table: "pd.DataFrame", path: Path, *, panel: str, group: str, x: str, y: str, fronts: Sequence[str], x_label: str,
    y_label: str, title: str,
) -> None:  # fmt: skip
    """Draw a panel for each value of ``panel``, a colour and mark for each of ``group``, the front as steps.

    Parameters
    ----------
    table : DataFrame
        A row a point; an error of zero is drawn at the foot of a logarithmic panel.
    path : Path
        PNG to write.
    panel, group, x, y : str
        Columns.
    fronts : sequence of str
        Columns of bool: the front and, where it is another, that of software alone.
    """
    names = list(dict.fromkeys(table[panel]))
    groups = list(dict.fromkeys(table[group]))
    places = len(names) + 1  # the legend has one of its own
    columns = min(COLUMNS, places)
    rows = -(-places // columns)
    size = (3.0 * columns, 2.5 * rows + 0.4)
    with figure(path, title, nrows=rows, ncols=columns, figsize=size, squeeze=False) as grid:
        for axes, name in zip(grid.flat, names, strict=False):
            _panel(axes, table[table[panel] == name], str(name), groups, group, x, y, fronts)
        for axes in grid.flat[len(names) :]:
            axes.set_axis_off()
        for axes in grid[:, 0]:
            axes.set_ylabel(y_label, fontsize=9)
        for axes in grid.flat[max(len(names) - columns, 0) : len(names)]:
            axes.set_xlabel(x_label, fontsize=9)
        lines = list(LINES)[: len(fronts)]
        handles = [*(_mark(_style(k)) for k in range(len(groups))), *(_mark(LINES[line]) for line in lines)]
        grid.flat[len(names)].legend(handles, [*groups, *lines], fontsize=9, loc="upper left")


def _panel(
    axes: "Axes", rows: "pd.DataFrame", name: str, groups: list[str], group: str, x: str, y: str, fronts: Sequence[str]
) -> None:
    linear = rows[y].max() < 10.0 * max(rows[y].min(), 1e-9)  # less than a decade: from zero
    positive = rows[y][rows[y] > 0]
    foot = 0.0 if linear or not len(positive) else 10.0 ** np.floor(np.log10(positive.min()) - 0.3)
    heights = rows[y].where(rows[y] > 0, foot)
    for index, key in enumerate(groups):
        mine = rows[group] == key
        axes.plot(rows[x][mine], heights[mine], **_style(index))
    for front, line in zip(fronts, LINES.values(), strict=False):
        best = rows.assign(height=heights)[rows[front]].sort_values([x, "height"])
        axes.step(best[x], best["height"], where="post", **line)
    axes.set_xscale("log")
    axes.set_xlim(*_decades(rows[x]))
    if foot > 0.0:
        axes.set_yscale("log")
        axes.set_ylim(foot / 2.0, 2.0 * _decades(heights)[1])
    else:
        axes.set_ylim(-0.03 * max(heights.max(), 1e-6), 1.2 * max(heights.max(), 1e-6))
    axes.minorticks_off()
    axes.set_title(name, fontsize=10)
    axes.tick_params(labelsize=9)
    if (rows[y] <= 0).any() and foot > 0.0:
        axes.annotate("none", (0.01, foot), xycoords=("axes fraction", "data"), fontsize=7, va="bottom")


def _decades(values: "pd.Series[float]") -> tuple[float, float]:
    """Powers of ten around values."""
    low, high = np.floor(np.log10(values.min() / 1.2)), np.ceil(np.log10(values.max() * 1.2))
    return float(10.0**low), float(10.0 ** max(high, low + 1))


def _style(index: int) -> dict[str, Any]:
    color = PALETTE[index % len(PALETTE)]
    marker = MARKERS[(index + index // len(PALETTE)) % len(MARKERS)]
    return {"marker": marker, "linestyle": "none", "markersize": 5, "color": color, "alpha": 0.85}


def _mark(style: dict[str, Any]) -> "Line2D":
    from matplotlib.lines import Line2D

    return Line2D([], [], **style)


def side_by_side(truth: NDArray[np.float64], image: NDArray[np.float64], path: Path, *, title: str) -> None:
    """Draw the true picture, another, and the difference, amplified.

    Parameters
    ----------
    truth, image : ndarray, (H, W, 3)
        In [0, 1].
    path : Path
        PNG to write.
    """
    height, width = truth.shape[:2]
    difference = np.clip(AMPLIFIED * np.abs(truth - image), 0.0, 1.0)
    shown = (("exact, converged", truth), ("the method", image), (f"difference, {AMPLIFIED:g} times", difference))
    with figure(path, title, ncols=3, figsize=(12.0, 4.0 * height / width + 0.7)) as row:
        for axes, (name, picture) in zip(row, shown, strict=True):
            axes.imshow(np.clip(picture, 0.0, 1.0), interpolation="nearest")
            axes.set_title(name, fontsize=9)
            axes.set_axis_off()
