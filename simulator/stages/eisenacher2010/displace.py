"""Displacement maps, with bounds that hold (not in Eisenacher & Loop 2010, who call them difficult with tiny tiles).

Vertices are moved along the normal while dicing, by a map over each urPatch. How far that is on screen is bounded for
the whole frame before anything is split: no vertex moves by more than ``room`` pixels. Sub-patches are split until
they are smaller than the bound by twice that, and culled against a screen larger by it on all sides; then a displaced
grid is no wider than the bound, and lies in as many tiles as its slots. The light is that of the surface before.
"""

import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.simt import Simt
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.eisenacher2010.bound_and_split import SubPatches
from tilestamp.simulator.stages.eisenacher2010.dice import GRID_SIDE, Grids, dice
from tilestamp.simulator.stages.eisenacher2010.dice_counts import DiceEvent
from tilestamp.simulator.work import Work

WHITE = 255  # a texel that displaces by the whole height
Numbers = NDArray[np.float64]


class Padded(NamedTuple):
    """What is split instead: a larger screen, a smaller bound."""

    matrix: Numbers
    width: int
    height: int
    bound: float
    room: float  # pixels that a vertex moves at most


def padded(
    points: NDArray[np.float32], matrix: ArrayLike, width: int, height: int, bound: float, relief_height: float
) -> Padded:
    """Leave room for displacement.

    A point moved by d along a unit vector has x' - x = (a.d - x b.d) / (w + b.d) on screen, x from the middle.

    Parameters
    ----------
    points : ndarray, (P, 16, 4), float32
    matrix : array-like, (4, 4)
    width, height : int
        Pixels.
    bound : float
        Pixels that a displaced grid may be wide and high.
    relief_height : float
        Units of the model that a vertex moves at most.

    Raises
    ------
    TilestampError
        Patches at the eye, where there is no such bound; a bound that displacement alone exceeds.
    """
    rows, reach = np.asarray(matrix, np.float64), abs(relief_height)
    nearest = float(((points @ rows[3]) / points[..., 3]).min())
    turn = reach * float(np.linalg.norm(rows[3, :3]))
    if nearest <= 2 * turn:
        raise TilestampError("relief: patches come too near to the eye for a bound of their displacement")
    room = max(
        (reach * 0.5 * size * float(np.linalg.norm(row[:3])) + (0.5 * size + bound) * turn) / (nearest - 2 * turn)
        for size, row in ((width, rows[0]), (height, rows[1]))
    )
    if 2 * room >= bound:
        raise TilestampError(f"relief: vertices move by up to {room:.3g} pixels; bound must be more than twice that")
    edge = math.ceil(room)
    scale = np.diag([width / (width + 2 * edge), height / (height + 2 * edge), 1.0, 1.0])
    return Padded(scale @ rows, width + 2 * edge, height + 2 * edge, bound - 2 * room, room)


def dice_displaced(
    points: NDArray[np.float32],
    subpatches: SubPatches,
    matrix: ArrayLike,
    width: int,
    height: int,
    simt: Simt,
    *,
    relief: NDArray[np.uint8],
    relief_height: float,
    **options: Any,
) -> StageResult[Grids]:
    """Dice, and move vertices along their normals.

    Parameters
    ----------
    points, subpatches, matrix, width, height, simt, options
        As for ``dice``.
    relief : ndarray, (H, W), uint8
        Laid over each urPatch, u to the right and v down; bilinear between texels.
    relief_height : float
        Units of the model that white moves a vertex.

    Raises
    ------
    TilestampError
        A map of another shape.
    """
    if relief.ndim != 2 or not relief.size:
        raise TilestampError(f"relief must be (H, W) bytes, not of shape {relief.shape}")
    grids, works, _ = dice(points, subpatches, matrix, width, height, simt, **options)
    moved = _displaced(points, subpatches, relief, relief_height)
    clip = moved @ np.asarray(matrix, np.float64).T
    vertices = grids.vertices.copy()
    vertices[..., 0] = (clip[..., 0] / clip[..., 3] + 1) * (0.5 * width)
    vertices[..., 1] = (1 - clip[..., 1] / clip[..., 3]) * (0.5 * height)
    vertices[..., 2] = clip[..., 2] / clip[..., 3]
    low, high = vertices[:, :, :2].min(axis=1), vertices[:, :, :2].max(axis=1)
    boxes = np.concatenate([low, high], axis=1)
    widest = float((high - low).max(initial=0))
    return StageResult(Grids(vertices, boxes), tuple(_fetching(work) for work in works), {"widest_grid": widest})


def _fetching(work: Work) -> Work:
    """Dicing that fetches a texel more for each vertex."""
    table = work.table.copy()
    table[:, DiceEvent.TEXTURE_LANES] += table[:, DiceEvent.VERTEX_LANES]
    return replace(work, table=table, variant="displaced")


def _displaced(
    points: NDArray[np.float32], subpatches: SubPatches, relief: NDArray[np.uint8], height: float
) -> Numbers:
    """Displaced vertices, (N, 16, 4), homogeneous with w = 1."""
    cells = (3.0 * 2.0 ** subpatches.level.astype(np.float64))[:, None]
    u, v = (
        (3.0 * place.astype(np.float64)[:, None] + np.arange(GRID_SIDE)) / cells
        for place in (subpatches.i, subpatches.j)
    )
    nets = points[subpatches.patch].astype(np.float64).reshape(-1, 4, 4, 4)
    (at_u, slope_u), (at_v, slope_v) = _basis(u), _basis(v)
    surface, along_u, along_v = (
        np.einsum("nkv,nlu,nvuc->nklc", by_v, by_u, nets).reshape(-1, GRID_SIDE**2, 4)
        for by_v, by_u in ((at_v, at_u), (at_v, slope_u), (slope_v, at_u))
    )
    w = surface[..., 3:]
    tangents = [along[..., :3] * w - surface[..., :3] * along[..., 3:] for along in (along_u, along_v)]
    normal = np.cross(*tangents)
    length = np.linalg.norm(normal, axis=-1, keepdims=True)
    unit = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)
    level = _texels(relief, np.repeat(u[:, None], GRID_SIDE, axis=1), np.repeat(v[:, :, None], GRID_SIDE, axis=2))
    moved = surface[..., :3] / w + height * level.reshape(-1, GRID_SIDE**2, 1) * unit
    return np.concatenate([moved, np.ones_like(w)], axis=-1)


def _basis(t: Numbers) -> tuple[Numbers, Numbers]:
    """Bernstein polynomials and their derivatives at parameters (N, 4): (N, 4, 4)."""
    s = 1 - t
    values = np.stack([s**3, 3 * t * s**2, 3 * t**2 * s, t**3], axis=-1)
    slopes = 3 * np.stack([-(s**2), s**2 - 2 * t * s, 2 * t * s - t**2, t**2], axis=-1)
    return values, slopes


def _texels(relief: NDArray[np.uint8], u: Numbers, v: Numbers) -> Numbers:
    """Levels from 0 to 1, bilinear; the outermost texels lie on the edges of a patch."""
    rows, columns = relief.shape
    x, y = u * (columns - 1), v * (rows - 1)
    i, j = (np.minimum(np.floor(place).astype(np.int64), size) for place, size in ((x, columns - 1), (y, rows - 1)))
    right, below = np.minimum(i + 1, columns - 1), np.minimum(j + 1, rows - 1)
    level = relief.astype(np.float64) / WHITE
    dx, dy = x - i, y - j
    top, bottom = (level[row, i] * (1 - dx) + level[row, right] * dx for row in (j, below))
    found: Numbers = top * (1 - dy) + bottom * dy
    return found
