"""Cages into bicubic Bezier patches (Loop & Schaefer 2008, section 3: geometry patches).

One patch a quad. Where the four corners of a quad have valence 4 the patch is the bicubic B-spline itself, which is the
Catmull-Clark surface: exact. Around extraordinary vertices the patch interpolates the Catmull-Clark limit positions of
its corners and joins its neighbours along equal boundary curves (no gap; the normal may jump: the paper's tangent
patches, which hide that jump in the shading, are not built). A cage with other faces than quads is refined once first.

Boundaries: the boundary curve is the cubic B-spline of its vertices, and a corner is interpolated (see `quad_cage`).
"""

import numpy as np
from numpy.typing import NDArray

from tilestamp.simulator.scenes.geometry import Patches
from tilestamp.simulator.scenes.quad_cage import Cage, Points, refine, scatter_sum

# Places of a quad's corners and of the points around them in a 4x4 patch, row-major, corner by corner.
CORNER_PLACES = (0, 3, 15, 12)
INTERIOR_PLACES = (5, 6, 10, 9)
FORWARD_PLACES = (1, 7, 14, 8)  # on the edge to the next corner
BACKWARD_PLACES = (4, 2, 11, 13)  # on the edge to the corner before


def patches_from_cage(cage: Cage) -> Patches:
    """Turn every quad of a cage into a bicubic Bezier patch.

    Parameters
    ----------
    cage : Cage
        Refined once first if a face is not a quad.

    Returns
    -------
    Patches
        In the order of the faces; row 0 runs from a face's first corner to its second. Points that neighbours share
        are equal to the bit.
    """
    if (cage.sizes != 4).any():
        cage = refine(cage)
    interior = _interior_points(cage)
    previous = np.empty_like(cage.next_corner)
    previous[cage.next_corner] = np.arange(len(cage.corners))
    edge_points = _edge_points(cage, interior, previous)
    points = np.ones((len(cage.sizes), 16, 4))
    for places, values in (
        (CORNER_PLACES, _limit_points(cage, interior)[cage.corners]),
        (INTERIOR_PLACES, interior),
        (FORWARD_PLACES, edge_points[_edge_end(cage, np.arange(len(cage.corners)))]),
        (BACKWARD_PLACES, edge_points[_edge_end(cage, previous)]),
    ):
        points[:, places, :3] = values.reshape(-1, 4, 3)
    return Patches(points.astype(np.float32))


def _interior_points(cage: Cage) -> Points:
    """(n v + 2 left + 2 right + opposite) / (n + 5) for each face corner, n the valence."""
    quads = cage.positions[cage.corners].reshape(-1, 4, 3)
    # A boundary vertex counts as if its surface went on behind it: twice its faces, and 4 at a corner.
    inside = cage.boundary_at_vertex == 0
    valence = np.where(inside, cage.faces_at_vertex, np.maximum(2 * cage.faces_at_vertex, 4))
    n = valence[cage.corners].reshape(-1, 4, 1)
    sides = np.roll(quads, 1, axis=1) + np.roll(quads, -1, axis=1)
    points: Points = ((n * quads + 2.0 * sides + np.roll(quads, 2, axis=1)) / (n + 5)).reshape(-1, 3)
    return points


def _edge_end(cage: Cage, corner: NDArray[np.int64]) -> NDArray[np.int64]:
    """Give the number of the end of the edge that starts at a corner, as seen from the corner in question.

    Two numbers an edge. ``corner`` is, for each corner, itself (the edge ahead) or the one before (the edge behind).
    """
    edge = cage.edge_of_corner[corner]
    number: NDArray[np.int64] = 2 * edge + (cage.edges[edge, 1] == cage.corners)
    return number


def _edge_points(cage: Cage, interior: Points, previous: NDArray[np.int64]) -> Points:
    """Two points an edge: the mean of the interior points beside each; thirds of the edge on a boundary."""
    count = 2 * len(cage.edges)
    ahead = _edge_end(cage, np.arange(len(cage.corners)))
    behind = _edge_end(cage, previous)
    inside = (scatter_sum(ahead, interior, count) + scatter_sum(behind, interior, count)) / 2.0
    ends = cage.positions[cage.edges]
    thirds = ((2.0 * ends + ends[:, ::-1]) / 3.0).reshape(-1, 3)
    return np.where(np.repeat(cage.boundary_edges, 2)[:, None], thirds, inside)


def _limit_points(cage: Cage, interior: Points) -> Points:
    """Limit position of each vertex: the mean of the interior points around it (equal to the n^2, 4, 1 mask)."""
    around = scatter_sum(cage.corners, interior, len(cage.positions))
    smooth = around / np.maximum(cage.faces_at_vertex, 1)[:, None]
    curve = (4.0 * cage.positions + cage.sum_at_boundary_neighbours()) / 6.0
    limit = np.where(cage.boundary_at_vertex[:, None] > 0, curve, smooth)
    return np.where(cage.sharp_vertices[:, None], cage.positions, limit)
