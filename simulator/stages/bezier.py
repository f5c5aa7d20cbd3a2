"""Bicubic Bezier patches by parameter: restriction to a square of the parameter domain, basis and tangent rows."""

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from models.errors import TilestampError

THREE = np.float32(3.0)
TWO = np.float32(2.0)
ONE = np.float32(1.0)


@njit(cache=True, nogil=True)
def restriction(a, b, rows):
    """Fill ``rows`` (4, 4) so that ``q[k] = sum_x rows[x, k] p[x]`` are the control points over [a, b] (blossoms)."""
    A = ONE - a
    B = ONE - b
    rows[0, 0], rows[1, 0], rows[2, 0], rows[3, 0] = A * A * A, THREE * a * A * A, THREE * a * a * A, a * a * a
    rows[0, 1], rows[1, 1], rows[2, 1], rows[3, 1] = (
        A * A * B,
        A * (A * b + TWO * a * B),
        a * (a * B + TWO * A * b),
        a * a * b,
    )
    rows[0, 2], rows[1, 2], rows[2, 2], rows[3, 2] = (
        A * B * B,
        B * (a * B + TWO * A * b),
        b * (A * b + TWO * a * B),
        a * b * b,
    )
    rows[0, 3], rows[1, 3], rows[2, 3], rows[3, 3] = B * B * B, THREE * b * B * B, THREE * b * b * B, b * b * b


@njit(cache=True, nogil=True)
def restrict(points, by_u, by_v, between, out):
    """Control points of a sub-patch, ``out`` (3, 16), from ``points`` (3, 16) and two ``restriction`` tables."""
    for d in range(3):
        for r in range(4):
            for x in range(4):
                between[4 * r + x] = (
                    by_v[0, r] * points[d, x]
                    + by_v[1, r] * points[d, 4 + x]
                    + by_v[2, r] * points[d, 8 + x]
                    + by_v[3, r] * points[d, 12 + x]
                )
        for r in range(4):
            for c in range(4):
                out[d, 4 * r + c] = (
                    by_u[0, c] * between[4 * r]
                    + by_u[1, c] * between[4 * r + 1]
                    + by_u[2, c] * between[4 * r + 2]
                    + by_u[3, c] * between[4 * r + 3]
                )


def screen_points(points: NDArray[np.float32], matrix: ArrayLike, width: int, height: int) -> NDArray[np.float32]:
    """Control points as (x w, y w, w), x and y in pixels from the top left corner.

    Parameters
    ----------
    points : ndarray, (P, 16, 4), float32
        Homogeneous, model space.
    matrix : array-like, (4, 4)
        Model to clip space, for column vectors.
    width, height : int
        Pixels.

    Returns
    -------
    ndarray, (P, 3, 16), float32
        Rounded once, after the transformation in float64.

    Raises
    ------
    TilestampError
        NaN, infinity, or numbers that float32 does not hold.
    """
    viewport = np.array([[0.5 * width, 0, 0, 0.5 * width], [0, -0.5 * height, 0, 0.5 * height], [0, 0, 0, 1.0]])
    rows = viewport @ np.asarray(matrix, np.float64)
    with np.errstate(over="ignore", invalid="ignore"):
        screen = np.ascontiguousarray((rows @ points.astype(np.float64).transpose(0, 2, 1)).astype(np.float32))
    if not np.isfinite(screen).all():
        raise TilestampError("control points and camera must be finite numbers, small enough for float32 on screen")
    return screen
