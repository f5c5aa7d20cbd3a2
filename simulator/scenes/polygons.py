"""Polygons of a file as triangles: fans where a fan is right, cut ears where a polygon is concave; and a mesh of them.

Triangles keep the order of the file, degenerate and duplicate ones included: what to do with those is the rasterizer's
business. Colours are taken as linear.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.kernel import kernel
from tilestamp.simulator.scenes.clip_space import finite_positions, vertex_numbers
from tilestamp.simulator.scenes.geometry import Mesh

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]
MOST_NAMED = 8  # corners of a face in an error
ARROW = np.array([[1, 2, 3], [1, 3, 0]])  # from its second corner the fan of an arrow is right
FLAT = 1e-6  # of a polygon's area: what a fan may turn over before the polygon counts as concave


@dataclass
class Polygons:
    """What a file holds, before it is cut into triangles.

    Parameters
    ----------
    positions : ndarray, (V, 3), float64
    corners : ndarray, (sum of sizes,), int64
        Vertex numbers of the polygons, one polygon after another.
    sizes : ndarray, (F,), int64
        Corners of each polygon: 3 or more.
    colors : ndarray, (V, 4), float64, or None
        RGBA in [0, 1] of the vertices.
    face_colors : ndarray, (F, 4), float64, or None
        RGBA of the polygons, where ``colors`` is None.
    normals : ndarray, (V, 3), float64, or None
    """

    positions: Floats
    corners: Indices
    sizes: Indices
    colors: Floats | None = None
    face_colors: Floats | None = None
    normals: Floats | None = None

    def mesh(self, source: str | Path) -> Mesh:
        """Cut the polygons into triangles; polygons that have colours of their own share no vertices."""
        self._check(source)
        if len(self.corners) == 3 * len(self.sizes):
            triangles, polygon = self.corners.reshape(-1, 3), np.arange(len(self.sizes), dtype=np.int32)
        else:
            cut, polygon = triangulate(self.positions, self.corners, self.sizes)
            triangles = self.corners[cut]
        if self.colors is not None or self.face_colors is None:
            return model_mesh(self.positions, triangles, self.colors, self.normals, source)
        vertices = triangles.reshape(-1)
        normals = None if self.normals is None else self.normals[vertices]
        colors = self.face_colors[polygon].repeat(3, axis=0)
        return model_mesh(self.positions[vertices], np.arange(len(vertices)).reshape(-1, 3), colors, normals, source)

    def _check(self, source: str | Path) -> None:
        if not len(self.sizes):
            raise TilestampError(f"{source}: has no faces, so there is nothing to rasterize")
        wrong = (self.corners < 0) | (self.corners >= len(self.positions))
        if wrong.any():
            ends = np.cumsum(self.sizes)
            face = int(np.searchsorted(ends, wrong.argmax(), side="right"))
            used = self.corners[ends[face] - self.sizes[face] : ends[face]][:MOST_NAMED].tolist()
            raise TilestampError(
                f"{source}: face {face} uses vertices {used}, but there are {len(self.positions)} (from 0)"
            )


def whole_numbers(values: NDArray[Any], source: str | Path) -> Indices:
    """Give vertex numbers as integers; raises TilestampError where one has a fraction."""
    if values.dtype.kind == "f" and (broken := values % 1.0 != 0.0).any():
        raise TilestampError(f"{source}: a face uses the vertex {values[broken.argmax()]:g}, which is no whole number")
    return values.astype(np.int64)


def triangulate(positions: Floats, corners: Indices, sizes: Indices) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Cut polygons into triangles.

    Returns
    -------
    ndarray, (T, 3), int32
        Places in ``corners``, polygon by polygon: a fan from the first corner where no triangle of it is turned over.
    ndarray, (T,), int32
        Polygon of each triangle.
    """
    pieces = sizes - 2
    cut, polygon = np.empty((pieces.sum(), 3), np.int32), np.repeat(np.arange(len(sizes), dtype=np.int32), pieces)
    folded = _fans(positions, corners, sizes, cut)
    kept = np.ones(len(cut), np.bool_)
    for face in np.flatnonzero(folded).tolist():
        row = int(np.searchsorted(polygon, face))
        first = cut[row, 0]
        points = positions[corners[first : first + sizes[face]]]
        normal = np.cross(points - points[0], np.roll(points, -1, axis=0) - points[0]).sum(axis=0)
        ears = ARROW if sizes[face] == 4 else _ears(points, normal)
        a, b, c = (points[ears[:, k]] for k in range(3))
        if len(ears) and (np.cross(b - a, c - a) @ normal >= 0).all():
            cut[row : row + len(ears)] = first + ears
            kept[row + len(ears) : row + pieces[face]] = False
    return (cut, polygon) if kept.all() else (cut[kept], polygon[kept])


@kernel
def _fans(positions: Any, corners: Any, sizes: Any, cut: Any) -> Any:
    """Write the fan of each polygon; tell which fans turn a triangle over, and so leave their polygon."""
    folded = np.zeros(len(sizes), np.bool_)
    normal, edges = np.empty((2, 3)), np.empty((2, 3))
    first = row = 0
    for face in range(len(sizes)):
        normal[0] = 0.0
        for sums in range(2 if sizes[face] > 3 else 0):  # the polygon's normal, then each triangle's along it
            for k in range(1, sizes[face] - 1):
                for axis in range(3):
                    for side in range(2):
                        edges[side, axis] = positions[corners[first + k + side], axis] - positions[corners[first], axis]
                along = squared = 0.0
                for axis in range(3):
                    up, left = (axis + 1) % 3, (axis + 2) % 3
                    normal[1, axis] = edges[0, up] * edges[1, left] - edges[0, left] * edges[1, up]
                    along += normal[1, axis] * normal[0, axis]
                    squared += normal[0, axis] ** 2
                if sums == 0:
                    normal[0] += normal[1]
                elif along < -FLAT * squared:
                    folded[face] = True
        for k in range(1, sizes[face] - 1):
            cut[row] = first, first + k, first + k + 1
            row += 1
        first += sizes[face]
    return folded


def _ears(points: Floats, normal: Floats) -> Indices:
    """Triangles of one concave polygon, (T, 3), wound as it is, seen along its normal."""
    from mapbox_earcut import triangulate_float64

    drop = int(np.abs(normal).argmax())
    flat = np.delete(points, drop, axis=1)
    if (normal[drop] < 0) != (drop == 1):  # earcut winds counter-clockwise
        flat[:, 0] *= -1.0
    flat -= flat.min(axis=0)
    ears: Indices = triangulate_float64(np.ascontiguousarray(flat), np.array([len(flat)], np.uint32)).astype(np.int64)
    return ears.reshape(-1, 3)


def model_mesh(
    positions: Floats, triangles: ArrayLike, colors: Floats | None, normals: Floats | None, source: str | Path
) -> Mesh:
    """Make a mesh of model-space vertices (V, 3), checked; normals are made where there are none."""
    indices = vertex_numbers(triangles, len(positions), source)
    points = finite_positions(np.concatenate([positions, np.ones((len(positions), 1))], axis=1), source)
    if normals is None or not np.isfinite(normals).all():
        made = vertex_normals(positions, indices)
    else:
        made = (normals / np.maximum(lengths(normals), np.finfo(np.float64).tiny)).astype(np.float32)
    return Mesh(points, indices, None if colors is None else colors.astype(np.float32), made)


def vertex_normals(positions: NDArray[Any], triangles: NDArray[Any]) -> NDArray[np.float32]:
    """Average unit normals at the vertices, weighted by the areas of the triangles around; zero where none is."""
    sums = np.zeros((len(positions), 3))
    _add_normals(positions, triangles, sums)
    far = lengths(sums)
    normals: NDArray[np.float32] = np.divide(sums, far, out=sums, where=far > 0).astype(np.float32)
    return normals


def lengths(vectors: Floats) -> Floats:
    """Lengths (n, 1) of some vectors (n, 3), as ``np.linalg.norm`` has them, column by column."""
    x, y, z = (vectors * vectors).T
    found: Floats = np.sqrt(x + y + z)
    return found[:, None]


@kernel
def _add_normals(positions: Any, triangles: Any, sums: Any) -> None:
    """Add each triangle's normal, twice as long as its area, at its vertices."""
    edges = np.empty((2, 3))
    for t in range(len(triangles)):
        for k in range(2):
            for axis in range(3):
                edges[k, axis] = np.float64(positions[triangles[t, k + 1], axis]) - np.float64(
                    positions[triangles[t, 0], axis]
                )
        for axis in range(3):
            up, left = (axis + 1) % 3, (axis + 2) % 3
            normal = edges[0, up] * edges[1, left] - edges[0, left] * edges[1, up]
            for corner in range(3):
                sums[triangles[t, corner], axis] += normal
