"""Cost against error on logarithmic axes: a colour a group, the front as steps, published points hollow."""

from typing import TYPE_CHECKING

import numpy as np

from tilestamp.reports.style import PALETTE, figure, legend_beside, plain_ticks

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

    from tilestamp.reports.style import Into

MARKERS = "os^vP*Xd"
MOST_NAMES = 18
NAME_WIDTH, NAME_HEIGHT = 0.25, 0.035  # of the axes


def frontier(
    into: "Into",
    points: "pd.DataFrame",
    xlabel: str,
    ylabel: str,
    title: str,
    *,
    label: bool = True,
    guide: float | None = None,
) -> "Axes":
    """Draw cost against error, lower left is better.

    Parameters
    ----------
    into : Path, Axes or None
        Where it goes (``tilestamp.reports.style``).
    points : DataFrame
        A row a point: ``name`` (its label), ``group`` (colour and legend), ``cost``, ``error``, ``published`` (bool:
        drawn hollow) and, if there is one to draw, ``front`` (bool). An error of zero is drawn at the foot of the
        axis, and the foot says so.
    xlabel, ylabel, title : str
        With units.
    label : bool
        Write the names of the points; of many, those on the front and the published ones.
    guide : float, optional
        An error to mark by a dotted line, as an aim.
    """
    shown = points[points["cost"].gt(0) & points["cost"].notna() & points["error"].notna()].copy()
    positive = shown["error"][shown["error"] > 0]
    foot = 10.0 ** np.floor(np.log10(positive.min()) - 0.5) if len(positive) else 1e-3
    none = shown["error"] <= 0
    shown["height"] = shown["error"].where(~none, foot)
    with figure(into, title, figsize=(8.6, 5.6)) as axes:
        for index, (group, rows) in enumerate(shown.groupby("group", sort=False)):
            color, marker = PALETTE[index % len(PALETTE)], MARKERS[index % len(MARKERS)]
            for published, part in rows.groupby("published"):
                mixed = published and not rows["published"].all()
                axes.plot(
                    part["cost"],
                    part["height"],
                    marker="D" if published else marker,
                    linestyle="none",
                    markersize=6,
                    color=color,
                    markerfacecolor="none" if published else color,
                    label=f"{group} (published)" if mixed else str(group),
                )
        if "front" in shown:
            _steps(axes, shown[shown["front"]])
        if guide is not None:
            axes.axhline(guide, color="#999999", linestyle=":", linewidth=1.2)
        axes.set(xlabel=xlabel, ylabel=ylabel, xscale="log", yscale="log")
        axes.margins(x=0.15, y=0.1)
        plain_ticks(axes)
        if none.any():
            axes.annotate("no error", (0.005, foot), xycoords=("axes fraction", "data"), fontsize=8, va="bottom")
        if label:
            _label(axes, shown)
        legend_beside(axes)
    drawn: Axes = axes
    return drawn


def _steps(axes: "Axes", front: "pd.DataFrame") -> None:
    """Draw the front from the cheapest to the most exact point."""
    rows = front.sort_values(["cost", "height"])
    label = "front: nothing beats it in both"
    axes.step(rows["cost"], rows["height"], where="post", color="black", linewidth=1.0, label=label)


def _label(axes: "Axes", shown: "pd.DataFrame") -> None:
    """Write names beside their points, lower where the next one to the left is as high; too many are left out."""
    named = shown.drop_duplicates(["name", "cost", "height"]).sort_values("cost")
    if len(named) > MOST_NAMES and "front" in named:
        named = named[named["front"] | named["published"].astype(bool)]
    placed: list[tuple[float, float]] = []
    for point in named.itertuples():
        x, y = axes.transAxes.inverted().transform(axes.transData.transform((point.cost, point.height)))
        height = y + 0.6 * NAME_HEIGHT
        while any(abs(x - left) < NAME_WIDTH and abs(height - other) < NAME_HEIGHT for left, other in placed):
            height -= 0.1 * NAME_HEIGHT
        placed.append((x, height))
        side, gap = ("right", -0.012) if x > 1.0 - NAME_WIDTH else ("left", 0.012)
        axes.annotate(point.name, (x + gap, height), xycoords="axes fraction", fontsize=7, va="center", ha=side)
