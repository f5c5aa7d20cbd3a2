"""Maps over two parameters: a panel a method, a cell a run, all on one scale."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.reports.style import HEAT, figure

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis

    from tilestamp.reports.style import Into

COLUMNS = 3  # panels side by side, at most


def value_maps(
    maps: "dict[str, pd.DataFrame]",
    path: Path,
    *,
    title: str,
    unit: str,
    x_label: str,
    y_label: str,
    log_x: bool = False,
    log_y: bool = False,
    top: float = 1.0,
) -> None:
    """Draw tables whose columns are x and whose index is y, numbers or names; NaN stays white.

    Parameters
    ----------
    maps : dict of str to DataFrame
        A panel each.
    path : Path
        PNG to write.
    title, unit, x_label, y_label : str
    log_x, log_y : bool
        Where the values of an axis grow by a factor.
    top : float
        Value from which the colour is the brightest.
    """
    rows = -(-len(maps) // COLUMNS)
    columns = -(-len(maps) // rows)
    size = (5.2 * columns, 3.2 * rows + 0.6)
    with figure(path, title, nrows=rows, ncols=columns, figsize=size, squeeze=False) as grid:
        for axes, (name, table) in zip(grid.flat, maps.items(), strict=False):
            _panel(axes, table, unit, log_x, log_y, top, "neither" if top >= 1 else "max")
            axes.set(title=name, xlabel=x_label, ylabel=y_label)
        for axes in grid.flat[len(maps) :]:
            axes.set_visible(False)


def value_map(
    table: "pd.DataFrame", into: "Into", *, title: str, unit: str, x_label: str, y_label: str, top: float
) -> "Axes":
    """Draw one such table, of which neither axis is logarithmic; see ``value_maps``."""
    with figure(into, title) as axes:
        _panel(axes, table, unit, log_x=False, log_y=False, top=top, extend="neither")
        axes.set(xlabel=x_label, ylabel=y_label)
    drawn: Axes = axes
    return drawn


def _panel(axes: "Axes", table: "pd.DataFrame", unit: str, log_x: bool, log_y: bool, top: float, extend: str) -> None:
    x, y = _edges(table.columns, log_x), _edges(table.index, log_y)
    image = axes.pcolormesh(x, y, table.to_numpy(np.float64), cmap=HEAT, vmin=0, vmax=top)
    axes.grid(visible=False)
    axes.figure.colorbar(image, ax=axes, label=unit, extend=extend)
    axes.set_xscale("log" if log_x else "linear")
    axes.set_yscale("log" if log_y else "linear")
    _name(axes.xaxis, table.columns, rotation=60)
    _name(axes.yaxis, table.index)


def _edges(labels: "pd.Index", log: bool) -> NDArray[np.float64]:
    """Borders of cells around values, or around the places of names."""
    values = np.arange(len(labels)) if _are_names(labels) else np.asarray(labels, np.float64)
    at = np.log(values) if log else values
    middle = (at[1:] + at[:-1]) / 2
    edges = np.concatenate([[2 * at[0] - middle[0]], middle, [2 * at[-1] - middle[-1]]])
    return np.exp(edges) if log else edges


def _are_names(labels: "pd.Index") -> bool:
    return isinstance(labels[0], str)


def _name(axis: "Axis", labels: "pd.Index", **style: Any) -> None:
    """Write names at their places."""
    if _are_names(labels):
        axis.set_ticks(range(len(labels)), list(labels), fontsize=8, **style)
