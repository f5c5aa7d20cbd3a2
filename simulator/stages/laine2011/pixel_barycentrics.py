"""Barycentrics of pixel centres from clip positions, as nvdiffrast's shader finds them after its rasterizer."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kernel import kernel
from tilestamp.simulator.parallel import for_parts, parts_of

_PART_ROWS = 16  # at least


@kernel(error_model="numpy")
def _pixel(p0: Any, p1: Any, p2: Any, fx: Any, fy: Any) -> Any:
    """Barycentrics of vertices 0 and 1, and z/w, in float64, before clamping."""
    x0, y0 = p0[0] - fx * p0[3], p0[1] - fy * p0[3]
    x1, y1 = p1[0] - fx * p1[3], p1[1] - fy * p1[3]
    x2, y2 = p2[0] - fx * p2[3], p2[1] - fy * p2[3]
    a0 = x1 * y2 - y1 * x2
    a1 = x2 * y0 - y2 * x0
    a2 = x0 * y1 - y0 * x1
    total = a0 + a1 + a2
    z = p0[2] * a0 + p1[2] * a1 + p2[2] * a2
    w = p0[3] * a0 + p1[3] * a1 + p2[3] * a2
    return a0 / total, a1 / total, z / w


@kernel
def _clamp(value: Any, low: Any, high: Any) -> Any:
    """Clamp, and take NaN for the lower end, as the GPU's saturation does."""
    return min(max(value, low), high) if value == value else low  # noqa: PLR0124


@kernel(error_model="numpy")
def _rows_part(part: int, parts: int, ids: Any, positions: Any, triangles: Any, out: Any) -> None:
    height, width = ids.shape
    corners = np.empty((3, 4), np.float64)
    for j in range(height * part // parts, height * (part + 1) // parts):
        fy = (2.0 * j + 1.0) / height - 1.0
        for i in range(width):
            t = ids[j, i]
            if t < 0:
                continue
            for k in range(3):
                for c in range(4):
                    corners[k, c] = positions[triangles[t, k], c]
            u, v, zw = _pixel(corners[0], corners[1], corners[2], (2.0 * i + 1.0) / width - 1.0, fy)
            u, v = _clamp(u, 0.0, 1.0), _clamp(v, 0.0, 1.0)
            beyond = max(u + v, 1.0)
            out[j, i, 0], out[j, i, 1], out[j, i, 2] = u / beyond, v / beyond, _clamp(zw, -1.0, 1.0)


def pixel_barycentrics(
    ids: NDArray[np.int32], positions: NDArray[np.float32], triangles: NDArray[np.int32]
) -> NDArray[np.float32]:
    """Perspective-correct barycentrics of vertices 0 and 1, and z/w, at each pixel centre.

    Parameters
    ----------
    ids : ndarray, (H, W), int32
        Triangle of each pixel, -1 for none; row 0 at clip y = -1.
    positions : ndarray, (V, 4), float32
    triangles : ndarray, (F, 3), int32

    Returns
    -------
    ndarray, (H, W, 3), float32
        Evaluated in float64, then rounded; 0 where there is no triangle. u and v are clamped to 0..1 with a sum of
        at most 1, z/w to -1..1.
    """
    out = np.zeros((*ids.shape, 3), np.float32)
    with np.errstate(all="ignore"):
        for_parts(_rows_part, parts_of(len(ids), _PART_ROWS), ids, positions, triangles, out)
    return out
