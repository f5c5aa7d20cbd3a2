"""Tornado: what a lower and a higher value of each number does, the largest swing on top."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from tilestamp.reports.style import PALETTE, figure

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

MOST = 12  # bars of a panel
PANELS = 6


def tornado(table: "pd.DataFrame", path: Path, *, panel: str, label: str, title: str, least: float) -> None:
    """Draw a panel for each value of ``panel``, a pair of bars for each of ``label``, in per cent.

    Parameters
    ----------
    table : DataFrame
        A row a bar pair: ``panel``, ``label``; ``lower``, ``value``, ``higher``: the number before, now and after;
        ``less``, ``more``: what follows, over what is now (NaN: nothing is drawn).
    path : Path
        PNG to write.
    least : float
        Relative swing below which a number is left out.
    """
    names = list(dict.fromkeys(table[panel]))[:PANELS]
    shown = {name: _largest(table[table[panel] == name], least) for name in names}
    columns = min(len(names), 2)
    rows = -(-len(names) // columns)
    places = max(1, *map(len, shown.values()))
    size = (6.4 * columns, (0.26 * places + 1.0) * rows + 0.5)
    with figure(path, title, nrows=rows, ncols=columns, figsize=size, squeeze=False) as grid:
        for axes, name in zip(grid.flat, names, strict=False):
            _panel(axes, shown[name], str(name), label, places)
        for axes in grid.flat[len(names) :]:
            axes.set_axis_off()
        grid.flat[0].legend(fontsize=8, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2)


def _largest(rows: "pd.DataFrame", least: float) -> "pd.DataFrame":
    """Rows of the largest swings, the largest first."""
    swings = (rows[["less", "more"]] - 1).abs().max(axis=1)
    return rows.loc[swings[swings >= least].sort_values(ascending=False, kind="stable").index[:MOST]]


def _panel(axes: "Axes", rows: "pd.DataFrame", name: str, label: str, places: int) -> None:
    for side, color, said in (("less", PALETTE[0], "number lower"), ("more", PALETTE[1], "number higher")):
        axes.barh(range(len(rows)), 100 * (rows[side] - 1).fillna(0.0), color=color, height=0.62, label=said)
    axes.set_yticks(range(len(rows)), [_change(row, label) for _, row in rows.iterrows()], fontsize=7)
    axes.set_ylim(places - 0.4, -0.6)
    axes.axvline(0.0, color="black", linewidth=0.8)
    axes.set_title(name, fontsize=9)
    axes.set_xlabel("change of time [%]", fontsize=8)
    axes.tick_params(axis="x", labelsize=8)
    axes.grid(visible=False, axis="y")


def _change(row: "pd.Series[Any]", label: str) -> str:
    """Say what a pair of bars changes: the number, and in parentheses what it is changed to."""
    to = [f"{row[end]:.6g}" for end, side in (("lower", "less"), ("higher", "more")) if row[side] == row[side]]
    return f"{row[label]}  {row['value']:.6g} ({', '.join(to)})"
