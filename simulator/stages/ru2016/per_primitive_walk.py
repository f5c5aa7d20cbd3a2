"""Kernels of the per-primitive raster: the resident warps walk the boxes of their triangles in lockstep."""

from enum import IntEnum
from typing import Any

import numpy as np
from numba import njit

from models.atomics import add_requests, count_atomics
from simulator.stages.ru2016.triangle import area, barycentric, corners, inside, pixel_box

BLOCK = 128  # threads
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
    LONGEST_WRITES = 19  # most steps of a warp in which a lane writes


@njit(cache=True, nogil=True, error_model="numpy")
def walk(
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


@njit(cache=True, nogil=True, error_model="numpy")
def _wave(
    screen: Any, triangles: Any, drawable: Any, first: int, end: int, culling: bool, warp: int, merge: int,
    nearest: Any, depth: Any, raced: Any, landed: Any, rounds: int, requests: Any, events: Any,
) -> Any:  # fmt: skip
    """Run the resident warps first..end-1 to their ends; returns the round after the last."""
    count = end - first
    boxes = np.zeros((count, warp, 5), np.int64)  # left, columns, top, rows, triangle
    place = np.zeros((count, 3), np.int64)  # of each warp: column and row of its boxes, rows of the column
    seen = np.zeros((count, 3), np.int64)  # steps, steps with a hit, steps with a write
    for w in range(count):
        row = _row(events, first + w, warp)
        _boxes(screen, triangles, drawable, (first + w) * warp, depth.shape, culling, boxes[w], row)
        place[w, 2] = _rows(boxes[w], 0)
    pixels = np.full(warp, -1, np.int64)
    values = np.zeros(warp, np.int32)
    wins = np.zeros(warp, np.bool_)
    s = 0
    busy = True
    while busy:
        busy = False
        for w in range(count):
            if place[w, 1] >= place[w, 2]:  # at its end
                continue
            busy = True
            row = _row(events, first + w, warp)
            hits = _step(screen, triangles, boxes[w], place[w], nearest, depth, pixels, values, wins, row)
            seen[w, 0] += 1
            if hits > 0:
                delay = 1 + ((first + w) * 2654435761 + s * 40503) // 65536 % RACE_ROUNDS
                seen[w, 1] += 1
                seen[w, 2] += _write(boxes[w], pixels, wins, raced, landed, rounds + s + delay, row)
            if hits > 0 and events is not None:
                _count_atomics(pixels, merge, row, requests)
            _advance(boxes[w], place[w])
        s += 1
    if events is not None:
        for w in range(count):
            row = _row(events, first + w, warp)
            row[3] += seen[w, 0]  # BOX_STEPS
            for k in range(3):
                row[17 + k] = max(row[17 + k], seen[w, k])  # LONGEST, LONGEST_HITS, LONGEST_WRITES
    return rounds + s


@njit(cache=True, nogil=True, error_model="numpy")
def _rows(boxes: Any, column: int) -> Any:
    """Steps of a warp down one column of its lanes' boxes: those of the highest that has the column; 0 at the end."""
    rows = 0
    for lane in range(len(boxes)):
        if column < boxes[lane, 1]:
            rows = max(rows, boxes[lane, 3])
    return rows


@njit(cache=True, nogil=True, error_model="numpy")
def _advance(boxes: Any, place: Any) -> None:
    """Go on to the next row, or to the next column, where the lanes of the warp meet again."""
    place[1] += 1
    if place[1] >= place[2]:
        place[0] += 1
        place[1] = 0
        place[2] = _rows(boxes, place[0])


@njit(cache=True, nogil=True, error_model="numpy")
def _row(events: Any, w: int, warp: int) -> Any:
    """Give the events of a warp's block."""
    if events is None:
        return None
    return events[w * warp // BLOCK]


@njit(cache=True, nogil=True, error_model="numpy")
def _boxes(
    screen: Any, triangles: Any, drawable: Any, first: int, shape: Any, culling: bool, boxes: Any, row: Any
) -> None:
    """Cull, and find each lane's box of pixels."""
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
        if left > right or top > bottom:
            continue
        boxes[lane, 0] = left
        boxes[lane, 1] = right - left + 1
        boxes[lane, 2] = top
        boxes[lane, 3] = bottom - top + 1
        boxes[lane, 4] = t
    if row is not None:
        row[0] += 1  # WARPS


@njit(cache=True, nogil=True, error_model="numpy")
def _step(
    screen: Any, triangles: Any, boxes: Any, place: Any, nearest: Any, depth: Any, pixels: Any, values: Any,
    wins: Any, row: Any,
) -> int:  # fmt: skip
    """One box step of a warp up to its atomicMin; ``pixels`` gets the pixel of each lane that hits, else -1."""
    hits = 0
    for lane in range(len(boxes)):
        pixels[lane] = -1
        wins[lane] = False
        if place[0] >= boxes[lane, 1] or place[1] >= boxes[lane, 3]:
            continue
        if row is not None:
            row[4] += 1  # SAMPLE_TESTS
        x = boxes[lane, 0] + place[0]
        y = boxes[lane, 2] + place[1]
        t = boxes[lane, 4]
        x0, y0, x1, y1, x2, y2 = corners(screen, triangles, t)
        inverse = _ONE / area(x0, y0, x1, y1, x2, y2)
        a, b, c = barycentric(x0, y0, x1, y1, x2, y2, inverse, np.float32(x) + _HALF, np.float32(y) + _HALF)
        if not inside(a, b, c):
            continue
        z = a * screen[triangles[t, 0], 2] + b * screen[triangles[t, 1], 2] + c * screen[triangles[t, 2], 2]
        if z < _ZERO or z >= _ONE:
            continue
        pixels[lane] = y * depth.shape[1] + x
        values[lane] = np.int32(np.float64(z) * DEPTH_SCALE)
        hits += 1
        if values[lane] < depth[y, x]:
            depth[y, x] = values[lane]
            nearest[y, x] = t
            wins[lane] = True
    if row is not None:
        row[5] += hits  # SAMPLE_HITS
    return hits


@njit(cache=True, nogil=True, error_model="numpy")
def _write(boxes: Any, pixels: Any, wins: Any, raced: Any, landed: Any, lands: int, row: Any) -> int:
    """Lanes that lowered the depth put their fragment, which lands in round ``lands``; 1 if there are any."""
    written = 0
    for lane in range(len(pixels)):
        if not wins[lane]:
            continue
        y, x = pixels[lane] // raced.shape[1], pixels[lane] % raced.shape[1]
        written += 1
        if lands >= landed[y, x]:
            landed[y, x] = lands
            raced[y, x] = boxes[lane, 4]
    if row is not None and written > 0:
        row[11] += 1  # WRITES
        row[12] += written
    return min(written, 1)


@njit(cache=True, nogil=True, error_model="numpy")
def _count_atomics(pixels: Any, merge: int, row: Any, requests: Any) -> None:
    for lane in range(len(pixels)):
        pixels[lane] *= 4  # bytes; inactive lanes stay negative
    lanes, merged, conflicts, depth = count_atomics(pixels, len(pixels), merge)
    row[6] += 1
    row[7] += lanes
    row[8] += merged
    row[9] += conflicts
    row[10] += depth
    add_requests(pixels, len(pixels), merge, 0, requests)
