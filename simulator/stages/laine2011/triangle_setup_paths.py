"""Triangle setup, second half: a triangle that is drawn whole, and one that is clipped, are written."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.bits import lowest_bit
from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.borrow import borrow
from tilestamp.simulator.stages.laine2011.clipper import MAX_VERTICES, between, clip_triangle
from tilestamp.simulator.stages.laine2011.plane_equation import reciprocal_area
from tilestamp.simulator.stages.laine2011.screen_vertices import Screen, place_of
from tilestamp.simulator.stages.laine2011.subtriangle import (
    Corner,
    View,
    area_of,
    snap,
    store_attribute_planes,
    store_depth_plane,
    store_header,
    survives,
)

WARP = 32
BLOCK = 64  # threads, a triangle each
WHOLE, CUT = 0, 1  # columns of the masks of warps: lanes with a sub-triangle at their own slot, uncut or clipped


class Setup(NamedTuple):
    """What triangle setup leaves in memory; F input triangles, S slots.

    A triangle with one sub-triangle has it in slot t, its own; one with m >= 2 has them in ``misc[t]`` and the m - 1
    slots that follow, all beyond F, allocated in input order. Headers lie at their slots, and what no sub-triangle has
    is left as it was in memory; R data records lie side by side, so that those of what is culled take no memory.
    """

    subtriangles: NDArray[np.uint8]  # (F,) sub-triangles of each triangle, 0 to 7
    headers: NDArray[np.int16]  # (S, 6) snapped x, y of three vertices, 1/16 pixel from the viewport's centre
    misc: NDArray[np.uint32]  # (S,) least depth, rounded down to a multiple of 4096, and 12 bits of flips
    records: NDArray[np.int32]  # (S,) which data record a slot has
    planes: NDArray[np.uint32]  # (R, 16) or, nvdiffrast, (R, 4): the data records
    inputs: NDArray[np.int32]  # (R,) input triangle, by record


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
    a: Corner, b: Corner, c: Corner, whole: bool, view: View, out: Setup, slot: int, record: int, t: int, triangles: Any
) -> None:
    """Write header and data record of one sub-triangle; a clockwise one with vertices 1 and 2 swapped."""
    area = np.int64(area_of(a, b, c))
    turned = area < 0
    if turned:
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
        store_attribute_planes(a, b, c, whole, turned, mantissa, shift, view, out.planes, record)
    for k in range(3):
        out.planes[record, 13 + k] = np.uint32(triangles[3 * t + k])


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
        if i >= 2 and survives(a, b, c, view):
            if slot >= 0:
                _store(a, b, c, False, view, out, slot + kept, record + kept, t, triangles)
            kept += 1
        b = c
    return kept


@kernel(lent=True, inline=True)
def _corner(screen: Screen, positions: Any, i: int, u: Any, v: Any, view: View) -> Any:
    """Make a corner of an input vertex."""
    sx, sy = place_of(screen, positions, i, view)
    return Corner(sx, sy, screen.ratios[2 * i], screen.ratios[2 * i + 1], positions[4 * i + 3], u, v)


@kernel(lent=True)
def store_whole(screen: Screen, positions: Any, triangles: Any, t: int, record: int, view: View, out: Setup) -> None:
    """Write a triangle that needs no clipping to its own slot."""
    zero, one = np.float32(0), np.float32(1)
    i, j, k = np.int64(triangles[3 * t]), np.int64(triangles[3 * t + 1]), np.int64(triangles[3 * t + 2])
    a = _corner(screen, positions, i, zero, zero, view)
    b = _corner(screen, positions, j, one, zero, view)
    c = _corner(screen, positions, k, zero, one, view)
    _store(a, b, c, True, view, out, t, record, t, triangles)


@kernel(lent=True)
def clip_and_store(
    scratch: Scratch, positions: Any, view: View, out: Setup, slot: int, record: int, t: int, triangles: Any
) -> Any:
    """Clip one triangle and write what survives, where ``slot`` is not negative; returns survivors and fan size."""
    clip, polygon = scratch.clip, scratch.polygon
    for k in range(3):
        for c in range(4):
            clip[k, c] = positions[4 * np.int64(triangles[3 * t + k]) + c]
    n = clip_triangle(clip, polygon, scratch.spare, scratch.plane, scratch.steps)
    return _fan(clip, polygon, n, view, out, slot, record, t, triangles), max(n - 2, 0)


@kernel(lent=True)
def share_of(part: int, parts: int, triangles: int) -> Any:
    """First triangle, and that behind the last, of a share of the blocks."""
    blocks = (triangles + BLOCK - 1) // BLOCK
    return blocks * part // parts * BLOCK, min(blocks * (part + 1) // parts * BLOCK, triangles)


@kernel(lent=True)
def _store_range(
    begin: int,
    end: int,
    record: int,
    screen: Screen,
    positions: Any,
    triangles: Any,
    view: View,
    out: Setup,
    masks: Any,
    scratch: Scratch,
) -> None:
    """Write the sub-triangles that lie at the own slots of their triangles, records from ``record`` on."""
    for warp in range(begin // WARP, (end + WARP - 1) // WARP):
        left = np.uint64(masks[warp, WHOLE] | masks[warp, CUT])
        while left:
            lane = lowest_bit(left)
            left &= left - np.uint64(1)
            t = warp * WARP + lane
            if masks[warp, CUT] >> lane & 1:
                clip_and_store(scratch, positions, view, out, t, record, t, triangles)
            else:
                store_whole(screen, positions, triangles, t, record, view, out)
            record += 1


@kernel
def store_part(
    part: int,
    parts: int,
    records: Any,
    screen: Screen,
    positions: Any,
    triangles: Any,
    view: View,
    out: Setup,
    masks: Any,
) -> None:
    """Take a share of the blocks, through arrays without reference counts."""
    begin, end = share_of(part, parts, out.subtriangles.size)
    screen, positions, triangles, out = borrow(screen), borrow(positions), borrow(triangles), borrow(out)
    scratch = new_scratch()
    _store_range(begin, end, records[part], screen, positions, triangles, view, out, borrow(masks), borrow(scratch))
    scratch.steps[0] = 0  # the owner lives to here


@kernel
def store_several(several: Any, records: int, positions: Any, triangles: Any, view: View, out: Setup) -> None:
    """Write the sub-triangles of the triangles that have two or more, to the slots allocated for them."""
    scratch = new_scratch()
    for t in several:
        first = np.int64(out.misc[t])
        clip_and_store(scratch, positions, view, out, first, first + records, t, triangles)
