"""Pictures for sample test efficiency: wrong pixels in red over the picture, two heat maps on one scale."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.reports.style import HEAT, figure

RED = (220, 0, 30)
GROWN = 1  # pixels around a wrong one that are drawn red too, so that single pixels can be seen


def wrong_pixels(image: NDArray[np.uint8], wrong: NDArray[np.bool_], path: Path, *, title: str) -> None:
    """Draw a picture, paled, with the wrong pixels in red (each grown by a pixel on every side).

    Parameters
    ----------
    image : ndarray, (H, W, 3), uint8
    wrong : ndarray, (H, W), bool
    path : Path
        PNG to write.
    """
    shown = (255 - (255 - image.astype(np.int64)) // 2).astype(np.uint8)
    grown = wrong.copy()
    for y, x in zip(*np.nonzero(wrong), strict=True):
        grown[max(y - GROWN, 0) : y + GROWN + 1, max(x - GROWN, 0) : x + GROWN + 1] = True
    shown[grown] = RED
    with figure(path, title, figsize=(8, 8 * image.shape[0] / image.shape[1] + 0.6)) as axes:
        axes.imshow(shown, interpolation="nearest")
        axes.grid(visible=False)
        axes.set(xlabel="x [pixels]", ylabel="y [pixels]")


def heat_maps(maps: dict[str, NDArray[Any]], path: Path, *, title: str, unit: str) -> None:
    """Draw maps of one unit side by side on one scale; zero stays white.

    Parameters
    ----------
    maps : dict of str to ndarray, (H, W)
    path : Path
        PNG to write.
    """
    top = max(float(np.quantile(counts[counts > 0], 0.999)) if (counts > 0).any() else 1.0 for counts in maps.values())
    with figure(path, title, ncols=len(maps), figsize=(6 * len(maps), 4.6), squeeze=False) as grid:
        for axes, (name, counts) in zip(grid[0], maps.items(), strict=True):
            image = axes.imshow(np.ma.masked_equal(counts, 0), cmap=HEAT, vmin=0, vmax=top, interpolation="nearest")
            axes.grid(visible=False)
            axes.set(title=name, xlabel="x [pixels]", ylabel="y [pixels]")
            axes.figure.colorbar(image, ax=axes, label=unit, shrink=0.8, extend="max")
