"""Tiles that a triangle may reach in a bent picture: cones against its edge planes, bins first (cone tests that hold).

All lines of sight of a tile lie in a cone. It misses the triangle if it lies wholly beyond a plane through the eye and
an edge, or apart from the cone about the corners (which holds the triangle, because a cone of less than a right angle
is convex). Bins of 8x8 tiles come first, each by the thread of its triangle; then the tiles of those that are not
missed, a thread for each row of them: a triangle all around the eye would keep one thread at work for long.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.nonlinear.projections import Projection, cones
from tilestamp.simulator.stages.stochastic.bounds import Visits
from tilestamp.simulator.stages.stochastic.tile_lists import MovingLists

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


class Outlines(NamedTuple):
    """What is bounded of triangles: a cone about each, and unit normals of its edge planes that point inward."""

    axes: NDArray[np.float64]
    spread: NDArray[np.float64]
    inward: NDArray[np.float64]


def outlines(planes: EdgePlanes) -> Outlines:
    """Bound triangles; a corner at the eye gives what is not a number, and bounds nothing."""
    with np.errstate(invalid="ignore", divide="ignore"):
        units = planes.corners / np.linalg.norm(planes.corners, axis=2, keepdims=True)
        axes = units.sum(axis=1)
        axes /= np.linalg.norm(axes, axis=1, keepdims=True)
        spread = np.arccos(np.clip((units * axes[:, None]).sum(axis=2), -1, 1)).max(axis=1)
        inward = planes.normals.astype(np.float64) * np.sign(planes.volumes)[:, None, None]
        inward /= np.linalg.norm(inward, axis=2, keepdims=True)
    return Outlines(axes, spread, inward)


def visit_bins(found: Outlines, to: Projection, tile: int) -> Visits:
    """Look at every bin of each triangle: a thread a triangle."""
    bins = cones(to, tile * BIN)
    return _visits(found, np.arange(len(found.axes)), np.arange(len(bins))[None, None], bins, 1)


def visit_cones(found: Outlines, bins: MovingLists, to: Projection, spp: int, tile: int) -> tuple[Visits, NDArray[Any]]:
    """Look at the tiles of listed bins: a thread for each pair of triangle and bin and row of tiles in it.

    Returns
    -------
    Visits
    ndarray, (threads,), int64
        Triangle of each thread.
    """
    columns, rows, wide = -(-to.width // tile), -(-to.height // tile), -(-to.width // (tile * BIN))
    of = np.repeat(np.arange(len(bins.starts) - 1), np.diff(bins.starts))
    i = of[:, None, None] % wide * BIN + np.arange(BIN)
    j = of[:, None, None] // wide * BIN + np.arange(BIN)[:, None]
    looked = np.where((i < columns) & (j < rows), j * columns + i, -1)
    return _visits(found, bins.entries, looked, cones(to, tile), (1 << spp) - 1), np.repeat(bins.entries, BIN)


def _visits(
    found: Outlines, triangles: NDArray[Any], looked: NDArray[np.int64], squares: NDArray[np.float64], mask: int
) -> Visits:
    """Visits of squares (threads of a triangle, or one, their rows; -1: none), each thread a row."""
    looked = np.broadcast_to(looked, (len(triangles), *looked.shape[1:]))
    there = looked >= 0
    starts = np.concatenate([[0], np.cumsum(there.sum(axis=2).ravel())]).astype(np.int64)
    of = np.repeat(triangles, there.sum(axis=(1, 2))).astype(np.int64)
    tiles = looked[there].astype(np.int32)
    masks = np.empty(len(tiles), np.int64)
    _look(*found, of, tiles, squares, mask, masks)
    return Visits(starts, tiles, masks, np.ones(len(tiles), np.int64))


@kernel
def _look(axes: Any, spread: Any, inward: Any, of: Any, tiles: Any, squares: Any, mask: int, masks: Any) -> None:
    for at in range(len(of)):
        masks[at] = 0 if misses(axes, spread, inward, of[at], squares[tiles[at]]) else mask


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
