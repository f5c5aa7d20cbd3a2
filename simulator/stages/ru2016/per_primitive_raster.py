"""Per-primitive raster: one thread a triangle (Ru 2016's "basic" rasterization).

Each thread walks the pixels of its triangle's box: barycentric test, an integer ``atomicMin`` on the depth buffer, and
if the buffer then holds its own depth, the fragment is computed and written, **unprotected**: between its check and its
write another thread may put a nearer depth and write its fragment first, and the farther one is then left standing.

The race is modelled, not left to luck. All resident warps walk in lockstep, one box step each a round; the depth
operations of a round happen warp after warp, lane after lane. A fragment lands some rounds after its check: 1 to
``RACE_ROUNDS``, by a hash of warp and step, as a scheduler would spread them. What stays is the fragment that lands
last; a pixel is wrong if that is not the nearest one. ``RACE_ROUNDS`` and the rounds themselves are assumptions.
"""

from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from models.atomics import add_requests, count_atomics
from models.launch import Stream
from models.simt import Simt
from simulator.stages.ru2016.tiled_raster import FRAGMENT_BYTES, Visible
from simulator.stages.ru2016.triangle import area, barycentric, corners, inside, pixel_box
from simulator.stages.ru2016.vertex_shading import PRIMITIVE_BYTES
from simulator.work import Work

BLOCK = 128  # threads
WARPS_AN_SM = 32  # resident: 50 % of 64, as 63 registers allow
RACE_ROUNDS = 3  # assumed
DEPTH_SCALE = np.float64(2**31 - 1)  # depths are compared as integers
FAR = np.int32(2**31 - 1)
_HALF = np.float32(0.5)
_ONE = np.float32(1.0)
_ZERO = np.float32(0.0)


class PerPrimitiveEvent(IntEnum):
    """Events of one block."""

    WARPS = 0
    WARP_LANES = 1
    CULLED = 2
    BOX_STEPS = 3  # warp steps over the pixels of the boxes: one barycentric test each
    SAMPLE_TESTS = 4  # lanes in them
    SAMPLE_HITS = 5
    ATOMIC = 6
    ATOMIC_LANES = 7
    ATOMIC_REQUESTS = 8
    ATOMIC_CONFLICTS = 9
    ATOMIC_DEPTH = 10
    WRITES = 11  # warp steps in which a lane computes and writes its fragment
    WRITE_LANES = 12
    STORE_TRANSACTIONS = 13
    STORE_BYTES = 14
    LOAD_TRANSACTIONS = 15
    LOAD_BYTES = 16
    LONGEST = 17  # most steps of a warp: the dependent chain of the block
    LONGEST_HITS = 18  # most steps of a warp in which a lane hits


class Race(NamedTuple):
    """What the unprotected writes left.

    Parameters
    ----------
    triangles : ndarray, (H, W), int32
        Triangle of the fragment that landed last.
    landed : ndarray, (H, W), int64
        Its round.
    """

    triangles: NDArray[np.int32]
    landed: NDArray[np.int64]


@njit(cache=True, nogil=True, error_model="numpy")
def _wave(
    screen: Any, triangles: Any, drawable: Any, first: int, end: int, culling: bool, warp: int, merge: int,
    nearest: Any, depth: Any, raced: Any, landed: Any, rounds: int, requests: Any, events: Any,
) -> Any:  # fmt: skip
    """Run the resident warps first..end-1 to their ends; returns the round after the last."""
    boxes = np.zeros((end - first, warp, 5), np.int64)  # left, columns, top, pixels, triangle
    longest = np.zeros(end - first, np.int64)
    for w in range(end - first):
        longest[w] = _boxes(
            screen,
            triangles,
            drawable,
            (first + w) * warp,
            depth.shape,
            culling,
            boxes[w],
            _row(events, first + w, warp),
        )
    hit_steps = np.zeros(end - first, np.int64)
    places = np.full(warp, -1, np.int64)
    values = np.zeros(warp, np.int32)
    last = longest.max()
    for s in range(last):
        for w in range(end - first):
            if s < longest[w]:
                row = _row(events, first + w, warp)
                hits = _step(screen, triangles, boxes[w], s, nearest, depth, places, values, row)
                if hits > 0:
                    delay = 1 + ((first + w) * 2654435761 + s * 40503) // 65536 % RACE_ROUNDS
                    _write(boxes[w], places, values, depth, raced, landed, rounds + s + delay, row)
                    hit_steps[w] += 1
                if hits > 0 and events is not None:
                    _count_atomics(places, merge, row, requests)
    if events is not None:
        for w in range(end - first):
            row = _row(events, first + w, warp)
            row[18] = max(row[18], hit_steps[w])  # LONGEST_HITS
    return rounds + last


@njit(cache=True, nogil=True, error_model="numpy")
def _row(events: Any, w: int, warp: int) -> Any:
    """Give the events of a warp's block."""
    if events is None:
        return None
    return events[w * warp // BLOCK]


@njit(cache=True, nogil=True, error_model="numpy")
def _boxes(
    screen: Any, triangles: Any, drawable: Any, first: int, shape: Any, culling: bool, boxes: Any, row: Any
) -> Any:
    """Cull, and find each lane's box of pixels; returns the most pixels of a lane."""
    longest = 0
    for lane in range(len(boxes)):
        if first + lane >= len(drawable):
            break
        t = drawable[first + lane]
        x0, y0, x1, y1, x2, y2 = corners(screen, triangles, t)
        if row is not None:
            row[1] += 1  # WARP_LANES
        size = area(x0, y0, x1, y1, x2, y2)
        if (culling and size <= _ZERO) or size == _ZERO:
            if row is not None:
                row[2] += 1  # CULLED
            continue
        left, right, top, bottom = pixel_box(x0, y0, x1, y1, x2, y2, shape[1], shape[0])
        boxes[lane, 0] = left
        boxes[lane, 1] = max(0, right - left + 1)
        boxes[lane, 2] = top
        boxes[lane, 3] = boxes[lane, 1] * max(0, bottom - top + 1)
        boxes[lane, 4] = t
        longest = max(longest, boxes[lane, 3])
    if row is not None:
        row[0] += 1  # WARPS
        row[3] += longest  # BOX_STEPS
        row[17] = max(row[17], longest)  # LONGEST
    return longest


@njit(cache=True, nogil=True, error_model="numpy")
def _step(
    screen: Any, triangles: Any, boxes: Any, s: int, nearest: Any, depth: Any, places: Any, values: Any, row: Any
) -> int:
    """One box step of a warp up to its atomicMin; ``places`` gets the pixel of each lane that hits, else -1."""
    hits = 0
    for lane in range(len(boxes)):
        places[lane] = -1
        if s >= boxes[lane, 3]:
            continue
        if row is not None:
            row[4] += 1  # SAMPLE_TESTS
        x = boxes[lane, 0] + s % boxes[lane, 1]
        y = boxes[lane, 2] + s // boxes[lane, 1]
        t = boxes[lane, 4]
        x0, y0, x1, y1, x2, y2 = corners(screen, triangles, t)
        inverse = _ONE / area(x0, y0, x1, y1, x2, y2)
        a, b, c = barycentric(x0, y0, x1, y1, x2, y2, inverse, np.float32(x) + _HALF, np.float32(y) + _HALF)
        if not inside(a, b, c):
            continue
        z = a * screen[triangles[t, 0], 2] + b * screen[triangles[t, 1], 2] + c * screen[triangles[t, 2], 2]
        if z < _ZERO or z >= _ONE:
            continue
        places[lane] = y * depth.shape[1] + x
        values[lane] = np.int32(np.float64(z) * DEPTH_SCALE)
        hits += 1
        if values[lane] < depth[y, x]:
            depth[y, x] = values[lane]
            nearest[y, x] = t
    if row is not None:
        row[5] += hits  # SAMPLE_HITS
    return hits


@njit(cache=True, nogil=True, error_model="numpy")
def _write(boxes: Any, places: Any, values: Any, depth: Any, raced: Any, landed: Any, lands: int, row: Any) -> None:
    """Check and write: lanes whose depth still stands put their fragment, which lands in round ``lands``."""
    written = 0
    for lane in range(len(places)):
        if places[lane] < 0:
            continue
        y, x = places[lane] // depth.shape[1], places[lane] % depth.shape[1]
        if depth[y, x] != values[lane]:
            continue
        written += 1
        if lands >= landed[y, x]:
            landed[y, x] = lands
            raced[y, x] = boxes[lane, 4]
    if row is not None and written > 0:
        row[11] += 1  # WRITES
        row[12] += written


@njit(cache=True, nogil=True, error_model="numpy")
def _count_atomics(places: Any, merge: int, row: Any, requests: Any) -> None:
    for lane in range(len(places)):
        places[lane] *= 4  # bytes; inactive lanes stay negative
    lanes, merged, conflicts, depth = count_atomics(places, len(places), merge)
    row[6] += 1
    row[7] += lanes
    row[8] += merged
    row[9] += conflicts
    row[10] += depth
    add_requests(places, len(places), merge, 0, requests)


@njit(cache=True, nogil=True, error_model="numpy")
def _per_primitive_raster(
    screen: Any, triangles: Any, drawable: Any, culling: bool, warp: int, merge: int, resident: int,
    nearest: Any, depth: Any, raced: Any, landed: Any, requests: Any, events: Any,
) -> None:  # fmt: skip
    """All waves of resident warps."""
    warps = (len(drawable) + warp - 1) // warp
    rounds = 0
    for first in range(0, warps, resident):
        end = min(warps, first + resident)
        rounds = _wave(
            screen, triangles, drawable, first, end, culling, warp, merge,
            nearest, depth, raced, landed, rounds, requests, events,
        )  # fmt: skip


def per_primitive_raster(
    screen: NDArray[np.float32],
    triangles: NDArray[np.int32],
    drawable: NDArray[np.int32],
    width: int,
    height: int,
    simt: Simt,
    *,
    culling: bool,
) -> tuple[Visible, Race, Work]:
    """Draw triangle by triangle.

    Parameters
    ----------
    screen : ndarray, (V, 4), float32
    triangles : ndarray, (F, 3), int32
    drawable : ndarray, (F',), int32
    width, height : int
        Pixels.
    simt : Simt
    culling : bool

    Returns
    -------
    visible : Visible
        What a protected write would leave: the nearest triangle, and the depth buffer.
    race : Race
        What the unprotected write leaves in this model.
    work : Work
        One row a block.
    """
    visible = np.full((height, width), -1, np.int32)
    depth = np.full((height, width), FAR, np.int32)
    race = Race(np.full((height, width), -1, np.int32), np.full((height, width), -1, np.int64))
    blocks = max(1, -(-len(drawable) // BLOCK))
    events = np.zeros((blocks, len(PerPrimitiveEvent)), np.int64)
    requests = np.zeros(width * height // 8 + 1, np.int64)
    _per_primitive_raster(
        screen, triangles, drawable, culling, simt.warp, int(simt.atomic_merge), simt.sms * WARPS_AN_SM,
        visible, depth, *race, requests, events,
    )  # fmt: skip
    _add_traffic(events, simt)
    total = events.sum(axis=0)
    streams = (
        Stream("primitives", "load", len(drawable) * PRIMITIVE_BYTES, len(drawable) * PRIMITIVE_BYTES),
        Stream("depth", "atomic", 32 * int(total[PerPrimitiveEvent.ATOMIC_REQUESTS]), 4 * width * height),
        Stream("fragments", "store", 64 * int(total[PerPrimitiveEvent.WRITE_LANES]), FRAGMENT_BYTES * width * height),
    )
    work = Work(
        "per_primitive_raster", "per_primitive_raster", PerPrimitiveEvent, events, blocks, BLOCK,
        streams=streams, atomic_requests=requests,
    )  # fmt: skip
    return Visible(visible, (depth / DEPTH_SCALE).astype(np.float32)), race, work


def _add_traffic(events: NDArray[np.int64], simt: Simt) -> None:
    """Each lane reads its own primitive once and writes its own fragment, a segment of its own for each word."""
    segment = 128 if simt.coalescing == 2 else 32
    words = FRAGMENT_BYTES // 4
    reads = events[:, PerPrimitiveEvent.WARP_LANES] * (PRIMITIVE_BYTES // 4)
    writes = events[:, PerPrimitiveEvent.WRITE_LANES] * words
    events[:, PerPrimitiveEvent.LOAD_TRANSACTIONS] = reads
    events[:, PerPrimitiveEvent.LOAD_BYTES] = reads * segment
    events[:, PerPrimitiveEvent.STORE_TRANSACTIONS] = writes
    events[:, PerPrimitiveEvent.STORE_BYTES] = writes * 32
