"""Which triangles share edges: the vertex across each edge, by which ``antialias`` knows a silhouette."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kernel import kernel
from tilestamp.simulator.nvdiffrast.arrays import Array, as_triangles

NO_VERTEX = -1


class TopologyHash(NamedTuple):
    """Across each edge of each triangle, the vertex of the triangle there."""

    opposite: NDArray[np.int32]  # (F, 3) across the edge that vertex k is not of; -1 for none


def antialias_construct_topology_hash(tri: Array) -> TopologyHash:
    """Find which triangles share edges, once for several calls of ``antialias``.

    Parameters
    ----------
    tri : array, (F, 3), int32
        Triangles with a vertex twice, or a negative one, are no neighbours of any.

    Returns
    -------
    TopologyHash
        Of an edge of three or more triangles the first two different opposite vertices count (in the original, those
        that come first in a race).
    """
    tri = as_triangles(tri)
    whole = (tri >= 0).all(axis=1) & (tri[:, 0] != tri[:, 1]) & (tri[:, 1] != tri[:, 2]) & (tri[:, 2] != tri[:, 0])
    ends = np.stack([tri[:, [1, 2, 0]], tri[:, [2, 0, 1]]], axis=-1).astype(np.int64)
    edges = (ends.min(axis=-1) << 32 | ends.max(axis=-1)).reshape(-1)
    order = np.argsort(edges, kind="stable")
    order = order[np.repeat(whole, 3)[order]]
    opposite = np.full(tri.size, NO_VERTEX, np.int32)
    _pair_part(edges, order, tri.reshape(-1), opposite)
    return TopologyHash(opposite.reshape(tri.shape))


@kernel
def _pair_part(edges: Any, order: Any, vertices: Any, opposite: Any) -> None:
    """Of the corners that see one edge, in their order: give each the other of the first two different vertices."""
    first = 0
    while first < len(order):
        last = first
        one = vertices[order[first]]
        other = np.int32(NO_VERTEX)
        while last < len(order) and edges[order[last]] == edges[order[first]]:
            if other < 0 and vertices[order[last]] != one:
                other = vertices[order[last]]
            last += 1
        for k in range(first, last):
            v = vertices[order[k]]
            opposite[order[k]] = other if v == one else one if v == other else NO_VERTEX
        first = last
