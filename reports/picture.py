"""A picture, as it is."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tilestamp.reports.style import figure


def picture(image: NDArray[np.uint8], path: Path, *, title: str) -> None:
    """Draw a picture without axes.

    Parameters
    ----------
    image : ndarray, (H, W, 3), uint8
    path : Path
        PNG to write.
    """
    with figure(path, title, figsize=(8, 8 * image.shape[0] / image.shape[1] + 0.6)) as axes:
        axes.imshow(image, interpolation="nearest")
        axes.set_axis_off()
