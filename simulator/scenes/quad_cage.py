"""A cage: the polygons that a subdivision surface is modelled with, and one step of Catmull and Clark's refinement.

Boundaries follow the usual rules: the boundary is refined as a cubic B-spline curve of its own, and a corner (a
boundary vertex of one face only, or one where other than two boundary edges meet) stays where it is.
"""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.simulator.scenes.obj_file import ObjFile, read_obj

Indices = NDArray[np.int64]
Points = NDArray[np.float64]


@dataclass(frozen=True)
class Cage:
    """Polygons that keep their corners; everything derived from them is computed once.

    Parameters
    ----------
    positions : ndarray, (V, 3), float64
    corners : ndarray, (C,), int64
        Vertices of the faces, one face after another.
    sizes : ndarray, (F,), int64
        Corners of each face.
    """

    positions: Points
    corners: Indices
    sizes: Indices

    @cached_property
    def face_of_corner(self) -> Indices:
        """Face of each corner, (C,)."""
        return np.repeat(np.arange(len(self.sizes)), self.sizes)

    @cached_property
    def next_corner(self) -> Indices:
        """The corner that follows each one around its face, (C,)."""
        ends = np.cumsum(self.sizes)
        following = np.arange(1, len(self.corners) + 1)
        following[ends - 1] = ends - self.sizes
        return following

    @cached_property
    def _edge_table(self) -> tuple[Indices, Indices, Indices]:
        start, end = self.corners, self.corners[self.next_corner]
        vertices = len(self.positions)
        keys, edge_of_corner, faces = np.unique(
            np.minimum(start, end) * vertices + np.maximum(start, end), return_inverse=True, return_counts=True
        )
        return np.stack([keys // vertices, keys % vertices], axis=1), edge_of_corner.reshape(-1), faces

    @property
    def edges(self) -> Indices:
        """Vertices of the edges, lower number first, (E, 2)."""
        return self._edge_table[0]

    @property
    def edge_of_corner(self) -> Indices:
        """The edge from each corner to the next one, (C,)."""
        return self._edge_table[1]

    @cached_property
    def boundary_edges(self) -> NDArray[np.bool_]:
        """Edges that are not between exactly two faces, (E,): the surface ends, or is creased, there."""
        boundary: NDArray[np.bool_] = self._edge_table[2] != 2
        return boundary

    @cached_property
    def faces_at_vertex(self) -> Indices:
        """Face corners at each vertex, (V,): the valence inside the surface."""
        return np.bincount(self.corners, minlength=len(self.positions))

    @cached_property
    def boundary_at_vertex(self) -> Indices:
        """Boundary edges at each vertex, (V,)."""
        return np.bincount(self.edges[self.boundary_edges].reshape(-1), minlength=len(self.positions))

    @cached_property
    def sharp_vertices(self) -> NDArray[np.bool_]:
        """Boundary vertices that the surface passes through, (V,)."""
        on_boundary = self.boundary_at_vertex > 0
        sharp: NDArray[np.bool_] = on_boundary & ((self.faces_at_vertex == 1) | (self.boundary_at_vertex != 2))
        return sharp

    def sum_at_boundary_neighbours(self) -> Points:
        """Sum of the neighbours along boundary edges of each vertex, (V, 3)."""
        ends = self.edges[self.boundary_edges]
        return scatter_sum(ends[:, 0], self.positions[ends[:, 1]], len(self.positions)) + scatter_sum(
            ends[:, 1], self.positions[ends[:, 0]], len(self.positions)
        )


def cage_of(model: ObjFile, path: str | Path) -> Cage:
    """Make a cage of an OBJ file's polygons; raises TilestampError where one is folded onto itself."""
    cage = Cage(model.positions, model.corners, model.sizes)
    folded = cage.corners == cage.corners[cage.next_corner]
    if folded.any():
        face = int(cage.face_of_corner[folded.argmax()])
        raise TilestampError(f"{path}: face {face + 1} names the same vertex twice in a row, so it is no polygon")
    return cage


def read_cage(path: str | Path) -> Cage:
    """Read the polygons of an OBJ file; raises TilestampError where a line is broken (``file:line``)."""
    return cage_of(read_obj(path), path)


def refine(cage: Cage) -> Cage:
    """One Catmull-Clark step (Catmull & Clark 1978): every face becomes one quad a corner.

    The new vertices are the old ones, then a point an edge, then a point a face.
    """
    vertices, edges = len(cage.positions), len(cage.edges)
    at_corner = cage.positions[cage.corners]
    faces = scatter_sum(cage.face_of_corner, at_corner, len(cage.sizes)) / cage.sizes[:, None]
    middles = cage.positions[cage.edges].mean(axis=1)
    beside = scatter_sum(cage.edge_of_corner, faces[cage.face_of_corner], edges) / 2.0
    edge_points = np.where(cage.boundary_edges[:, None], middles, (middles + beside) / 2.0)
    previous_edge = np.empty_like(cage.edge_of_corner)
    previous_edge[cage.next_corner] = cage.edge_of_corner
    quads = np.stack(
        [
            cage.corners,
            vertices + cage.edge_of_corner,
            vertices + edges + cage.face_of_corner,
            vertices + previous_edge,
        ],
        axis=1,
    )
    positions = np.concatenate([_moved_vertices(cage, faces, middles), edge_points, faces])
    return Cage(positions, quads.reshape(-1), np.full(len(quads), 4))


def scatter_sum(targets: Indices, values: Points, length: int) -> Points:
    """Sum of the rows of ``values`` that share a target, (length, 3)."""
    return np.stack([np.bincount(targets, values[:, axis], minlength=length) for axis in range(3)], axis=1)


def _moved_vertices(cage: Cage, faces: Points, middles: Points) -> Points:
    """Apply the vertex rule (F + 2 R + (n - 3) P) / n inside, (1, 6, 1) / 8 on the boundary, none at a corner."""
    count = len(cage.positions)
    valence = np.maximum(cage.faces_at_vertex, 1)[:, None]  # a vertex without a face goes nowhere
    around = scatter_sum(cage.corners, faces[cage.face_of_corner], count) / valence
    ends = cage.edges
    spokes = scatter_sum(ends.reshape(-1), np.repeat(middles, 2, axis=0), count) / valence
    smooth = (around + 2.0 * spokes + (valence - 3.0) * cage.positions) / valence
    curve = (6.0 * cage.positions + cage.sum_at_boundary_neighbours()) / 8.0
    moved = np.where(cage.boundary_at_vertex[:, None] > 0, curve, smooth)
    fixed = cage.sharp_vertices | (cage.faces_at_vertex == 0)
    return np.where(fixed[:, None], cage.positions, moved)
