"""Bicubic Bezier patches by parameter: restriction to a square of the parameter domain, basis and tangent rows."""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from models.errors import TilestampError

THREE = np.float32(3.0)
TWO = np.float32(2.0)
ONE = np.float32(1.0)


@njit(cache=True, nogil=True)
def restriction(a: Any, b: Any, rows: Any) -> Any:
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
def basis(first: Any, side: Any, rows: Any, slopes: Any) -> Any:
    """Bernstein polynomials at four evenly spaced parameters of the interval [first * side, (first + 1) * side].

    Parameters
    ----------
    first : int
    side : float32
        A power of two, so that the ends of the unit interval are exact.
    rows : ndarray, (4, 4), float32
        Filled: ``rows[x, k]`` weighs control point x at parameter k.
    slopes : ndarray, (3, 4), float32
        Filled: ``slopes[x, k]`` weighs the difference of control points x + 1 and x in a third of the derivative.
    """
    for k in range(4):
        a = np.float32(3 * first + k) * side / THREE
        A = ONE - a
        rows[0, k], rows[1, k], rows[2, k], rows[3, k] = A * A * A, THREE * a * A * A, THREE * a * a * A, a * a * a
        slopes[0, k], slopes[1, k], slopes[2, k] = A * A, TWO * a * A, a * a


@njit(cache=True, nogil=True)
def _along_v(points: Any, d: Any, by_v: Any, between: Any) -> Any:
    """Contract the rows of coordinate d of a net: ``between[4 r + x]``.

    Here and below: indices instead of views, whose reference counts would cost more than the sums; and four sums
    before four stores, so that LLVM makes them one vector.
    """
    for r in range(4):
        v0, v1, v2, v3 = by_v[0, r], by_v[1, r], by_v[2, r], by_v[3, r]
        x0 = v0 * points[d, 0] + v1 * points[d, 4] + v2 * points[d, 8] + v3 * points[d, 12]
        x1 = v0 * points[d, 1] + v1 * points[d, 5] + v2 * points[d, 9] + v3 * points[d, 13]
        x2 = v0 * points[d, 2] + v1 * points[d, 6] + v2 * points[d, 10] + v3 * points[d, 14]
        x3 = v0 * points[d, 3] + v1 * points[d, 7] + v2 * points[d, 11] + v3 * points[d, 15]
        q = 4 * r
        between[q], between[q + 1], between[q + 2], between[q + 3] = x0, x1, x2, x3


@njit(cache=True, nogil=True)
def _along_u(between: Any, by_u: Any, out: Any, d: Any) -> Any:
    """Contract the columns: ``out[d, 4 r + c]``."""
    for r in range(4):
        q = 4 * r
        p0, p1, p2, p3 = between[q], between[q + 1], between[q + 2], between[q + 3]
        c0 = by_u[0, 0] * p0 + by_u[1, 0] * p1 + by_u[2, 0] * p2 + by_u[3, 0] * p3
        c1 = by_u[0, 1] * p0 + by_u[1, 1] * p1 + by_u[2, 1] * p2 + by_u[3, 1] * p3
        c2 = by_u[0, 2] * p0 + by_u[1, 2] * p1 + by_u[2, 2] * p2 + by_u[3, 2] * p3
        c3 = by_u[0, 3] * p0 + by_u[1, 3] * p1 + by_u[2, 3] * p2 + by_u[3, 3] * p3
        out[d, q], out[d, q + 1], out[d, q + 2], out[d, q + 3] = c0, c1, c2, c3


@njit(cache=True, nogil=True)
def restrict(points: Any, by_u: Any, by_v: Any, between: Any, out: Any) -> Any:
    """Tensor product: control points of a sub-patch by ``restriction`` tables, points of a grid by ``basis`` tables.

    Parameters
    ----------
    points : ndarray, (>= D, 16), float32
        Control net, a coordinate a row.
    by_u, by_v : ndarray, (4, 4), float32
    between : ndarray, (16,), float32
        Scratch.
    out : ndarray, (D, 16), float32
    """
    for d in range(out.shape[0]):
        _along_v(points, d, by_v, between)
        _along_u(between, by_u, out, d)


@njit(cache=True, nogil=True)
def _slopes_along_u(between: Any, slope_u: Any, out: Any, d: Any) -> Any:
    """Contract the differences of neighbouring columns."""
    for r in range(4):
        q = 4 * r
        d0, d1, d2 = between[q + 1] - between[q], between[q + 2] - between[q + 1], between[q + 3] - between[q + 2]
        c0 = slope_u[0, 0] * d0 + slope_u[1, 0] * d1 + slope_u[2, 0] * d2
        c1 = slope_u[0, 1] * d0 + slope_u[1, 1] * d1 + slope_u[2, 1] * d2
        c2 = slope_u[0, 2] * d0 + slope_u[1, 2] * d1 + slope_u[2, 2] * d2
        c3 = slope_u[0, 3] * d0 + slope_u[1, 3] * d1 + slope_u[2, 3] * d2
        out[d, q], out[d, q + 1], out[d, q + 2], out[d, q + 3] = c0, c1, c2, c3


@njit(cache=True, nogil=True)
def _slopes_along_v(points: Any, d: Any, slope_v: Any, between: Any) -> Any:
    """Contract the differences of neighbouring rows."""
    for r in range(4):
        v0, v1, v2 = slope_v[0, r], slope_v[1, r], slope_v[2, r]
        x0 = (
            v0 * (points[d, 4] - points[d, 0])
            + v1 * (points[d, 8] - points[d, 4])
            + v2 * (points[d, 12] - points[d, 8])
        )
        x1 = (
            v0 * (points[d, 5] - points[d, 1])
            + v1 * (points[d, 9] - points[d, 5])
            + v2 * (points[d, 13] - points[d, 9])
        )
        x2 = (
            v0 * (points[d, 6] - points[d, 2])
            + v1 * (points[d, 10] - points[d, 6])
            + v2 * (points[d, 14] - points[d, 10])
        )
        x3 = (
            v0 * (points[d, 7] - points[d, 3])
            + v1 * (points[d, 11] - points[d, 7])
            + v2 * (points[d, 15] - points[d, 11])
        )
        q = 4 * r
        between[q], between[q + 1], between[q + 2], between[q + 3] = x0, x1, x2, x3


@njit(cache=True, nogil=True)
def evaluate(
    points: Any, by_u: Any, by_v: Any, slope_u: Any, slope_v: Any, between: Any, out: Any, along_u: Any, along_v: Any
) -> Any:
    """Points of a grid, and thirds of the derivatives along u and v: a coordinate of ``points`` a row of each.

    Differences of equal control points are exactly zero: a collapsed edge shows as a zero tangent.
    """
    for d in range(points.shape[0]):
        _along_v(points, d, by_v, between)
        _along_u(between, by_u, out, d)
        _slopes_along_u(between, slope_u, along_u, d)
        _slopes_along_v(points, d, slope_v, between)
        _along_u(between, by_u, along_v, d)


def screen_points(points: NDArray[np.float32], matrix: ArrayLike, width: int, height: int) -> NDArray[np.float32]:
    """Control points as (x w, y w, w, z w), x and y in pixels from the top left corner, z in [-1, 1] where visible.

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
    ndarray, (P, 4, 16), float32
        Rounded once, after the transformation in float64.

    Raises
    ------
    TilestampError
        NaN, infinity, or numbers that float32 does not hold.
    """
    viewport = np.array(
        [[0.5 * width, 0, 0, 0.5 * width], [0, -0.5 * height, 0, 0.5 * height], [0, 0, 0, 1.0], [0, 0, 1, 0]]
    )
    rows = viewport @ np.asarray(matrix, np.float64)
    with np.errstate(over="ignore", invalid="ignore"):
        screen = np.ascontiguousarray((rows @ points.astype(np.float64).transpose(0, 2, 1)).astype(np.float32))
    if not np.isfinite(screen).all():
        raise TilestampError("control points and camera must be finite numbers, small enough for float32 on screen")
    return screen
