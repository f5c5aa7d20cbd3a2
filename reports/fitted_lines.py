"""Lines of a model through a densely measured curve, with the points that it was fitted on marked."""

from pathlib import Path
from typing import TYPE_CHECKING

from tilestamp.reports.style import PALETTE, figure, legend_beside

if TYPE_CHECKING:
    import pandas as pd


def fitted_lines(
    table: "pd.DataFrame",
    measured: "pd.DataFrame",
    path: Path,
    *,
    x: str,
    y: str,
    by: str,
    title: str,
    labels: tuple[str, str],
) -> None:
    """Draw a line for each value of ``by``: filled points are predicted, hollow ones fitted, crosses measured.

    Parameters
    ----------
    table : DataFrame
        The model: columns ``x``, ``y``, ``by`` and ``status``, a row a point.
    measured : DataFrame
        What was measured: columns ``x``, ``y``, ``by``.
    path : Path
        PNG to write.
    labels : tuple of str
        Of the axes.
    """
    with figure(path, title) as axes:
        for color, (name, group) in zip(PALETTE, table.groupby(by, sort=False), strict=False):
            rows, real = group.sort_values(x), measured[measured[by] == name]
            fitted = rows[rows["status"] == "fitted"]
            axes.plot(rows[x], rows[y], color=color, marker="o", markersize=4, label=str(name), linewidth=1.2)
            axes.plot(fitted[x], fitted[y], color=color, marker="o", markersize=7, linestyle="none", fillstyle="none")
            axes.plot(real[x], real[y], color=color, marker="x", markersize=3, linestyle="none", alpha=0.6)
        axes.plot([], [], color="black", marker="x", markersize=3, linestyle="none", label="published")
        axes.plot(
            [], [], color="black", marker="o", markersize=7, linestyle="none", fillstyle="none", label="fitted here"
        )
        axes.set(xlabel=labels[0], ylabel=labels[1])
        axes.set_ylim(bottom=0)
        legend_beside(axes)
