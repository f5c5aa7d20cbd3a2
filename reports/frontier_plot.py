"""Cost against error on logarithmic axes: a colour a group, the front as steps, published points hollow."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from reports.style import PALETTE, figure

if TYPE_CHECKING:
    import pandas as pd

MARKERS = "os^vP*Xd"


def frontier(
    path: Path,
    points: "pd.DataFrame",
    xlabel: str,
    ylabel: str,
    title: str,
    *,
    label: bool = True,
    guide: float | None = None,
) -> None:
    """Draw cost against error, lower left is better.

    Parameters
    ----------
    path : Path
        PNG to write.
    points : DataFrame
        A row a point: ``name`` (its label), ``group`` (colour and legend), ``cost``, ``error``, ``published`` (bool:
        drawn hollow) and, if there is one to draw, ``front`` (bool). An error of zero is drawn at the foot of the
        axis, and the foot says so.
    xlabel, ylabel, title : str
        With units.
    label : bool
        Write the names of the points: those on the front and the published ones, or all where there is no front.
    guide : float, optional
        An error to mark by a dotted line, as an aim.
    """
    shown = points[points["cost"].gt(0) & points["cost"].notna() & points["error"].notna()].copy()
    positive = shown["error"][shown["error"] > 0]
    foot = 10.0 ** np.floor(np.log10(positive.min()) - 0.5) if len(positive) else 1e-3
    none = shown["error"] <= 0
    shown["height"] = shown["error"].where(~none, foot)
    with figure(path, title, figsize=(8.6, 5.6)) as axes:
        for index, (group, rows) in enumerate(shown.groupby("group", sort=False)):
            color, marker = PALETTE[index % len(PALETTE)], MARKERS[index % len(MARKERS)]
            for published, part in rows.groupby("published"):
                axes.plot(
                    part["cost"],
                    part["height"],
                    marker="D" if published else marker,
                    linestyle="none",
                    markersize=6,
                    color=color,
                    markerfacecolor="none" if published else color,
                    label=f"{group} (published)" if published else str(group),
                )
        if "front" in shown:
            _steps(axes, shown[shown["front"]])
        if guide is not None:
            axes.axhline(guide, color="#999999", linestyle=":", linewidth=1.2)
        axes.set(xlabel=xlabel, ylabel=ylabel, xscale="log", yscale="log")
        axes.margins(x=0.12, y=0.1)
        if none.any():
            axes.annotate("no error", (0.005, foot), xycoords=("axes fraction", "data"), fontsize=8, va="bottom")
        if label:
            _label(axes, shown)
        axes.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))


def _steps(axes: Any, front: "pd.DataFrame") -> None:
    """Draw the front from the cheapest to the most exact point."""
    rows = front.sort_values(["cost", "height"])
    axes.step(  # type: ignore[attr-defined]  # matplotlib's Axes
        rows["cost"],
        rows["height"],
        where="post",
        color="black",
        linewidth=1.0,
        label="front: nothing beats it in both",
    )


def _label(axes: Any, shown: "pd.DataFrame") -> None:
    """Write names beside their points, each name once a place."""
    named = shown[shown["front"] | shown["published"].astype(bool)] if "front" in shown else shown
    for point in named.drop_duplicates(["name", "cost", "height"]).itertuples():
        axes.annotate(point.name, (point.cost, point.height), xytext=(5, 4), textcoords="offset points", fontsize=7)
