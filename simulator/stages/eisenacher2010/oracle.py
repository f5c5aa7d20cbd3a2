"""The oracle of bound and split: what to do with each sub-patch (Eisenacher & Loop 2010, section 3.1).

A sub-patch is culled where all its control points lie outside one side of the screen, or behind the eye; kept where the
box of its projected points satisfies the bound; else split. Where points lie on both sides of the eye's plane there is
no box: it is split as well. Two limits that the paper lacks: sub-patches wholly nearer than ``near`` are culled too, so
that splitting across the eye's plane ends; and none is kept before ``min_depth`` halvings, so that neighbours can be
given the same depth.
"""

from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.eisenacher2010.bezier import (
    LANES,
    POINTS,
    gather,
    new_squares,
    restrict,
    restriction,
    set_square,
)


class Path(IntEnum):
    """What the oracle found, and the way it took."""

    CULL = 0  # off screen, wholly behind the eye, or wholly nearer than allowed
    KEEP = 1
    GIVE_UP = 2  # still large, or still across the eye plane, at the depth limit
    ACROSS = 3  # split without a box: across the eye plane
    SPLIT = 4


CULL, KEEP, GIVE_UP, ACROSS, SPLIT = (int(path) for path in Path)


class _Scratch(NamedTuple):
    """Sub-patches side by side, and what the oracle finds out about them."""

    by_u: NDArray[np.float32]  # (4, 4, LANES)
    by_v: NDArray[np.float32]
    between: NDArray[np.float32]  # (4, 4, LANES)
    gathered: NDArray[np.int32]  # (LANES,) patch whose points are in ``patch_net``
    patch_net: NDArray[np.float32]  # (3, 16, LANES) x w, y w in pixels, and w
    net: NDArray[np.float32]  # (3, 16, LANES)
    everywhere: NDArray[np.int32]  # (LANES,) sides of the frustum that all points lie outside of
    anywhere: NDArray[np.int32]  # (LANES,) that a point lies outside of
    box: NDArray[np.float32]  # (4, LANES) x0, y0, x1, y1


_NOT_FRONT = np.int32(32)  # bit: w > 0 does not hold (it may be no number)
_OFF_SCREEN = np.int32(31)  # bits: the four sides of the screen, and w <= near
_ROW = POINTS * LANES  # a coordinate of all points


@kernel
def _new_scratch(side: Any, lanes: Any) -> Any:
    return _Scratch(
        np.empty(4 * side * lanes, np.float32),
        np.empty(4 * side * lanes, np.float32),
        np.empty(side * side * lanes, np.float32),
        np.full(lanes, -1, np.int32),
        np.empty(3 * POINTS * lanes, np.float32),
        np.empty(3 * POINTS * lanes, np.float32),
        np.empty(lanes, np.int32),
        np.empty(lanes, np.int32),
        np.empty((4, lanes), np.float32),
    )


@kernel(lent=True)
def _is_small(x0: Any, y0: Any, x1: Any, y1: Any, bound: Any, whole_pixels: Any) -> Any:
    """Whether a box satisfies the bound."""
    if whole_pixels:
        return np.floor(x1) - np.floor(x0) <= bound and np.floor(y1) - np.floor(y0) <= bound
    return x1 - x0 < bound and y1 - y0 < bound


@kernel(error_model="numpy", lent=True)
def _measure(s: _Scratch, width: Any, height: Any, near: Any) -> None:
    """Sides of the frustum and boxes of all lanes; a box means nothing where a point lies behind the eye."""
    net, box = s.net, s.box
    s.everywhere[:] = -1
    s.anywhere[:] = 0
    box[:2] = np.inf
    box[2:] = -np.inf
    lanes = s.everywhere.shape[0]
    for k in range(0, POINTS * LANES, LANES):
        for n in range(lanes):
            x, y, w = net[k + n], net[_ROW + k + n], net[2 * _ROW + k + n]
            out = np.int32(x < 0) | np.int32(x > width * w) << 1 | np.int32(y < 0) << 2 | np.int32(y > height * w) << 3
            out |= np.int32(w <= near) << 4 | np.int32(not w > 0) << 5
            s.everywhere[n] &= out
            s.anywhere[n] |= out
        for n in range(lanes):
            scale = np.float32(1) / net[2 * _ROW + k + n]
            x, y = net[k + n] * scale, net[_ROW + k + n] * scale
            box[0, n], box[1, n] = min(box[0, n], x), min(box[1, n], y)
            box[2, n], box[3, n] = max(box[2, n], x), max(box[3, n], y)


@kernel(lent=True)
def _path(s: _Scratch, n: Any, bound: Any, whole_pixels: Any) -> Any:
    """What was found about lane ``n``."""
    if s.everywhere[n] & _OFF_SCREEN:
        return CULL
    if s.anywhere[n] & _NOT_FRONT:
        return ACROSS
    return KEEP if _is_small(s.box[0, n], s.box[1, n], s.box[2, n], s.box[3, n], bound, whole_pixels) else SPLIT


@kernel
def examine(
    part: int,
    parts: int,
    side: Any,
    width: Any,
    screen: Any,
    queue: Any,
    path: Any,
    size: Any,
    bound: Any,
    whole_pixels: Any,
    min_depth: Any,
    max_depth: Any,
) -> None:
    """Examine one part of the queue, ``width`` (LANES) at once; a sub-patch that was kept before is kept again.

    ``size`` is width and height of the screen in pixels, and the nearest w that is drawn.
    """
    s, squares = _new_scratch(side, width), new_squares(width)
    picked = np.empty(LANES, np.int64)
    k, stop = part * path.shape[0] // parts, (part + 1) * path.shape[0] // parts
    while k < stop:
        lanes = 0
        while k < stop and lanes < LANES:
            if path[k] != KEEP:
                set_square(squares, lanes, queue, k)
                picked[lanes] = k
                lanes += 1
            k += 1
        restriction(squares.i, squares.side, s.by_u)
        restriction(squares.j, squares.side, s.by_v)
        gather(screen, squares.patch, s.gathered, s.patch_net)
        restrict(s.patch_net, s.by_u, s.by_v, s.between, s.net)
        _measure(s, size[0], size[1], size[2])
        for n in range(lanes):
            found = _path(s, n, bound, whole_pixels)
            if found == KEEP and queue.level[picked[n]] < min_depth:
                found = SPLIT
            path[picked[n]] = GIVE_UP if found >= ACROSS and queue.level[picked[n]] >= max_depth else found
