"""Clipping one triangle against the view frustum, in barycentric coordinates (cudaraster 1.1, triangle setup)."""

from typing import Any

import numpy as np

from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.laine2011.exact import fma

MAX_VERTICES = 31  # 9 in exact arithmetic; room for every crossing that rounding could add
_ONE = np.float32(1)


@kernel(error_model="numpy", lent=True)
def _plane_value(plane: Any, bary: Any, i: int) -> Any:
    return fma(plane[2], bary[i, 1], fma(plane[1], bary[i, 0], plane[0]))


@kernel(error_model="numpy", lent=True)
def _clip_plane(plane: Any, source: Any, target: Any, n: int) -> Any:
    """Keep the part of an n-gon where the plane is not negative; returns its number of vertices."""
    if n < 3:
        return 0
    kept = 0
    a = n - 1
    a_value = _plane_value(plane, source, a)
    for b in range(n):
        b_value = _plane_value(plane, source, b)
        if a_value * b_value < np.float32(0):
            t = a_value / (a_value - b_value)
            s = _ONE - t
            target[kept, 0] = fma(s, source[a, 0], t * source[b, 0])
            target[kept, 1] = fma(s, source[a, 1], t * source[b, 1])
            kept += 1
        if b_value >= np.float32(0):
            target[kept, 0] = source[b, 0]
            target[kept, 1] = source[b, 1]
            kept += 1
        a, a_value = b, b_value
    return kept


@kernel(error_model="numpy", lent=True)
def clip_triangle(corners: Any, polygon: Any, spare: Any, plane: Any, steps: Any) -> Any:
    """Clip a triangle whose corners are clip positions; an axis is clipped only where a corner lies outside it.

    Parameters
    ----------
    corners : array (3, 4), float32
    polygon, spare : arrays (MAX_VERTICES, 2), float32
        The result, barycentrics towards corners 1 and 2, is left in ``polygon``.
    plane : array (3,), float32
        Scratch.
    steps : array (6,), int64
        Filled with the vertices walked at each plane, for counting.

    Returns
    -------
    int
        Vertices of the clipped polygon, 0 or 3 to 9 (barring rounding).
    """
    for k in range(3):
        polygon[k, 0] = polygon[k, 1] = np.float32(0)
        steps[2 * k] = steps[2 * k + 1] = 0
    polygon[1, 0] = polygon[2, 1] = _ONE
    n = 3
    for axis in range(3):
        outside = False
        for k in range(3):
            outside |= corners[k, 3] < abs(corners[k, axis])
        if not outside:
            continue
        for side in range(2):
            sign = np.float32(1 - 2 * side)
            plane[0] = corners[0, 3] + sign * corners[0, axis]
            for k in range(1, 3):
                run = corners[k, axis] - corners[0, axis]
                plane[k] = (corners[k, 3] - corners[0, 3]) + sign * run
            steps[2 * axis + side] = n if n >= 3 else 0
            n = _clip_plane(plane, polygon, spare, n)
            for i in range(n):
                polygon[i, 0], polygon[i, 1] = spare[i, 0], spare[i, 1]
    return n if n >= 3 else 0


@kernel(error_model="numpy", lent=True)
def between(a: Any, b: Any, c: Any, u: Any, v: Any) -> Any:
    """One component of a clip position at barycentrics (u, v), from those of the three corners."""
    return fma(c - a, v, fma(b - a, u, a))
