"""Triangle setup, its events: what the two warps of a block of 64 threads do."""

from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.coalescing import transactions
from tilestamp.models.kernel import kernel
from tilestamp.models.simt import Simt
from tilestamp.simulator.stages.laine2011.subtriangle import View
from tilestamp.simulator.stages.laine2011.triangle_setup_paths import CLIPPED, OUTSIDE, WARP, Setup

INDEX_BYTES, POSITION_BYTES, HEADER_BYTES = 12, 16, 16
RECORD_PARTS = 4  # of 16 bytes, in release 1.1


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
    OUTSIDE_WARPS = 24  # warps with a first vertex outside the frustum: all six planes are tested
    CULLED_WARPS = 25  # warps with a triangle outside one view plane
    SITE_WARPS = 26  # warps with an unclipped triangle whose box holds one or two sample sites: the first is tested
    SITE_LANES = 27
    RETEST_WARPS = 28  # warps of those with a triangle that has missed the first of two sites
    CLIP_AXES = 29  # axes along which a warp clips
    FAST_WARPS = 30  # warps with a triangle that needs no clipping: it is snapped and culled
    FAST_LANES = 31


_E = TriangleSetupEvent
_ACCESSES = 12  # three indices and three positions, loaded; count, header and four parts of a record, stored
_LOADS = 6
_STEP_COLUMNS = np.array([_E.SNAP_WARPS, _E.STORE_STEPS, _E.CLIP_WARPS, *[_E.CLIP_STEPS] * 6, _E.FAN_STEPS])
"""Columns of what the longest lane of a warp decides."""

_LANE_COLUMNS = np.array([_E.SNAP_LANES, _E.STORE_LANES, _E.CLIP_LANES, *[_E.CLIP_STEP_LANES] * 6, _E.FAN_LANES])
"""Columns of the lanes in each of them."""

_PATH_WARPS = np.array([_E.OUTSIDE_WARPS, _E.CULLED_WARPS, _E.SITE_WARPS])


class Counting(NamedTuple):
    """What counting remembers from lane to lane and from warp to warp."""

    value: NDArray[np.int64]  # (10,) steps of the lane in hand, by ``_STEP_COLUMNS``
    longest: NDArray[np.int64]  # (10,) maxima over the warp
    lanes: NDArray[np.int64]  # (32,) addresses
    read: NDArray[np.bool_]  # (32,) triangles with indices in range
    paths: NDArray[np.int64]  # (8,) lanes of the warp on each branch: see ``count_paths``
    regular: NDArray[np.int64]  # (12, 2) transactions and bytes of accesses that are the same for all full warps


@kernel
def new_counting() -> Any:
    """Allocate what one worker counts with."""
    i64 = np.int64
    return Counting(
        np.zeros(_STEP_COLUMNS.size, i64), np.zeros(_STEP_COLUMNS.size, i64), np.empty(WARP, i64),
        np.zeros(WARP, np.bool_), np.zeros(8, i64), np.zeros((_ACCESSES, 2), i64),
    )  # fmt: skip


@kernel
def count_lane(row: Any, counting: Counting, outcome: int, kept: int, fan: int, steps: Any) -> None:
    """Count one thread; ``counting.longest`` holds the warp's maxima so far."""
    row[_E.TRIANGLE_LANES] += 1
    if outcome == OUTSIDE:
        row[_E.VIEWPORT_CULLED] += 1
        return
    value, longest = counting.value, counting.longest
    value[0], value[1], value[2], value[9] = 1, kept, 1, fan
    columns = 2  # snap and store
    if outcome > 0:
        row[_E.BACKFACE_CULLED if outcome == 1 else _E.BETWEEN_CULLED] += 1
    elif outcome < 0:
        columns = _STEP_COLUMNS.size
        for p in range(6):
            value[3 + p] = steps[p]
        if kept >= 2:
            row[_E.ATOMIC_LANES] += 1
            row[_E.STORE_TRANSACTIONS] += 2 * kept + 1  # header and record in slots of its own, and where those are
            row[_E.STORE_BYTES] += 32 * (2 * kept + 1)
    for i in range(columns):
        row[_LANE_COLUMNS[i]] += value[i]
        row[_STEP_COLUMNS[i]] += max(value[i] - longest[i], 0)
        longest[i] = max(longest[i], value[i])


@kernel
def count_paths(paths: Any, corners: Any, in_range: bool, outcome: int, sites: int, steps: Any) -> None:
    """Note the branches of one thread: first vertex outside, culled, one site, two, clips along x, y, z, no clip."""
    w = corners[0, 3]
    paths[0] += in_range and (w < abs(corners[0, 0]) or w < abs(corners[0, 1]) or w < abs(corners[0, 2]))
    paths[1] += outcome == OUTSIDE
    paths[2] += sites > 0
    paths[3] += sites > 1
    paths[7] += outcome >= 0
    if outcome == CLIPPED:
        for axis in range(3):
            paths[4 + axis] += steps[2 * axis] > 0


@kernel
def _address_lanes(access: int, counting: Counting, triangles: Any, t0: int, n: int, view: View, out: Setup) -> Any:
    """Find the addresses of an access by n lanes from triangle t0 on; returns bytes a lane, 0 where it is left out.

    Of a record of 1.1 the first 16 bytes are written for depth alone, the middle 32 for interpolation alone.
    """
    lanes, k, part = counting.lanes, access % 3, access - _LOADS - 2
    words = out.planes.shape[1] // 4
    if access < 3:
        for i in range(n):
            lanes[i] = (t0 + i) * INDEX_BYTES + 4 * k
        return 4
    if access < _LOADS:
        for i in range(n):
            lanes[i] = np.int64(triangles[t0 + i, k]) * POSITION_BYTES if counting.read[i] else -1
        return POSITION_BYTES
    if part == -2:
        for i in range(n):
            lanes[i] = t0 + i
        return 1
    if part == -1:
        for i in range(n):
            lanes[i] = (t0 + i) * HEADER_BYTES if out.subtriangles[t0 + i] > 0 else -1
        return HEADER_BYTES
    if part >= words or (words == RECORD_PARTS and part < 3 and not (view.interpolate if part else view.depth)):
        return 0
    for i in range(n):
        lanes[i] = (t0 + i) * HEADER_BYTES * words + 16 * part if out.subtriangles[t0 + i] == 1 else -1
    return HEADER_BYTES


@kernel
def count_warp(
    row: Any, allocating: int, counting: Counting, triangles: Any, t0: int, n: int, view: View, out: Setup, simt: Simt
) -> None:
    """Count what the warp of n triangles from t0 on does to memory."""
    row[_E.WARPS] += 1
    paths = counting.paths
    for i in range(3):
        row[_PATH_WARPS[i]] += paths[i] > 0
        row[_E.CLIP_AXES] += paths[4 + i] > 0
    row[_E.SITE_LANES] += paths[2]
    row[_E.RETEST_WARPS] += paths[3] > 0
    row[_E.FAST_WARPS] += paths[7] > 0
    row[_E.FAST_LANES] += paths[7]
    if allocating > 0:
        row[_E.ATOMIC] += 1
        row[_E.ATOMIC_REQUESTS] += allocating  # lanes at one address are not merged
        row[_E.ATOMIC_CONFLICTS] += allocating - 1
        row[_E.ATOMIC_DEPTH] += allocating
    storing = 0
    for t in range(t0, t0 + n):
        storing += out.subtriangles[t] == 1
    for access in range(_ACCESSES):
        is_regular = n == WARP and (access < 3 or access == _LOADS or (access > _LOADS and storing == WARP))
        known = counting.regular[access]
        if not (is_regular and known[0] > 0):
            size = _address_lanes(access, counting, triangles, t0, n, view, out)
            if size == 0:
                continue
            count, moved = transactions(counting.lanes, n, size, simt.coalescing)
            if is_regular:
                known[0], known[1] = count, moved
        else:
            count, moved = known[0], known[1]
        if access < _LOADS:
            row[_E.LOAD_TRANSACTIONS] += count
            row[_E.LOAD_BYTES] += moved
        else:
            row[_E.STORE_TRANSACTIONS] += count
            row[_E.STORE_BYTES] += moved
