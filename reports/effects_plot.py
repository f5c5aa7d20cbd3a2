"""Effects: a bar for each of some axes with its interval, the largest on top."""

from typing import TYPE_CHECKING

from tilestamp.reports.style import PALETTE, figure

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

    from tilestamp.reports.style import Into


def effects_plot(
    table: "pd.DataFrame", into: "Into", *, value: str, x_label: str, title: str, inner: str = "", start: float = 0.0
) -> "Axes":
    """Draw the bars.

    Parameters
    ----------
    table : DataFrame
        A row a bar, the largest first: ``axis``, ``value``, ``low`` and ``high``, the ends of its interval.
    into : Path, Axes or None
        Where it goes (``tilestamp.reports.style``).
    inner : str
        A column to draw as a narrow bar inside: a part of the value.
    start : float
        Where bars begin: what says that there is no effect.
    """
    places = range(len(table))
    with figure(into, title, figsize=(8.0, 0.32 * len(table) + 1.5)) as axes:
        axes.barh(places, table[value] - start, left=start, color=PALETTE[0], height=0.62, label=value)
        if inner:
            axes.barh(places, table[inner] - start, left=start, color=PALETTE[1], height=0.24, label=inner)
        axes.hlines(places, table["low"], table["high"], color="black", linewidth=1.0, label="95 %")
        axes.set_yticks(places, list(table["axis"]), fontsize=8)
        axes.invert_yaxis()
        axes.set_xlabel(x_label)
        axes.set_xlim(left=start)
        axes.grid(visible=False, axis="y")
        axes.legend(fontsize=8, loc="lower right")
    drawn: Axes = axes
    return drawn
