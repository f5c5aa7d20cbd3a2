"""Tile lists: the triangles that touch each tile (Ru 2016, "Tile-based rasterization").

One thread a triangle (128 a block): cull back faces, walk the tiles of the box, test each by a separating axis test on
five axes (two of the tile, three of the triangle), and append with **one global atomicAdd for each (triangle, tile)**
and a 4-byte store. A warp walks in lockstep: lane i is at step s of its own box.

The original gives each tile room for all triangles if there are at most 100, else for a tenth of them, and does not
check for overflow. Here an overflow is dropped and reported; the default counts first, scans, and then fills.
"""

from enum import IntEnum
from typing import Any, Literal, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from models.atomics import add_requests, count_atomics
from models.coalescing import transactions
from models.launch import Stream
from models.simt import Simt
from simulator.stages.ru2016.triangle import area, corners, pixel_box
from simulator.stages.ru2016.vertex_shading import PRIMITIVE_BYTES
from simulator.work import Work

BLOCK = 128  # threads
SMALL_MODEL = 100  # triangles up to which a list can hold all of them
Capacity = Literal["safe", "original"]
_ZERO = np.float32(0.0)
_COUNTER_WORD = 4  # bytes of a tile's counter, and of a list entry


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


class TileLists(NamedTuple):
    """Triangles by tile, in the order in which they were appended.

    Parameters
    ----------
    starts : ndarray, (tiles + 1,), int64
    entries : ndarray, (starts[-1],), int32
    """

    starts: NDArray[np.int64]
    entries: NDArray[np.int32]


@njit(cache=True, nogil=True, error_model="numpy")
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


@njit(cache=True, nogil=True, error_model="numpy")
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


@njit(cache=True, nogil=True, error_model="numpy")
def _fill(
    screen: Any, triangles: Any, drawable: Any, width: int, height: int, tile: int, culling: bool, warp: int,
    rule: int, merge: int, limits: Any, sizes: Any, entries: Any, requests: Any, events: Any,
) -> int:  # fmt: skip
    """Walk all warps; ``entries`` None: only count. Returns the appends that found no room."""
    columns = (width + tile - 1) // tile
    boxes = np.empty((warp, 5), np.int64)  # first column, columns, first row, tiles, triangle
    addresses = np.empty(warp, np.int64)
    places = np.empty(warp, np.int64)
    side = np.float32(tile)
    lost = 0
    for first in range(0, len(drawable), warp):
        longest = _boxes(screen, triangles, drawable, first, width, height, tile, culling, boxes, events)
        for s in range(longest):
            appended = 0
            for lane in range(warp):
                addresses[lane] = -1
                places[lane] = -1
                if s >= boxes[lane, 3]:
                    continue
                if events is not None:
                    events[first // BLOCK, 4] += 1  # BOX_LANES
                column = boxes[lane, 0] + s % boxes[lane, 1]
                row = boxes[lane, 2] + s // boxes[lane, 1]
                t = boxes[lane, 4]
                x0, y0, x1, y1, x2, y2 = corners(screen, triangles, t)
                if not overlaps(x0, y0, x1, y1, x2, y2, np.float32(column * tile), np.float32(row * tile), side):
                    continue
                target = row * columns + column
                addresses[lane] = target * _COUNTER_WORD
                place = limits[target] + sizes[target]
                sizes[target] += 1
                appended += 1
                if entries is not None:
                    if place < limits[target + 1]:
                        entries[place] = t
                        places[lane] = place * _COUNTER_WORD
                    else:
                        lost += 1
            if events is not None:
                row = events[first // BLOCK]
                row[3] += 1  # BOX_STEPS
                if appended > 0:
                    _count_append(addresses, places, warp, rule, merge, row, requests)
        if events is not None:
            events[first // BLOCK, 16] = max(events[first // BLOCK, 16], longest)  # LONGEST
    return lost


@njit(cache=True, nogil=True, error_model="numpy")
def _boxes(
    screen: Any, triangles: Any, drawable: Any, first: int, width: int, height: int, tile: int, culling: bool,
    boxes: Any, events: Any,
) -> int:  # fmt: skip
    """Cull, and find each lane's box of tiles; returns the most tiles of a lane."""
    longest = 0
    for lane in range(len(boxes)):
        boxes[lane, 3] = 0
        if first + lane >= len(drawable):
            continue
        t = drawable[first + lane]
        x0, y0, x1, y1, x2, y2 = corners(screen, triangles, t)
        if events is not None:
            events[first // BLOCK, 1] += 1  # WARP_LANES
        if culling and area(x0, y0, x1, y1, x2, y2) <= _ZERO:
            if events is not None:
                events[first // BLOCK, 2] += 1  # CULLED
            continue
        left, right, top, bottom = pixel_box(x0, y0, x1, y1, x2, y2, width, height)
        if left > right or top > bottom:
            continue
        boxes[lane, 0] = left // tile
        boxes[lane, 1] = right // tile - left // tile + 1
        boxes[lane, 2] = top // tile
        boxes[lane, 3] = boxes[lane, 1] * (bottom // tile - top // tile + 1)
        boxes[lane, 4] = t
        longest = max(longest, boxes[lane, 3])
    if events is not None:
        events[first // BLOCK, 0] += 1  # WARPS
    return longest


@njit(cache=True, nogil=True, error_model="numpy")
def _count_append(addresses: Any, places: Any, warp: int, rule: int, merge: int, row: Any, requests: Any) -> None:
    """Count one warp's atomicAdd on the counters and the stores of the entries."""
    lanes, merged, conflicts, depth = count_atomics(addresses, warp, merge)
    row[5] += 1  # APPENDS
    row[6] += lanes
    row[7] += 1  # ATOMIC
    row[8] += lanes
    row[9] += merged
    row[10] += conflicts
    row[11] += depth
    add_requests(addresses, warp, merge, 0, requests)
    count, size = transactions(places, warp, _COUNTER_WORD, rule)
    row[14] += count  # STORE_TRANSACTIONS
    row[15] += size


def tile_lists(
    screen: NDArray[np.float32],
    triangles: NDArray[np.int32],
    drawable: NDArray[np.int32],
    width: int,
    height: int,
    simt: Simt,
    *,
    tile: int,
    culling: bool,
    capacity: Capacity,
) -> tuple[TileLists, list[Work], int]:
    """Make the lists.

    Parameters
    ----------
    screen : ndarray, (V, 4), float32
        Shaded vertices.
    triangles : ndarray, (F, 3), int32
    drawable : ndarray, (F',), int32
        Triangles to look at.
    width, height, tile : int
        Pixels.
    simt : Simt
    culling : bool
        Whether triangles that face away are left out.
    capacity : {"safe", "original"}
        Count, scan, fill; or the original's fixed room.

    Returns
    -------
    TileLists
    works : list of Work
        The counting launch (``safe`` only) and the filling one.
    lost : int
        Appends without room: 0 with ``safe``.
    """
    tiles = -(-width // tile) * -(-height // tile)
    blocks = max(1, -(-len(drawable) // BLOCK))
    shape = (screen, triangles, drawable, width, height, tile, culling, simt.warp, int(simt.coalescing))

    def launch(kernel: str, limits: NDArray[np.int64], entries: NDArray[np.int32] | None) -> tuple[Any, int, Work]:
        events = np.zeros((blocks, len(TileListEvent)), np.int64)
        requests = np.zeros(tiles // 8 + 1, np.int64)
        sizes = np.zeros(tiles, np.int64)
        lost = _fill(*shape, int(simt.atomic_merge), limits, sizes, entries, requests, events)
        _add_primitive_loads(events, simt)
        return sizes, lost, Work(
            "tile_lists", kernel, TileListEvent, events, blocks, BLOCK,
            streams=_streams(events, len(drawable), tiles), atomic_requests=requests,
        )  # fmt: skip

    if capacity == "original":
        room = len(drawable) if len(drawable) <= SMALL_MODEL else len(drawable) // 10
        limits = np.arange(tiles + 1, dtype=np.int64) * room
        entries = np.full(int(limits[-1]), -1, np.int32)
        sizes, lost, work = launch("tile_lists", limits, entries)
        kept = np.minimum(sizes, room)
        starts = np.concatenate([[0], np.cumsum(kept)]).astype(np.int64)
        return TileLists(starts, entries[entries >= 0]), [work], lost
    sizes, _, counting = launch("tile_counts", np.zeros(tiles + 1, np.int64), None)
    starts = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
    entries = np.empty(int(starts[-1]), np.int32)
    _, lost, filling = launch("tile_lists", starts, entries)
    return TileLists(starts, entries), [counting, filling], lost


def _add_primitive_loads(events: NDArray[np.int64], simt: Simt) -> None:
    """Nine floats of each primitive, 196 bytes apart: every lane its own segment."""
    segment = 128 if simt.coalescing == 2 else 32
    loads = events[:, TileListEvent.WARP_LANES] * 9
    events[:, TileListEvent.LOAD_TRANSACTIONS] += loads
    events[:, TileListEvent.LOAD_BYTES] += loads * segment


def _streams(events: NDArray[np.int64], count: int, tiles: int) -> tuple[Stream, ...]:
    total = events.sum(axis=0)
    appended = int(total[TileListEvent.APPEND_LANES])
    return (
        Stream("primitives", "load", 96 * int(total[TileListEvent.WARP_LANES]), count * PRIMITIVE_BYTES),
        Stream("tile_lists", "store", int(total[TileListEvent.STORE_BYTES]), 4 * appended),
        Stream("tile_counters", "atomic", 32 * int(total[TileListEvent.ATOMIC_REQUESTS]), 4 * tiles),
    )
