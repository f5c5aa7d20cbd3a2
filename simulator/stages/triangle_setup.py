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
from simulator.stages.clipper import MAX_VERTICES, clip_triangle, polygon_vertex
from simulator.stages.subtriangle import (
    Corners,
    View,
    cull,
    make_counter_clockwise,
    snap,
    store_attribute_planes,
    store_depth_plane,
    store_header,
)
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


@njit(cache=True, nogil=True)
def _outside(clip):
    """Whether all corners lie beyond one view plane (only looked at where the first corner is outside)."""
    w = clip[:, 3]
    if not (w[0] < abs(clip[0, 0]) or w[0] < abs(clip[0, 1]) or w[0] < abs(clip[0, 2])):
        return False
    for c in range(3):
        if w[0] < clip[0, c] and w[1] < clip[1, c] and w[2] < clip[2, c]:
            return True
        if w[0] < -clip[0, c] and w[1] < -clip[1, c] and w[2] < -clip[2, c]:
            return True
    return False


@njit(cache=True, nogil=True)
def _inside(clip, axes_from):
    """Whether no corner leaves the frustum along the axes from ``axes_from`` on; a NaN coordinate counts as inside."""
    for k in range(3):
        seen = False
        for c in range(axes_from, 3):
            magnitude = abs(clip[k, c])
            if clip[k, 3] < magnitude:
                return False
            seen |= magnitude >= np.float32(0)
        if not seen or not clip[k, 3] == clip[k, 3]:  # noqa: PLR0124, SIM201 - NaN
            return False
    return True


@njit(cache=True, nogil=True)
def _in_guard_band(snapped):
    low, high = snapped.min(), snapped.max()
    return low >= -GUARD_BAND - 1 and high <= GUARD_BAND and high - low <= GUARD_BAND


@njit(cache=True, nogil=True)
def _store(corners, area, view, out, slot, t, triangles):
    """Write header and data record of one sub-triangle."""
    if area < 0:
        make_counter_clockwise(corners)
    out.misc[slot] = store_header(corners, view, out.headers[slot])
    out.inputs[slot] = t
    record = out.planes[slot]
    if view.depth:
        store_depth_plane(corners, abs(area), view, record)
    if record.size == 4:
        record[3] = np.uint32(t + 1)
        return
    if view.interpolate:
        store_attribute_planes(corners, abs(area), view, record)
    for k in range(3):
        record[13 + k] = np.uint32(triangles[t, k])


@njit(cache=True, nogil=True)
def _fan(source, corners, polygon, n, view, out, slot, t, triangles):
    """Count the surviving triangles of a clipped polygon; from ``slot`` on, where not negative, write them."""
    kept = 0
    for i in range(2, n):
        for k, at in enumerate((0, i - 1, i)):
            polygon_vertex(source, polygon, at, corners.clip[k])
            corners.barycentric[k] = polygon[at]
        snap(corners, view)
        outcome, area = cull(corners.snapped, view)
        if outcome == 0:
            if slot >= 0:
                _store(corners, area, view, out, slot + kept, t, triangles)
            kept += 1
    return kept


@njit(cache=True, nogil=True)
def _load(positions, triangles, t, clip):
    """Fetch the three corners; False where an index is out of range."""
    for k in range(3):
        v = triangles[t, k]
        if v < 0 or v >= positions.shape[0]:
            return False
        clip[k] = positions[v]
    return True


@njit(cache=True, nogil=True)
def _fast_path(corners, view, out, t, triangles):
    """Outcome of a triangle that needs no clipping (_CLIPPED where it does); a kept one is written to its own slot."""
    if _outside(corners.clip):
        return _OUTSIDE
    if not _inside(corners.clip, 2 if view.guard_band else 0):
        return _CLIPPED
    snap(corners, view)
    if view.guard_band and not _in_guard_band(corners.snapped):
        return _CLIPPED
    outcome, area = cull(corners.snapped, view)
    if outcome == 0:
        corners.barycentric[:] = np.float32(0)
        corners.barycentric[1, 0] = corners.barycentric[2, 1] = np.float32(1)
        _store(corners, area, view, out, t, t, triangles)
    return outcome


@njit(cache=True, nogil=True)
def _clip_and_store(source, corners, scratch, plane, steps, view, out, slot, t, triangles):
    """Clip one triangle and write what survives (a single survivor to the own slot); returns survivors and fan size."""
    n = clip_triangle(source, scratch[0], scratch[1], plane, steps)
    kept = _fan(source, corners, scratch[0], n, view, out, slot, t, triangles)
    if kept == 1 and slot < 0:
        _fan(source, corners, scratch[0], n, view, out, t, t, triangles)
    return kept, max(n - 2, 0)


@njit(cache=True, nogil=True)
def _longest(row, warp_longest, column, lane_value, i):
    """Add one lane to a pair of columns: steps of the longest lane of the warp, and lane steps."""
    row[column + 1] += lane_value
    if lane_value > warp_longest[i]:
        row[column] += lane_value - warp_longest[i]
        warp_longest[i] = lane_value


@njit(cache=True, nogil=True)
def _count_lane(row, longest, outcome, kept, fan, steps):
    """Count one thread; ``longest`` holds the warp's maxima so far."""
    row[1] += 1
    if outcome == _OUTSIDE:
        row[_VIEWPORT_CULLED] += 1
        return
    _longest(row, longest, 3, 1, 0)
    if outcome > 0:
        row[4 + outcome] += 1
    elif outcome == 0:
        _longest(row, longest, _STORE_STEPS, 1, 1)
    else:
        _longest(row, longest, 7, 1, 2)
        for p in range(6):
            _longest(row, longest, _CLIP_STEPS, steps[p], 3 + p)
        _longest(row, longest, _FAN_STEPS, fan, 9)
        _longest(row, longest, _STORE_STEPS, kept, 1)
        if kept >= 2:
            row[16] += 1


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
def _setup_range(begin, end, positions, triangles, view, simt, out, table):
    """All triangles of some whole blocks; those with two or more sub-triangles are only counted here."""
    f32 = np.float32
    corners = Corners(np.empty((3, 4), f32), np.empty((3, 2), f32), np.empty((3, 2), np.int64), np.empty(3, f32))
    source = np.empty((3, 4), f32)
    scratch, plane = np.empty((2, MAX_VERTICES, 2), f32), np.empty(3, f32)
    steps = np.zeros(6, np.int64)
    longest, lanes, read = np.zeros(10, np.int64), np.empty(WARP, np.int64), np.zeros(WARP, np.bool_)
    for warp in range(begin, end, WARP):
        last = min(warp + WARP, end)
        allocating, longest[:] = 0, 0
        for t in range(warp, last):
            out.first[t] = t
            kept, fan, outcome = 0, 0, _OUTSIDE
            read[t - warp] = _load(positions, triangles, t, corners.clip)
            if read[t - warp]:
                outcome = _fast_path(corners, view, out, t, triangles)
                kept = 1 if outcome == 0 else 0
            if outcome == _CLIPPED:
                source[:] = corners.clip
                kept, fan = _clip_and_store(source, corners, scratch, plane, steps, view, out, -1, t, triangles)
                allocating += 1 if kept >= 2 else 0
            out.subtriangles[t] = kept
            if table is not None:
                _count_lane(table[t // BLOCK], longest, outcome, kept, fan, steps)
        if table is not None:
            _count_warp(table[warp // BLOCK], allocating, read, triangles, warp, last, out, simt, lanes)


@njit(cache=True, nogil=True, parallel=True)
def _setup_all(positions, triangles, view, simt, out, table):
    chunk = _CHUNK_BLOCKS * BLOCK
    for c in prange((triangles.shape[0] + chunk - 1) // chunk):
        _setup_range(c * chunk, min((c + 1) * chunk, triangles.shape[0]), positions, triangles, view, simt, out, table)


@njit(cache=True, nogil=True)
def _setup_several(several, positions, triangles, view, out):
    """Write the sub-triangles of the triangles that have two or more, to the slots allocated for them."""
    f32 = np.float32
    corners = Corners(np.empty((3, 4), f32), np.empty((3, 2), f32), np.empty((3, 2), np.int64), np.empty(3, f32))
    source = np.empty((3, 4), f32)
    scratch, plane = np.empty((2, MAX_VERTICES, 2), f32), np.empty(3, f32)
    steps = np.zeros(6, np.int64)
    for t in several:
        _load(positions, triangles, t, source)
        out.misc[t] = out.first[t]
        _clip_and_store(source, corners, scratch, plane, steps, view, out, out.first[t], t, triangles)


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
