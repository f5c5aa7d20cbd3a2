"""Bicubic Bezier patches by parameter: restriction to a square of the parameter domain, basis and tangent rows.

A vector is one sub-patch, a lane a control point or a vertex of it (row r, column c at lane 4 r + c): so tables of
weights along u have a row's four columns in each row, and those along v a column's four rows in each column. Each lane
does the float32 operations of one thread in their order.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.vectors import SIDE, columns, load, load_rows, select

POINTS = 16  # control points of a patch, vertices of a grid
THREE = np.float32(3.0)
TWO = np.float32(2.0)
ONE = np.float32(1.0)
_COLUMN, _ROW = np.tile(np.arange(SIDE, dtype=np.float32), SIDE), np.repeat(np.arange(SIDE, dtype=np.float32), SIDE)


@kernel(lent=True, inline=True)
def places() -> Any:
    """Column of each lane in its grid, and row."""
    return load(_COLUMN, 0), load(_ROW, 0)


@kernel(lent=True, inline=True)
def side_of(level: Any) -> Any:
    """Side of a sub-patch's square: a power of two, so that the ends of the unit interval are exact."""
    return ONE / np.float32(1 << np.int64(level))


@kernel(error_model="numpy", lent=True, inline=True)
def restriction(first: Any, side: Any, k: Any) -> Any:
    """Tables of the interval [a, b] = [first * side, (first + 1) * side] by blossoms.

    Returns vectors ``rows`` so that ``q[k] = sum_x rows[x] p[x]`` is control point k, of 0 to 3, over the interval.
    """
    a, b = np.float32(first) * side, np.float32(np.int64(first) + 1) * side
    A, B = ONE - a, ONE - b
    after_first, second_half, last = k > np.float32(0), k > ONE, k > TWO
    inner = after_first & ~last
    near, near_rest = select(second_half, b, a), select(second_half, B, A)
    ab, ba = A * b + TWO * a * B, a * B + TWO * A * b
    return (
        select(last, B, A) * select(second_half, B, A) * select(after_first, B, A),
        select(inner, near_rest * select(second_half, ba, ab), THREE * near * near_rest * near_rest),
        select(inner, near * select(second_half, ab, ba), THREE * near * near * near_rest),
        select(last, b, a) * near * select(after_first, b, a),
    )


@kernel(error_model="numpy", lent=True, inline=True)
def parameters(first: Any, side: Any, k: Any) -> Any:
    """Parameters k, of 0 to 3, evenly spaced over the interval [first * side, (first + 1) * side]."""
    return (np.float32(3 * np.int64(first)) + k) * side / THREE


@kernel(lent=True, inline=True)
def basis(a: Any) -> Any:
    """Bernstein polynomials: ``rows[x]`` weighs control point x at a parameter."""
    A = ONE - a
    return A * A * A, THREE * a * A * A, THREE * a * a * A, a * a * a


@kernel(lent=True, inline=True)
def slopes(a: Any) -> Any:
    """``slopes[x]`` weighs the difference of control points x + 1 and x in a third of the derivative."""
    A = ONE - a
    return A * A, TWO * a * A, a * a


@kernel(lent=True, inline=True)
def _weigh(w: Any, p: Any) -> Any:
    return w[0] * p[0] + w[1] * p[1] + w[2] * p[2] + w[3] * p[3]


@kernel(lent=True, inline=True)
def _weigh_steps(w: Any, p: Any) -> Any:
    return w[0] * (p[1] - p[0]) + w[1] * (p[2] - p[1]) + w[2] * (p[3] - p[2])


@kernel(lent=True, inline=True)
def restrict(net: Any, at: Any, by_u: Any, by_v: Any) -> Any:
    """Tensor product of a coordinate's 16 control points ``net[at:]``.

    Control points of a sub-patch by ``restriction`` tables, vertices of a grid by ``basis`` tables.
    """
    return _weigh(by_u, columns(_weigh(by_v, load_rows(net, at))))


@kernel(lent=True, inline=True)
def evaluate(net: Any, at: Any, by_u: Any, by_v: Any, slope_u: Any, slope_v: Any) -> Any:
    """A coordinate of the vertices of a grid, and thirds of its derivatives along u and v.

    Differences of equal control points are exactly zero: a collapsed edge shows as a zero tangent.
    """
    rows = load_rows(net, at)
    across = columns(_weigh(by_v, rows))
    return _weigh(by_u, across), _weigh_steps(slope_u, across), _weigh(by_u, columns(_weigh_steps(slope_v, rows)))


@kernel(lent=True)
def evaluate_point(net: Any, at: Any, dimensions: int, u: Any, v: Any, rows: Any, values: Any) -> None:
    """Point of a patch at (u, v), and thirds of its derivatives along u and v: ``values[d]``, as ``evaluate``.

    ``rows`` (2, 4) is scratch.
    """
    by_u, by_v, slope_u, slope_v = basis(u), basis(v), slopes(u), slopes(v)
    for d in range(dimensions):
        for x in range(SIDE):
            first = at + POINTS * d + x
            p = (net[first], net[first + SIDE], net[first + 2 * SIDE], net[first + 3 * SIDE])
            rows[0, x], rows[1, x] = _weigh(by_v, p), _weigh_steps(slope_v, p)
        across, down = (
            (rows[0, 0], rows[0, 1], rows[0, 2], rows[0, 3]),
            (rows[1, 0], rows[1, 1], rows[1, 2], rows[1, 3]),
        )
        values[d, 0], values[d, 1], values[d, 2] = (
            _weigh(by_u, across),
            _weigh_steps(slope_u, across),
            _weigh(by_u, down),
        )


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
