"""Which triangle each sample sees, exactly: rational arithmetic for coverage, double precision for depth.

Nothing is snapped, clipped or divided: edge functions are determinants of homogeneous corners (Olano & Greer 1997), so
that a triangle may cross the eye's plane. A double with an error bound decides nearly all samples, exact arithmetic the
others (`orientation`). A sample on an edge belongs to the triangle whose left or top edge that is. Depth is linear on
the screen; what lies outside -1 to 1 is cut off sample by sample. Of equal depths the first triangle stays.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.kernel import kernel
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.reference.orientation import COMPONENTS, edge_function, edge_sign, sure_sign

CENTRE = (0.5, 0.5)
_PART_ROWS = 16  # at least


class Grid(NamedTuple):
    """A regular grid of samples: column i, row j lies at (x + i dx, y + j dy); row 0 is on top."""

    x: float
    y: float
    dx: float
    dy: float
    columns: int
    rows: int


class Visible(NamedTuple):
    """What the samples see; row 0 is the top row."""

    ids: NDArray[np.int32]  # (rows, columns) nearest triangle, -1 where there is none
    depth: NDArray[np.float64]  # (rows, columns) of the nearest, infinite where there is none
    hits: NDArray[np.int32]  # (rows, columns) triangles that cover the sample


@kernel
def set_up(corners: Any, edges: Any, owns: Any, expansion: Any) -> Any:
    """Edge functions opposite to corners 0, 1, 2, positive inside; returns the orientation, 0 where it has no area.

    Parameters
    ----------
    corners : ndarray, (3, 3), float64
    edges : ndarray, (3, 6), float64
        Coefficients of x, y, 1 and of the error bound.
    owns : ndarray, (3,), bool
        Whether samples on the edge are the triangle's.
    """
    for k in range(3):
        edge_function(corners[(k + 1) % 3], corners[(k + 2) % 3], edges[k])
    a = corners[0]
    sign = sure_sign(edges[0], corners[1], corners[2], a[0], a[1], a[2], expansion)
    for k in range(3):
        p, q = corners[(k + 1) % 3], corners[(k + 2) % 3]
        right = sign * sure_sign(edges[k], p, q, 1.0, 0.0, 0.0, expansion)
        down = sign * sure_sign(edges[k], p, q, 0.0, 1.0, 0.0, expansion)
        owns[k] = right > 0 or (right == 0 and down > 0)
        for c in range(3):
            edges[k, c] *= sign
    return sign


@kernel
def _owns_closely(
    corners: Any, owns: Any, sign: int, x: Any, y: Any, a: Any, b: Any, c: Any, near: Any, expansion: Any
) -> bool:
    """Whether a sample is covered that is inside, or on one of the three edges as far as ``near`` can tell."""
    for k in range(3):
        value = a if k == 0 else b if k == 1 else c
        if value <= near[k]:
            exact = sign * edge_sign(corners[(k + 1) % 3], corners[(k + 2) % 3], x, y, 1.0, expansion)
            if exact < 0 or (exact == 0 and not owns[k]):
                return False
    return True


@kernel
def _span(triangle: Any, axis: int, first: Any, step: Any, count: int) -> tuple[int, int]:
    """First and last grid line that a triangle can touch, or one more; all where it crosses the eye's plane."""
    low, high = np.inf, -np.inf
    for k in range(3):
        if triangle[k, 2] <= 0.0:
            return 0, count - 1
        at = (triangle[k, axis] / triangle[k, 2] - first) / step
        low, high = min(low, at), max(high, at)
    if not (low <= high) or high < -1.0 or low > count:
        return 0, -1
    return max(int(np.floor(max(low, 0.0))) - 1, 0), min(int(np.ceil(min(high, float(count)))) + 1, count - 1)


@kernel
def _weights(triangle: Any, depths: Any, t: int, sign: int, weights: Any) -> None:
    """Factors of the edge functions in z / w: at a sample w is 1, so weights that add up to the determinant do it."""
    det = 0.0
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        det += triangle[0, k] * (triangle[1, i] * triangle[2, j] - triangle[1, j] * triangle[2, i])
    for k in range(3):
        weights[k] = depths[t, k] / (sign * det) if det != 0.0 else 0.0


@kernel
def _draw(
    corners: Any, depths: Any, cull: Any, grid: Grid, first_row: int, end_row: int, ids: Any, depth: Any, hits: Any
) -> None:
    """Draw all triangles, in order, to rows ``first_row`` up to ``end_row`` of a grid; the arrays hold only those.

    Scratch is private, and no view of a shared array is made for a sample: counting its references would make threads
    wait for one another.
    """
    triangle, edges, owns = np.empty((3, 3)), np.empty((3, 6)), np.empty(3, np.bool_)
    at_row, near, weights, expansion = np.empty(3), np.empty(3), np.empty(3), np.empty(COMPONENTS)
    for t in range(corners.shape[0]):
        for k in range(3):
            for c in range(3):
                triangle[k, c] = corners[t, k, c]
        top, bottom = _span(triangle, 1, grid.y, grid.dy, grid.rows)
        if bottom < first_row or top >= end_row:
            continue
        left, right = _span(triangle, 0, grid.x, grid.dx, grid.columns)
        if right < left:
            continue
        sign = set_up(triangle, edges, owns, expansion)
        if sign == 0 or (cull and sign > 0):  # with y down, counter-clockwise is negative
            continue
        _weights(triangle, depths, t, sign, weights)
        right_a, right_b, right_c = edges[0, 0], edges[1, 0], edges[2, 0]
        reach = max(abs(grid.x + left * grid.dx), abs(grid.x + right * grid.dx))
        for j in range(max(top, first_row), min(bottom + 1, end_row)):
            y, row = grid.y + j * grid.dy, j - first_row
            for k in range(3):
                at_row[k] = edges[k, 1] * y + edges[k, 2]
                near[k] = edges[k, 3] * reach + edges[k, 4] * abs(y) + edges[k, 5]
            row_a, row_b, row_c, near_a, near_b, near_c = at_row[0], at_row[1], at_row[2], near[0], near[1], near[2]
            for i in range(left, right + 1):
                x = grid.x + i * grid.dx
                a, b, c = right_a * x + row_a, right_b * x + row_b, right_c * x + row_c
                if a < -near_a or b < -near_b or c < -near_c:
                    continue
                if (a <= near_a or b <= near_b or c <= near_c) and not _owns_closely(
                    triangle, owns, sign, x, y, a, b, c, near, expansion
                ):
                    continue
                z = a * weights[0] + b * weights[1] + c * weights[2]
                if -1.0 <= z <= 1.0:
                    hits[row, i] += 1
                    if z < depth[row, i]:
                        depth[row, i], ids[row, i] = z, t


@kernel
def _draw_part(
    part: int, parts: int, corners: Any, depths: Any, cull: Any, grid: Grid, first_row: int, ids: Any, depth: Any,
    hits: Any,
) -> None:  # fmt: skip
    first, end = ids.shape[0] * part // parts, ids.shape[0] * (part + 1) // parts
    seen = (ids[first:end], depth[first:end], hits[first:end])
    _draw(corners, depths, cull, grid, first_row + first, first_row + end, *seen)


def exact_coverage(
    corners: NDArray[np.floating],
    width: int,
    height: int,
    *,
    depths: NDArray[np.floating] | None = None,
    offset: tuple[float, float] = CENTRE,
) -> Visible:
    """Cover the pixels of a screen with triangles in screen coordinates, exactly.

    Parameters
    ----------
    corners : ndarray, (T, 3, 2), float64
        x and y in pixels from the top left corner, y down; either way round.
    width, height : int
        Pixels.
    depths : ndarray, (T, 3), optional
        Of the corners, -1 nearest to 1 farthest; 0 if not given (then the first triangle stays).
    offset : (float, float)
        Where in its pixel the sample lies.

    Returns
    -------
    Visible
        ``hits`` counts the triangles on each sample: 1 everywhere in a partition.

    Raises
    ------
    TilestampError
        Corners of another shape, or not finite.
    """
    if corners.ndim != 3 or corners.shape[1:] != (3, 2) or not np.isfinite(corners).all():
        raise TilestampError(f"exact coverage: corners must be finite and (T, 3, 2), not {corners.shape}")
    homogeneous = np.ones((len(corners), 3, 3))
    homogeneous[:, :, :2] = corners
    deep = np.zeros((len(corners), 3)) if depths is None else np.ascontiguousarray(depths, np.float64)
    return cover(homogeneous, deep, Grid(offset[0], offset[1], 1.0, 1.0, width, height))


def exact_visibility(
    positions: NDArray[np.float32],
    triangles: NDArray[np.int32],
    width: int,
    height: int,
    *,
    offset: tuple[float, float] = CENTRE,
    cull_backfaces: bool = False,
) -> Visible:
    """Find the triangle that each pixel's sample sees, from float32 clip space as the pipelines get it.

    Parameters
    ----------
    positions : ndarray, (V, 4), float32
        Clip space.
    triangles : ndarray, (F, 3), int32
    width, height : int
        Pixels.
    offset : (float, float)
        Where in its pixel the sample lies, from the top left corner.
    cull_backfaces : bool
        Leave out what is clockwise on the screen.

    Returns
    -------
    Visible
        Depth is z / w.
    """
    corners, depths = homogeneous_corners(positions, triangles, width, height)
    return visibility(corners, depths, width, height, offset=offset, cull_backfaces=cull_backfaces)


def visibility(
    corners: NDArray[np.float64],
    depths: NDArray[np.float64],
    width: int,
    height: int,
    *,
    offset: tuple[float, float] = CENTRE,
    cull_backfaces: bool = False,
) -> Visible:
    """As `exact_visibility`, of `homogeneous_corners` or `screen_corners`."""
    return cover(corners, depths, pixel_grid(width, height, offset), cull=cull_backfaces)


def screen_corners(
    vertices: NDArray[np.floating], width: int, height: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Corners (F, 3, 3) and depths (F, 3) as of `homogeneous_corners`, of triangles that are on the screen already.

    Parameters
    ----------
    vertices : ndarray, (F, 3, 3)
        x and y in pixels from the top left corner, depth from -1 to 1.
    width, height : int
        Pixels.
    """
    screen = vertices.astype(np.float64)
    corners = np.ones_like(screen)
    corners[..., 0], corners[..., 1] = 2.0 * screen[..., 0] - width, 2.0 * screen[..., 1] - height
    return corners, np.ascontiguousarray(screen[..., 2])


def homogeneous_corners(
    positions: NDArray[np.float32], triangles: NDArray[np.int32], width: int, height: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Corners (F, 3, 3) in half pixels from the screen's centre, y down, and their z (F, 3): both without rounding."""
    clip = positions.astype(np.float64)[triangles]
    return np.stack([clip[..., 0] * width, -clip[..., 1] * height, clip[..., 3]], axis=-1), np.ascontiguousarray(
        clip[..., 2]
    )


def pixel_grid(width: int, height: int, offset: tuple[float, float] = CENTRE, side: int = 1) -> Grid:
    """One sample a pixel, or ``side`` x ``side``, as `homogeneous_corners` measures them: in half pixels."""
    step = 2.0 / side
    return Grid(offset[0] * step - width, offset[1] * step - height, step, step, width * side, height * side)


def cover(
    corners: NDArray[np.float64],
    depths: NDArray[np.float64],
    grid: Grid,
    *,
    cull: bool = False,
    rows: tuple[int, int] | None = None,
) -> Visible:
    """Draw to the rows from the first up to, not including, the second; to all of the grid if not given."""
    first, end = rows or (0, grid.rows)
    shape = (end - first, grid.columns)
    visible = Visible(np.full(shape, -1, np.int32), np.full(shape, np.inf), np.zeros(shape, np.int32))
    for_parts(_draw_part, parts_of(end - first, _PART_ROWS), corners, depths, cull, grid, first, *visible)
    return visible
