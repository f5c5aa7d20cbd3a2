"""One visual style for every plot: quiet axes, one palette, published points always hollow black diamonds."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

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
def figure(path: Path, title: str, **layout: Any) -> Iterator[Any]:
    """Open a figure with axes in the house style and save it to ``path`` at the end.

    Parameters
    ----------
    path : Path
        A PNG file.
    title : str
        What the plot shows, in a sentence.
    **layout
        For ``matplotlib.pyplot.subplots``.
    """
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt
    from cycler import cycler

    settings: Any = SETTINGS | {"axes.prop_cycle": cycler(color=PALETTE)}
    with mpl.rc_context(settings):
        fig, axes = plt.subplots(**layout)
        try:
            yield axes
            fig.suptitle(title, x=0.01, ha="left", fontsize=11, fontweight="bold")
            fig.tight_layout()
            path.parent.mkdir(parents=True, exist_ok=True)
            fig.savefig(path)
        finally:
            plt.close(fig)
