"""Dice: every sub-patch becomes a 4x4 grid of shaded vertices (Eisenacher & Loop 2010, section 3).

"Then we evaluate a 4x4 grid for each sub-patch and shade the vertices. Position and color are written to a VBO." Like
the original we evaluate in float32: a thread a vertex, a half-warp a sub-patch. The kernel here evaluates grids as
tensor products instead, rows first, a batch of them side by side, which changes no count.

A vertex is 16 bytes: x, y in pixels from the top left corner, depth z/w, and the colour as RGBA8 in the bits of the
fourth float. Dice also leaves the box of the 16 vertices, which bucketing needs.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.kernel import kernel
from tilestamp.models.simt import Simt
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.eisenacher2010 import shading
from tilestamp.simulator.stages.eisenacher2010.bezier import (
    LANES,
    Squares,
    basis,
    evaluate,
    evaluate_point,
    gather,
    new_squares,
    restrict,
    screen_points,
    set_square,
)
from tilestamp.simulator.stages.eisenacher2010.bound_and_split import SubPatches
from tilestamp.simulator.stages.eisenacher2010.dice_counts import BLOCK, VERTICES, dice_work
from tilestamp.simulator.stages.eisenacher2010.larger_grids import GridSide, joined, squares
from tilestamp.simulator.stages.eisenacher2010.shading import (
    COLOR,
    MATT,
    NORMAL,
    NUDGE,
    Grid,
    lighting,
    new_grid,
    set_normals,
    shade,
    tangent,
)

GRID_SIDE = 4  # vertices


class Grids(NamedTuple):
    """Diced sub-patches, in the order of the queue."""

    vertices: NDArray[np.float32]  # (N, side**2, 4) x, y in pixels, z/w, RGBA8 bits; vertex side * row + column
    boxes: NDArray[np.float32]  # (N, 4) x0, y0, x1, y1 of the vertices


@kernel(lent=True)
def _borrow_normals(grid: Grid, net: Any, squares: Squares, lanes: int, values: Any) -> None:
    """Where tangents vanish or are parallel, take the normal a little nearer to the middle of the patch.

    ``values`` (6, 4): a coordinate a row, point and derivatives along u and v; and two rows of scratch.
    """
    middle = np.float32(0.5)
    values[3, 0] = 1
    for n in range(lanes):
        for k in range(VERTICES):
            at = k * LANES + n
            if grid.rows[MATT + at] > 0:
                continue
            u = np.float32(3 * squares.i[n] + (k & 3)) * squares.side[n] / np.float32(3)
            v = np.float32(3 * squares.j[n] + (k >> 2)) * squares.side[n] / np.float32(3)
            evaluate_point(net, n, u + (middle - u) * NUDGE, v + (middle - v) * NUDGE, values[4:], values)
            ux, uy, uz = tangent(values, 1)
            vx, vy, vz = tangent(values, 2)
            grid.rows[NORMAL + at] = uy * vz - uz * vy
            grid.rows[NORMAL + shading.VERTICES + at] = uz * vx - ux * vz
            grid.rows[NORMAL + 2 * shading.VERTICES + at] = ux * vy - uy * vx


@kernel(lent=True)
def _set_boxes(s: Any, box: Any) -> None:
    """Bound the vertices of all lanes."""
    for n in range(box.shape[0] // 4):
        x0 = x1 = s[n]
        y0 = y1 = s[shading.VERTICES + n]
        for k in range(LANES, shading.VERTICES, LANES):
            x, y = s[k + n], s[shading.VERTICES + k + n]
            x0, y0, x1, y1 = min(x0, x), min(y0, y), max(x1, x), max(y1, y)
        box[n], box[LANES + n], box[2 * LANES + n], box[3 * LANES + n] = x0, y0, x1, y1


@kernel(lent=True)
def _store_grids(grid: Grid, first: Any, lanes: int, vertices: Any, boxes: Any) -> None:
    """Write the vertices of each lane, and their box."""
    _set_boxes(grid.rows, grid.box)
    for n in range(lanes):
        s, box = grid.rows[n:], grid.box[n:]
        for k in range(VERTICES):
            vertices[first + n, k, 0] = s[k * LANES]
            vertices[first + n, k, 1] = s[shading.VERTICES + k * LANES]
            vertices[first + n, k, 2] = s[3 * shading.VERTICES + k * LANES]
            vertices[first + n, k, 3] = s[COLOR + k * LANES]
        for k in range(4):
            boxes[first + n, k] = box[k * LANES]


@kernel(error_model="numpy", lent=True)
def _project(s: Any) -> None:
    """Divide the screen rows of all vertices by w."""
    for k in range(shading.VERTICES):
        scale = np.float32(1) / s[2 * shading.VERTICES + k]
        s[k] *= scale
        s[shading.VERTICES + k] *= scale
        s[3 * shading.VERTICES + k] *= scale


@kernel
def _dice(
    part: int,
    parts: int,
    side: Any,
    width: int,
    subpatches: Any,
    nets: Any,
    screen: Any,
    light: Any,
    texture: Any,
    shaded: Any,
    vertices: Any,
    boxes: Any,
) -> None:
    """Dice one part of the sub-patches, ``width`` (LANES) side by side; the last one fills lanes that are left."""
    grid, squares = new_grid(side, width), new_squares(width)
    corners, net = np.empty(4 * VERTICES * width, np.float32), np.empty(nets.shape[1] * VERTICES * width, np.float32)
    gathered = np.full((2, width), -1, np.int32)
    values = np.zeros((6, 4), np.float32)
    number = boxes.shape[0]
    batches = (number + LANES - 1) // LANES
    for first in range(part * batches // parts * LANES, (part + 1) * batches // parts * LANES, LANES):
        lanes = min(LANES, number - first)
        for n in range(width):
            set_square(squares, n, subpatches, first + min(n, lanes - 1))
        basis(squares.i, squares.side, grid.by_u, grid.slope_u)
        basis(squares.j, squares.side, grid.by_v, grid.slope_v)
        gather(screen, squares.patch, gathered[0], corners)
        restrict(corners, grid.by_u, grid.by_v, grid.between, grid.screen)
        _project(grid.rows)
        if shaded:
            gather(nets, squares.patch, gathered[1], net)
            evaluate(
                net, grid.by_u, grid.by_v, grid.slope_u, grid.slope_v, grid.between, grid.point, grid.along_u,
                grid.along_v,
            )  # fmt: skip
            if set_normals(grid.rows):
                _borrow_normals(grid, net, squares, lanes, values)
            shade(grid, light, texture, squares)
        _store_grids(grid, first, lanes, vertices, boxes)


def dice(
    points: NDArray[np.float32],
    subpatches: SubPatches,
    matrix: ArrayLike,
    width: int,
    height: int,
    simt: Simt,
    *,
    texture: NDArray[np.uint8] | None = None,
    counting: bool = True,
    shaded: bool = True,
    side: GridSide = 4,
) -> StageResult[Grids]:
    """Evaluate and shade a 4x4 grid for each sub-patch.

    Parameters
    ----------
    points : ndarray, (P, 16, 4), float32
        Homogeneous control points (wx, wy, wz, w) of the urPatches.
    subpatches : SubPatches
    matrix : array-like, (4, 4)
        Model to clip space, for column vectors.
    width, height : int
        Pixels.
    simt : Simt
    texture : ndarray, (H, W, 3 or 4), uint8, optional
        Laid over each urPatch, u to the right and v down; a solid checker if not given.
    counting : bool
        Without it no works come back.
    shaded : bool
        Without it vertices have no colour: where no picture is wanted.
    side : int
        Vertices a side of a grid; more than four the paper has not (``larger_grids``).

    Returns
    -------
    outputs : Grids
    works : one, a row a block

    Raises
    ------
    TilestampError
        A texture of another shape or type, or numbers that are not finite.
    """
    if texture is not None and not (
        texture.ndim == 3 and texture.shape[2] in (3, 4) and texture.size and texture.dtype == np.uint8
    ):
        raise TilestampError(f"texture must be (H, W, 3 or 4) bytes, not {texture.dtype} of shape {texture.shape}")
    works = (dice_work(subpatches.patch, len(points), texture is not None, simt, side),) if counting else ()
    if side > GRID_SIDE:
        cut = squares(subpatches, side)
        parts = dice(points, cut, matrix, width, height, simt, texture=texture, counting=False, shaded=shaded).outputs
        vertices = joined(parts.vertices, side)
        low, high = vertices[:, :, :2].min(axis=1), vertices[:, :, :2].max(axis=1)
        return StageResult(Grids(vertices, np.concatenate([low, high], axis=1)), works)
    dimensions = 3 if (points[..., 3] == 1).all() else 4
    nets = np.ascontiguousarray(points[..., :dimensions].transpose(0, 2, 1))
    screen = screen_points(points, matrix, width, height)
    number = len(subpatches.patch)
    vertices = np.empty((number, VERTICES, 4), np.float32)
    grids = Grids(vertices, np.empty((number, 4), np.float32))
    light = lighting(points, matrix)
    for_parts(
        _dice,
        parts_of(number, BLOCK),
        GRID_SIDE,
        LANES,
        subpatches,
        nets,
        screen,
        light,
        texture,
        shaded,
        vertices,
        grids.boxes,
    )
    return StageResult(grids, works)
