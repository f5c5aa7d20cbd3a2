"""Triangle setup, one thread: a triangle that is drawn whole, and one that is clipped."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.laine2011.clipper import MAX_VERTICES, between, clip_triangle
from tilestamp.simulator.stages.laine2011.plane_equation import reciprocal_area
from tilestamp.simulator.stages.laine2011.screen_vertices import BEYOND, CLIP, Screen
from tilestamp.simulator.stages.laine2011.subtriangle import (
    ABSENT,
    CLIPPED,
    KEPT,
    OUTSIDE,
    Corner,
    View,
    cull,
    snap,
    store_attribute_planes,
    store_depth_plane,
    store_header,
)

GUARD_BAND = 32767  # 1/16 pixel; the largest span, too, that the coverage tables allow


class Setup(NamedTuple):
    """What triangle setup leaves in memory; F input triangles, S slots.

    A triangle with one sub-triangle has it in slot t, its own; one with m >= 2 has them in ``misc[t]`` and the m - 1
    slots that follow, all beyond F, allocated in input order. Headers lie at their slots; data records lie side by
    side, so that those of what is culled take no memory.
    """

    subtriangles: NDArray[np.uint8]  # (F,) sub-triangles of each triangle, 0 to 7
    headers: NDArray[np.int16]  # (S, 6) snapped x, y of three vertices, 1/16 pixel from the viewport's centre
    misc: NDArray[np.uint32]  # (S,) least depth, rounded down to a multiple of 4096, and 12 bits of flips
    records: NDArray[np.int32]  # (S,) which data record a slot that is written has
    planes: NDArray[np.uint32]  # (S, 16) or, nvdiffrast, (S, 4): the data records
    inputs: NDArray[np.int32]  # (S,) input triangle, by record


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


@kernel(lent=True)
def _store(
    a: Corner, b: Corner, c: Corner, area: int, view: View, out: Setup, slot: int, record: int, t: int, triangles: Any
) -> None:
    """Write header and data record of one sub-triangle; a clockwise one with vertices 1 and 2 swapped."""
    if area < 0:
        b, c, area = c, b, -area
    store_header(a, b, c, view, out.headers, out.misc, slot)
    out.records[slot], out.inputs[record] = record, t
    mantissa, shift = reciprocal_area(area)
    if view.depth:
        store_depth_plane(a, b, c, mantissa, shift, view, out.planes, record)
    if out.planes.shape[1] == 4:
        out.planes[record, 3] = np.uint32(t + 1)
        return
    if view.interpolate:
        store_attribute_planes(a, b, c, mantissa, shift, view, out.planes, record)
    for k in range(3):
        out.planes[record, 13 + k] = np.uint32(triangles[t, k])


@kernel(lent=True)
def _fan_corner(clip: Any, polygon: Any, i: int, view: View) -> Any:
    u, v = polygon[i, 0], polygon[i, 1]
    x, y = between(clip[0, 0], clip[1, 0], clip[2, 0], u, v), between(clip[0, 1], clip[1, 1], clip[2, 1], u, v)
    z, w = between(clip[0, 2], clip[1, 2], clip[2, 2], u, v), between(clip[0, 3], clip[1, 3], clip[2, 3], u, v)
    return snap(x, y, z, w, u, v, view)


@kernel(lent=True)
def _fan(
    clip: Any, polygon: Any, n: int, view: View, out: Setup, slot: int, record: int, t: int, triangles: Any
) -> Any:
    """Count the surviving triangles of a clipped polygon; from ``slot`` on, where not negative, write them."""
    kept = 0
    if n < 3:
        return kept
    a = b = _fan_corner(clip, polygon, np.int64(0), view)  # a literal index would be compiled by itself
    for i in range(1, n):
        c = _fan_corner(clip, polygon, i, view)
        outcome, area, _ = cull(a.sx, a.sy, b.sx, b.sy, c.sx, c.sy, view)
        if i >= 2 and outcome == KEPT:
            if slot >= 0:
                _store(a, b, c, area, view, out, slot + kept, record + kept, t, triangles)
            kept += 1
        b = c
    return kept


@kernel(lent=True, inline=True)
def whole_outcome(screen: Screen, triangles: Any, t: int, view: View) -> Any:
    """Outcome of a triangle if it needs no clipping (``CLIPPED`` if it does), its area, and the sites looked at."""
    i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
    if min(i, j, k) < 0 or max(i, j, k) >= screen.codes.size:
        return ABSENT, 0, 0
    p, q, r = screen.codes[i], screen.codes[j], screen.codes[k]
    if p & q & r & BEYOND:
        return OUTSIDE, 0, 0
    if (p | q | r) & CLIP:
        return CLIPPED, 0, 0
    ax, bx, cx = np.int64(screen.places[i, 0]), np.int64(screen.places[j, 0]), np.int64(screen.places[k, 0])
    ay, by, cy = np.int64(screen.places[i, 1]), np.int64(screen.places[j, 1]), np.int64(screen.places[k, 1])
    if view.guard_band:
        low, high = min(ax, bx, cx, ay, by, cy), max(ax, bx, cx, ay, by, cy)
        if low < -GUARD_BAND - 1 or high > GUARD_BAND or high - low > GUARD_BAND:
            return CLIPPED, 0, 0
    return cull(ax, ay, bx, by, cx, cy, view)


@kernel(lent=True, inline=True)
def _corner(screen: Screen, positions: Any, i: int, u: Any, v: Any) -> Any:
    """Make a corner of an input vertex."""
    place, ratio = screen.places[i], screen.ratios[i]
    return Corner(np.int64(place[0]), np.int64(place[1]), ratio[0], ratio[1], positions[i, 3], u, v)


@kernel(lent=True, inline=True)
def store_whole(
    screen: Screen, positions: Any, triangles: Any, t: int, record: int, area: int, view: View, out: Setup
) -> None:
    """Write a triangle that needs no clipping to its own slot."""
    zero, one = np.float32(0), np.float32(1)
    a = _corner(screen, positions, triangles[t, 0], zero, zero)
    b = _corner(screen, positions, triangles[t, 1], one, zero)
    c = _corner(screen, positions, triangles[t, 2], zero, one)
    _store(a, b, c, area, view, out, t, record, t, triangles)


@kernel(lent=True)
def clip_and_store(
    scratch: Scratch, positions: Any, view: View, out: Setup, slot: int, record: int, t: int, triangles: Any
) -> Any:
    """Clip one triangle and write what survives (a single survivor to the own slot); returns survivors and fan size."""
    clip, polygon = scratch.clip, scratch.polygon
    for k in range(3):
        for c in range(4):
            clip[k, c] = positions[triangles[t, k], c]
    n = clip_triangle(clip, polygon, scratch.spare, scratch.plane, scratch.steps)
    kept = _fan(clip, polygon, n, view, out, slot, record, t, triangles)
    if kept == 1 and slot < 0:
        _fan(clip, polygon, n, view, out, t, record, t, triangles)
    return kept, max(n - 2, 0)
