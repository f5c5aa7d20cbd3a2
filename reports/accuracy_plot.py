"""Predicted against measured times, both logarithmic."""

from pathlib import Path
from typing import TYPE_CHECKING

from tilestamp.reports.style import PALETTE, figure

if TYPE_CHECKING:
    import pandas as pd

BAND = 0.25  # error whose limits are drawn


def accuracy_plot(table: "pd.DataFrame", path: Path, *, title: str) -> None:
    """Draw a point for each time: one colour a family, filled where nothing was fitted to the scene, hollow elsewhere.

    Parameters
    ----------
    table : DataFrame
        Columns ``measured`` and ``ours`` (microseconds), ``family``, ``seen`` (bool).
    path : Path
        PNG to write.
    title : str
    """
    ends = [0.8 * min(table.measured.min(), table.ours.min()), 1.25 * max(table.measured.max(), table.ours.max())]
    with figure(path, title, figsize=(7.6, 6.6)) as axes:
        axes.plot(ends, ends, color="black", linewidth=0.8)
        for factor in (1.0 + BAND, 1.0 - BAND):
            axes.plot(ends, [factor * end for end in ends], color="#999999", linewidth=0.8, linestyle=":")
        for color, (name, rows) in zip(PALETTE, table.groupby("family"), strict=False):
            for seen, group in rows.groupby("seen", sort=False):
                fill = "none" if seen else color
                axes.plot(group.measured, group.ours, "o", ms=4, mfc=fill, mec=color, mew=0.7, alpha=0.75)
            axes.plot([], [], "s", ms=7, color=color, label=f"{name} ({len(rows)})")
        axes.plot([], [], "o", ms=5, color="black", label="a scene that nothing was fitted to")
        axes.plot([], [], "o", ms=5, mfc="none", mec="black", label="a scene that some number was fitted to")
        axes.plot([], [], color="#999999", linewidth=0.8, linestyle=":", label=f"{100 * BAND:.0f} % off")
        axes.set(xscale="log", yscale="log", xlim=ends, ylim=ends, aspect="equal")
        axes.set(xlabel="measured, us", ylabel="predicted, us")
        axes.legend(fontsize=8, loc="upper left")
