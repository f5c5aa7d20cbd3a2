"""Heat maps of a counter, a cell a tile or a pixel."""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.reports.style import HEAT, figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from tilestamp.reports.style import Into


def heat_map(
    counts: NDArray[Any],
    into: "Into",
    *,
    title: str,
    unit: str,
    size: tuple[int, int],
    tile: int | tuple[int, int] = 1,
    from_below: bool = False,
) -> "Axes":
    """Draw ``counts`` over the screen with a colour bar.

    Parameters
    ----------
    counts : ndarray, (rows, columns)
        Row 0 is the top row; NaN stays white.
    into : Path, Axes or None
        Where it goes (``tilestamp.reports.style``).
    unit : str
        What a cell counts.
    size : tuple of int
        Width and height of the screen in pixels: the axes.
    tile : int, or tuple of two
        Pixels on a side of a cell, or its width and height. What of the cells lies outside the screen is not shown.
    from_below : bool
        Whether the cells begin at the bottom of the screen.
    """
    with figure(into, title, figsize=(8, 6.4 * size[1] / size[0] + 1.0)) as axes:
        shown = np.ma.masked_invalid(np.asarray(counts, np.float64))
        top = float(np.quantile(shown.compressed(), 0.999)) if shown.count() else 1.0
        image = axes.imshow(
            shown,
            cmap=HEAT,
            vmin=0,
            vmax=top or 1.0,
            extent=extent(counts.shape, size[1], tile, from_below=from_below),
            interpolation="nearest",
        )
        axes.set(xlim=(0, size[0]), ylim=(size[1], 0))
        axes.grid(visible=False)
        axes.set(xlabel="x [pixels]", ylabel="y [pixels]")
        axes.figure.colorbar(image, ax=axes, label=unit, shrink=0.9, extend="max")
    drawn: Axes = axes
    return drawn


def extent(
    cells: tuple[int, ...], height: int, tile: int | tuple[int, int], *, from_below: bool
) -> tuple[int, int, int, int]:
    """Left, right, bottom and top of a map of (rows, columns) cells, in pixels from the screen's top left corner."""
    width, rise = (tile, tile) if isinstance(tile, int) else tile
    rows, columns = rise * cells[0], width * cells[1]
    top = height - rows if from_below else 0
    return 0, columns, top + rows, top
