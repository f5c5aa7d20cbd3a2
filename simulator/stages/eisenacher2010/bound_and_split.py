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

from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.kernel import kernel
from tilestamp.models.simt import Simt
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.eisenacher2010.bezier import screen_points
from tilestamp.simulator.stages.eisenacher2010.bucket_scan import bucket_scan
from tilestamp.simulator.stages.eisenacher2010.oracle import ACROSS, CULL, KEEP, Path, examine
from tilestamp.simulator.stages.eisenacher2010.split_counts import (
    oracle_work,
    scan_works,
    subdivide_work,
    transform_work,
)

BLOCK = 256  # threads, a sub-patch each
MAX_DEPTH = 14  # halvings: a queue entry packs level, i and j into 4 + 14 + 14 bits
MAX_QUEUE = 2**24  # sub-patches

BoundRule = Literal["control_points", "pixel_extent"]


class SubPatches(NamedTuple):
    """Sub-patches in the order of the queue: (i, j) / 2**level is the corner of a square of side 1 / 2**level.

    ``passes`` says how they came about: queue length, culled, kept, split, given up of each pass.
    """

    patch: NDArray[np.int32]  # (N,) index of the urPatch
    level: NDArray[np.uint8]  # (N,)
    i: NDArray[np.uint16]  # (N,) along u
    j: NDArray[np.uint16]  # (N,) along v
    passes: NDArray[np.int64]  # (passes, 5)


@kernel(lent=True)
def _subdivide(
    part: int, parts: int, queue: SubPatches, path: Any, places: Any, target: SubPatches, target_path: Any
) -> None:
    """Move what is kept, and write the four children of what is split, u first: one part of the queue."""
    for k in range(part * path.shape[0] // parts, (part + 1) * path.shape[0] // parts):
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
    near: float = 0.0,
    min_depth: int = 0,
    max_depth: int = MAX_DEPTH,
) -> StageResult[SubPatches]:
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
    near : float
        Sub-patches that lie wholly nearer to the eye's plane are culled (not in the paper).
    min_depth : int
        Halvings that every sub-patch on screen takes; as many as the deepest needs make all alike, and no cracks.
    max_depth : int
        Halvings after which a sub-patch that is still large, or across the eye plane, is given up: it is dropped and
        counted in ``SubPatches.passes``.

    Returns
    -------
    outputs : SubPatches
    works : transform; then oracle, scan and subdivide of each pass; a row a block

    Raises
    ------
    TilestampError
        Numbers that are not finite, or more than 16 M sub-patches.
    """
    _check(points, min_depth, max_depth)
    screen = screen_points(points, matrix, width, height)
    size, limit = np.array([width, height, near], np.float32), np.float32(bound)
    queue, path = _first_queue(len(points))
    works = [transform_work(len(points), simt)] if counting else []
    passes = []
    while True:
        whole_pixels = bound_rule == "pixel_extent"
        parts = parts_of(len(path), BLOCK)
        for_parts(
            examine, parts, screen.reshape(-1), queue, path, size, limit, whole_pixels,
            min_depth, max_depth,
        )  # fmt: skip
        slots = (path == KEEP).astype(np.uint32)
        slots += np.uint32(4) * (path >= ACROSS)
        places, scan, _ = bucket_scan(slots, simt, counting=counting)
        culled, kept, given_up, across, split = (int(np.count_nonzero(path == way)) for way in Path)
        passes.append([len(path), culled, kept, across + split, given_up])
        if counting:
            works += [oracle_work(queue.patch, path, simt), *scan_works(scan)]
        if kept == len(path):
            break
        if counting:
            works.append(subdivide_work(path, places, simt))
        queue, path = _next_queue(queue, path, places, kept + 4 * (across + split), bound)
        if across + split == 0:
            break
    return StageResult(SubPatches(*queue[:4], np.array(passes, np.int64)), tuple(works))


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
    queue: SubPatches,
    path: NDArray[np.uint8],
    places: NDArray[np.uint32],
    length: int,
    bound: float,
) -> tuple[SubPatches, NDArray[np.uint8]]:
    """Fill the other buffer."""
    if length > MAX_QUEUE:
        raise TilestampError(
            f"bound {bound:g} asks for {length} sub-patches at once, more than {MAX_QUEUE}: "
            "take a larger bound, a smaller image or a camera further away"
        )
    target, target_path = _empty_queue(length)
    parts = parts_of(len(path), BLOCK)
    for_parts(_subdivide, parts, queue, path, places, target, target_path)
    return target, target_path


def _check(points: NDArray[np.float32], min_depth: int, max_depth: int) -> None:
    """Refuse what the oracle would never be done with."""
    if points.ndim != 3 or points.shape[1:] != (16, 4):
        raise TilestampError(f"patches need 16 points of 4 numbers each, not an array of shape {points.shape}")
    if not (points[..., 3] > 0).all():
        raise TilestampError("the weights of control points must be positive")
    if min_depth > max_depth:
        raise TilestampError(f"min_depth is at most max_depth ({max_depth}), not {min_depth}")
    if not 0 <= max_depth <= MAX_DEPTH:
        raise TilestampError(f"max_depth must lie between 0 and {MAX_DEPTH}, not {max_depth}")
