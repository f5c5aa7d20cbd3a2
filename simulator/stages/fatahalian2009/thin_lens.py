"""Defocus: how far each vertex is from the eye, and its circle of confusion by a thin lens (Cook et al. 1987)."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tilestamp.simulator.stages.fatahalian2009.micropolygons import Micropolygons


def defocus(
    polygons: Micropolygons, matrix: ArrayLike, width: int, height: int, focus: float | None, aperture: float
) -> NDArray[np.float32]:
    """Radius in pixels of each vertex's circle of confusion, (M, 3 or 4); sharp is ``focus``, else the mean distance.

    In an orthographic view all is at one distance, so that nothing is out of focus by default.
    """
    distance = eye_distances(polygons, matrix, width, height)
    mean = float(distance.mean()) if distance.size else 1.0
    return circle_of_confusion(distance, focus or mean, aperture)


def eye_distances(polygons: Micropolygons, matrix: ArrayLike, width: int, height: int) -> NDArray[np.float64]:
    """Distance of each vertex along the line of sight, (M, 3 or 4): w before the division, found by going back."""
    x, y, depth = np.moveaxis(polygons.vertices.astype(np.float64), -1, 0)
    clip = np.stack([2 * x / width - 1, 1 - 2 * y / height, 2 * depth - 1, np.ones_like(x)])
    distances: NDArray[np.float64] = 1.0 / np.tensordot(np.linalg.inv(np.asarray(matrix, float))[3], clip, axes=1)
    return distances


def circle_of_confusion(distance: ArrayLike, focus: float, aperture: float) -> NDArray[np.float32]:
    """Radius in pixels of a thin lens: ``aperture`` pixels at infinite distance, none at ``focus``."""
    away = np.asarray(distance, np.float64)
    return (aperture * np.abs(away - focus) / away).astype(np.float32)
