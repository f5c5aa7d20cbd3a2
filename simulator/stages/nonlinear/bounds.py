"""Tiles that a triangle may reach in a bent picture: cones against its edge planes, bins first (cone tests that hold).

All lines of sight of a tile lie in a cone. It misses the triangle if it lies wholly beyond a plane through the eye and an
edge, or apart from the cone about the corners (which holds the triangle, because a cone of less than a right angle is
convex). A bin of 8x8 tiles is looked at first, and its tiles where it does not miss.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.nonlinear.projections import Projection, cones
from tilestamp.simulator.stages.stochastic.bounds import Visits

BIN = 8  # tiles on a side
MARGIN = 1e-5  # radians: covers the rounding of a test in float32


class EdgePlanes(NamedTuple):
    """Planes through the eye and the edges of triangles.

    Parameters
    ----------
    corners : ndarray, (M, 3, 3), float64
        In eye space.
    normals : ndarray, (M, 3, 3), float32 or float64
        Of the edge opposite each corner, not of unit length: the weight of the corner on a line of sight.
    volumes : ndarray, (M,), the same
        Six times the signed volume of eye and triangle: the distance along a line of sight is volume over weights.
    """

    corners: NDArray[np.float64]
    normals: NDArray[Any]
    volumes: NDArray[Any]


def edge_planes(corners: NDArray[np.float32], *, double: bool) -> EdgePlanes:
    """Set triangles up."""
    kind: type[np.floating[Any]] = np.float64 if double else np.float32
    at = corners.astype(kind)
    normals = np.stack([np.cross(at[:, (k + 1) % 3], at[:, (k + 2) % 3]) for k in range(3)], axis=1)
    return EdgePlanes(corners.astype(np.float64), normals, (normals[:, 0] * at[:, 0]).sum(axis=1))


def visit_cones(planes: EdgePlanes, to: Projection, spp: int, tile: int) -> Visits:
    """Bound each triangle; a bin that is looked at is a visit without a sample."""
    tiles, bins = cones(to, tile), cones(to, tile * BIN)
    columns, rows = -(-to.width // tile), -(-to.height // tile)
    wide = -(-to.width // (tile * BIN))
    lengths = np.linalg.norm(planes.corners, axis=2, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):  # a corner at the eye bounds nothing
        units = planes.corners / lengths
        axes = units.sum(axis=1)
        axes /= np.linalg.norm(axes, axis=1, keepdims=True)
        spread = np.arccos(np.clip((units * axes[:, None]).sum(axis=2), -1, 1)).max(axis=1)
        inward = planes.normals.astype(np.float64) * np.sign(planes.volumes)[:, None, None]
        inward /= np.linalg.norm(inward, axis=2, keepdims=True)
    given = (axes, spread, inward, tiles, bins, columns, rows, wide)
    counts = np.zeros(len(planes.volumes), np.int64)
    none = np.empty(0, np.int32)
    _visit(*given, counts, np.zeros(len(counts), np.int64), none, none.astype(np.int64), 0)
    starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    found, masks = np.empty(starts[-1], np.int32), np.empty(starts[-1], np.int64)
    _visit(*given, counts, starts, found, masks, (1 << spp) - 1)
    return Visits(starts, found, masks, np.ones(len(found), np.int64))


@kernel
def _visit(
    axes: Any, spread: Any, inward: Any, tiles: Any, bins: Any, columns: int, rows: int, wide: int, counts: Any,
    starts: Any, found: Any, masks: Any, mask: int,
) -> None:  # fmt: skip
    """Look at the bins, and at the tiles of those that a triangle may reach; counts alone while there is no mask."""
    for p in range(len(axes)):
        at = starts[p]
        for b in range(len(bins)):
            near = not misses(axes, spread, inward, p, bins[b])
            if mask:
                found[at], masks[at] = 0, 0
            at += 1
            if not near:
                continue
            for j in range(b // wide * BIN, min((b // wide + 1) * BIN, rows)):
                for i in range(b % wide * BIN, min((b % wide + 1) * BIN, columns)):
                    if mask:
                        missed = misses(axes, spread, inward, p, tiles[j * columns + i])
                        found[at], masks[at] = j * columns + i, 0 if missed else mask
                    at += 1
        counts[p] = at - starts[p]


@kernel
def misses(axes: Any, spread: Any, inward: Any, p: int, cone: Any) -> bool:
    """Whether no line of sight in a cone meets triangle p; what is not a number misses nothing."""
    angle = cone[3] + MARGIN
    if angle < np.pi / 2:
        for k in range(3):
            away = inward[p, k, 0] * cone[0] + inward[p, k, 1] * cone[1] + inward[p, k, 2] * cone[2]
            if away < -np.sin(angle):
                return True
    together = angle + spread[p]
    if spread[p] < np.pi / 2 and together < np.pi:
        return bool(axes[p, 0] * cone[0] + axes[p, 1] * cone[1] + axes[p, 2] * cone[2] < np.cos(together))
    return False
