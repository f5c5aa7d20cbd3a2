"""Triangle setup, its events: what the two warps of a block of 64 threads do."""

from enum import IntEnum
from typing import Any

import numpy as np
from numba import njit

from models.coalescing import transactions
from models.simt import Simt
from simulator.stages.subtriangle import View
from simulator.stages.triangle_setup_paths import OUTSIDE, Setup

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


_E = TriangleSetupEvent
_VIEWPORT_CULLED, _CLIP_STEPS, _FAN_STEPS, _STORE_STEPS = (
    int(e) for e in (_E.VIEWPORT_CULLED, _E.CLIP_STEPS, _E.FAN_STEPS, _E.STORE_STEPS)
)


@njit(cache=True, nogil=True)
def _longest(table: Any, block: int, column: int, value: int, longest: Any, i: int) -> None:
    """Add one lane to a pair of columns: steps of the longest lane of the warp, and lane steps."""
    table[block, column + 1] += value
    if value > longest[i]:
        table[block, column] += value - longest[i]
        longest[i] = value


@njit(cache=True, nogil=True)
def count_lane(table: Any, block: int, longest: Any, outcome: int, kept: int, fan: int, steps: Any) -> None:
    """Count one thread; ``longest`` holds the warp's maxima so far."""
    table[block, 1] += 1
    if outcome == OUTSIDE:
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
def count_warp(
    row: Any,
    allocating: int,
    positions_read: Any,
    triangles: Any,
    t0: int,
    t1: int,
    view: View,
    out: Setup,
    simt: Simt,
    lanes: Any,
) -> None:
    """Count what the warp of triangles t0..t1-1 does to memory.

    Of a record of 1.1 the first 16 bytes are written for depth alone, the middle 32 for interpolation alone.
    """
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
        if words == RECORD_PARTS and not (part == RECORD_PARTS - 1 or (view.interpolate if part else view.depth)):
            continue
        for i in range(n):
            lanes[i] = (t0 + i) * HEADER_BYTES * words + 16 * part if out.subtriangles[t0 + i] == 1 else -1
        count, size = transactions(lanes, n, HEADER_BYTES, simt.coalescing)
        row[22] += count
        row[23] += size
