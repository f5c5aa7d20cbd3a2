"""Triangle setup, its events: what the two warps of a block of 64 threads do."""

from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.bits import popcount
from tilestamp.models.coalescing import SECTOR_BYTES, smallest_transaction_bytes
from tilestamp.models.kernel import kernel
from tilestamp.models.simt import Simt
from tilestamp.simulator.stages.laine2011.subtriangle import (
    ABSENT,
    BACKFACE,
    BETWEEN,
    CLIPPED,
    KEPT,
    OUTSIDE,
    View,
)
from tilestamp.simulator.stages.laine2011.triangle_setup_paths import Setup

INDEX_BYTES, POSITION_BYTES, HEADER_BYTES = 12, 16, 16
RECORD_PARTS = 4  # of 16 bytes, in release 1.1
FIRST_OUTSIDE, ONE_SITE, TWO_SITES, SINGLE, SEVERAL = range(ABSENT + 1, ABSENT + 6)


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
_KEPT, _FAN, _STEPS = 0, 1, 2  # columns of ``Counting.most``: sub-triangles, fan, vertices walked at each of six planes
_CORNERS = 192  # that a block loads, in six loads
_SEEN = 512  # places of a table of what a block has read, more than those
_EIGHTS = 24  # first bit of the second half of what is noted of a line


class Lines(NamedTuple):
    """Lines of 8 vertices that a block has read: a table by the last bits of their numbers."""

    keys: NDArray[np.int64]  # (512,) which line; -1: none
    loads: NDArray[np.int64]  # (512,) four bits a load: its sectors read; and above those: which eights of lanes did
    used: NDArray[np.int64]  # (193,) how many places are taken, and which


class Counting(NamedTuple):
    """What counting remembers of a warp and of a block."""

    lanes: NDArray[np.int64]  # (11,) lanes of the warp, a bit each, by outcome, site, and sub-triangles written
    most: NDArray[np.int64]  # (8,) of the clipped lanes of the warp, the longest
    total: NDArray[np.int64]  # (8,) and their sum
    lines: Lines


@kernel
def new_counting() -> Any:
    """Allocate what one worker counts with."""
    i64 = np.int64
    return Counting(
        np.zeros(ABSENT + 6, i64), np.zeros(8, i64), np.zeros(8, i64),
        Lines(np.full(_SEEN, -1, i64), np.zeros(_SEEN, i64), np.zeros(_CORNERS + 1, i64)),
    )  # fmt: skip


@kernel(lent=True)
def forget_warp(counting: Counting) -> None:
    """Make ready for the next warp."""
    if counting.lanes[CLIPPED]:
        counting.most[:] = 0
        counting.total[:] = 0
    counting.lanes[:] = 0


@kernel(lent=True)
def count_clipped(counting: Counting, bit: int, kept: int, fan: int, steps: Any) -> None:
    """Note a clipped lane."""
    lanes, most, total = counting.lanes, counting.most, counting.total
    lanes[SINGLE] |= bit if kept == 1 else 0
    lanes[SEVERAL] |= bit if kept > 1 else 0
    for i in range(8):
        value = kept if i == _KEPT else fan if i == _FAN else steps[i - _STEPS]
        most[i] = max(most[i], value)
        total[i] += value


@kernel(lent=True)
def _lanes(mask: Any) -> Any:
    return popcount(np.uint64(mask))


@kernel(lent=True)
def _groups(mask: Any, size: int) -> Any:
    """Aligned groups of ``size`` lanes, a power of two, with a lane in the mask."""
    step = 1
    while step < size:
        mask |= mask >> step
        step *= 2
    return _lanes(mask & (0xFFFFFFFF // ((1 << size) - 1)))


@kernel(lent=True)
def _place(lines: Lines, line: int) -> Any:
    """Place of a line of vertices in the table of what a block has read."""
    at = line & (_SEEN - 1)
    while lines.keys[at] != line:
        if lines.keys[at] < 0:
            lines.keys[at], lines.loads[at] = line, 0
            lines.used[0] += 1
            lines.used[lines.used[0]] = at
            break
        at = (at + 1) & (_SEEN - 1)
    return at


@kernel(lent=True)
def note_vertices(lines: Lines, corners: Any, n: int, second: int, absent: int) -> None:
    """Note which vertices the n lanes of a warp load, 16 bytes a lane, a corner of each triangle at a time.

    ``second``: whether it is the second warp of its block. A line has four sectors of two vertices.
    """
    for corner in range(3):
        load, at, bits = 4 * (3 * second + corner), 0, 0
        last: Any = -1
        for lane in range(n):
            vertex: Any = np.int64(corners[np.uint64(3 * lane + corner)])
            if absent >> lane & 1:
                continue
            if vertex >> 3 != last:
                lines.loads[at] |= bits
                last, bits = vertex >> 3, 0
                at = _place(lines, last)
            bits |= 1 << (load + (vertex >> 1 & 3)) | 1 << (_EIGHTS + load + (lane >> 3))
        lines.loads[at] |= bits


@kernel(lent=True)
def count_vertices(row: Any, vertices: Any, lines: Lines, simt: Simt) -> None:
    """Count the loads of a block's vertices, and forget them.

    ``vertices`` adds up what the streams say: sectors, each once a block, and lines, each once a load.
    """
    segment = smallest_transaction_bytes(simt.coalescing)
    eights, count = segment != SECTOR_BYTES, 0  # lines are loaded by eight lanes at a time
    for i in range(1, lines.used[0] + 1):
        at = lines.used[i]
        lines.keys[at] = -1
        sectors = lines.loads[at] & (1 << _EIGHTS) - 1
        once = sectors | sectors >> 12
        vertices[0] += _lanes((once | once >> 4 | once >> 8) & 0xF)
        halves = sectors | sectors >> 1
        vertices[1] += _lanes((halves | halves >> 2) & 0x111111)
        count += _lanes(lines.loads[at] >> _EIGHTS if eights else sectors)
    lines.used[0] = 0
    row[_E.LOAD_TRANSACTIONS] += count
    row[_E.LOAD_BYTES] += count * segment


@kernel(lent=True)
def _count_lanes(row: Any, counting: Counting, n: int) -> None:
    """Count the branches that the lanes of a warp take."""
    lanes, most, total = counting.lanes, counting.most, counting.total
    outside, clipped = lanes[OUTSIDE] | lanes[ABSENT], lanes[CLIPPED]
    fast = lanes[KEPT] | lanes[BACKFACE] | lanes[BETWEEN]
    snapped = n - _lanes(outside)
    row[_E.WARPS] += 1
    row[_E.TRIANGLE_LANES] += n
    row[_E.VIEWPORT_CULLED] += n - snapped
    row[_E.CULLED_WARPS] += outside > 0
    row[_E.OUTSIDE_WARPS] += lanes[FIRST_OUTSIDE] > 0
    row[_E.SNAP_WARPS] += snapped > 0
    row[_E.SNAP_LANES] += snapped
    row[_E.BACKFACE_CULLED] += _lanes(lanes[BACKFACE])
    row[_E.BETWEEN_CULLED] += _lanes(lanes[BETWEEN])
    row[_E.FAST_WARPS] += fast > 0
    row[_E.FAST_LANES] += _lanes(fast)
    row[_E.SITE_WARPS] += lanes[ONE_SITE] > 0
    row[_E.SITE_LANES] += _lanes(lanes[ONE_SITE])
    row[_E.RETEST_WARPS] += lanes[TWO_SITES] > 0
    row[_E.STORE_STEPS] += max(most[_KEPT], lanes[KEPT] > 0)
    row[_E.STORE_LANES] += _lanes(lanes[KEPT]) + total[_KEPT]
    if clipped == 0:
        return
    row[_E.CLIP_WARPS] += 1
    row[_E.CLIP_LANES] += _lanes(clipped)
    row[_E.FAN_STEPS] += most[_FAN]
    row[_E.FAN_LANES] += total[_FAN]
    for plane in range(6):
        row[_E.CLIP_STEPS] += most[_STEPS + plane]
        row[_E.CLIP_STEP_LANES] += total[_STEPS + plane]
        row[_E.CLIP_AXES] += plane % 2 == 0 and most[_STEPS + plane] > 0
    several = _lanes(lanes[SEVERAL])
    row[_E.ATOMIC] += several > 0
    row[_E.ATOMIC_LANES] += several
    row[_E.ATOMIC_REQUESTS] += several  # lanes at one address are not merged
    row[_E.ATOMIC_CONFLICTS] += max(several - 1, 0)
    row[_E.ATOMIC_DEPTH] += several
    own = (
        2 * (total[_KEPT] - _lanes(lanes[SINGLE])) + several
    )  # headers and records in slots beyond, and where those are
    row[_E.STORE_TRANSACTIONS] += own
    row[_E.STORE_BYTES] += SECTOR_BYTES * own


@kernel(lent=True)
def count_warp(row: Any, counting: Counting, n: int, view: View, out: Setup, simt: Simt) -> None:
    """Count a warp of n triangles, its vertices apart.

    Indices and counts stand side by side; a header has 16 bytes, a record as many, or in 1.1 four times as many, of
    which the first part is written for depth alone, the middle two for interpolation alone.
    """
    lanes, segment = counting.lanes, smallest_transaction_bytes(simt.coalescing)
    _count_lanes(row, counting, n)
    indices = 0
    for k in range(3):
        indices += (INDEX_BYTES * (n - 1) + 4 * k) // segment + 1  # those of a warp begin a line
    row[_E.LOAD_TRANSACTIONS] += indices
    row[_E.LOAD_BYTES] += indices * segment
    single = lanes[KEPT] | lanes[SINGLE]
    parts = 1 if out.planes.shape[1] < 4 * RECORD_PARTS else 1 + view.depth + 2 * view.interpolate
    stores = (n - 1) // segment + 1 + _groups(single | lanes[SEVERAL], segment // HEADER_BYTES)
    stores += parts * _groups(single, max(segment // (4 * out.planes.shape[1]), 1))
    row[_E.STORE_TRANSACTIONS] += stores
    row[_E.STORE_BYTES] += stores * segment
