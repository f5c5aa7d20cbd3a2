"""Catmull-Clark subdivision of any cage, to a level or to a size on screen (Catmull & Clark 1978; DeRose et al. 1998).

A step makes one quad of each face corner. Who neighbours whom afterwards follows from the numbering alone, so nothing
is searched for after the first look at the cage: the vertices of a step are the old vertices, a point an edge and a
point a face; its edges are two halves of each old edge and a spoke from each edge point to each face point beside it.

Boundaries are creases that never soften; a boundary vertex of one face stays where it is, as in ``quad_cage``.
Handled: faces of any number of corners, isolated vertices (dropped), zero-area faces (they stay so), faces wound
against their neighbours (turned round). Refused in a sentence: edges of three faces, faces of two corners or with a
corner twice, one-sided surfaces.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.simulator.scenes.catmull_clark_cage import check_cage, cleaned_cage, edge_sharpness
from tilestamp.simulator.scenes.catmull_clark_step import limit_points, step
from tilestamp.simulator.scenes.quad_cage import Cage

MOST_FACES = 1 << 26  # 67 million quads: beyond it memory, not patience, runs out


class Surface(NamedTuple):
    """A polygon surface ready to be refined, and which face of the cage each polygon comes from.

    Parameters
    ----------
    positions : ndarray, (V, 3), float64
    offsets : ndarray, (F + 1,), int32
        First corner of each face; all faces are quads after one step.
    corners : ndarray, (C,), int32
        Vertices of the faces.
    corner_edges : ndarray, (C,), int32
        The edge from each corner to the next.
    edges : ndarray, (E, 2), int32
    sharpness : ndarray, (E,), float32
        Steps for which an edge stays a crease; infinite on boundaries.
    cage_face : ndarray, (F,), int32
    """

    positions: NDArray[np.float64]
    offsets: NDArray[np.int32]
    corners: NDArray[np.int32]
    corner_edges: NDArray[np.int32]
    edges: NDArray[np.int32]
    sharpness: NDArray[np.float32]
    cage_face: NDArray[np.int32]

    @property
    def quads(self) -> NDArray[np.int32]:
        """Corners of the faces, (F, 4), once all are quads."""
        return self.corners.reshape(-1, 4)


def surface_of(cage: Cage, creases: ArrayLike = (), sharpness: ArrayLike = ()) -> Surface:
    """Look at a cage once: its edges, boundaries and creases.

    Parameters
    ----------
    cage : Cage
    creases : array-like, (K, 2), int
        Vertex pairs of the cage.
    sharpness : array-like, (K,), float
        Steps for which each crease holds; ``inf`` for ever.

    Raises
    ------
    TilestampError
        The cage is no surface (see the module), or a crease is no edge of it.
    """
    check_cage(cage)
    clean, kept = cleaned_cage(cage)
    sharp = edge_sharpness(clean, kept, np.asarray(creases, np.int64).reshape(-1, 2), np.asarray(sharpness, np.float32))
    return Surface(
        clean.positions,
        np.concatenate([[0], np.cumsum(clean.sizes)]).astype(np.int32),
        clean.corners.astype(np.int32),
        clean.edge_of_corner.astype(np.int32),
        clean.edges.astype(np.int32),
        sharp,
        np.arange(len(clean.sizes), dtype=np.int32),
    )


def subdivide(surface: Surface, levels: int) -> Surface:
    """Refine ``levels`` times.

    Raises
    ------
    TilestampError
        More than ``MOST_FACES`` quads would come out, or ``levels`` is negative.
    """
    faces = len(surface.corners) * 4 ** max(levels - 1, 0)
    if levels < 0 or faces > MOST_FACES:
        raise TilestampError(f"subdivision to level {levels} would make {faces:,} quads; at most {MOST_FACES:,} fit")
    for _ in range(levels):
        surface = Surface(*step(*surface))
    return surface


def limit_positions(surface: Surface) -> NDArray[np.float64]:
    """Where the vertices of a surface of quads end up after infinitely many steps, (V, 3) float64.

    Exact for smooth vertices and for creases that hold for ever; a crease that softens later counts as one that holds.
    """
    if len(surface.corners) != 4 * len(surface.cage_face):
        raise TilestampError("limit positions need quads: subdivide once first")
    limits: NDArray[np.float64] = limit_points(surface.positions, surface.quads, surface.edges, surface.sharpness)
    return limits
