"""What all of Ru's raster kernels compute: signed areas, barycentric coordinates, boxes (device functions)."""

from typing import Any

import numpy as np

from tilestamp.models.kernel import kernel

_ZERO = np.float32(0.0)
_ONE = np.float32(1.0)


@kernel(error_model="numpy", lent=True)
def corners(screen: Any, triangles: Any, t: int) -> tuple[Any, Any, Any, Any, Any, Any]:
    """Screen coordinates of a triangle's corners: x0, y0, x1, y1, x2, y2."""
    a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
    return screen[a, 0], screen[a, 1], screen[b, 0], screen[b, 1], screen[c, 0], screen[c, 1]


@kernel(error_model="numpy", lent=True)
def area(x0: Any, y0: Any, x1: Any, y1: Any, x2: Any, y2: Any) -> Any:
    """Twice the signed area; positive where the corners run counter-clockwise on a screen whose y points down."""
    return (x2 - x0) * (y1 - y0) - (x1 - x0) * (y2 - y0)


@kernel(error_model="numpy", lent=True)
def barycentric(
    x0: Any, y0: Any, x1: Any, y1: Any, x2: Any, y2: Any, inverse: Any, px: Any, py: Any
) -> tuple[Any, Any, Any]:
    """Barycentric coordinates of a point by area evaluations; ``inverse`` is one over the triangle's own area."""
    b = area(x0, y0, px, py, x2, y2) * inverse
    c = area(x0, y0, x1, y1, px, py) * inverse
    return _ONE - b - c, b, c


@kernel(error_model="numpy", lent=True)
def inside(a: Any, b: Any, c: Any) -> Any:
    """Whether all three lie in [0, 1]: edges belong to both neighbours, as in the original."""
    return (a >= _ZERO) & (b >= _ZERO) & (c >= _ZERO) & (a <= _ONE) & (b <= _ONE) & (c <= _ONE)  # in any number at once


@kernel(error_model="numpy", lent=True)
def _column(coordinate: Any, size: int) -> int:
    """Column or row of a coordinate, the nearest border's where it lies outside."""
    return int(min(max(coordinate, _ZERO), np.float32(size - 1)))


@kernel(error_model="numpy", lent=True)
def border_box(
    x0: Any, y0: Any, x1: Any, y1: Any, x2: Any, y2: Any, width: int, height: int
) -> tuple[int, int, int, int]:
    """As ``pixel_box``, but a triangle beside the screen has a column or row of its border, as in the original."""
    return (
        _column(min(x0, x1, x2), width), _column(max(x0, x1, x2), width),
        _column(min(y0, y1, y2), height), _column(max(y0, y1, y2), height),
    )  # fmt: skip


@kernel(error_model="numpy", lent=True)
def pixel_box(
    x0: Any, y0: Any, x1: Any, y1: Any, x2: Any, y2: Any, width: int, height: int
) -> tuple[int, int, int, int]:
    """Pixels of the triangle's box: first and last column, first and last row; empty if first > last."""
    low_x = min(x0, x1, x2)
    low_y = min(y0, y1, y2)
    high_x = max(x0, x1, x2)
    high_y = max(y0, y1, y2)
    if not (high_x >= _ZERO and high_y >= _ZERO and low_x <= width and low_y <= height):
        return 0, -1, 0, -1
    first_x = int(max(low_x, _ZERO))
    first_y = int(max(low_y, _ZERO))
    last_x = int(min(high_x, np.float32(width - 1)))
    last_y = int(min(high_y, np.float32(height - 1)))
    return first_x, last_x, first_y, last_y
