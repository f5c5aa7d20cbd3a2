"""Which samples a micropolygon covers: exact edge functions on a sub-pixel grid, top-left rule (Pineda 1988).

Vertices are snapped to 1/4096 pixel, so that all arithmetic is exact in 64 bits and every way of choosing which samples
to test gives the same picture. A quad is its two triangles 0 1 2 and 0 2 3: it need be neither flat nor convex, and a
mesh of quads has no gap and no doubly covered sample. One evaluation of a polygon at a sample is one test.
"""

from typing import Any

import numpy as np

from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.fatahalian2009.sample_positions import SUBPIXELS

STEP = SUBPIXELS  # sub-pixel steps a pixel
STEP_BITS = SUBPIXELS.bit_length() - 1
EDGE_ROWS = 6  # three edges of each of two triangles
BOXES = 3  # box of the polygon, then of each triangle


@kernel
def new_setup() -> tuple[Any, Any, Any, Any]:
    """Scratch of ``set_up``: edges (6, 4), boxes (3, 4), depths (2, 3), and the snapped vertices (4, 2)."""
    return (
        np.zeros((EDGE_ROWS, 4), np.int64),
        np.zeros((BOXES, 4), np.int64),
        np.zeros((2, 3)),
        np.zeros((4, 2), np.int64),
    )


@kernel(lent=True)
def set_up(polygon: Any, edges: Any, boxes: Any, depths: Any, snapped: Any) -> Any:
    """Set a polygon up: edge functions a x + b y + c >= 0 inside, boxes, depths; returns twice its signed area.

    Parameters
    ----------
    polygon : ndarray, (3 or 4, 3), float32
    edges : ndarray, (6, 4), int64
        a, b, c with the top-left rule taken in, and what the rule took from c.
    boxes : ndarray, (3, 4), int64
        Lowest x, y and highest x, y in sub-pixel steps.
    """
    snap(polygon, boxes, snapped)
    return set_edges(polygon, edges, boxes, depths, snapped)


@kernel(lent=True)
def snap(polygon: Any, boxes: Any, snapped: Any) -> None:
    """Snap the vertices to the sub-pixel grid and fill the polygon's own box: all that choosing stamps needs."""
    for d in range(2):
        low = np.int64(np.floor(np.float64(polygon[0, d]) * STEP + 0.5))
        high = low
        snapped[0, d] = low
        for k in range(1, polygon.shape[0]):
            at = np.int64(np.floor(np.float64(polygon[k, d]) * STEP + 0.5))
            snapped[k, d] = at
            low = min(low, at)
            high = max(high, at)
        boxes[0, d] = low
        boxes[0, 2 + d] = high


@kernel(lent=True)
def set_edges(polygon: Any, edges: Any, boxes: Any, depths: Any, snapped: Any) -> Any:
    """Set up edges and depths of snapped vertices; returns twice the signed area."""
    area = _triangle(snapped, 1, 2, 0, edges, boxes)
    depths[0, 0], depths[0, 1], depths[0, 2] = polygon[0, 2], polygon[1, 2], polygon[2, 2]
    if polygon.shape[0] == 4:
        area += _triangle(snapped, 2, 3, 1, edges, boxes)
        depths[1, 0], depths[1, 1], depths[1, 2] = polygon[0, 2], polygon[2, 2], polygon[3, 2]
    else:
        edges[3, 2] = -1
        depths[1, :] = depths[0, 2]
    return area


@kernel(lent=True)
def _triangle(snapped: Any, j: int, k: int, t: int, edges: Any, boxes: Any) -> Any:
    """Edges 0-j, j-k, k-0 of triangle t, turned so that the inside is positive; returns twice the signed area."""
    xi, yi, xj, yj, xk, yk = (
        snapped[0, 0], snapped[0, 1], snapped[j, 0], snapped[j, 1], snapped[k, 0], snapped[k, 1],
    )  # fmt: skip
    box = 1 + t
    boxes[box, 0], boxes[box, 1] = min(xi, xj, xk), min(yi, yj, yk)
    boxes[box, 2], boxes[box, 3] = max(xi, xj, xk), max(yi, yj, yk)
    area = (xj - xi) * (yk - yi) - (yj - yi) * (xk - xi)
    sign = 1 if area > 0 else -1 if area < 0 else 0
    _edge(xi, yi, xj, yj, sign, edges, 3 * t)
    _edge(xj, yj, xk, yk, sign, edges, 3 * t + 1)
    _edge(xk, yk, xi, yi, sign, edges, 3 * t + 2)
    return area


@kernel(lent=True)
def _edge(x0: int, y0: int, x1: int, y1: int, sign: int, edges: Any, row: int) -> None:
    """One edge function; a triangle without area (sign 0) owns nothing and so covers nothing."""
    a = sign * (y0 - y1)
    b = sign * (x1 - x0)
    rule = 0 if a > 0 or (a == 0 and b > 0) else 1  # left edges and top edges own the samples on them
    edges[row, 0], edges[row, 1] = a, b
    edges[row, 2] = -(a * x0 + b * y0) - rule
    edges[row, 3] = rule if sign != 0 else 0


@kernel(lent=True, inline=True)
def in_box(boxes: Any, at_x: int, at_y: int) -> bool:
    """Whether a sample lies in the polygon's own box: no other can be covered."""
    return bool(boxes[0, 0] <= at_x <= boxes[0, 2] and boxes[0, 1] <= at_y <= boxes[0, 3])


@kernel(lent=True)
def covering_triangle(edges: Any, x: int, y: int) -> int:
    """Triangle of the polygon (0 or 1) that covers the sample, -1 if none does: one sample test."""
    for first in range(0, EDGE_ROWS, 3):
        if (
            edges[first, 0] * x + edges[first, 1] * y + edges[first, 2] >= 0
            and edges[first + 1, 0] * x + edges[first + 1, 1] * y + edges[first + 1, 2] >= 0
            and edges[first + 2, 0] * x + edges[first + 2, 1] * y + edges[first + 2, 2] >= 0
        ):
            return first // 3
    return -1


@kernel(lent=True)
def depth_at(edges: Any, depths: Any, triangle: int, x: int, y: int) -> Any:
    """Depth of a triangle at a sample that it covers: barycentric, float64, rounded once to float32."""
    first = 3 * triangle
    at_2 = np.float64(_value(edges, first, x, y))  # the edge from 0 to 1 is opposite 2
    at_0 = np.float64(_value(edges, first + 1, x, y))
    at_1 = np.float64(_value(edges, first + 2, x, y))
    weighted = at_0 * depths[triangle, 0] + at_1 * depths[triangle, 1] + at_2 * depths[triangle, 2]
    return np.float32(weighted / (at_0 + at_1 + at_2))


@kernel(lent=True)
def _value(edges: Any, row: int, x: int, y: int) -> Any:
    """Evaluate an edge function without the top-left rule."""
    return edges[row, 0] * x + edges[row, 1] * y + edges[row, 2] + edges[row, 3]


@kernel(lent=True)
def touches(edges: Any, boxes: Any, corners: Any, x0: int, y0: int, x1: int, y1: int) -> bool:
    """Whether the polygon reaches into the square from (x0, y0) up to, not including, (x1, y1)."""
    for triangle in range(corners - 2):
        t = 1 + triangle
        if boxes[t, 2] < x0 or boxes[t, 3] < y0 or boxes[t, 0] >= x1 or boxes[t, 1] >= y1:
            continue
        reached = True
        for row in range(3 * triangle, 3 * triangle + 3):
            a, b = edges[row, 0], edges[row, 1]
            x = x1 - 1 if a > 0 else x0
            y = y1 - 1 if b > 0 else y0
            if _value(edges, row, x, y) < 0:
                reached = False
        if reached:
            return True
    return False


@kernel(lent=True)
def fills(edges: Any, corners: Any, x0: int, y0: int, x1: int, y1: int) -> bool:
    """Whether one triangle of the polygon covers all of the square: every sample in it is hit, without a test."""
    for triangle in range(corners - 2):
        filled = True
        for row in range(3 * triangle, 3 * triangle + 3):
            a, b = edges[row, 0], edges[row, 1]
            x = x0 if a > 0 else x1 - 1
            y = y0 if b > 0 else y1 - 1
            if a * x + b * y + edges[row, 2] < 0:
                filled = False
        if filled:
            return True
    return False
