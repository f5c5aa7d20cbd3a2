"""Sample positions: where in a pixel its 1 to 16 samples lie, from a file."""

import tomllib
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError

SUBPIXELS = 4096  # steps of the sub-pixel grid along an axis: vertices and samples are snapped to it
STANDARD = Path(__file__).parent / "data" / "sample_positions.toml"


@cache
def sample_positions(spp: int, file: str | Path | None = None) -> NDArray[np.int64]:
    """Read the positions of ``spp`` samples.

    Parameters
    ----------
    spp : int
        Samples a pixel, 1 to 16.
    file : str or Path, optional
        A TOML file of the form ``4 = [[0.375, 0.125], ...]``: x and y in pixels from the pixel's top left corner.

    Returns
    -------
    ndarray, (spp, 2), int64
        x and y in steps of 1 / SUBPIXELS pixel.

    Raises
    ------
    TilestampError
        No such file, no such pattern in it, or a position outside the pixel.
    """
    path = Path(file) if file is not None else STANDARD
    try:
        patterns = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise TilestampError(f"{path}: cannot be read ({error.strerror})") from None
    except ValueError as error:  # no TOML, no text or no path
        raise TilestampError(f"{path}: {error}") from None
    if str(spp) not in patterns:
        raise TilestampError(f"{path}: there is no pattern of {spp} samples")
    try:
        positions = np.array(patterns[str(spp)], np.float64)
    except (TypeError, ValueError):
        positions = np.empty(0)
    if positions.shape != (spp, 2) or not ((positions >= 0) & (positions < 1)).all():
        raise TilestampError(f"{path}: the pattern {spp} is not {spp} pairs of numbers from 0 up to 1")
    return np.floor(positions * SUBPIXELS).astype(np.int64)
