"""The synthetic triangles of Figure 5 (Laine & Karras 2011): about 2**20 equilateral triangles of one screen area.

Layers of a triangular grid, each rotated and moved at random, cover the viewport; where triangles are small a layer
keeps only patches of 8x8 quads, spaced so that at least 16 layers are drawn. Everything is float32 as in the authors'
benchmark; the random numbers are theirs too (`xorshift`). The order of the two draws of a translation was left to their
compiler: here the first goes to y (and of a colour the first to the last component); no statistic depends on it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.simulator.scenes.geometry import Mesh
from tilestamp.simulator.scenes.xorshift import AUTHORS_SEED, draw_floats, random_state

TARGET_TRIANGLES = 1 << 20
PATCH_QUADS = 8  # a patch is 8x8 quads, 9x9 vertices
MINIMUM_LAYERS = 16
ALPHA = np.float32(0.5)
LARGEST_SHARE = 0.125  # of the viewport that one triangle may cover: far beyond the authors' 40 pixels

Floats = NDArray[np.float32]
f32 = np.float32


@dataclass(frozen=True)
class Layout:
    """How one area is laid out: the spacing of patches in a layer, in quads, and the number of layers."""

    step: int
    layers: int


def layout(area: float, width: int, height: int) -> Layout:
    """Choose spacing and layers so that about 2**20 triangles of ``area`` pixels are drawn."""
    shrink = np.sqrt(f32(2.0) * f32(area))
    per_layer = (f32(width) - shrink) * (f32(height) - shrink) / f32(area)
    target = f32(TARGET_TRIANGLES)
    step = max(int(np.sqrt(per_layer / target * f32(MINIMUM_LAYERS)) * f32(PATCH_QUADS)) + 1, PATCH_QUADS)
    share = f32(step * step) / f32(PATCH_QUADS * PATCH_QUADS)
    return Layout(step, max(int(target / per_layer * share + f32(0.5)), MINIMUM_LAYERS))


def sweep_mesh(
    area: float, width: int = 1024, height: int = 768, seed: int = 0, state: NDArray[np.uint32] | None = None
) -> Mesh:
    """Make the triangles of one area of the sweep.

    Parameters
    ----------
    area : float
        Pixels a triangle. 0 stands for triangles of one pixel that all face away: it measures culling.
    width, height : int
        Viewport, in pixels.
    seed : int
        0 is the authors' seed, 123.
    state : ndarray, (12,), uint32, optional
        A generator (`xorshift.random_state`) to draw from instead of a fresh one; it is moved on past this area's
        colours, as in the authors' run over all areas.

    Returns
    -------
    Mesh
        In clip space with w = 1; unused vertices included, as in the original.
    """
    if not np.isfinite(area) or not 0.0 <= area <= LARGEST_SHARE * width * height or width < 1 or height < 1:
        raise TilestampError(f"sweep: triangles of {area:g} pixels cannot fill a viewport of {width}x{height}")
    state = random_state(seed or AUTHORS_SEED) if state is None else state
    size, mirror = (1.0, -1.0) if area == 0 else (area, 1.0)
    plan = layout(size, width, height)
    layers = [_layer(size, mirror, width, height, plan, number, state) for number in range(plan.layers)]
    vertices = np.concatenate([layer for layer in layers if len(layer)])
    colors = np.empty((vertices.shape[0] * vertices.shape[1], 4), dtype=np.float32)
    colors[:, 2::-1] = draw_floats(state, 3 * len(colors)).reshape(-1, 3)
    colors[:, 3] = ALPHA
    return Mesh(vertices.reshape(-1, 4), _triangles(vertices), colors, clip_space=True)


def _layer(
    size: float, mirror: float, width: int, height: int, plan: Layout, number: int, state: NDArray[np.uint32]
) -> Floats:
    """Vertices of the visible patches of one layer, (patches, 81, 4)."""
    matrix = _grid_to_ndc(size, mirror, width, height, plan.step, draw_floats(state, 3))
    inverse = np.linalg.inv(matrix.astype(np.float64)).astype(np.float32)
    # The homogeneous scale stays in the inverse, so this box is larger than the viewport: where patches are sparse,
    # the counts of the original depend on it.
    reach = np.abs(inverse[:2, 0]) + np.abs(inverse[:2, 1])
    low = np.ceil(inverse[:2, 2] - reach).astype(np.int64)
    high = np.floor(inverse[:2, 2] + reach).astype(np.int64)
    xs, ys = (np.arange(low[axis], high[axis] + 1, plan.step) for axis in (0, 1))
    origins = np.stack(np.meshgrid(xs, ys), axis=-1).reshape(-1, 2)
    matrix /= matrix[2, 2]
    corners = _transform(matrix, origins, np.array([0, PATCH_QUADS]))
    outside = (corners.max(axis=1) < f32(-1.0)) | (corners.min(axis=1) > f32(1.0))
    points = _transform(matrix, origins[~outside.any(axis=1)], np.arange(PATCH_QUADS + 1))
    vertices = np.empty((*points.shape[:2], 4), dtype=np.float32)
    vertices[:, :, :2] = points
    vertices[:, :, 2] = f32(1.0) - f32(2.0) * (f32(number) + f32(0.5)) / f32(plan.layers)
    vertices[:, :, 3] = 1.0
    return vertices


def _grid_to_ndc(size: float, mirror: float, width: int, height: int, step: int, draws: Floats) -> Floats:
    """Move, shear to equilateral triangles, rotate, and scale to the viewport: (3, 3) float32.

    The factor that gives a grid triangle unit area stands as the homogeneous scale, at [2, 2].
    """
    angle = draws[0] * f32(2.0 * np.pi)
    ty, tx = draws[1] * f32(step), draws[2] * f32(step)
    cosine, sine = np.cos(angle), np.sin(angle)
    unit = np.sqrt(np.sqrt(f32(0.75)) / f32(2.0))
    move = np.array([[1, 0, tx], [0, 1, ty], [0, 0, 1]], dtype=np.float32)
    shear = np.array([[1, 0.5, 0], [0, np.sqrt(f32(0.75)), 0], [0, 0, unit]], dtype=np.float32)
    rotate = np.array([[cosine, sine, 0], [-sine, cosine, 0], [0, 0, 1]], dtype=np.float32)
    scale = np.diag(np.array([f32(2.0) * np.sqrt(f32(size)) / f32(side) for side in (width, height)] + [f32(1.0)]))
    matrix = scale @ rotate @ shear @ move
    matrix[:, 0] *= f32(mirror)
    return matrix.astype(np.float32)


def _transform(matrix: Floats, origins: NDArray[np.int64], offsets: NDArray[np.int64]) -> Floats:
    """NDC of a square of grid points for each patch origin, row by row, (patches, n * n, 2)."""
    x = np.repeat((origins[:, 0, None] + offsets)[:, None, :], len(offsets), axis=1).reshape(len(origins), -1)
    y = np.repeat((origins[:, 1, None] + offsets)[:, :, None], len(offsets), axis=2).reshape(len(origins), -1)
    gx, gy = x.astype(np.float32), y.astype(np.float32)
    return np.stack([row[0] * gx + row[1] * gy + row[2] for row in matrix[:2]], axis=-1)


def _triangles(vertices: Floats) -> NDArray[np.int32]:
    """List the triangles of all patches whose three vertices are inside the viewport, in the original's order."""
    side = PATCH_QUADS + 1
    corner = np.arange(PATCH_QUADS)[:, None] * side + np.arange(PATCH_QUADS)
    v0, v1, v2, v3 = (corner + offset for offset in (0, 1, side, side + 1))
    pattern = np.stack([v0, v1, v2, v2, v1, v3], axis=-1).reshape(-1, 3)
    inside = np.maximum(np.abs(vertices[:, :, 0]), np.abs(vertices[:, :, 1])) <= f32(1.0)
    kept = inside[:, pattern[:, 0]] & inside[:, pattern[:, 1]] & inside[:, pattern[:, 2]]
    patch, triangle = np.nonzero(kept)
    numbers = pattern.astype(np.int32)[triangle]
    numbers += (patch * (side * side)).astype(np.int32)[:, None]
    return numbers
