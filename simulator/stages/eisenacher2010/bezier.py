"""Bicubic Bezier patches by parameter: restriction to a square of the parameter domain, basis and tangent rows.

Sixteen sub-patches are worked on side by side: each innermost loop runs over ``LANES`` of them, and LLVM makes vectors
of it. For that, arrays are flat, their axes given in the comments: constant distances show that they do not overlap;
a coordinate of a net is a view, so that no index in a loop could be below zero, which would mean one from the end;
and their lengths are not known to the compiler, which would unroll short loops instead. Each lane does the same float32
operations in the same order as one alone would.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.kernel import kernel

LANES = 16  # sub-patches side by side
POINTS = 16  # control points of a patch, vertices of a grid
THREE = np.float32(3.0)
TWO = np.float32(2.0)
ONE = np.float32(1.0)


class Squares(NamedTuple):
    """Sub-patches side by side: (i, j) * side is the corner of a square of the parameter domain."""

    patch: NDArray[np.int32]  # (LANES,)
    i: NDArray[np.int32]
    j: NDArray[np.int32]
    side: NDArray[np.float32]  # a power of two, so that the ends of the unit interval are exact


@kernel
def new_squares(lanes: Any) -> Any:
    """Scratch for sub-patches."""
    return Squares(
        np.zeros(lanes, np.int32), np.zeros(lanes, np.int32), np.zeros(lanes, np.int32), np.ones(lanes, np.float32)
    )


@kernel(lent=True)
def set_square(squares: Squares, lane: Any, queue: Any, n: Any) -> None:
    """Put sub-patch ``n`` of the queue in a lane."""
    squares.patch[lane] = queue.patch[n]
    squares.i[lane], squares.j[lane] = queue.i[n], queue.j[n]
    squares.side[lane] = ONE / np.float32(1 << queue.level[n])


@kernel(lent=True)
def gather(points: Any, patch: Any, gathered: Any, net: Any) -> None:
    """Lay the control points (P, >= D, 16) of the patches of all lanes side by side: ``net`` (D, 16, LANES).

    Lanes keep those of the patch that they have ``gathered``: neighbours in the queue come from one patch.
    """
    for lane in range(LANES):
        p = patch[lane]
        if gathered[lane] == p:
            continue
        gathered[lane] = p
        for d in range(net.shape[0] // (POINTS * LANES)):
            for k in range(POINTS):
                net[(POINTS * d + k) * LANES + lane] = points[p, d, k]


@kernel(error_model="numpy", lent=True)
def restriction(first: Any, side: Any, rows: Any) -> None:
    """Tables of the intervals [a, b] = [first * side, (first + 1) * side] by blossoms.

    Fill ``rows`` (4, 4, LANES) so that ``q[k] = sum_x rows[x, k] p[x]`` are the control points over the interval.
    """
    for n in range(side.shape[0]):
        a, b = np.float32(first[n]) * side[n], np.float32(first[n] + np.int32(1)) * side[n]
        A, B = ONE - a, ONE - b
        rows[0 * LANES + n], rows[4 * LANES + n], rows[8 * LANES + n], rows[12 * LANES + n] = _bernstein(a, A)
        rows[1 * LANES + n], rows[5 * LANES + n] = A * A * B, A * (A * b + TWO * a * B)
        rows[9 * LANES + n], rows[13 * LANES + n] = a * (a * B + TWO * A * b), a * a * b
        rows[2 * LANES + n], rows[6 * LANES + n] = A * B * B, B * (a * B + TWO * A * b)
        rows[10 * LANES + n], rows[14 * LANES + n] = b * (A * b + TWO * a * B), a * b * b
        rows[3 * LANES + n], rows[7 * LANES + n], rows[11 * LANES + n], rows[15 * LANES + n] = _bernstein(b, B)


@kernel(lent=True)
def _bernstein(a: Any, A: Any) -> Any:
    return A * A * A, THREE * a * A * A, THREE * a * a * A, a * a * a


@kernel(error_model="numpy", lent=True)
def basis(first: Any, side: Any, rows: Any, slopes: Any) -> None:
    """Bernstein polynomials at four evenly spaced parameters of the intervals [first * side, (first + 1) * side].

    Parameters
    ----------
    first : ndarray, (LANES,), int32
    side : ndarray, (LANES,), float32
    rows : ndarray, (4, 4, LANES), float32
        Filled: ``rows[x, k]`` weighs control point x at parameter k.
    slopes : ndarray, (3, 4, LANES), float32
        Filled: ``slopes[x, k]`` weighs the difference of control points x + 1 and x in a third of the derivative.
    """
    for k in range(4):
        for n in range(side.shape[0]):
            a = np.float32(np.int32(3) * first[n] + np.int32(k)) * side[n] / THREE
            A = ONE - a
            (
                rows[(0 + k) * LANES + n],
                rows[(4 + k) * LANES + n],
                rows[(8 + k) * LANES + n],
                rows[(12 + k) * LANES + n],
            ) = _bernstein(a, A)
            slopes[(0 + k) * LANES + n], slopes[(4 + k) * LANES + n], slopes[(8 + k) * LANES + n] = (
                A * A,
                TWO * a * A,
                a * a,
            )


@kernel(lent=True)
def _weigh(w: Any, k: Any, n: Any, p0: Any, p1: Any, p2: Any, p3: Any) -> Any:
    return (
        w[(0 + k) * LANES + n] * p0
        + w[(4 + k) * LANES + n] * p1
        + w[(8 + k) * LANES + n] * p2
        + w[(12 + k) * LANES + n] * p3
    )


@kernel(lent=True)
def _weigh_steps(w: Any, k: Any, n: Any, p0: Any, p1: Any, p2: Any, p3: Any) -> Any:
    return w[(0 + k) * LANES + n] * (p1 - p0) + w[(4 + k) * LANES + n] * (p2 - p1) + w[(8 + k) * LANES + n] * (p3 - p2)


@kernel(lent=True)
def _along_v(net: Any, by_v: Any, between: Any) -> None:
    """Contract the rows of a coordinate of a net: ``between[r, x]``."""
    for x in range(4):
        for n in range(between.shape[0] // POINTS):
            at = x * LANES + n
            p0, p1, p2, p3 = net[at], net[at + 4 * LANES], net[at + 8 * LANES], net[at + 12 * LANES]
            q0, q1 = _weigh(by_v, 0, n, p0, p1, p2, p3), _weigh(by_v, 1, n, p0, p1, p2, p3)
            q2, q3 = _weigh(by_v, 2, n, p0, p1, p2, p3), _weigh(by_v, 3, n, p0, p1, p2, p3)
            between[at], between[at + 4 * LANES], between[at + 8 * LANES], between[at + 12 * LANES] = q0, q1, q2, q3


@kernel(lent=True)
def _along_u(between: Any, by_u: Any, out: Any) -> None:
    """Contract the columns: ``out[4 r + c]``."""
    for r in range(4):
        for n in range(between.shape[0] // POINTS):
            at = 4 * r * LANES + n
            p0, p1, p2, p3 = between[at], between[at + LANES], between[at + 2 * LANES], between[at + 3 * LANES]
            q0, q1 = _weigh(by_u, 0, n, p0, p1, p2, p3), _weigh(by_u, 1, n, p0, p1, p2, p3)
            q2, q3 = _weigh(by_u, 2, n, p0, p1, p2, p3), _weigh(by_u, 3, n, p0, p1, p2, p3)
            out[at], out[at + LANES], out[at + 2 * LANES], out[at + 3 * LANES] = q0, q1, q2, q3


@kernel(lent=True)
def restrict(net: Any, by_u: Any, by_v: Any, between: Any, out: Any) -> None:
    """Tensor product: control points of sub-patches by ``restriction`` tables, points of grids by ``basis`` tables.

    Parameters
    ----------
    net : ndarray, (>= D, 16, LANES), float32
        Control nets, a coordinate a row.
    by_u, by_v : ndarray, (4, 4, LANES), float32
    between : ndarray, (4, 4, LANES), float32
        Scratch.
    out : ndarray, (D, 16, LANES), float32
    """
    for d in range(out.shape[0] // (POINTS * LANES)):
        of_d = slice(POINTS * LANES * d, POINTS * LANES * (d + 1))
        _along_v(net[of_d], by_v, between)
        _along_u(between, by_u, out[of_d])


@kernel(lent=True)
def _slopes_along_u(between: Any, slope_u: Any, out: Any) -> None:
    """Contract the differences of neighbouring columns."""
    for r in range(4):
        for n in range(between.shape[0] // POINTS):
            at = 4 * r * LANES + n
            p0, p1, p2, p3 = between[at], between[at + LANES], between[at + 2 * LANES], between[at + 3 * LANES]
            q0, q1 = _weigh_steps(slope_u, 0, n, p0, p1, p2, p3), _weigh_steps(slope_u, 1, n, p0, p1, p2, p3)
            q2, q3 = _weigh_steps(slope_u, 2, n, p0, p1, p2, p3), _weigh_steps(slope_u, 3, n, p0, p1, p2, p3)
            out[at], out[at + LANES], out[at + 2 * LANES], out[at + 3 * LANES] = q0, q1, q2, q3


@kernel(lent=True)
def _slopes_along_v(net: Any, slope_v: Any, between: Any) -> None:
    """Contract the differences of neighbouring rows."""
    for x in range(4):
        for n in range(between.shape[0] // POINTS):
            at = x * LANES + n
            p0, p1, p2, p3 = net[at], net[at + 4 * LANES], net[at + 8 * LANES], net[at + 12 * LANES]
            q0, q1 = _weigh_steps(slope_v, 0, n, p0, p1, p2, p3), _weigh_steps(slope_v, 1, n, p0, p1, p2, p3)
            q2, q3 = _weigh_steps(slope_v, 2, n, p0, p1, p2, p3), _weigh_steps(slope_v, 3, n, p0, p1, p2, p3)
            between[at], between[at + 4 * LANES], between[at + 8 * LANES], between[at + 12 * LANES] = q0, q1, q2, q3


@kernel(lent=True)
def evaluate(
    net: Any, by_u: Any, by_v: Any, slope_u: Any, slope_v: Any, between: Any, out: Any, along_u: Any, along_v: Any
) -> None:
    """Points of grids, and thirds of the derivatives along u and v: a coordinate of ``net`` a row of each.

    Differences of equal control points are exactly zero: a collapsed edge shows as a zero tangent.
    """
    for d in range(net.shape[0] // (POINTS * LANES)):
        of_d = slice(POINTS * LANES * d, POINTS * LANES * (d + 1))
        _along_v(net[of_d], by_v, between)
        _along_u(between, by_u, out[of_d])
        _slopes_along_u(between, slope_u, along_u[of_d])
        _slopes_along_v(net[of_d], slope_v, between)
        _along_u(between, by_u, along_v[of_d])


@kernel(lent=True)
def evaluate_point(net: Any, n: Any, u: Any, v: Any, rows: Any, values: Any) -> None:
    """Point of lane ``n`` at (u, v), and thirds of its derivatives along u and v: ``values[d]``, as ``evaluate``.

    ``rows`` (2, 4) is scratch.
    """
    U, V = ONE - u, ONE - v
    by_u, by_v = _bernstein(u, U), _bernstein(v, V)
    for d in range(net.shape[0] // (POINTS * LANES)):
        for x in range(4):
            at = (POINTS * d + x) * LANES + n
            p0, p1, p2, p3 = net[at], net[at + 4 * LANES], net[at + 8 * LANES], net[at + 12 * LANES]
            rows[0, x] = by_v[0] * p0 + by_v[1] * p1 + by_v[2] * p2 + by_v[3] * p3
            rows[1, x] = V * V * (p1 - p0) + TWO * v * V * (p2 - p1) + v * v * (p3 - p2)
        p0, p1, p2, p3 = rows[0, 0], rows[0, 1], rows[0, 2], rows[0, 3]
        values[d, 0] = by_u[0] * p0 + by_u[1] * p1 + by_u[2] * p2 + by_u[3] * p3
        values[d, 1] = U * U * (p1 - p0) + TWO * u * U * (p2 - p1) + u * u * (p3 - p2)
        p0, p1, p2, p3 = rows[1, 0], rows[1, 1], rows[1, 2], rows[1, 3]
        values[d, 2] = by_u[0] * p0 + by_u[1] * p1 + by_u[2] * p2 + by_u[3] * p3


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
