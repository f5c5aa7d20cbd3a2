"""Kernels of the per-primitive raster: the resident warps walk the boxes of their triangles in lockstep.

A lane goes on to its next column of pixels without waiting for the others of its warp, so a warp takes as many steps as
its largest box has pixels. That is how the original runs on an H200, to the last step (2,951,510 in ten frames).
"""

from typing import Any

import numpy as np

from tilestamp.models.atomics import add_requests, count_atomics
from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.ru2016.per_primitive_warps import BLOCK, PerPrimitiveEvent
from tilestamp.simulator.stages.ru2016.triangle import area, barycentric, border_box, corners, inside

RACE_PLACES = 3  # in a round, at which fragments land (assumed)
DEPTH_SCALE = np.float64(2**31 - 1)  # depths are compared as integers
FAR = np.int32(2**31 - 1)
LONGEST = (  # what is kept of the warp of a block that does it most often, in the order of ``Walkers.seen``
    int(PerPrimitiveEvent.LONGEST),
    int(PerPrimitiveEvent.LONGEST_HITS),
    int(PerPrimitiveEvent.LONGEST_WRITES),
    int(PerPrimitiveEvent.LONGEST_TEXTURED),
    int(PerPrimitiveEvent.LONGEST_COLUMNS),
)
_HALF = np.float32(0.5)
_ONE = np.float32(1.0)
_ZERO = np.float32(0.0)


@kernel(error_model="numpy", lent=True)
def walk(mesh: Any, culling: bool, merge: int, warps: Any, buffers: Any, events: Any) -> None:
    """All waves of resident warps.

    Parameters
    ----------
    mesh : tuple
        Shaded vertices, triangles, those to draw, how far the vertices were moved for samples at corners, and of each
        triangle whether it has a texture.
    culling, merge
    warps : Walkers
    buffers : tuple
        Nearest triangle, depth, triangle of the fragment that landed last, its round, atomic requests.
    events : ndarray
    """
    resident, warp = warps.boxes.shape[:2]
    total = (len(mesh[2]) + warp - 1) // warp
    rounds = 0
    for first in range(0, total, resident):
        end = min(total, first + resident)
        warps.boxes[:] = 0
        warps.seen[:] = 0
        rounds = _wave(mesh, first, end, culling, merge, warps, buffers, rounds, events)


@kernel(error_model="numpy", lent=True)
def _wave(
    mesh: Any, first: int, end: int, culling: bool, merge: int, warps: Any, buffers: Any, rounds: int, events: Any
) -> Any:
    """Run the resident warps first..end-1 to their ends; returns the round after the last."""
    boxes, shapes, steps, seen, pixels, who, wins = warps
    nearest, depth, raced, landed, requests = buffers
    textured = mesh[4]
    warp = len(pixels)
    count = end - first
    for w in range(count):
        row = events[(first + w) * warp // BLOCK]
        steps[w] = _boxes(*mesh[:4], (first + w) * warp, depth.shape, culling, boxes[w], shapes[w], row)
    s = 0
    busy = True
    while busy:
        busy = False
        for w in range(count):
            if s >= steps[w]:  # at its end
                continue
            busy = True
            row = events[(first + w) * warp // BLOCK]
            hits, columns = _step(shapes[w], boxes[w], nearest, depth, pixels, who, wins, row)
            seen[w, 0] += 1
            seen[w, 4] += min(columns, 1)
            if hits > 0:
                delay = ((first + w) * 2654435761 + s * 40503) // 65536 % RACE_PLACES
                lands = RACE_PLACES * (rounds + s) + delay
                seen[w, 1] += 1
                written, mapped = _write(boxes, w, pixels[:hits], who, wins, textured, raced, landed, lands, row)
                seen[w, 2] += min(written, 1)
                seen[w, 3] += min(mapped, 1)
                _count_atomics(pixels[:hits], merge, row, requests)
        s += 1
    for w in range(count):
        row = events[(first + w) * warp // BLOCK]
        row[PerPrimitiveEvent.BOX_STEPS] += seen[w, 0]
        for k in range(len(LONGEST)):
            row[LONGEST[k]] = max(row[LONGEST[k]], seen[w, k])
    return rounds + s


@kernel(error_model="numpy", lent=True)
def _boxes(
    screen: Any, triangles: Any, drawable: Any, shift: Any, first: int, shape: Any, culling: bool, boxes: Any,
    shapes: Any, row: Any,
) -> int:  # fmt: skip
    """Cull, and find each lane's box of pixels, by the vertices' own places, and what does not change over it.

    Returns the pixels of the largest.
    """
    front = 0
    most = 0
    for lane in range(len(boxes)):
        if first + lane >= len(drawable):
            break
        t = drawable[first + lane]
        x0, y0, x1, y1, x2, y2 = corners(screen, triangles, t)
        row[PerPrimitiveEvent.WARP_LANES] += 1
        size = area(x0, y0, x1, y1, x2, y2)
        if (culling and size <= _ZERO) or size == _ZERO:
            row[PerPrimitiveEvent.CULLED] += 1
            continue
        front += 1
        left, right, top, bottom = border_box(
            x0 - shift[0], y0 - shift[1], x1 - shift[0], y1 - shift[1], x2 - shift[0], y2 - shift[1], shape[1], shape[0]
        )
        boxes[lane, 0] = left
        boxes[lane, 1] = right - left + 1
        boxes[lane, 2] = bottom
        boxes[lane, 3] = bottom - top + 1
        boxes[lane, 4] = t
        most = max(most, boxes[lane, 1] * boxes[lane, 3])
        for k in range(3):
            shapes[lane, 2 * k] = screen[triangles[t, k], 0]
            shapes[lane, 2 * k + 1] = screen[triangles[t, k], 1]
            shapes[lane, 7 + k] = screen[triangles[t, k], 2]
        shapes[lane, 6] = _ONE / size
    row[PerPrimitiveEvent.WARPS] += 1
    row[PerPrimitiveEvent.FRONT_WARPS] += min(front, 1)
    row[PerPrimitiveEvent.FRONT_LANES] += front
    return most


@kernel(error_model="numpy", lent=True)
def _step(
    shapes: Any, boxes: Any, nearest: Any, depth: Any, pixels: Any, who: Any, wins: Any, row: Any
) -> tuple[int, int]:
    """One box step of a warp up to its atomicMin.

    Of each lane that hits, in order: its pixel, its number, whether it lowered the depth. Returns how many, and how
    many lanes end a column.
    """
    hits = 0
    tests = 0
    columns = 0
    for lane in range(len(boxes)):
        if boxes[lane, 5] >= boxes[lane, 1]:
            continue
        tests += 1
        x = boxes[lane, 0] + boxes[lane, 5]
        y = boxes[lane, 2] - boxes[lane, 6]
        boxes[lane, 6] += 1
        if boxes[lane, 6] == boxes[lane, 3]:
            boxes[lane, 6] = 0
            boxes[lane, 5] += 1
            columns += 1
        x0, y0, x1, y1 = shapes[lane, 0], shapes[lane, 1], shapes[lane, 2], shapes[lane, 3]
        x2, y2, inverse = shapes[lane, 4], shapes[lane, 5], shapes[lane, 6]
        a, b, c = barycentric(x0, y0, x1, y1, x2, y2, inverse, np.float32(x) + _HALF, np.float32(y) + _HALF)
        if not inside(a, b, c):
            continue
        z = a * shapes[lane, 7] + b * shapes[lane, 8] + c * shapes[lane, 9]
        if z < _ZERO or z >= _ONE:
            continue
        value = np.int32(np.float64(z) * DEPTH_SCALE)
        pixels[hits] = y * depth.shape[1] + x
        who[hits] = lane
        wins[hits] = value < depth[y, x]
        if wins[hits]:
            depth[y, x] = value
            nearest[y, x] = boxes[lane, 4]
        hits += 1
    row[PerPrimitiveEvent.SAMPLE_TESTS] += tests
    row[PerPrimitiveEvent.SAMPLE_HITS] += hits
    row[PerPrimitiveEvent.COLUMN_STEPS] += min(columns, 1)
    row[PerPrimitiveEvent.COLUMN_LANES] += columns
    return hits, columns


@kernel(error_model="numpy", lent=True)
def _write(
    boxes: Any, w: int, pixels: Any, who: Any, wins: Any, textured: Any, raced: Any, landed: Any, lands: int, row: Any
) -> tuple[int, int]:
    """Lanes that lowered the depth put their fragment, which lands at ``lands``; how many, and with a texture.

    Of lanes that write the same pixel together the lowest one's fragment stays. So 924 of the 928 pixels that an H200
    draws wrong in all of 100 frames (three models without culling) are wrong, 923 with the triangle that it has there.
    """
    written = 0
    mapped = 0
    for i in range(len(pixels) - 1, -1, -1):
        if not wins[i]:
            continue
        y, x = pixels[i] // raced.shape[1], pixels[i] % raced.shape[1]
        t = boxes[w, who[i], 4]
        written += 1
        mapped += textured[t]
        if lands >= landed[y, x]:
            landed[y, x] = lands
            raced[y, x] = t
    row[PerPrimitiveEvent.WRITES] += min(written, 1)
    row[PerPrimitiveEvent.WRITE_LANES] += written
    row[PerPrimitiveEvent.TEXTURED_WRITES] += min(mapped, 1)
    row[PerPrimitiveEvent.TEXTURED_LANES] += mapped
    return written, mapped


@kernel(error_model="numpy", lent=True)
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
