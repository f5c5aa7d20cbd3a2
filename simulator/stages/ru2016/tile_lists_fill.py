"""Kernels of the tile lists: which tiles a triangle touches, walked warp by warp in lockstep."""

from enum import IntEnum
from typing import Any

import numpy as np

from tilestamp.models.atomics import add_requests, count_atomics
from tilestamp.models.coalescing import transactions
from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.ru2016.triangle import area, corners, pixel_box

BLOCK = 128  # threads
COUNTER_WORD = 4  # bytes of a tile's counter, and of a list entry
_ZERO = np.float32(0.0)


class TileListEvent(IntEnum):
    """Events of one block."""

    WARPS = 0  # warps that load their triangles and cull
    WARP_LANES = 1
    CULLED = 2  # lanes whose triangle faces away
    BOX_STEPS = 3  # warp steps over the tiles of the boxes: one separating axis test each
    BOX_LANES = 4
    APPENDS = 5  # warp steps in which a lane appends
    APPEND_LANES = 6
    ATOMIC = 7
    ATOMIC_LANES = 8
    ATOMIC_REQUESTS = 9
    ATOMIC_CONFLICTS = 10
    ATOMIC_DEPTH = 11
    LOAD_TRANSACTIONS = 12
    LOAD_BYTES = 13
    STORE_TRANSACTIONS = 14
    STORE_BYTES = 15
    LONGEST = 16  # most steps of a warp: the dependent chain of the block
    LONGEST_APPENDS = 17  # most steps of a warp in which a lane appends, and waits for its place


@kernel(error_model="numpy")
def overlaps(x0: Any, y0: Any, x1: Any, y1: Any, x2: Any, y2: Any, left: Any, top: Any, size: Any) -> bool:
    """Whether a triangle and a square tile overlap: no axis of five separates them (touching counts)."""
    right = left + size
    bottom = top + size
    if max(x0, x1, x2) < left or min(x0, x1, x2) > right:
        return False
    if max(y0, y1, y2) < top or min(y0, y1, y2) > bottom:
        return False
    return not (
        _separates(x0, y0, x1, y1, x2, y2, left, top, right, bottom)
        or _separates(x1, y1, x2, y2, x0, y0, left, top, right, bottom)
        or _separates(x2, y2, x0, y0, x1, y1, left, top, right, bottom)
    )


@kernel(error_model="numpy")
def _separates(
    ax: Any, ay: Any, bx: Any, by: Any, cx: Any, cy: Any, left: Any, top: Any, right: Any, bottom: Any
) -> Any:
    """Whether the normal of edge ab separates the tile from the triangle, whose third corner is c."""
    nx = ay - by
    ny = bx - ax
    third = nx * (cx - ax) + ny * (cy - ay)
    x = nx * (left - ax), nx * (right - ax)
    y = ny * (top - ay), ny * (bottom - ay)
    if third >= _ZERO:
        return max(x[0], x[1]) + max(y[0], y[1]) < _ZERO
    return min(x[0], x[1]) + min(y[0], y[1]) > _ZERO


@kernel(error_model="numpy")
def fill(
    screen: Any, triangles: Any, drawable: Any, width: int, height: int, tile: int, culling: bool, warp: int,
    rule: int, merge: int, room: int, limits: Any, sizes: Any, entries: Any, requests: Any, events: Any,
) -> int:  # fmt: skip
    """Walk all warps; ``entries`` None: only count. Returns the appends that found no room.

    Entries of tile i go to ``limits[i]`` and on; in the machine's memory lists lie ``room`` entries apart, if not 0.
    """
    boxes = np.empty((warp, 5), np.int64)  # first column, columns, first row, rows, triangle
    addresses = np.empty(warp, np.int64)
    places = np.empty(warp, np.int64)
    lost = 0
    for first in range(0, len(drawable), warp):
        rows = _boxes(screen, triangles, drawable, first, width, height, tile, culling, boxes, events)
        steps = 0
        waits = 0
        for y in range(rows):
            columns = _columns(boxes, y)
            for x in range(columns):
                appended, missed = _append(
                    screen, triangles, boxes, x, y, width, tile, room, limits, sizes, entries, addresses, places
                )
                lost += missed
                waits += appended > 0
                if events is not None and appended > 0:
                    _count_append(addresses, places, warp, rule, merge, events[first // BLOCK], requests)
            steps += columns
            if events is not None:
                for lane in range(warp):
                    events[first // BLOCK, TileListEvent.BOX_LANES] += boxes[lane, 1] if y < boxes[lane, 3] else 0
        if events is not None:
            row = events[first // BLOCK]
            row[TileListEvent.BOX_STEPS] += steps
            row[TileListEvent.LONGEST] = max(row[TileListEvent.LONGEST], steps)
            row[TileListEvent.LONGEST_APPENDS] = max(row[TileListEvent.LONGEST_APPENDS], waits)
    return lost


@kernel(error_model="numpy")
def _columns(boxes: Any, y: int) -> int:
    """Steps of a warp over row y of its lanes' boxes: those of the widest that has the row."""
    columns = 0
    for lane in range(len(boxes)):
        if y < boxes[lane, 3]:
            columns = max(columns, boxes[lane, 1])
    return columns


@kernel(error_model="numpy")
def _append(
    screen: Any, triangles: Any, boxes: Any, x: int, y: int, width: int, tile: int, room: int, limits: Any,
    sizes: Any, entries: Any, addresses: Any, places: Any,
) -> tuple[int, int]:  # fmt: skip
    """One step of a warp: each lane tests tile (x, y) of its box and appends. Returns appends, and those lost."""
    across = (width + tile - 1) // tile
    side = np.float32(tile)
    appended = 0
    lost = 0
    for lane in range(len(boxes)):
        addresses[lane] = -1
        places[lane] = -1
        if x >= boxes[lane, 1] or y >= boxes[lane, 3]:
            continue
        column = boxes[lane, 0] + x
        row = boxes[lane, 2] + y
        t = boxes[lane, 4]
        x0, y0, x1, y1, x2, y2 = corners(screen, triangles, t)
        if not overlaps(x0, y0, x1, y1, x2, y2, np.float32(column * tile), np.float32(row * tile), side):
            continue
        target = row * across + column
        addresses[lane] = target * COUNTER_WORD
        place = limits[target] + sizes[target]
        stored = target * room + sizes[target] if room else place
        sizes[target] += 1
        appended += 1
        if entries is not None:
            if place < limits[target + 1]:
                entries[place] = t
                places[lane] = stored * COUNTER_WORD
            else:
                lost += 1
    return appended, lost


@kernel(error_model="numpy")
def _boxes(
    screen: Any, triangles: Any, drawable: Any, first: int, width: int, height: int, tile: int, culling: bool,
    boxes: Any, events: Any,
) -> int:  # fmt: skip
    """Cull, and find each lane's box of tiles; returns the most rows of a lane."""
    most = 0
    for lane in range(len(boxes)):
        boxes[lane, 1] = 0
        boxes[lane, 3] = 0
        if first + lane >= len(drawable):
            continue
        t = drawable[first + lane]
        x0, y0, x1, y1, x2, y2 = corners(screen, triangles, t)
        if events is not None:
            events[first // BLOCK, TileListEvent.WARP_LANES] += 1
        if culling and area(x0, y0, x1, y1, x2, y2) <= _ZERO:
            if events is not None:
                events[first // BLOCK, TileListEvent.CULLED] += 1
            continue
        left, right, top, bottom = pixel_box(x0, y0, x1, y1, x2, y2, width, height)
        if left > right or top > bottom:
            continue
        boxes[lane, 0] = left // tile
        boxes[lane, 1] = right // tile - left // tile + 1
        boxes[lane, 2] = top // tile
        boxes[lane, 3] = bottom // tile - top // tile + 1
        boxes[lane, 4] = t
        most = max(most, boxes[lane, 3])
    if events is not None:
        events[first // BLOCK, TileListEvent.WARPS] += 1
    return most


@kernel(error_model="numpy")
def _count_append(addresses: Any, places: Any, warp: int, rule: int, merge: int, row: Any, requests: Any) -> None:
    """Count one warp's atomicAdd on the counters and the stores of the entries."""
    lanes, merged, conflicts, depth = count_atomics(addresses, warp, merge)
    row[TileListEvent.APPENDS] += 1
    row[TileListEvent.APPEND_LANES] += lanes
    row[TileListEvent.ATOMIC] += 1
    row[TileListEvent.ATOMIC_LANES] += lanes
    row[TileListEvent.ATOMIC_REQUESTS] += merged
    row[TileListEvent.ATOMIC_CONFLICTS] += conflicts
    row[TileListEvent.ATOMIC_DEPTH] += depth
    add_requests(addresses, warp, merge, 0, requests)
    count, size = transactions(places, warp, COUNTER_WORD, rule)
    row[TileListEvent.STORE_TRANSACTIONS] += count
    row[TileListEvent.STORE_BYTES] += size
