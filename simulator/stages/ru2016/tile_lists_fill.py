"""Kernels of the tile lists: which tiles a triangle touches, walked by all resident warps in lockstep.

A warp does one step of its boxes a round. Which of the warps that append in the same round comes first is not known;
a hash of their numbers decides (``tile_lists_warps.walkers``). On a machine that holds all triangles at once an entry
so stands in its list by how far into its box the tile lies, not by its triangle's number.
"""

from typing import Any

import numpy as np

from tilestamp.models.atomics import add_requests, count_atomics
from tilestamp.models.coalescing import transactions
from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.ru2016.tile_lists_warps import BLOCK, COUNTER_WORD, SEPARATED_BY_NONE, TileListEvent
from tilestamp.simulator.stages.ru2016.triangle import area, corners, pixel_box

_ZERO = np.float32(0.0)


@kernel(error_model="numpy", lent=True)
def edges_tried(x0: Any, y0: Any, x1: Any, y1: Any, x2: Any, y2: Any, left: Any, top: Any, size: Any) -> int:
    """Edges of a triangle that are tried until one separates it from a square tile (touching does not).

    0 where a side of the tile does; ``SEPARATED_BY_NONE`` where they overlap.
    """
    right = left + size
    bottom = top + size
    if max(x0, x1, x2) < left or min(x0, x1, x2) > right:
        return 0
    if max(y0, y1, y2) < top or min(y0, y1, y2) > bottom:
        return 0
    if _separates(x0, y0, x1, y1, x2, y2, left, top, right, bottom):
        return 1
    if _separates(x1, y1, x2, y2, x0, y0, left, top, right, bottom):
        return 2
    return 3 if _separates(x2, y2, x0, y0, x1, y1, left, top, right, bottom) else SEPARATED_BY_NONE


@kernel(error_model="numpy", lent=True)
def overlaps(x0: Any, y0: Any, x1: Any, y1: Any, x2: Any, y2: Any, left: Any, top: Any, size: Any) -> Any:
    """Whether a triangle and a square tile overlap: no axis of five separates them."""
    return edges_tried(x0, y0, x1, y1, x2, y2, left, top, size) == SEPARATED_BY_NONE


@kernel(error_model="numpy", lent=True)
def _separates(
    ax: Any, ay: Any, bx: Any, by: Any, cx: Any, cy: Any, left: Any, top: Any, right: Any, bottom: Any
) -> Any:
    """Whether the normal of edge ab separates the tile from the triangle, whose third corner is c, on either side."""
    nx = ay - by
    ny = bx - ax
    third = nx * (cx - ax) + ny * (cy - ay)
    x = nx * (left - ax), nx * (right - ax)
    y = ny * (top - ay), ny * (bottom - ay)
    nearest = min(x[0], x[1]) + min(y[0], y[1])
    farthest = max(x[0], x[1]) + max(y[0], y[1])
    return farthest < min(third, _ZERO) or nearest > max(third, _ZERO)


@kernel(error_model="numpy", lent=True)
def count_entries(part: int, parts: int, mesh: Any, frame: Any, sizes: Any) -> None:
    """Count the entries of each tile's list, of a share of the triangles in a row of ``sizes``; their order is free."""
    screen, triangles, drawable = mesh
    width, height, tile, culling = frame
    across = (width + tile - 1) // tile
    side = np.float32(tile)
    for i in range(len(drawable) * part // parts, len(drawable) * (part + 1) // parts):
        x0, y0, x1, y1, x2, y2 = corners(screen, triangles, drawable[i])
        if culling and area(x0, y0, x1, y1, x2, y2) <= _ZERO:
            continue
        left, right, top, bottom = pixel_box(x0, y0, x1, y1, x2, y2, width, height)
        if left > right or top > bottom:
            continue
        for line in range(top // tile, bottom // tile + 1):
            for column in range(left // tile, right // tile + 1):
                if overlaps(x0, y0, x1, y1, x2, y2, np.float32(column * tile), np.float32(line * tile), side):
                    sizes[part, line * across + column] += 1


@kernel(error_model="numpy", lent=True)
def fill(
    mesh: Any, frame: Any, rules: Any, walkers: Any, room: int, limits: Any, sizes: Any, entries: Any, requests: Any,
    events: Any,
) -> int:  # fmt: skip
    """Walk all warps; returns the appends that found no room.

    Parameters
    ----------
    mesh : tuple
        Shaded vertices, triangles, those to draw.
    frame : tuple
        Width, height and tile in pixels; whether to cull.
    rules : tuple
        Of coalescing, and of merging atomics.
    walkers : TileWalkers
    room : int
        Entries between lists in the machine's memory; 0: entries of tile i go to ``limits[i]`` and on there too.
    limits, sizes, entries, requests, events : ndarray
    """
    resident, warp = walkers.boxes.shape[:2]
    total = (len(mesh[2]) + warp - 1) // warp
    lost = 0
    for first in range(0, total, resident):
        count = min(total, first + resident) - first
        for w in range(count):
            row = events[(first + w) * warp // BLOCK]
            rows = _boxes(mesh, (first + w) * warp, frame, walkers.boxes[w], row)
            walkers.place[w, :] = 0
            walkers.place[w, 3] = rows
            if rows > 0:
                _begin_row(walkers.boxes[w], walkers.place[w], row)
        lost += _rounds(
            mesh, frame, rules, walkers, first, count, room,
            (limits, sizes, entries, requests), events,
        )  # fmt: skip
    return lost


@kernel(error_model="numpy", lent=True)
def _rounds(
    mesh: Any, frame: Any, rules: Any, walkers: Any, first: int, count: int, room: int, lists: Any, events: Any
) -> int:
    """One step of each resident warp a round, until the last has ended."""
    boxes, place, order, addresses, places = walkers
    limits, sizes, entries, requests = lists
    warp = boxes.shape[1]
    lost = 0
    busy = True
    while busy:
        busy = False
        for i in range(len(order)):
            w = order[i]
            if w >= count or place[w, 1] >= place[w, 3]:
                continue
            busy = True
            row = events[(first + w) * warp // BLOCK]
            appended, missed = _append(
                mesh, frame, boxes[w], place[w], room, limits, sizes, entries, addresses, places, row
            )
            lost += missed
            if appended > 0:
                place[w, 5] += 1
                _count_append(addresses, places, warp, rules, row, requests)
            place[w, 4] += 1
            place[w, 0] += 1
            if place[w, 0] >= place[w, 2]:  # lanes meet after each row
                place[w, 0] = 0
                place[w, 1] += 1
                if place[w, 1] < place[w, 3]:
                    _begin_row(boxes[w], place[w], row)
    for w in range(count):
        row = events[(first + w) * warp // BLOCK]
        row[TileListEvent.BOX_STEPS] += place[w, 4]
        row[TileListEvent.LONGEST] = max(row[TileListEvent.LONGEST], place[w, 4])
        row[TileListEvent.LONGEST_APPENDS] = max(row[TileListEvent.LONGEST_APPENDS], place[w, 5])
        row[TileListEvent.LONGEST_EDGES] = max(row[TileListEvent.LONGEST_EDGES], place[w, 6])
        row[TileListEvent.LONGEST_ROWS] = max(row[TileListEvent.LONGEST_ROWS], place[w, 3])
    return lost


@kernel(error_model="numpy", lent=True)
def _begin_row(boxes: Any, place: Any, row: Any) -> None:
    """Find the steps of a warp over a row of its lanes' boxes: those of the widest that has the row."""
    columns = 0
    lanes = 0
    tiles = 0
    for lane in range(len(boxes)):
        if place[1] < boxes[lane, 3]:
            columns = max(columns, boxes[lane, 1])
            tiles += boxes[lane, 1]
            lanes += 1
    place[2] = columns
    row[TileListEvent.ROW_STEPS] += 1
    row[TileListEvent.ROW_LANES] += lanes
    row[TileListEvent.BOX_LANES] += tiles


@kernel(error_model="numpy", lent=True)
def _append(
    mesh: Any, frame: Any, boxes: Any, place: Any, room: int, limits: Any, sizes: Any, entries: Any,
    addresses: Any, places: Any, row: Any,
) -> tuple[int, int]:  # fmt: skip
    """One step of a warp: each lane tests a tile of its box, lowest row first. Returns appends, and those lost."""
    screen, triangles, _ = mesh
    width, _, tile, _ = frame
    across = (width + tile - 1) // tile
    side = np.float32(tile)
    x, y = place[0], place[1]
    appended = 0
    lost = 0
    deepest = 0
    lanes = 0
    for lane in range(len(boxes)):
        addresses[lane] = -1
        places[lane] = -1
        if x >= boxes[lane, 1] or y >= boxes[lane, 3]:
            continue
        column = boxes[lane, 0] + x
        line = boxes[lane, 2] - y
        t = boxes[lane, 4]
        x0, y0, x1, y1, x2, y2 = corners(screen, triangles, t)
        tried = edges_tried(x0, y0, x1, y1, x2, y2, np.float32(column * tile), np.float32(line * tile), side)
        deepest = max(deepest, min(tried, 3))
        lanes += min(tried, 3)
        if tried < SEPARATED_BY_NONE:
            continue
        target = line * across + column
        addresses[lane] = target * COUNTER_WORD
        at = limits[target] + sizes[target]
        stored = target * room + sizes[target] if room else at
        sizes[target] += 1
        appended += 1
        if at < limits[target + 1]:
            entries[at] = t
            places[lane] = stored * COUNTER_WORD
        else:
            lost += 1
    place[6] += deepest
    row[TileListEvent.EDGE_STEPS] += deepest
    row[TileListEvent.EDGE_LANES] += lanes
    return appended, lost


@kernel(error_model="numpy", lent=True)
def _boxes(mesh: Any, first: int, frame: Any, boxes: Any, row: Any) -> int:
    """Cull, and find each lane's box of tiles; returns the most rows of a lane."""
    screen, triangles, drawable = mesh
    width, height, tile, culling = frame
    most = 0
    front = 0
    for lane in range(len(boxes)):
        boxes[lane, 1] = 0
        boxes[lane, 3] = 0
        if first + lane >= len(drawable):
            continue
        t = drawable[first + lane]
        x0, y0, x1, y1, x2, y2 = corners(screen, triangles, t)
        row[TileListEvent.WARP_LANES] += 1
        if culling and area(x0, y0, x1, y1, x2, y2) <= _ZERO:
            row[TileListEvent.CULLED] += 1
            continue
        front += 1
        left, right, top, bottom = pixel_box(x0, y0, x1, y1, x2, y2, width, height)
        if left > right or top > bottom:
            continue
        boxes[lane, 0] = left // tile
        boxes[lane, 1] = right // tile - left // tile + 1
        boxes[lane, 2] = bottom // tile
        boxes[lane, 3] = bottom // tile - top // tile + 1
        boxes[lane, 4] = t
        most = max(most, boxes[lane, 3])
    row[TileListEvent.WARPS] += 1
    row[TileListEvent.FRONT_WARPS] += min(front, 1)
    row[TileListEvent.FRONT_LANES] += front
    return most


@kernel(error_model="numpy", lent=True)
def _count_append(addresses: Any, places: Any, warp: int, rules: Any, row: Any, requests: Any) -> None:
    """Count one warp's atomicAdd on the counters and the stores of the entries."""
    lanes, merged, conflicts, depth = count_atomics(addresses, warp, rules[1])
    row[TileListEvent.APPENDS] += 1
    row[TileListEvent.APPEND_LANES] += lanes
    row[TileListEvent.ATOMIC] += 1
    row[TileListEvent.ATOMIC_LANES] += lanes
    row[TileListEvent.ATOMIC_REQUESTS] += merged
    row[TileListEvent.ATOMIC_CONFLICTS] += conflicts
    row[TileListEvent.ATOMIC_DEPTH] += depth
    add_requests(addresses, warp, rules[1], 0, requests)
    count, size = transactions(places, warp, COUNTER_WORD, rules[0])
    row[TileListEvent.STORE_TRANSACTIONS] += count
    row[TileListEvent.STORE_BYTES] += size
