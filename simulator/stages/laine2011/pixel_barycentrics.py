"""Barycentrics of pixel centres from clip positions, as nvdiffrast's pixel shader finds them after its rasterizer.

All in float32, in the order and with the fused multiply-adds of its compiled code (0.4.0, measured on an H200): a cross
product ``a b - c d`` fuses the first product and rounds the second.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kernel import kernel
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stages.laine2011.exact import fma

_PART_ROWS = 16  # at least
_ZERO, _ONE, _TWO = np.float32(0), np.float32(1), np.float32(2)


@kernel(error_model="numpy", lent=True)
def _cross(a: Any, b: Any, c: Any, d: Any) -> Any:
    """Return a b - c d; the second product is rounded by itself."""
    return fma(a, b, -(c * d))


@kernel(error_model="numpy", lent=True)
def _saturate(value: Any) -> Any:
    """Clamp to 0..1; NaN to 0, as the GPU does."""
    return min(value, _ONE) if value > _ZERO else _ZERO


@kernel(error_model="numpy", lent=True)
def _values(p: Any, q: Any, r: Any, fx: Any, fy: Any, out: Any) -> Any:
    """Write u, v and z/w of one pixel centre; returns the reciprocal of the triangle's area seen from it."""
    x0, y0 = fma(p[3], -fx, p[0]), fma(p[3], -fy, p[1])
    x1, y1 = fma(q[3], -fx, q[0]), fma(q[3], -fy, q[1])
    x2, y2 = fma(r[3], -fx, r[0]), fma(r[3], -fy, r[1])
    a0, a1, a2 = _cross(x1, y2, y1, x2), _cross(y0, x2, x0, y2), _cross(x0, y1, y0, x1)
    inverse = _ONE / (a2 + (a0 + a1))
    u, v = _saturate(a0 * inverse), _saturate(a1 * inverse)
    beyond = _ONE / max(u + v, _ONE)
    z = fma(r[2], a2, fma(p[2], a0, q[2] * a1))
    w = fma(r[3], a2, fma(p[3], a0, q[3] * a1))
    ratio = z / w
    ratio = min(_ONE, ratio)  # NaN too
    out[0], out[1], out[2] = u * beyond, v * beyond, max(ratio, -_ONE)
    return inverse


@kernel(error_model="numpy", lent=True)
def _derivatives(p: Any, q: Any, r: Any, u: Any, v: Any, step_x: Any, step_y: Any, out: Any) -> None:
    """Write du/dX, du/dY, dv/dX, dv/dY; a step is 1 / area times 2 / pixels along the axis."""
    e0, e1, e2 = _cross(q[3], r[1], q[1], r[3]), _cross(p[1], r[3], p[3], r[1]), _cross(p[3], q[1], p[1], q[3])
    total = e2 + (e0 + e1)
    out[0], out[2] = step_x * fma(u, total, -e0), step_x * fma(v, total, -e1)
    e0, e1, e2 = _cross(q[0], r[3], q[3], r[0]), _cross(p[3], r[0], p[0], r[3]), _cross(p[0], q[3], p[3], q[0])
    total = e2 + (e0 + e1)
    out[1], out[3] = step_y * fma(u, total, -e0), step_y * fma(v, total, -e1)


@kernel(error_model="numpy")
def _rows_part(
    part: int, parts: int, ids: Any, positions: Any, triangles: Any, steps: Any, first: int, out: Any, derivatives: Any
) -> None:
    height, width = ids.shape
    step_x, step_y, first_x, first_y = steps[0], steps[1], steps[2], steps[3]
    for j in range(height * part // parts, height * (part + 1) // parts):
        fy = fma(np.float32(j), step_y, first_y)
        for i in range(width):
            t = ids[j, i]
            if t < 0:
                continue
            p, q, r = positions[triangles[t, 0]], positions[triangles[t, 1]], positions[triangles[t, 2]]
            values = out[j, i]
            if first >= 0:
                values[3] = np.float32(t + first + 1)
            inverse = _values(p, q, r, fma(np.float32(i), step_x, first_x), fy, values)
            if derivatives is not None:
                ends = inverse * step_x, inverse * step_y
                _derivatives(p, q, r, values[0], values[1], ends[0], ends[1], derivatives[j, i])


def pixel_barycentrics(
    ids: NDArray[np.int32],
    positions: NDArray[np.float32],
    triangles: NDArray[np.int32],
    out: NDArray[np.float32] | None = None,
    derivatives: NDArray[np.float32] | None = None,
    first: int = -1,
) -> NDArray[np.float32]:
    """Perspective-correct barycentrics of vertices 0 and 1, and z/w, at each pixel centre.

    Parameters
    ----------
    ids : ndarray, (H, W), int32
        Triangle of each pixel, -1 for none; row 0 at clip y = -1.
    positions : ndarray, (V, 4), float32
    triangles : ndarray, (F, 3), int32
    out : ndarray, (H, W, 3 or more), float32, optional
        Where to write them; zeros before.
    derivatives : ndarray, (H, W, 4), float32, optional
        Takes du/dX, du/dY, dv/dX, dv/dY, in units of pixels; zeros before.
    first : int
        Where not negative, ``out[..., 3]`` takes the triangle's number, counted from ``first`` + 1.

    Returns
    -------
    ndarray, (H, W, 3), float32
        0 where there is no triangle. u and v are clamped to 0..1 with a sum of at most 1 (up to a rounding), z/w to
        -1..1, NaN to 1; each bit as on an H200.
    """
    if out is None:
        out = np.zeros((*ids.shape, 3), np.float32)
    height, width = ids.shape
    size = np.array([width, height], np.float32)
    steps = np.concatenate([_TWO / size, _ONE / size - _ONE])
    with np.errstate(all="ignore"):
        for_parts(_rows_part, parts_of(height, _PART_ROWS), ids, positions, triangles, steps, first, out, derivatives)
    return out
