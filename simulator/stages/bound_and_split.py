"""Bound and split: patches are examined and subdivided breadth-first until they are small on screen.

Eisenacher & Loop 2010, section 3.1, after Eisenacher, Meyer & Loop 2009. urPatches are transformed once. Each pass an
oracle examines every sub-patch of the queue and writes how many slots it wants in the next one: 0 to cull, 1 to keep,
4 to subdivide; a scan turns that into places; subdivide fills the other queue. Splitting happens in the parameter
domain: a sub-patch is a patch index and a square of the unit square.

"Smaller than a certain screen space size" leaves open how a box is measured. ``bound_rule`` is that choice, one for
all models and never for a cell:

- ``control_points``: the box of the 16 projected control points is less than the bound wide and high. The front end
  of the H200 measurements does so, and all its queue passes come out the same here.
- ``pixel_extent``: the same box in whole pixels, ``floor(x1) - floor(x0) <= bound``: all boxes that are sure to lie in
  four tiles as large as the bound. It explains how many more patches the paper has at a bound of 8 than
  ``control_points`` gives, on every model alike (figures in ``simulator/scenes/views.py``).
"""

from enum import IntEnum
from typing import Any, Literal, NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import ArrayLike, NDArray

from models.errors import TilestampError
from models.simt import Simt
from simulator.stages.bezier import restrict, restriction, screen_points
from simulator.stages.bucket_scan import bucket_scan
from simulator.stages.split_counts import oracle_work, scan_works, subdivide_work, transform_work
from simulator.work import Work

BLOCK = 256  # threads, a sub-patch each
MAX_DEPTH = 14  # halvings: a queue entry packs level, i and j into 4 + 14 + 14 bits
MAX_QUEUE = 2**24  # sub-patches

BoundRule = Literal["control_points", "pixel_extent"]
BOUND_RULES = ("control_points", "pixel_extent")


class SubPatches(NamedTuple):
    """Sub-patches in the order of the queue: (i, j) / 2**level is the corner of a square of side 1 / 2**level.

    ``passes`` says how they came about: queue length, culled, kept, split, given up of each pass.
    """

    patch: NDArray[np.int32]  # (N,) index of the urPatch
    level: NDArray[np.uint8]  # (N,)
    i: NDArray[np.uint16]  # (N,) along u
    j: NDArray[np.uint16]  # (N,) along v
    passes: NDArray[np.int64]  # (passes, 5)


class Path(IntEnum):
    """What the oracle found, and the way it took."""

    CULL = 0  # off screen, or wholly behind the eye
    KEEP = 1
    GIVE_UP = 2  # still large, or still across the eye plane, at the depth limit
    ACROSS = 3  # split without a box: across the eye plane
    SPLIT = 4


CULL, KEEP, GIVE_UP, ACROSS, SPLIT = (int(path) for path in Path)
_SLOTS = np.array([0, 1, 0, 4, 4], np.uint32)  # wanted in the next queue, by path


@njit(cache=True, nogil=True)
def _is_small(x0: Any, y0: Any, x1: Any, y1: Any, bound: Any, whole_pixels: Any) -> Any:
    """Whether a box satisfies the bound."""
    if whole_pixels:
        return np.floor(x1) - np.floor(x0) <= bound and np.floor(y1) - np.floor(y0) <= bound
    return x1 - x0 < bound and y1 - y0 < bound


@njit(cache=True, nogil=True)
def _examine(net: Any, width: Any, height: Any, bound: Any, whole_pixels: Any) -> Any:
    """Path of a sub-patch with the control points ``net`` (3, 16): x w, y w in pixels, and w."""
    front = behind = left = right = above = below = 0
    for k in range(16):
        x, y, w = net[0, k], net[1, k], net[2, k]
        front += w > 0
        behind += w <= 0
        left += x < 0
        right += x > width * w
        above += y < 0
        below += y > height * w
    if behind == 16 or left == 16 or right == 16 or above == 16 or below == 16:
        return CULL
    if front < 16:
        return ACROSS
    x0 = y0 = np.float32(np.inf)
    x1 = y1 = np.float32(-np.inf)
    for k in range(16):
        scale = np.float32(1) / net[2, k]
        x, y = net[0, k] * scale, net[1, k] * scale
        x0, x1 = min(x0, x), max(x1, x)
        y0, y1 = min(y0, y), max(y1, y)
    return KEEP if _is_small(x0, y0, x1, y1, bound, whole_pixels) else SPLIT


@njit(cache=True, nogil=True)
def _oracle_block(
    start: Any, stop: Any, screen: Any, queue: Any, path: Any, size: Any, bound: Any, whole_pixels: Any, max_depth: Any
) -> Any:
    """Examine the sub-patches start..stop-1; one that was kept before is kept again."""
    by_u = np.empty((4, 4), np.float32)
    by_v = np.empty((4, 4), np.float32)
    between = np.empty(16, np.float32)
    net = np.empty((3, 16), np.float32)
    for k in range(start, stop):
        if path[k] == KEEP:
            continue
        side = np.float32(1) / np.float32(1 << queue.level[k])
        restriction(np.float32(queue.i[k]) * side, np.float32(queue.i[k] + 1) * side, by_u)
        restriction(np.float32(queue.j[k]) * side, np.float32(queue.j[k] + 1) * side, by_v)
        restrict(screen[queue.patch[k]], by_u, by_v, between, net)
        found = _examine(net, size[0], size[1], bound, whole_pixels)
        path[k] = GIVE_UP if found >= ACROSS and queue.level[k] >= max_depth else found


@njit(cache=True, nogil=True, parallel=True)
def _oracle(screen: Any, queue: Any, path: Any, size: Any, bound: Any, whole_pixels: Any, max_depth: Any) -> Any:
    for block in prange(-(-path.shape[0] // BLOCK)):
        stop = min((block + 1) * BLOCK, path.shape[0])
        _oracle_block(block * BLOCK, stop, screen, queue, path, size, bound, whole_pixels, max_depth)


@njit(cache=True, nogil=True)
def _subdivide_block(start: Any, stop: Any, queue: Any, path: Any, places: Any, target: Any, target_path: Any) -> Any:
    """Move what is kept, and write the four children of what is split, u first."""
    for k in range(start, stop):
        place = places[k]
        if path[k] == KEEP:
            target.patch[place] = queue.patch[k]
            target.level[place] = queue.level[k]
            target.i[place], target.j[place] = queue.i[k], queue.j[k]
            target_path[place] = KEEP
        elif path[k] >= ACROSS:
            for child in range(4):
                target.patch[place + child] = queue.patch[k]
                target.level[place + child] = queue.level[k] + 1
                target.i[place + child] = 2 * queue.i[k] + (child & 1)
                target.j[place + child] = 2 * queue.j[k] + (child >> 1)
                target_path[place + child] = CULL  # not yet examined


@njit(cache=True, nogil=True, parallel=True)
def _subdivide(queue: Any, path: Any, places: Any, target: Any, target_path: Any) -> Any:
    for block in prange(-(-path.shape[0] // BLOCK)):
        stop = min((block + 1) * BLOCK, path.shape[0])
        _subdivide_block(block * BLOCK, stop, queue, path, places, target, target_path)


def bound_and_split(
    points: NDArray[np.float32],
    matrix: ArrayLike,
    width: int,
    height: int,
    bound: float,
    simt: Simt,
    *,
    bound_rule: BoundRule = "control_points",
    counting: bool = True,
    max_depth: int = MAX_DEPTH,
) -> tuple[SubPatches, list[Work]]:
    """Subdivide patches until their sub-patches are small on screen.

    Parameters
    ----------
    points : ndarray, (P, 16, 4), float32
        Homogeneous control points (wx, wy, wz, w) with positive weights.
    matrix : array-like, (4, 4)
        Model to clip space, for column vectors.
    width, height : int
        Pixels.
    bound : float
        Pixels that the box of a sub-patch may be wide and high.
    simt : Simt
    bound_rule : {"control_points", "pixel_extent"}
        How a box is measured; see the module.
    counting : bool
        Without it no works come back.
    max_depth : int
        Halvings after which a sub-patch that is still large, or across the eye plane, is given up: it is dropped and
        counted in ``SubPatches.passes``.

    Returns
    -------
    subpatches : SubPatches
    works : list of Work
        Transform; then oracle, scan and subdivide of each pass. A row a block.

    Raises
    ------
    TilestampError
        Options out of range, numbers that are not finite, or more than 16 M sub-patches.
    """
    _check(points, bound, bound_rule, max_depth)
    screen = screen_points(points, matrix, width, height)
    size, limit = np.array([width, height], np.float32), np.float32(bound)
    queue, path = _first_queue(len(points))
    works = [transform_work(len(points), simt)] if counting else []
    passes = []
    while True:
        _oracle(screen, queue, path, size, limit, bound_rule == "pixel_extent", max_depth)
        slots = _SLOTS[path]
        places, scan = bucket_scan(slots, simt, counting=counting)
        culled, kept, given_up, across, split = (int(n) for n in np.bincount(path, minlength=len(Path)))
        passes.append([len(path), culled, kept, across + split, given_up])
        if counting:
            works += [oracle_work(queue.patch, path, simt), *scan_works(scan)]
        if kept == len(path):
            break
        if counting:
            works.append(subdivide_work(path, places, simt))
        queue, path = _next_queue(queue, path, places, int(slots.sum()), bound)
        if across + split == 0:
            break
    return SubPatches(*queue[:4], np.array(passes, np.int64)), works


def _first_queue(patches: int) -> tuple[SubPatches, NDArray[np.uint8]]:
    """Give the queue of all urPatches, not yet examined."""
    queue, path = _empty_queue(patches)
    queue.patch[:] = np.arange(patches)
    for array in (queue.level, queue.i, queue.j, path):
        array[:] = 0
    return queue, path


def _empty_queue(length: int) -> tuple[SubPatches, NDArray[np.uint8]]:
    queue = SubPatches(
        np.empty(length, np.int32),
        np.empty(length, np.uint8),
        np.empty(length, np.uint16),
        np.empty(length, np.uint16),
        np.empty((0, 5), np.int64),
    )
    return queue, np.empty(length, np.uint8)


def _next_queue(
    queue: SubPatches, path: NDArray[np.uint8], places: NDArray[np.uint32], length: int, bound: float
) -> tuple[SubPatches, NDArray[np.uint8]]:
    """Fill the other buffer."""
    if length > MAX_QUEUE:
        raise TilestampError(
            f"bound {bound:g} asks for {length} sub-patches at once, more than {MAX_QUEUE}: "
            "take a larger bound, a smaller image or a camera further away"
        )
    target, target_path = _empty_queue(length)
    _subdivide(queue, path, places, target, target_path)
    return target, target_path


def _check(points: NDArray[np.float32], bound: float, bound_rule: str, max_depth: int) -> None:
    """Refuse what the oracle would never be done with."""
    if points.ndim != 3 or points.shape[1:] != (16, 4):
        raise TilestampError(f"patches need 16 points of 4 numbers each, not an array of shape {points.shape}")
    if not (points[..., 3] > 0).all():
        raise TilestampError("the weights of control points must be positive")
    if not (np.isfinite(bound) and bound > 0):
        raise TilestampError(f"bound must be a positive number of pixels, not {bound}")
    if bound_rule not in BOUND_RULES:
        raise TilestampError(f"bound_rule must be one of {', '.join(BOUND_RULES)}, not {bound_rule}")
    if not 0 <= max_depth <= MAX_DEPTH:
        raise TilestampError(f"max_depth must lie between 0 and {MAX_DEPTH}, not {max_depth}")
