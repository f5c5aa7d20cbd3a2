"""One visual style for every plot: quiet axes, one palette, published points always hollow black diamonds."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    Into = Path | Axes | None
    """Where a plot goes: a PNG file, axes that are there, or a new figure, which stays open and a notebook shows."""

PALETTE = ("#1f5aa6", "#d95f02", "#1b9e77", "#7b5ea7", "#c2185b", "#8d6e2f", "#4f6d7a", "#000000")
PUBLISHED = {"marker": "D", "markerfacecolor": "none", "markeredgecolor": "black", "markersize": 7, "linestyle": "none"}
HEAT = "magma"
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
}


@contextmanager
def figure(into: "Into", title: str, figsize: tuple[float, float] | None = None, **layout: Any) -> Iterator[Any]:
    """Draw in the house style: give axes, and at the end save them where ``into`` is a file.

    Parameters
    ----------
    into : Path, Axes or None
        A PNG file; axes to draw on; or a new figure, which stays open.
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
            into.parent.mkdir(parents=True, exist_ok=True)
            fig.savefig(into)


def _opened(figsize: tuple[float, float] | None) -> Any:
    """A figure that pyplot knows, so that a notebook or a window shows it."""
    from matplotlib import pyplot as plt

    return plt.figure(figsize=figsize)
