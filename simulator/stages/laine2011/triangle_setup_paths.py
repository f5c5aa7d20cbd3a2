"""Triangle setup, one thread: the fast path of a triangle inside the frustum, and the clipper's path."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.laine2011.clipper import MAX_VERTICES, between, clip_triangle
from tilestamp.simulator.stages.laine2011.plane_equation import reciprocal_area
from tilestamp.simulator.stages.laine2011.subtriangle import (
    Corner,
    View,
    cull,
    snap,
    store_attribute_planes,
    store_depth_plane,
    store_header,
)

GUARD_BAND = 32767  # 1/16 pixel; the largest span, too, that the coverage tables allow
WARP = 32
CLIPPED = -1  # outcome of the fast path: go to the clipper
OUTSIDE = -2  # outside one view plane


class Setup(NamedTuple):
    """What triangle setup leaves in memory; F input triangles, S slots.

    A triangle with one sub-triangle has it in slot t, its own; one with m >= 2 has them in ``first[t]`` and the m - 1
    slots that follow, all beyond F, allocated in input order.
    """

    subtriangles: NDArray[np.uint8]  # (F,) sub-triangles of each triangle, 0 to 7
    first: NDArray[np.int32]  # (F,) slot of the first
    headers: NDArray[np.int16]  # (S, 6) snapped x, y of three vertices, 1/16 pixel from the viewport's centre
    misc: NDArray[np.uint32]  # (S,) least depth, rounded down to a multiple of 4096, and 12 bits of flips
    planes: NDArray[np.uint32]  # (S, 16) or, nvdiffrast, (S, 4): the data record
    inputs: NDArray[np.int32]  # (S,) input triangle


class Scratch(NamedTuple):
    """Working memory of one worker."""

    clip: NDArray[np.float32]  # (3, 4) corners of the triangle in hand
    polygon: NDArray[np.float32]  # (n, 2) barycentrics of its clipped polygon
    spare: NDArray[np.float32]
    plane: NDArray[np.float32]
    steps: NDArray[np.int64]  # (6,) vertices walked at each clip plane


@kernel
def new_scratch() -> Any:
    """Allocate the working memory of one worker."""
    f32 = np.float32
    return Scratch(
        np.empty((3, 4), f32), np.empty((MAX_VERTICES, 2), f32), np.empty((MAX_VERTICES, 2), f32), np.empty(3, f32),
        np.zeros(6, np.int64),
    )  # fmt: skip


@kernel
def _beyond(x0: Any, w0: Any, x1: Any, w1: Any, x2: Any, w2: Any) -> Any:
    """Whether three corners lie beyond one of the two view planes of an axis."""
    return (w0 < x0 and w1 < x1 and w2 < x2) or (w0 < -x0 and w1 < -x1 and w2 < -x2)


@kernel
def _outside(c: Any) -> Any:
    """Whether all corners lie beyond one view plane (only looked at where the first corner is outside)."""
    w0, w1, w2 = c[0, 3], c[1, 3], c[2, 3]
    if not (w0 < abs(c[0, 0]) or w0 < abs(c[0, 1]) or w0 < abs(c[0, 2])):
        return False
    return (
        _beyond(c[0, 0], w0, c[1, 0], w1, c[2, 0], w2)
        or _beyond(c[0, 1], w0, c[1, 1], w1, c[2, 1], w2)
        or _beyond(c[0, 2], w0, c[1, 2], w1, c[2, 2], w2)
    )


@kernel
def _inside(clip: Any, first_axis: int) -> Any:
    """Whether no corner leaves the frustum along the axes from ``first_axis`` on; a NaN among numbers is ignored."""
    for k in range(3):
        seen = False
        w = clip[k, 3]
        for axis in range(first_axis, 3):
            magnitude = abs(clip[k, axis])
            if w < magnitude:
                return False
            seen |= magnitude >= np.float32(0)
        if not seen or w != w:  # noqa: PLR0124 - NaN
            return False
    return True


@kernel
def _in_guard_band(a: Corner, b: Corner, c: Corner) -> Any:
    low, high = min(a.sx, b.sx, c.sx, a.sy, b.sy, c.sy), max(a.sx, b.sx, c.sx, a.sy, b.sy, c.sy)
    return low >= -GUARD_BAND - 1 and high <= GUARD_BAND and high - low <= GUARD_BAND


@kernel
def _store(
    a: Corner, b: Corner, c: Corner, area: int, view: View, out: Setup, slot: int, t: int, triangles: Any
) -> None:
    """Write header and data record of one sub-triangle; a clockwise one with vertices 1 and 2 swapped."""
    if area < 0:
        b, c, area = c, b, -area
    store_header(a, b, c, view, out.headers, out.misc, slot)
    out.inputs[slot] = t
    mantissa, shift = reciprocal_area(area)
    if view.depth:
        store_depth_plane(a, b, c, mantissa, shift, view, out.planes, slot)
    if out.planes.shape[1] == 4:
        out.planes[slot, 3] = np.uint32(t + 1)
        return
    if view.interpolate:
        store_attribute_planes(a, b, c, mantissa, shift, view, out.planes, slot)
    for k in range(3):
        out.planes[slot, 13 + k] = np.uint32(triangles[t, k])


@kernel
def _fan_corner(clip: Any, polygon: Any, i: int, view: View) -> Any:
    u, v = polygon[i, 0], polygon[i, 1]
    x, y = between(clip[0, 0], clip[1, 0], clip[2, 0], u, v), between(clip[0, 1], clip[1, 1], clip[2, 1], u, v)
    z, w = between(clip[0, 2], clip[1, 2], clip[2, 2], u, v), between(clip[0, 3], clip[1, 3], clip[2, 3], u, v)
    return snap(x, y, z, w, u, v, view)


@kernel
def _fan(clip: Any, polygon: Any, n: int, view: View, out: Setup, slot: int, t: int, triangles: Any) -> Any:
    """Count the surviving triangles of a clipped polygon; from ``slot`` on, where not negative, write them."""
    kept = 0
    if n < 3:
        return kept
    a = b = _fan_corner(clip, polygon, np.int64(0), view)  # a literal index would be compiled by itself
    for i in range(1, n):
        c = _fan_corner(clip, polygon, i, view)
        outcome, area, _ = cull(a, b, c, view)
        if i >= 2 and outcome == 0:
            if slot >= 0:
                _store(a, b, c, area, view, out, slot + kept, t, triangles)
            kept += 1
        b = c
    return kept


@kernel
def load_corners(positions: Any, triangles: Any, t: int, clip: Any) -> Any:
    """Fetch the three corners; False where an index is out of range."""
    for k in range(3):
        v = triangles[t, k]
        if v < 0 or v >= positions.shape[0]:
            return False
        for c in range(4):
            clip[k, c] = positions[v, c]
    return True


@kernel
def fast_path(clip: Any, view: View, out: Setup, t: int, triangles: Any) -> Any:
    """Outcome of a triangle that needs no clipping (CLIPPED where it does), and the sample sites looked at.

    A kept triangle is written to its own slot.
    """
    if _outside(clip):
        return OUTSIDE, 0
    if not _inside(clip, 2 if view.guard_band else 0):
        return CLIPPED, 0
    zero, one = np.float32(0), np.float32(1)
    a = snap(clip[0, 0], clip[0, 1], clip[0, 2], clip[0, 3], zero, zero, view)
    b = snap(clip[1, 0], clip[1, 1], clip[1, 2], clip[1, 3], one, zero, view)
    c = snap(clip[2, 0], clip[2, 1], clip[2, 2], clip[2, 3], zero, one, view)
    if view.guard_band and not _in_guard_band(a, b, c):
        return CLIPPED, 0
    outcome, area, sites = cull(a, b, c, view)
    if outcome == 0:
        _store(a, b, c, area, view, out, t, t, triangles)
    return outcome, sites


@kernel
def clip_and_store(scratch: Scratch, view: View, out: Setup, slot: int, t: int, triangles: Any) -> Any:
    """Clip one triangle and write what survives (a single survivor to the own slot); returns survivors and fan size."""
    clip, polygon = scratch.clip, scratch.polygon
    n = clip_triangle(clip, polygon, scratch.spare, scratch.plane, scratch.steps)
    kept = _fan(clip, polygon, n, view, out, slot, t, triangles)
    if kept == 1 and slot < 0:
        _fan(clip, polygon, n, view, out, t, t, triangles)
    return kept, max(n - 2, 0)
