"""Kernels of the per-primitive raster: the resident warps walk the boxes of their triangles in lockstep."""

from typing import Any

import numpy as np

from tilestamp.models.atomics import add_requests, count_atomics
from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.borrow import borrow, row_of
from tilestamp.simulator.stages.ru2016.per_primitive_warps import BLOCK, PerPrimitiveEvent
from tilestamp.simulator.stages.ru2016.triangle import area, barycentric, border_box, corners, inside

RACE_ROUNDS = 3  # assumed
DEPTH_SCALE = np.float64(2**31 - 1)  # depths are compared as integers
FAR = np.int32(2**31 - 1)
_HALF = np.float32(0.5)
_ONE = np.float32(1.0)
_ZERO = np.float32(0.0)


@kernel(error_model="numpy")
def walk(mesh: Any, culling: bool, merge: int, warps: Any, buffers: Any, events: Any) -> None:
    """All waves of resident warps.

    Parameters
    ----------
    mesh : tuple
        Shaded vertices, triangles, those to draw, and how far the vertices were moved for samples at corners.
    culling, merge
    warps : Walkers
    buffers : tuple
        Nearest triangle, depth, triangle of the fragment that landed last, its round, atomic requests.
    events : ndarray or None
    """
    resident, warp = warps.boxes.shape[:2]
    total = (len(mesh[2]) + warp - 1) // warp
    rounds = 0
    for first in range(0, total, resident):
        end = min(total, first + resident)
        warps.boxes[:] = 0
        warps.seen[:] = 0
        rounds = _wave(borrow(mesh), first, end, culling, merge, warps, borrow(buffers), rounds, borrow(events))


@kernel(error_model="numpy")
def _wave(
    mesh: Any, first: int, end: int, culling: bool, merge: int, warps: Any, buffers: Any, rounds: int, events: Any
) -> Any:
    """Run the resident warps first..end-1 to their ends; returns the round after the last."""
    boxes, shapes, place, present, seen, pixels, who, wins = borrow(
        (warps.boxes, warps.shapes, warps.place, warps.present, warps.seen, warps.pixels, warps.who, warps.wins)
    )
    nearest, depth, raced, landed, requests = buffers
    warp = len(pixels)
    count = end - first
    for w in range(count):
        row = row_of(events, (first + w) * warp // BLOCK)
        _boxes(*mesh, (first + w) * warp, depth.shape, culling, boxes[w], shapes[w], row)
        _column(boxes, w, 0, place, present)
    s = 0
    busy = True
    while busy:
        busy = False
        for w in range(count):
            if place[w, 1] >= place[w, 2]:  # at its end
                continue
            busy = True
            row = row_of(events, (first + w) * warp // BLOCK)
            hits = _step(shapes, boxes, w, place, present, nearest, depth, pixels, who, wins, row)
            seen[w, 0] += 1
            if hits > 0:
                delay = 1 + ((first + w) * 2654435761 + s * 40503) // 65536 % RACE_ROUNDS
                seen[w, 1] += 1
                seen[w, 2] += _write(boxes, w, pixels[:hits], who, wins, raced, landed, rounds + s + delay, row)
                if events is not None:
                    _count_atomics(pixels[:hits], merge, row, requests)
            place[w, 1] += 1
            if place[w, 1] >= place[w, 2]:  # the lanes meet before the next column
                _column(boxes, w, place[w, 0] + 1, place, present)
        s += 1
    if events is not None:
        for w in range(count):
            row = events[(first + w) * warp // BLOCK]
            row[PerPrimitiveEvent.BOX_STEPS] += seen[w, 0]
            row[PerPrimitiveEvent.LONGEST] = max(row[PerPrimitiveEvent.LONGEST], seen[w, 0])
            row[PerPrimitiveEvent.LONGEST_HITS] = max(row[PerPrimitiveEvent.LONGEST_HITS], seen[w, 1])
            row[PerPrimitiveEvent.LONGEST_WRITES] = max(row[PerPrimitiveEvent.LONGEST_WRITES], seen[w, 2])
    return rounds + s


@kernel(error_model="numpy")
def _column(boxes: Any, w: int, column: int, place: Any, present: Any) -> None:
    """Begin a column of a warp's boxes: it takes the rows of the highest box that has the column; none at the end."""
    rows = 0
    lanes = 0
    for lane in range(boxes.shape[1]):
        if column < boxes[w, lane, 1]:
            rows = max(rows, boxes[w, lane, 3])
            present[w, lanes] = lane
            lanes += 1
    place[w, 0] = column
    place[w, 1] = 0
    place[w, 2] = rows
    place[w, 3] = lanes


@kernel(error_model="numpy")
def _boxes(
    screen: Any, triangles: Any, drawable: Any, shift: Any, first: int, shape: Any, culling: bool, boxes: Any,
    shapes: Any, row: Any,
) -> None:  # fmt: skip
    """Cull, and find each lane's box of pixels, by the vertices' own places, and what does not change over it."""
    for lane in range(len(boxes)):
        if first + lane >= len(drawable):
            break
        t = drawable[first + lane]
        x0, y0, x1, y1, x2, y2 = corners(screen, triangles, t)
        if row is not None:
            row[PerPrimitiveEvent.WARP_LANES] += 1
        size = area(x0, y0, x1, y1, x2, y2)
        if (culling and size <= _ZERO) or size == _ZERO:
            if row is not None:
                row[PerPrimitiveEvent.CULLED] += 1
            continue
        left, right, top, bottom = border_box(
            x0 - shift[0], y0 - shift[1], x1 - shift[0], y1 - shift[1], x2 - shift[0], y2 - shift[1], shape[1], shape[0]
        )
        boxes[lane, 0] = left
        boxes[lane, 1] = right - left + 1
        boxes[lane, 2] = top
        boxes[lane, 3] = bottom - top + 1
        boxes[lane, 4] = t
        for k in range(3):
            shapes[lane, 2 * k] = screen[triangles[t, k], 0]
            shapes[lane, 2 * k + 1] = screen[triangles[t, k], 1]
            shapes[lane, 7 + k] = screen[triangles[t, k], 2]
        shapes[lane, 6] = _ONE / size
    if row is not None:
        row[PerPrimitiveEvent.WARPS] += 1


@kernel(error_model="numpy")
def _step(
    shapes: Any, boxes: Any, w: int, place: Any, present: Any, nearest: Any, depth: Any, pixels: Any, who: Any,
    wins: Any, row: Any,
) -> int:  # fmt: skip
    """One box step of a warp up to its atomicMin.

    Of each lane that hits, in order: its pixel, its number, whether it lowered the depth. Returns how many.
    """
    column, line = place[w, 0], place[w, 1]
    hits = 0
    tests = 0
    for i in range(place[w, 3]):
        lane = present[w, i]
        if line >= boxes[w, lane, 3]:
            continue
        tests += 1
        x = boxes[w, lane, 0] + column
        y = boxes[w, lane, 2] + line
        x0, y0, x1, y1 = shapes[w, lane, 0], shapes[w, lane, 1], shapes[w, lane, 2], shapes[w, lane, 3]
        x2, y2, inverse = shapes[w, lane, 4], shapes[w, lane, 5], shapes[w, lane, 6]
        a, b, c = barycentric(x0, y0, x1, y1, x2, y2, inverse, np.float32(x) + _HALF, np.float32(y) + _HALF)
        if not inside(a, b, c):
            continue
        z = a * shapes[w, lane, 7] + b * shapes[w, lane, 8] + c * shapes[w, lane, 9]
        if z < _ZERO or z >= _ONE:
            continue
        value = np.int32(np.float64(z) * DEPTH_SCALE)
        pixels[hits] = y * depth.shape[1] + x
        who[hits] = lane
        wins[hits] = value < depth[y, x]
        if wins[hits]:
            depth[y, x] = value
            nearest[y, x] = boxes[w, lane, 4]
        hits += 1
    if row is not None:
        row[PerPrimitiveEvent.SAMPLE_TESTS] += tests
        row[PerPrimitiveEvent.SAMPLE_HITS] += hits
    return hits


@kernel(error_model="numpy")
def _write(boxes: Any, w: int, pixels: Any, who: Any, wins: Any, raced: Any, landed: Any, lands: int, row: Any) -> int:
    """Lanes that lowered the depth put their fragment, which lands in round ``lands``; 1 if there are any."""
    written = 0
    for i in range(len(pixels)):
        if not wins[i]:
            continue
        y, x = pixels[i] // raced.shape[1], pixels[i] % raced.shape[1]
        written += 1
        if lands >= landed[y, x]:
            landed[y, x] = lands
            raced[y, x] = boxes[w, who[i], 4]
    if row is not None and written > 0:
        row[PerPrimitiveEvent.WRITES] += 1
        row[PerPrimitiveEvent.WRITE_LANES] += written
    return min(written, 1)


@kernel(error_model="numpy")
def _count_atomics(pixels: Any, merge: int, row: Any, requests: Any) -> None:
    for i in range(len(pixels)):
        pixels[i] *= 4  # bytes
    lanes, merged, conflicts, depth = count_atomics(pixels, len(pixels), merge)
    row[PerPrimitiveEvent.ATOMIC] += 1
    row[PerPrimitiveEvent.ATOMIC_LANES] += lanes
    row[PerPrimitiveEvent.ATOMIC_REQUESTS] += merged
    row[PerPrimitiveEvent.ATOMIC_CONFLICTS] += conflicts
    row[PerPrimitiveEvent.ATOMIC_DEPTH] += depth
    add_requests(pixels, len(pixels), merge, 0, requests)
