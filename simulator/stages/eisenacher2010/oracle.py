"""The oracle of bound and split: what to do with each sub-patch (Eisenacher & Loop 2010, section 3.1).

A sub-patch is culled where all its control points lie outside one side of the screen, or behind the eye; kept where the
box of its projected points satisfies the bound; else split. Where points lie on both sides of the eye's plane there is
no box: it is split as well. Two limits that the paper lacks: sub-patches wholly nearer than ``near`` are culled too, so
that splitting across the eye's plane ends; and none is kept before ``min_depth`` halvings, so that neighbours can be
given the same depth.
"""

from enum import IntEnum
from typing import Any

import numpy as np

from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.eisenacher2010.bezier import POINTS, places, restrict, restriction, side_of
from tilestamp.simulator.stages.vectors import bits, greatest, least


class Path(IntEnum):
    """What the oracle found, and the way it took."""

    CULL = 0  # off screen, wholly behind the eye, or wholly nearer than allowed
    KEEP = 1
    GIVE_UP = 2  # still large, or still across the eye plane, at the depth limit
    ACROSS = 3  # split without a box: across the eye plane
    SPLIT = 4


CULL, KEEP, GIVE_UP, ACROSS, SPLIT = (int(path) for path in Path)


_ALL = np.uint64(0xFFFF)  # lanes
_ZERO = np.float32(0)


@kernel(lent=True, inline=True)
def _is_small(x: Any, y: Any, bound: Any, whole_pixels: Any) -> Any:
    """Whether the box of some points satisfies the bound."""
    nowhere = np.float32(np.inf)
    x0, y0, x1, y1 = least(x, nowhere), least(y, nowhere), greatest(x, -nowhere), greatest(y, -nowhere)
    if whole_pixels:
        return np.floor(x1) - np.floor(x0) <= bound and np.floor(y1) - np.floor(y0) <= bound
    return x1 - x0 < bound and y1 - y0 < bound


@kernel(error_model="numpy", lent=True, inline=True)
def _path(x: Any, y: Any, w: Any, size: Any, bound: Any, whole_pixels: Any) -> Any:
    """What is found about control points (x w, y w, w)."""
    left, right, above, below = x < _ZERO, x > size[0] * w, y < _ZERO, y > size[1] * w
    if bits(left) == _ALL or bits(right) == _ALL or bits(above) == _ALL or bits(below) == _ALL:
        return CULL
    if bits(w <= size[2]) == _ALL:
        return CULL
    if bits(w > _ZERO) != _ALL:  # behind the eye, or no number
        return ACROSS
    scale = np.float32(1) / w
    return KEEP if _is_small(x * scale, y * scale, bound, whole_pixels) else SPLIT


@kernel
def examine(
    part: int,
    parts: int,
    screen: Any,
    queue: Any,
    path: Any,
    size: Any,
    bound: Any,
    whole_pixels: Any,
    min_depth: Any,
    max_depth: Any,
) -> None:
    """Examine one part of the queue; a sub-patch that was kept before is kept again.

    ``screen`` has the urPatches' control points, 64 numbers each. ``size`` is width and height of the screen in pixels,
    and the nearest w that is drawn.
    """
    column, row = places()
    for k in range(part * path.shape[0] // parts, (part + 1) * path.shape[0] // parts):
        if path[k] == KEEP:
            continue
        level, at = queue.level[k], 4 * POINTS * np.int64(queue.patch[k])
        by_u = restriction(queue.i[k], side_of(level), column)
        by_v = restriction(queue.j[k], side_of(level), row)
        x, y = restrict(screen, at, by_u, by_v), restrict(screen, at + POINTS, by_u, by_v)
        w = restrict(screen, at + 2 * POINTS, by_u, by_v)
        found = _path(x, y, w, size, bound, whole_pixels)
        if found == KEEP and level < min_depth:
            found = SPLIT
        path[k] = GIVE_UP if found >= ACROSS and level >= max_depth else found
