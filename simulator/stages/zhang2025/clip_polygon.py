"""Clipping of one triangle against the six planes of the view volume (device functions; Sutherland and Hodgman)."""

from typing import Any

import numpy as np

from tilestamp.models.kernel import kernel

PLANES = 6
MOST_VERTICES = 12  # 9, since a triangle gains one for each plane; rounding of slivers may find more crossings
_ZERO = np.float32(0.0)


@kernel(error_model="numpy", lent=True)
def distance(vertex: Any, plane: int) -> Any:
    """How far a vertex (x, y, z, w, ...) is inside a plane: w + x, w - x, w + y, w - y, w + z, w - z."""
    axis = vertex[plane // 2]
    return vertex[3] + axis if plane % 2 == 0 else vertex[3] - axis


@kernel(error_model="numpy", lent=True)
def outcode(vertex: Any) -> int:
    """Bit p: the vertex is outside of plane p."""
    code = 0
    for plane in range(PLANES):
        if distance(vertex, plane) < _ZERO:
            code |= 1 << plane
    return code


@kernel(error_model="numpy", lent=True)
def clip_polygon(polygon: Any, scratch: Any, count: int) -> int:
    """Clip ``polygon``, (12, n), in place; returns its vertices, 0 where nothing is left."""
    for plane in range(PLANES):
        kept = 0
        for i in range(count):
            if kept > len(scratch) - 2:
                break
            j = i + 1 if i + 1 < count else 0
            here = distance(polygon[i], plane)
            there = distance(polygon[j], plane)
            if here >= _ZERO:
                for k in range(polygon.shape[1]):
                    scratch[kept, k] = polygon[i, k]
                kept += 1
            if (here >= _ZERO) != (there >= _ZERO):
                t = here / (here - there)
                for k in range(polygon.shape[1]):
                    scratch[kept, k] = polygon[i, k] + t * (polygon[j, k] - polygon[i, k])
                kept += 1
        for i in range(kept):
            for k in range(polygon.shape[1]):
                polygon[i, k] = scratch[i, k]
        count = kept
        if count < 3:
            return 0
    return count
