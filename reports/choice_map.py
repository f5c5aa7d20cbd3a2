"""Map of the best of some choices over a plane: a colour a choice, the paler the closer the second best."""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.reports.style import PALETTE, figure

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

    from tilestamp.reports.style import Into

COLUMNS = 3  # panels side by side, at most
CLEAR = 0.3  # margin from which a colour is full
PALEST = 0.25


def choice_map(table: "pd.DataFrame", into: "Into", *, x: str, y: str, panel: str, title: str, legend: str) -> "Axes":
    """Draw which choice is the best at each place, its margin in the cell, and lines where the choice changes.

    Parameters
    ----------
    table : DataFrame
        A row a place: ``x``, ``y`` (numbers or names, in order of appearance), ``panel`` (a name), ``best`` and
        ``margin`` (share by which the second best is worse, NaN where there is none).
    into : Path or None
        Where it goes (``tilestamp.reports.style``).
    legend : str
        What the choices are.

    Returns
    -------
    Axes
        The first panel's.
    """
    names = list(dict.fromkeys(table[panel]))
    across, up = (list(dict.fromkeys(table[axis])) for axis in (x, y))
    choices = sorted(dict.fromkeys(table["best"]), key=lambda value: (isinstance(value, str), value))
    rows = -(-len(names) // COLUMNS)
    columns = -(-len(names) // rows)
    size = ((0.62 * len(across) + 1.6) * columns + 1.4, (0.34 * len(up) + 1.2) * rows + 0.6)
    with figure(into, title, nrows=rows, ncols=columns, figsize=size, squeeze=False) as grid:
        for axes, name in zip(grid.flat, names, strict=False):
            part = table[table[panel] == name]
            _panel(axes, *(_field(part, x, y, across, up, choices)))
            axes.set_xticks(range(len(across)), [_text(value) for value in across], rotation=60, fontsize=8)
            axes.set_yticks(range(len(up)), [_text(value) for value in up], fontsize=8)
            axes.set_xlabel(x)
            axes.set_ylabel(y)
            axes.set_title(str(name), fontsize=9)
            axes.grid(visible=False)
        for axes in grid.flat[len(names) :]:
            axes.set_axis_off()
        _legend(grid[0, -1], choices, legend)
    first: Axes = grid[0, 0]
    return first


def _field(
    part: "pd.DataFrame", x: str, y: str, across: list[Any], up: list[Any], choices: list[Any]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Number of the best choice (-1: none) and its margin, by place."""
    best, margin = np.full((len(up), len(across)), -1), np.full((len(up), len(across)), np.nan)
    for row in part.to_dict("records"):
        at = up.index(row[y]), across.index(row[x])
        best[at], margin[at] = choices.index(row["best"]), row["margin"]
    return best, margin


def _panel(axes: "Axes", best: NDArray[np.int64], margin: NDArray[np.float64]) -> None:
    from matplotlib.colors import to_rgb

    colors = np.ones((*best.shape, 3))
    for at in np.argwhere(best >= 0):
        place = tuple(at)
        share = np.clip(np.nan_to_num(margin[place], nan=CLEAR) / CLEAR, PALEST, 1.0)
        colors[place] = 1.0 - share * (1.0 - np.array(to_rgb(PALETTE[best[place] % len(PALETTE)])))
        said = "" if np.isnan(margin[place]) else f"{100 * margin[place]:.0f}"
        axes.text(at[1], at[0], said, ha="center", va="center", fontsize=7, color="white" if share > 0.7 else "black")
    axes.imshow(colors, origin="lower", aspect="auto", interpolation="nearest")
    for row, column in np.argwhere(best[:, 1:] != best[:, :-1]):
        axes.plot([column + 0.5] * 2, [row - 0.5, row + 0.5], color="black", linewidth=2.0)
    for row, column in np.argwhere(best[1:] != best[:-1]):
        axes.plot([column - 0.5, column + 0.5], [row + 0.5] * 2, color="black", linewidth=2.0)


def _legend(axes: "Axes", choices: list[Any], legend: str) -> None:
    from matplotlib.patches import Patch

    patches = [Patch(color=PALETTE[k % len(PALETTE)], label=_text(value)) for k, value in enumerate(choices)]
    title = f"{legend}\n(number: second\nbest worse by, %)"
    axes.legend(handles=patches, title=title, fontsize=8, title_fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))


def _text(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
