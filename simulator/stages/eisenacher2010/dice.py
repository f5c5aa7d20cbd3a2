"""Dice: every sub-patch becomes a 4x4 grid of shaded vertices (Eisenacher & Loop 2010, section 3).

"Then we evaluate a 4x4 grid for each sub-patch and shade the vertices. Position and color are written to a VBO." Like
the original we evaluate in float32: a thread a vertex, a half-warp a sub-patch, which is a vector here. It evaluates
tensor products, rows first, which changes no count.

A vertex is 16 bytes: x, y in pixels from the top left corner, depth z/w, and the colour as RGBA8 in the bits of the
fourth float. Dice also leaves the box of the 16 vertices, which bucketing needs.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tilestamp.models.bits import lowest_bit
from tilestamp.models.errors import TilestampError
from tilestamp.models.kernel import kernel
from tilestamp.models.simt import Simt
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.eisenacher2010.bezier import (
    ONE,
    POINTS,
    basis,
    evaluate,
    evaluate_point,
    parameters,
    places,
    restrict,
    screen_points,
    side_of,
    slopes,
)
from tilestamp.simulator.stages.eisenacher2010.bound_and_split import SubPatches
from tilestamp.simulator.stages.eisenacher2010.dice_counts import BLOCK, VERTICES, dice_work
from tilestamp.simulator.stages.eisenacher2010.larger_grids import GridSide, joined, squares
from tilestamp.simulator.stages.eisenacher2010.shading import (
    NUDGE,
    checker,
    colored,
    cross,
    lighting,
    lit,
    tangents,
    texels,
)
from tilestamp.simulator.stages.vectors import bits, first, greatest, least, load, spread, store, store_vertices

GRID_SIDE = 4  # vertices
UNSHADED = np.uint32(0xFF000000).view(np.float32)  # black, in the bits of a number


class Grids(NamedTuple):
    """Diced sub-patches, in the order of the queue."""

    vertices: NDArray[np.float32]  # (N, side**2, 4) x, y in pixels, z/w, RGBA8 bits; vertex side * row + column
    boxes: NDArray[np.float32]  # (N, 4) x0, y0, x1, y1 of the vertices


@kernel(lent=True)
def _borrow(
    nets: Any, at: Any, dimensions: int, u: Any, v: Any, missing: Any, normal: Any, scratch: Any, values: Any
) -> Any:
    """Where tangents vanish or are parallel, take the normal a little nearer to the middle of the patch.

    ``scratch`` is five rows of 16 numbers; ``values`` a point of the patch and its derivatives along u and v, a
    coordinate a row, and two rows of scratch.
    """
    middle, rows, near = np.float32(0.5), values[4:], values[:4]
    store(scratch, 0, u)
    store(scratch, POINTS, v)
    for d in range(3):
        store(scratch, (2 + d) * POINTS, normal[d])
    while missing != np.uint64(0):
        k = lowest_bit(missing)
        missing &= missing - np.uint64(1)
        u_k, v_k = scratch[k], scratch[POINTS + k]
        evaluate_point(nets, at, dimensions, u_k + (middle - u_k) * NUDGE, v_k + (middle - v_k) * NUDGE, rows, near)
        w = (near[3, 0], near[3, 1], near[3, 2])
        x = tangents((near[0, 0], near[0, 1], near[0, 2]), w)
        y = tangents((near[1, 0], near[1, 1], near[1, 2]), w)
        z = tangents((near[2, 0], near[2, 1], near[2, 2]), w)
        scratch[2 * POINTS + k], scratch[3 * POINTS + k], scratch[4 * POINTS + k], _ = cross(x, y, z)
    return load(scratch, 2 * POINTS), load(scratch, 3 * POINTS), load(scratch, 4 * POINTS)


@kernel(error_model="numpy")
def _dice(
    part: int,
    parts: int,
    subpatches: Any,
    nets: Any,
    weighted: bool,
    screen: Any,
    light: Any,
    texture: Any,
    shaded: bool,
    vertices: Any,
    boxes: Any,
) -> None:
    """Dice one part of the sub-patches; ``nets`` are 16 numbers a coordinate, the fourth the weights if there are."""
    column, row = places()
    scratch, values = np.zeros(5 * POINTS, np.float32), np.zeros((6, 4), np.float32)
    values[3, 0] = 1
    number, dimensions = boxes.shape[0], 4 if weighted else 3
    for n in range(number * part // parts, number * (part + 1) // parts):
        patch, side = np.int64(subpatches.patch[n]), side_of(subpatches.level[n])
        u, v = parameters(subpatches.i[n], side, column), parameters(subpatches.j[n], side, row)
        by_u, by_v, at = basis(u), basis(v), 4 * POINTS * patch
        scale = ONE / restrict(screen, at + 2 * POINTS, by_u, by_v)
        x, y = restrict(screen, at, by_u, by_v) * scale, restrict(screen, at + POINTS, by_u, by_v) * scale
        z, color = restrict(screen, at + 3 * POINTS, by_u, by_v) * scale, spread(UNSHADED)
        if shaded:
            at = dimensions * POINTS * patch
            slope_u, slope_v = slopes(u), slopes(v)
            px = evaluate(nets, at, by_u, by_v, slope_u, slope_v)
            py = evaluate(nets, at + POINTS, by_u, by_v, slope_u, slope_v)
            pz = evaluate(nets, at + 2 * POINTS, by_u, by_v, slope_u, slope_v)
            w, cells = spread(ONE), spread(light.squares)
            if weighted:
                weights = evaluate(nets, at + 3 * POINTS, by_u, by_v, slope_u, slope_v)
                px, py, pz = tangents(px, weights), tangents(py, weights), tangents(pz, weights)
                w, cells = weights[0], light.squares / weights[0]
            nx, ny, nz, none = cross(px, py, pz)
            normal, missing = (nx, ny, nz), bits(none)
            if missing != np.uint64(0):
                normal = _borrow(nets, at, dimensions, u, v, missing, normal, scratch, values)
            point = (px[0], py[0], pz[0], w)
            reflectance = checker(point, cells) if texture is None else texels(texture, u, v, scratch)
            color = colored(reflectance, lit(point, normal, light))
        store_vertices(vertices, 4 * POINTS * n, (x, y, z, color))
        boxes[n, 0], boxes[n, 1] = least(x, first(x)), least(y, first(y))
        boxes[n, 2], boxes[n, 3] = greatest(x, first(x)), greatest(y, first(y))


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
        _dice, parts_of(number, BLOCK), subpatches, nets.reshape(-1), dimensions == 4, screen.reshape(-1),
        light, texture, shaded, vertices.reshape(-1), grids.boxes,
    )  # fmt: skip
    return StageResult(grids, works)
