"""Heat maps of a counter, a cell a tile or a pixel."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reports.style import HEAT, figure


def heat_map(counts: NDArray[Any], path: Path, *, title: str, unit: str, width: int, height: int) -> None:
    """Draw ``counts`` over the screen with a colour bar.

    Parameters
    ----------
    counts : ndarray, (rows, columns)
        Row 0 is the top row; NaN stays white.
    path : Path
        PNG to write.
    unit : str
        What a cell counts.
    width, height : int
        Of the screen in pixels: the axes.
    """
    with figure(path, title, figsize=(8, 6.4 * height / width + 1.0)) as axes:
        shown = np.ma.masked_invalid(np.asarray(counts, np.float64))
        top = float(np.quantile(shown.compressed(), 0.999)) if shown.count() else 1.0
        image = axes.imshow(
            shown, cmap=HEAT, vmin=0, vmax=top or 1.0, extent=(0, width, height, 0), interpolation="nearest"
        )
        axes.grid(visible=False)
        axes.set(xlabel="x [pixels]", ylabel="y [pixels]")
        axes.figure.colorbar(image, ax=axes, label=unit, shrink=0.9, extend="max")
