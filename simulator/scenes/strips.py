"""Strips and fans as lists of triangles."""

import numpy as np
from numpy.typing import NDArray


def strip_triangles(corners: NDArray[np.int64]) -> NDArray[np.int64]:
    """Triangles (T, 3) of a strip; every second one is turned, so that all are wound as the first."""
    first = np.arange(max(len(corners) - 2, 0))
    odd = first % 2
    return corners[np.stack([first, first + 1 + odd, first + 2 - odd], axis=1)]


def fan_triangles(corners: NDArray[np.int64]) -> NDArray[np.int64]:
    """Triangles (T, 3) around the first corner of a fan."""
    first = np.arange(1, max(len(corners) - 1, 1))
    return corners[np.stack([0 * first, first, first + 1], axis=1)]
