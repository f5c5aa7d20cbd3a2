"""One visual style for every plot: quiet axes, one palette, published points always hollow black diamonds."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from tilestamp.reports.save import save_figure

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

    Into = Path | Axes | None
    """Where a plot goes: a file (without a suffix: a PNG and an SVG), axes that are there, or a new figure, which stays
    open and a notebook shows."""

PALETTE = ("#1f5aa6", "#d95f02", "#1b9e77", "#7b5ea7", "#c2185b", "#8d6e2f", "#4f6d7a", "#000000")
PUBLISHED = {"marker": "D", "markerfacecolor": "none", "markeredgecolor": "black", "markersize": 7, "linestyle": "none"}
HEAT = "magma"
MOST_PLAIN = 4  # decades of an axis whose numbers are written out
NAME_WIDTH = 28  # letters of a line of a legend
SETTINGS: dict[str, Any] = {
    "figure.figsize": (7.2, 4.4),
    "figure.dpi": 110,
    "savefig.dpi": 150,
    "font.size": 10,
    "axes.titlesize": 11,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.7,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "lines.linewidth": 1.7,
    "svg.hashsalt": "tilestamp",  # the same plot is the same file
}


@contextmanager
def figure(into: "Into", title: str, figsize: tuple[float, float] | None = None, **layout: Any) -> Iterator[Any]:
    """Draw in the house style: give axes, and at the end save them where ``into`` is a file.

    Parameters
    ----------
    into : Path, Axes or None
        A file, or without a suffix a PNG and an SVG; axes to draw on; or a new figure, which stays open.
    title : str
        What the plot shows, in a sentence.
    figsize : tuple of float, optional
        Width and height in inches.
    **layout
        For ``matplotlib.figure.Figure.subplots``.
    """
    import matplotlib as mpl
    from cycler import cycler
    from matplotlib.figure import Figure

    settings: Any = SETTINGS | {"axes.prop_cycle": cycler(color=PALETTE)}
    with mpl.rc_context(settings):
        if into is not None and not isinstance(into, Path):
            yield into
            into.set_title(title)
            return
        fig = Figure(figsize=figsize) if into else _opened(figsize)
        yield fig.subplots(**layout)
        fig.suptitle(title, x=0.01, ha="left", fontsize=11, fontweight="bold")
        fig.tight_layout()
        if into:
            save_figure(fig, into, title)


def _opened(figsize: tuple[float, float] | None) -> Any:
    """A figure that pyplot knows, so that a notebook or a window shows it."""
    from matplotlib import pyplot as plt

    return plt.figure(figsize=figsize)


def legend_beside(axes: "Axes", handles: "Mapping[str, Artist] | None" = None) -> None:
    """Put the legend to the right of the axes, where it hides nothing."""
    names, drawn = (list(handles), list(handles.values())) if handles else (axes.get_legend_handles_labels()[::-1])
    wrapped = [fill(str(name), NAME_WIDTH) for name in names]
    axes.legend(drawn, wrapped, fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))


def plain_ticks(axes: "Axes") -> None:
    """Write plain numbers on logarithmic axes, at 2 and 5 too where decades are few; powers where they are many."""
    from matplotlib.ticker import LogFormatterMathtext, LogLocator, NullFormatter, StrMethodFormatter

    for axis, (low, high) in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
        if axis.get_scale() != "log":
            continue
        decades = np.log10(high / low)
        steps = (1.0,) if decades > 2 else (1.0, 2.0, 5.0) if decades > 0.7 else tuple(np.arange(1.0, 10.0, 0.5))
        axis.set_major_locator(LogLocator(subs=steps))
        axis.set_major_formatter(StrMethodFormatter("{x:g}") if decades < MOST_PLAIN else LogFormatterMathtext())
        axis.set_minor_formatter(NullFormatter())
