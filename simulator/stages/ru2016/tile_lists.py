"""Tile lists: the triangles that touch each tile (Ru 2016, "Tile-based rasterization").

One thread a triangle (128 a block): cull back faces, walk the tiles of the box row by row, test each by a separating
axis test on five axes (two of the tile, three of the triangle), and append with **one global atomicAdd for each
(triangle, tile)** and a 4-byte store. A warp walks in lockstep: its lanes meet again after each row of their boxes; so
do all resident warps, which is what sets the order of the entries (``tile_lists_fill``).

The original gives each tile room for all triangles if there are at most 100, else for a tenth of them, and does not
check for overflow. Here an overflow is dropped and reported; the default counts first, scans, and then fills.
"""

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.coalescing import smallest_transaction_bytes
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.ru2016.compiled import words
from tilestamp.simulator.stages.ru2016.tile_lists_fill import count_entries, fill
from tilestamp.simulator.stages.ru2016.tile_lists_warps import BLOCK, TileListEvent, walkers
from tilestamp.simulator.stages.ru2016.vertex_shading import PRIMITIVE_BYTES
from tilestamp.simulator.stages.thread_per_item import Access, thread_per_item
from tilestamp.simulator.work import Work

SCAN_BLOCK = 256  # threads (ours: the original has no scan)
SMALL_MODEL = 100  # triangles up to which a list can hold all of them
COORDINATES = 6  # words read of each primitive: x and y of its corners
_PART_TRIANGLES = 4096  # at least
SECTOR_BYTES = 32  # loads of compute capability 3.0 pass by L1 and move such sectors
Capacity = Literal["safe", "original"]


class TileLists(NamedTuple):
    """Triangles by tile, in the order in which they were appended.

    Parameters
    ----------
    starts : ndarray, (tiles + 1,), int64
    entries : ndarray, (starts[-1],), int32
    """

    starts: NDArray[np.int64]
    entries: NDArray[np.int32]


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
) -> StageResult[TileLists]:
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
    outputs : TileLists
    works : the counting launch and the scan (``safe`` only), and the filling one
    facts : dict
        ``lost``: appends without room, 0 with ``safe``.
    """
    tiles = -(-width // tile) * -(-height // tile)
    blocks = max(1, -(-len(drawable) // BLOCK))
    given = (
        (screen, triangles, drawable),
        (width, height, tile, culling),
        (int(simt.coalescing), int(simt.atomic_merge)),
        walkers(min(simt.sms * words(simt).list_threads, len(drawable) + BLOCK) // simt.warp, simt.warp),
    )

    room = 0  # where lists have a fixed room, they lie that far apart; only the entries that fit are kept here
    if capacity == "original":
        room = len(drawable) if len(drawable) <= SMALL_MODEL else len(drawable) // 10

    parts = parts_of(len(drawable), _PART_TRIANGLES)
    counted = np.zeros((parts, tiles), np.int64)
    for_parts(count_entries, parts, *given[:2], counted)
    sizes = counted.sum(axis=0)
    kept = np.minimum(sizes, room) if room else sizes
    starts = np.concatenate([[0], np.cumsum(kept)]).astype(np.int64)
    entries = np.empty(int(starts[-1]), np.int32)
    events = np.zeros((blocks, len(TileListEvent)), np.int64)
    requests = np.zeros(tiles // 8 + 1, np.int64)
    lost = fill(*given, room, starts, np.zeros(tiles, np.int64), entries, requests, events)
    _add_primitive_loads(events, simt)

    def launched(kernel: str, table: NDArray[np.int64]) -> Work:
        streams = _streams(table, len(drawable), tiles)
        return Work(
            "tile_lists", TileListEvent, table, BLOCK, kernel=kernel, grid=blocks, streams=streams,
            atomic_requests=requests,
        )  # fmt: skip

    filling = launched("tile_lists", events)
    if room:
        return StageResult(TileLists(starts, entries), (filling,), {"lost": lost})
    counting = events.copy()  # the same walk, which stores nothing
    counting[:, [TileListEvent.STORE_TRANSACTIONS, TileListEvent.STORE_BYTES]] = 0
    works = launched("tile_counts", counting), _scan(tiles, simt), filling
    return StageResult(TileLists(starts, entries), works, {"lost": lost})


def _scan(tiles: int, simt: Simt) -> Work:
    """Sum the counts of the tiles before each: where its list begins."""
    counts, starts = Access("tile_counters", 4, 1), Access("tile_starts", 4, 1)
    return thread_per_item("tile_lists", "tile_scan", tiles, SCAN_BLOCK, simt, (counts,), (starts,))


def _add_primitive_loads(events: NDArray[np.int64], simt: Simt) -> None:
    """Two words of three vertices 64 bytes apart, of primitives 200 bytes apart: every lane a segment of its own."""
    segment = smallest_transaction_bytes(int(simt.coalescing))
    events[:, TileListEvent.BLOCKS] = 1
    loads = events[:, TileListEvent.WARP_LANES] * COORDINATES
    events[:, TileListEvent.LOAD_TRANSACTIONS] += loads
    events[:, TileListEvent.LOAD_BYTES] += loads * segment


def _streams(events: NDArray[np.int64], count: int, tiles: int) -> tuple[Stream, ...]:
    total = events.sum(axis=0)
    appended = int(total[TileListEvent.APPEND_LANES])
    return (
        Stream(
            "primitives",
            "load",
            COORDINATES * SECTOR_BYTES * int(total[TileListEvent.WARP_LANES]),
            count * PRIMITIVE_BYTES // 2,  # one of the two sectors of each vertex
        ),
        Stream("tile_lists", "store", int(total[TileListEvent.STORE_BYTES]), 4 * appended),
        Stream("tile_counters", "atomic", 32 * int(total[TileListEvent.ATOMIC_REQUESTS]), 4 * tiles),
    )
