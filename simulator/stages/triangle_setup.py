"""Triangle setup: one thread an input triangle, culls, clips, snaps and writes sub-triangles (cudaraster, first stage).

Two published releases: "1.1" (Laine & Karras 2011) has a guard band in x and y and culls backfaces; "nvdiffrast"
(2022) clips whatever leaves the frustum and keeps backfaces unless told otherwise.
"""

from enum import IntEnum
from typing import Any, Literal, NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from models.coalescing import transactions
from models.errors import TilestampError
from models.simt import Simt
from simulator.stages.clipper import MAX_VERTICES, clip_triangle, polygon_component
from simulator.stages.borrow import borrow
from simulator.stages.plane_equation import reciprocal_area
from simulator.stages.subtriangle import View, cull, snap, store_attribute_planes, store_depth_plane, store_header
from simulator.work import Work

Release = Literal["1.1", "nvdiffrast"]

BLOCK = 64  # threads, a triangle each
WARP = 32
SHARED_BYTES = 4608  # the clip polygons of 64 threads
SLACK = 4096  # sub-triangle slots beyond one for each triangle, at first
MAX_SUBTRIANGLES = 2**24
MAX_SIZE = 2048  # pixels along an axis: 16 bins of 16 tiles of 8 pixels
GUARD_BAND = 32767  # 1/16 pixel; the largest span, too, that the coverage tables allow
SUBTRIANGLE_BYTES = {"1.1": 81, "nvdiffrast": 33}  # count 1, header 16, data 64 or 16
INDEX_BYTES, POSITION_BYTES, HEADER_BYTES = 12, 16, 16
_CHUNK_BLOCKS = 64  # blocks that one call of the worker takes


class TriangleSetupEvent(IntEnum):
    """Events of one block of 64 threads. WARPS and STEPS are warp executions, LANES the active lanes in them."""

    WARPS = 0  # warps with a triangle: each reads indices and vertices and tests the view planes
    TRIANGLE_LANES = 1
    VIEWPORT_CULLED = 2  # lanes whose triangle is outside one view plane
    SNAP_WARPS = 3  # project, snap and cull without clipping
    SNAP_LANES = 4
    BACKFACE_CULLED = 5  # lanes: no area, or turned away
    BETWEEN_CULLED = 6  # lanes: no sample site inside
    CLIP_WARPS = 7  # warps with a triangle in the clipper
    CLIP_LANES = 8  # triangles in the clipper
    CLIP_STEPS = 9  # polygon vertices walked, by the longest lane, at each plane
    CLIP_STEP_LANES = 10
    FAN_STEPS = 11  # triangles of clipped polygons snapped and culled, by the longest lane
    FAN_LANES = 12
    STORE_STEPS = 13  # plane equations and records, by the longest lane
    STORE_LANES = 14  # sub-triangles written
    ATOMIC = 15  # warps that allocate slots beyond the triangles' own
    ATOMIC_LANES = 16
    ATOMIC_REQUESTS = 17
    ATOMIC_CONFLICTS = 18
    ATOMIC_DEPTH = 19
    LOAD_TRANSACTIONS = 20
    LOAD_BYTES = 21
    STORE_TRANSACTIONS = 22
    STORE_BYTES = 23


_E = TriangleSetupEvent
_VIEWPORT_CULLED, _CLIP_STEPS, _FAN_STEPS, _STORE_STEPS = (
    int(e) for e in (_E.VIEWPORT_CULLED, _E.CLIP_STEPS, _E.FAN_STEPS, _E.STORE_STEPS)
)
_CLIPPED = -1  # outcome of the fast path: go to the clipper
_OUTSIDE = -2  # outside one view plane


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
    longest: NDArray[np.int64]  # (10,) maxima over the warp
    lanes: NDArray[np.int64]  # (32,) addresses
    read: NDArray[np.bool_]  # (32,) triangles with indices in range


@njit(cache=True, nogil=True)
def _new_scratch():
    f32, i64 = np.float32, np.int64
    return Scratch(
        np.empty((3, 4), f32), np.empty((MAX_VERTICES, 2), f32), np.empty((MAX_VERTICES, 2), f32), np.empty(3, f32),
        np.zeros(6, i64), np.zeros(10, i64), np.empty(WARP, i64), np.zeros(WARP, np.bool_),
    )  # fmt: skip


@njit(cache=True, nogil=True)
def _beyond(x0, w0, x1, w1, x2, w2):
    """Whether three corners lie beyond one of the two view planes of an axis."""
    return (w0 < x0 and w1 < x1 and w2 < x2) or (w0 < -x0 and w1 < -x1 and w2 < -x2)


@njit(cache=True, nogil=True)
def _outside(c):
    """Whether all corners lie beyond one view plane (only looked at where the first corner is outside)."""
    w0, w1, w2 = c[0, 3], c[1, 3], c[2, 3]
    if not (w0 < abs(c[0, 0]) or w0 < abs(c[0, 1]) or w0 < abs(c[0, 2])):
        return False
    return (
        _beyond(c[0, 0], w0, c[1, 0], w1, c[2, 0], w2)
        or _beyond(c[0, 1], w0, c[1, 1], w1, c[2, 1], w2)
        or _beyond(c[0, 2], w0, c[1, 2], w1, c[2, 2], w2)
    )


@njit(cache=True, nogil=True)
def _inside(clip, first_axis):
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


@njit(cache=True, nogil=True)
def _in_guard_band(a, b, c):
    low, high = min(a.sx, b.sx, c.sx, a.sy, b.sy, c.sy), max(a.sx, b.sx, c.sx, a.sy, b.sy, c.sy)
    return low >= -GUARD_BAND - 1 and high <= GUARD_BAND and high - low <= GUARD_BAND


@njit(cache=True, nogil=True)
def _store(a, b, c, area, view, out, slot, t, triangles):
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


@njit(cache=True, nogil=True)
def _fan_corner(clip, polygon, i, view):
    x, y = polygon_component(clip, polygon, i, 0), polygon_component(clip, polygon, i, 1)
    z, w = polygon_component(clip, polygon, i, 2), polygon_component(clip, polygon, i, 3)
    return snap(x, y, z, w, polygon[i, 0], polygon[i, 1], view)


@njit(cache=True, nogil=True)
def _fan(clip, polygon, n, view, out, slot, t, triangles):
    """Count the surviving triangles of a clipped polygon; from ``slot`` on, where not negative, write them."""
    kept = 0
    if n < 3:
        return kept
    a, b = _fan_corner(clip, polygon, 0, view), _fan_corner(clip, polygon, 1, view)
    for i in range(2, n):
        c = _fan_corner(clip, polygon, i, view)
        outcome, area = cull(a, b, c, view)
        if outcome == 0:
            if slot >= 0:
                _store(a, b, c, area, view, out, slot + kept, t, triangles)
            kept += 1
        b = c
    return kept


@njit(cache=True, nogil=True)
def _load(positions, triangles, t, clip):
    """Fetch the three corners; False where an index is out of range."""
    for k in range(3):
        v = triangles[t, k]
        if v < 0 or v >= positions.shape[0]:
            return False
        for c in range(4):
            clip[k, c] = positions[v, c]
    return True


@njit(cache=True, nogil=True)
def _fast_path(clip, view, out, t, triangles):
    """Outcome of a triangle that needs no clipping (_CLIPPED where it does); a kept one is written to its own slot."""
    if _outside(clip):
        return _OUTSIDE
    if not _inside(clip, 2 if view.guard_band else 0):
        return _CLIPPED
    zero, one = np.float32(0), np.float32(1)
    a = snap(clip[0, 0], clip[0, 1], clip[0, 2], clip[0, 3], zero, zero, view)
    b = snap(clip[1, 0], clip[1, 1], clip[1, 2], clip[1, 3], one, zero, view)
    c = snap(clip[2, 0], clip[2, 1], clip[2, 2], clip[2, 3], zero, one, view)
    if view.guard_band and not _in_guard_band(a, b, c):
        return _CLIPPED
    outcome, area = cull(a, b, c, view)
    if outcome == 0:
        _store(a, b, c, area, view, out, t, t, triangles)
    return outcome


@njit(cache=True, nogil=True)
def _clip_and_store(scratch, view, out, slot, t, triangles):
    """Clip one triangle and write what survives (a single survivor to the own slot); returns survivors and fan size."""
    clip, polygon = scratch.clip, scratch.polygon
    n = clip_triangle(clip, polygon, scratch.spare, scratch.plane, scratch.steps)
    kept = _fan(clip, polygon, n, view, out, slot, t, triangles)
    if kept == 1 and slot < 0:
        _fan(clip, polygon, n, view, out, t, t, triangles)
    return kept, max(n - 2, 0)


@njit(cache=True, nogil=True)
def _longest(table, block, column, value, longest, i):
    """Add one lane to a pair of columns: steps of the longest lane of the warp, and lane steps."""
    table[block, column + 1] += value
    if value > longest[i]:
        table[block, column] += value - longest[i]
        longest[i] = value


@njit(cache=True, nogil=True)
def _count_lane(table, block, longest, outcome, kept, fan, steps):
    """Count one thread; ``longest`` holds the warp's maxima so far."""
    table[block, 1] += 1
    if outcome == _OUTSIDE:
        table[block, _VIEWPORT_CULLED] += 1
        return
    _longest(table, block, 3, 1, longest, 0)
    if outcome > 0:
        table[block, 4 + outcome] += 1
    elif outcome == 0:
        _longest(table, block, _STORE_STEPS, 1, longest, 1)
    else:
        _longest(table, block, 7, 1, longest, 2)
        for p in range(6):
            _longest(table, block, _CLIP_STEPS, steps[p], longest, 3 + p)
        _longest(table, block, _FAN_STEPS, fan, longest, 9)
        _longest(table, block, _STORE_STEPS, kept, longest, 1)
        if kept >= 2:
            table[block, 16] += 1


@njit(cache=True, nogil=True)
def _count_warp(row, allocating, positions_read, triangles, t0, t1, out, simt, lanes):
    """Count what the warp of triangles t0..t1-1 does to memory."""
    row[0] += 1
    if allocating > 0:
        row[15] += 1
        row[17] += allocating  # lanes at one address are not merged
        row[18] += allocating - 1
        row[19] += allocating
    n = t1 - t0
    for k in range(3):
        for i in range(n):
            lanes[i] = (t0 + i) * INDEX_BYTES + 4 * k
        count, size = transactions(lanes, n, 4, simt.coalescing)
        row[20] += count
        row[21] += size
        for i in range(n):
            lanes[i] = np.int64(triangles[t0 + i, k]) * POSITION_BYTES if positions_read[i] else -1
        count, size = transactions(lanes, n, 16, simt.coalescing)
        row[20] += count
        row[21] += size
    for i in range(n):
        lanes[i] = t0 + i
    count, size = transactions(lanes, n, 1, simt.coalescing)
    row[22] += count
    row[23] += size
    words = out.planes.shape[1] // 4
    for i in range(n):
        lanes[i] = (t0 + i) * HEADER_BYTES if out.subtriangles[t0 + i] > 0 else -1
    count, size = transactions(lanes, n, HEADER_BYTES, simt.coalescing)
    row[22] += count
    row[23] += size
    for part in range(words):
        for i in range(n):
            lanes[i] = (t0 + i) * HEADER_BYTES * words + 16 * part if out.subtriangles[t0 + i] == 1 else -1
        count, size = transactions(lanes, n, HEADER_BYTES, simt.coalescing)
        row[22] += count
        row[23] += size


@njit(cache=True, nogil=True)
def _setup_range(begin, end, positions, triangles, view, simt, out, scratch, table):
    """All triangles of some whole blocks; those with two or more sub-triangles are only counted here."""
    clip, longest, lanes, read = scratch.clip, scratch.longest, scratch.lanes, scratch.read
    for warp in range(begin, end, WARP):
        last = min(warp + WARP, end)
        allocating = 0
        for i in range(10):
            longest[i] = 0
        for t in range(warp, last):
            out.first[t] = t
            kept, fan, outcome = 0, 0, _OUTSIDE
            read[t - warp] = _load(positions, triangles, t, clip)
            if read[t - warp]:
                outcome = _fast_path(clip, view, out, t, triangles)
                kept = 1 if outcome == 0 else 0
            if outcome == _CLIPPED:
                kept, fan = _clip_and_store(scratch, view, out, -1, t, triangles)
                allocating += 1 if kept >= 2 else 0
            out.subtriangles[t] = kept
            if table is not None:
                _count_lane(table, t // BLOCK, longest, outcome, kept, fan, scratch.steps)
        if table is not None:
            _count_warp(table[warp // BLOCK], allocating, read, triangles, warp, last, out, simt, lanes)


@njit(cache=True, nogil=True)
def _setup_chunk(begin, end, positions, triangles, view, simt, out, table):
    """Take a chunk of the triangles, through arrays without reference counts."""
    scratch = _new_scratch()
    positions, triangles, out, lent = borrow(positions), borrow(triangles), borrow(out), borrow(scratch)
    if table is None:
        _setup_range(begin, end, positions, triangles, view, simt, out, lent, None)
    else:
        _setup_range(begin, end, positions, triangles, view, simt, out, lent, borrow(table))
    scratch.steps[0] = 0  # the owner lives to here


@njit(cache=True, nogil=True, parallel=True)
def _setup_all(positions, triangles, view, simt, out, table):
    chunk = _CHUNK_BLOCKS * BLOCK
    for c in prange((triangles.shape[0] + chunk - 1) // chunk):
        _setup_chunk(c * chunk, min((c + 1) * chunk, triangles.shape[0]), positions, triangles, view, simt, out, table)


@njit(cache=True, nogil=True)
def _setup_several(several, positions, triangles, view, out):
    """Write the sub-triangles of the triangles that have two or more, to the slots allocated for them."""
    scratch = _new_scratch()
    clip = scratch.clip
    for t in several:
        _load(positions, triangles, t, clip)
        out.misc[t] = out.first[t]
        _clip_and_store(scratch, view, out, out.first[t], t, triangles)


def make_view(
    width: int,
    height: int,
    *,
    release: Release,
    samples: int = 1,
    cull_backfaces: bool | None = None,
    depth: bool = True,
    interpolate: bool = True,
) -> View:
    """Check the viewport and the switches of a draw, and put them in the form that kernels take."""
    if release not in SUBTRIANGLE_BYTES:
        raise TilestampError(f"release is {release!r}; there is '1.1' and 'nvdiffrast'")
    if samples not in (1, 2, 4, 8) or (release == "nvdiffrast" and samples != 1):
        raise TilestampError(f"{samples} samples a pixel: release 1.1 has 1, 2, 4 and 8, and nvdiffrast has 1")
    if not (1 <= width <= MAX_SIZE and 1 <= height <= MAX_SIZE):
        raise TilestampError(
            f"size {width}x{height}: cudaraster draws 1 to {MAX_SIZE} pixels along an axis (16 bins of 128), as the original"
        )
    return View(
        half_width=8 * width,
        half_height=8 * height,
        scale_x=np.float32(8 * width),
        scale_y=np.float32(8 * height),
        log_samples=samples.bit_length() - 1,
        guard_band=release == "1.1",
        cull_backfaces=release == "1.1" if cull_backfaces is None else cull_backfaces,
        depth=depth,
        interpolate=interpolate and release == "1.1",
    )


def check_mesh(positions: NDArray[Any], triangles: NDArray[Any], *, release: Release) -> None:
    """Refuse arrays of other shapes and types, and indices that the release would not survive."""
    if positions.ndim != 2 or positions.shape[1] != 4 or positions.dtype != np.float32:
        raise TilestampError(
            f"positions are {positions.dtype} {positions.shape}; float32 (V, 4) in clip space is needed"
        )
    if triangles.ndim != 2 or triangles.shape[1] != 3 or triangles.dtype != np.int32:
        raise TilestampError(f"triangles are {triangles.dtype} {triangles.shape}; int32 (F, 3) is needed")
    if len(triangles) > MAX_SUBTRIANGLES:
        raise TilestampError(f"{len(triangles)} triangles: cudaraster takes at most {MAX_SUBTRIANGLES} a draw")
    if release == "1.1" and len(triangles) and (triangles.min() < 0 or triangles.max() >= len(positions)):
        bad = int(np.flatnonzero(((triangles < 0) | (triangles >= len(positions))).any(axis=1))[0])
        raise TilestampError(f"triangle {bad} has a vertex index out of range; the mesh has {len(positions)} vertices")


def triangle_setup(
    positions: NDArray[np.float32],
    triangles: NDArray[np.int32],
    width: int,
    height: int,
    simt: Simt,
    *,
    release: Release,
    samples: int = 1,
    cull_backfaces: bool | None = None,
    depth: bool = True,
    interpolate: bool = True,
    counting: bool = True,
    capacity: int | None = None,
) -> tuple[Setup, Work, dict[str, Any]]:
    """Cull, clip and set up all triangles of one draw.

    Parameters
    ----------
    positions : ndarray, (V, 4), float32
        Clip space.
    triangles : ndarray, (F, 3), int32
    width, height : int
        Viewport, pixels, at most 2048.
    simt : Simt
        Coalescing rule for the counts.
    release : {"1.1", "nvdiffrast"}
    samples : int
        1, 2, 4 or 8 samples a pixel (nvdiffrast: 1).
    cull_backfaces : bool or None
        None: as published, on in 1.1, off in nvdiffrast.
    depth, interpolate : bool
        Whether the depth plane and the attribute planes are needed.
    counting : bool
        Off: the work table stays empty.
    capacity : int or None
        Slots; None: F + 4096. Where more are needed nothing is lost: ``facts["numSubtris"]`` says how many, and the
        caller draws again.

    Returns
    -------
    setup : Setup
    work : Work
        A row a block of 64 threads.
    facts : dict
        ``numSubtris``, ``capacity`` and ``overflow``.

    Raises
    ------
    TilestampError
        Shapes, types, sizes; for release 1.1 also indices out of range (nvdiffrast skips such triangles).
    """
    view = make_view(
        width,
        height,
        release=release,
        samples=samples,
        cull_backfaces=cull_backfaces,
        depth=depth,
        interpolate=interpolate,
    )
    check_mesh(positions, triangles, release=release)
    F = len(triangles)
    out = _empty_setup(F, F, release)
    table = np.zeros((-(-F // BLOCK) if counting else 0, len(TriangleSetupEvent)), np.int64)
    with np.errstate(all="ignore"):
        _setup_all(positions, triangles, view, simt, out, table if counting else None)
        several = np.flatnonzero(out.subtriangles >= 2)
        counts = out.subtriangles[several].astype(np.int64)
        needed = F + int(counts.sum())
        capacity = F + SLACK if capacity is None else capacity
        if len(several) and needed <= capacity:
            out = _grown(out, needed)
            out.first[several] = F + np.cumsum(counts) - counts
            _setup_several(several, positions, triangles, view, out)
    work = Work("triangle_setup", "triangleSetup", TriangleSetupEvent, table, -(-F // BLOCK), BLOCK, SHARED_BYTES)
    return out, work, {"numSubtris": needed, "capacity": capacity, "overflow": needed > capacity}


def _empty_setup(F: int, slots: int, release: Release) -> Setup:
    return Setup(
        subtriangles=np.zeros(F, np.uint8),
        first=np.empty(F, np.int32),
        headers=np.zeros((slots, 6), np.int16),
        misc=np.zeros(slots, np.uint32),
        planes=np.zeros((slots, 16 if release == "1.1" else 4), np.uint32),
        inputs=np.zeros(slots, np.int32),
    )


def _grown(setup: Setup, slots: int) -> Setup:
    """The same with room for more slots."""
    longer = [np.concatenate([a, np.zeros((slots - len(a), *a.shape[1:]), a.dtype)]) for a in setup[2:]]
    return Setup(setup.subtriangles, setup.first, *longer)
