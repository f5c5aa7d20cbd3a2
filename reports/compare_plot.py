"""Grouped bars: values of several things beside each other, a group for each part, with a word at each bar's end."""

from pathlib import Path
from typing import TYPE_CHECKING

from tilestamp.reports.style import PALETTE, figure

if TYPE_CHECKING:
    import pandas as pd

DECADES = 30.0  # times the smallest: from here on the axis is logarithmic


def grouped_bars(
    table: "pd.DataFrame", path: Path, *, group: str, bar: str, value: str, note: str, title: str, label: str
) -> None:
    """Draw a group of horizontal bars for each value of ``group``, a bar in it for each of ``bar``.

    Parameters
    ----------
    table : DataFrame
        A row a bar.
    path : Path
        PNG to write.
    group, bar, value, note : str
        Columns; ``note`` is written at the end of a bar.
    label : str
        Of the axis of values.
    """
    groups, bars = (list(dict.fromkeys(table[name])) for name in (group, bar))
    height = 0.8 / len(bars)
    with figure(path, title, figsize=(7.6, max(2.6, 0.24 * len(groups) * (len(bars) + 0.8) + 1.2))) as axes:
        for index, name in enumerate(bars):
            rows = table[table[bar] == name]
            places = [groups.index(part) + (index - (len(bars) - 1) / 2) * height for part in rows[group]]
            color = PALETTE[index % len(PALETTE)]
            axes.barh(places, rows[value], height=0.92 * height, color=color, label=str(name))
            for place, length, text in zip(places, rows[value], rows[note], strict=True):
                axes.annotate(
                    f"{length:.3g} {text}", (length, place), (3, 0), textcoords="offset points", va="center", fontsize=7
                )
        positive = table[value][table[value] > 0]
        if len(positive) and positive.max() > DECADES * positive.min():
            axes.set_xscale("log")
            axes.set_xlim(positive.min() / 2, positive.max() * 4)
        else:
            axes.margins(x=0.18)
        axes.set_yticks(range(len(groups)), groups)
        axes.set_ylim(len(groups) - 0.45, -0.55)
        axes.grid(visible=False, axis="y")
        axes.set_xlabel(label)
        axes.legend(fontsize=8, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=min(4, len(bars)))
