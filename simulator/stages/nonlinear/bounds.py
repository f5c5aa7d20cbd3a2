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
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stages.nonlinear.projections import Projection, cones
from tilestamp.simulator.stages.stochastic.bounds import Visits
from tilestamp.simulator.stages.stochastic.tile_lists import MovingLists

BIN = 8  # tiles on a side
MARGIN = 1e-5  # radians: covers the rounding of a test in float32
UNSURE = 1e-12  # of a cosine by the sum of two angles: nearer to it, the cosine itself decides
SMALLEST_PART = 64  # triangles


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
    each = (looked >= 0).sum(axis=2).ravel()  # of a thread
    if len(looked) == 1:
        each = np.tile(each, len(triangles))
    starts = np.concatenate([[0], np.cumsum(each)]).astype(np.int64)
    tiles, masks = np.empty(starts[-1], np.int32), np.empty(starts[-1], np.int64)
    parts = parts_of(len(triangles), SMALLEST_PART)
    for_parts(_look, parts, *found, triangles, looked, squares, starts, mask, tiles, masks)
    return Visits(starts, tiles, masks, np.ones(len(tiles), np.int64))


@kernel
def _look(
    part: int, parts: int, axes: Any, spread: Any, inward: Any, triangles: Any, looked: Any, squares: Any, starts: Any,
    mask: int, tiles: Any, masks: Any,
) -> None:  # fmt: skip
    angles = squares[:, 3] + MARGIN
    turns = np.stack((np.sin(angles), np.cos(angles)), axis=1)
    _, threads, most = looked.shape
    for t in range(part * len(triangles) // parts, (part + 1) * len(triangles) // parts):
        p, rows = triangles[t], t if len(looked) > 1 else 0
        own = (np.sin(spread[p]), np.cos(spread[p]))
        for k in range(threads):
            at = starts[t * threads + k]
            for n in range(most):
                square = looked[rows, k, n]
                if square >= 0:
                    tiles[at] = square
                    masks[at] = 0 if _misses(axes, spread, inward, p, own, squares, turns, square) else mask
                    at += 1


@kernel(lent=True)
def _misses(axes: Any, spread: Any, inward: Any, p: int, own: Any, squares: Any, turns: Any, square: int) -> bool:
    """Whether no line of sight in a cone meets triangle p; what is not a number misses nothing.

    ``own`` and ``turns``: sine and cosine of the half angles of the triangle's cone, and of each square's.
    """
    x, y, z = squares[square, 0], squares[square, 1], squares[square, 2]
    angle = squares[square, 3] + MARGIN
    if angle < np.pi / 2:
        for k in range(3):
            if inward[p, k, 0] * x + inward[p, k, 1] * y + inward[p, k, 2] * z < -turns[square, 0]:
                return True
    together = angle + spread[p]
    if spread[p] < np.pi / 2 and together < np.pi:
        between = axes[p, 0] * x + axes[p, 1] * y + axes[p, 2] * z
        apart = between - (turns[square, 1] * own[1] - turns[square, 0] * own[0])
        return bool(apart < 0) if abs(apart) > UNSURE else bool(between < np.cos(together))
    return False
