"""Tiled raster: one block a tile, one thread a pixel (Ru 2016, "Tile-based rasterization").

Every thread walks the tile's list and reads the primitive from global memory (no shared memory): x and y of three
vertices for the areas; z and w where it lies inside, for the depth test in registers; all attributes where it is
nearer, to interpolate them at once. The fragment is written once at the end. A tile smaller than a warp leaves lanes of
it idle (4x4: half of them). Nothing holds the warps of a block together but its end: each walks the list by itself,
one dependent load after another.

Depth is interpolated linearly on the screen, in float32; equal depths keep the entry that came first.
"""

from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.bits import popcount
from tilestamp.models.coalescing import smallest_transaction_bytes, transactions
from tilestamp.models.counters import shown
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.laine2011.lanes import LANES
from tilestamp.simulator.stages.ru2016.compiled import words
from tilestamp.simulator.stages.ru2016.row_lanes import eight_inside, write_nearer
from tilestamp.simulator.stages.ru2016.tile_lists import SECTOR_BYTES, TileLists
from tilestamp.simulator.stages.ru2016.triangle import area, corners
from tilestamp.simulator.stages.sample_tests import SAMPLE_COUNTERS
from tilestamp.simulator.work import Work

FRAGMENT_BYTES = 56  # eye position, eye normal, texture coordinate, texture pointer and size, whether to shade
TEST_LOADS = 7  # the entry, and x and y of three vertices
HIT_LOADS = 6  # z and w of three vertices
LINE_BYTES = 128
FAR = np.float32(1.0)
_HALF = np.float32(0.5)
_ONE = np.float32(1.0)


@shown(*SAMPLE_COUNTERS)
class TiledRasterEvent(IntEnum):
    """Events of one block, that is of one tile."""

    WARPS = 0
    WARP_LANES = 1  # threads of the tile, off-screen ones included
    TEST_WARPS = 2  # warp executions of the barycentric test: one for each warp and list entry
    SAMPLE_TESTS = 3
    SAMPLE_HITS = 4
    HIT_WARPS = 5  # warp executions of the depth and its test
    NEARER_WARPS = 6  # warp executions of the interpolation
    NEARER_LANES = 7
    ENTRIES = 8  # list entries: the dependent chain of the block
    LOAD_TRANSACTIONS = 9
    LOAD_BYTES = 10
    STORE_TRANSACTIONS = 11
    STORE_BYTES = 12
    LONGEST_HITS = 13  # depth tests of the warp that makes most
    LONGEST_NEARER = 14  # interpolations of the warp that makes most
    BLOCKS = 15  # 1: what the start and end of a block's chain are priced on
    LISTED_WARPS = 16  # warps of a tile whose list is not empty
    LISTED_LANES = 17


class Visible(NamedTuple):
    """The nearest triangle of each pixel.

    Parameters
    ----------
    triangles : ndarray, (H, W), int32
        -1 where there is none.
    depth : ndarray, (H, W), float32
        In [0, 1], 1 where there is none.
    """

    triangles: NDArray[np.int32]
    depth: NDArray[np.float32]


@kernel(error_model="numpy", lent=True)
def mark_warps(hits: Any, nearer: Any, lane: int, warp: int, marks: Any) -> None:
    """Mark the warps of eight pixels of a row, the first of which is ``lane`` of its tile."""
    w, lanes = lane // warp, min(warp - lane % warp, LANES)
    while hits != np.uint64(0):
        own = ~np.uint64(0) >> np.uint64(64 - lanes)
        if hits & own:
            marks[0, w] = 1
        if nearer & own:
            marks[1, w] = 1
        hits >>= np.uint64(lanes)
        nearer >>= np.uint64(lanes)
        w, lanes = w + 1, min(warp, LANES)


@kernel(error_model="numpy", lent=True)
def _tile(
    screen: Any, triangles: Any, entries: Any, x_first: int, y_first: int, tile: int, warp: int,
    visible: Any, depth: Any, marks: Any, row: Any,
) -> None:  # fmt: skip
    """Rasterize one tile's list; ``marks``, (4, warps): who hits and who comes nearer now, and how often so far."""
    height, width = depth.shape
    on_screen = ~np.uint64(0) >> np.uint64(64 - min(tile, width - x_first))
    for t in entries:
        places = corners(screen, triangles, t)
        depths = screen[triangles[t, 0], 2], screen[triangles[t, 1], 2], screen[triangles[t, 2], 2]
        triangle = places, _ONE / area(*places), depths
        for y in range(min(tile, height - y_first)):
            py = np.float32(y_first + y) + _HALF
            for x in range(0, tile, LANES):
                hits = eight_inside(triangle, x_first + x, py) & (on_screen >> np.uint64(x))
                if hits == np.uint64(0):
                    continue
                nearer = write_nearer(triangle, x_first + x, y_first + y, py, hits, t, depth, visible)
                row[TiledRasterEvent.SAMPLE_HITS] += popcount(hits)
                row[TiledRasterEvent.NEARER_LANES] += popcount(nearer)
                mark_warps(hits, nearer, y * tile + x, warp, marks)
        for w in range(marks.shape[1]):
            row[TiledRasterEvent.HIT_WARPS] += marks[0, w]
            row[TiledRasterEvent.NEARER_WARPS] += marks[1, w]
            for k in range(2):
                marks[2 + k, w] += marks[k, w]
                marks[k, w] = 0


@kernel(error_model="numpy")
def _band(
    screen: Any, triangles: Any, starts: Any, entries: Any, tile: int, warp: int, visible: Any, depth: Any,
    tile_row: int, events: Any,
) -> None:  # fmt: skip
    """Rasterize a row of tiles."""
    columns = (depth.shape[1] + tile - 1) // tile
    warps = (tile * tile + warp - 1) // warp
    marks = np.zeros((4, warps), np.int64)
    for column in range(columns):
        i = tile_row * columns + column
        listed = entries[starts[i] : starts[i + 1]]
        row = events[i]
        _tile(screen, triangles, listed, column * tile, tile_row * tile, tile, warp, visible, depth, marks, row)
        row[TiledRasterEvent.WARPS] = warps
        row[TiledRasterEvent.WARP_LANES] = tile * tile
        row[TiledRasterEvent.TEST_WARPS] = warps * len(listed)
        row[TiledRasterEvent.SAMPLE_TESTS] = tile * tile * len(listed)
        row[TiledRasterEvent.ENTRIES] = len(listed)
        row[TiledRasterEvent.BLOCKS] = 1
        row[TiledRasterEvent.LISTED_WARPS] = warps * min(len(listed), 1)
        row[TiledRasterEvent.LISTED_LANES] = tile * tile * min(len(listed), 1)
        row[TiledRasterEvent.LONGEST_HITS] = marks[2].max()
        row[TiledRasterEvent.LONGEST_NEARER] = marks[3].max()
        marks[:] = 0


@kernel(error_model="numpy", lent=True)
def _tiled_raster(
    part: int, parts: int, screen: Any, triangles: Any, starts: Any, entries: Any, tile: int, warp: int,
    visible: Any, depth: Any, events: Any,
) -> None:  # fmt: skip
    """Rasterize a share of the rows of tiles."""
    rows = (depth.shape[0] + tile - 1) // tile
    for tile_row in range(part * rows // parts, (part + 1) * rows // parts):
        _band(screen, triangles, starts, entries, tile, warp, visible, depth, tile_row, events)


def tiled_raster(
    screen: NDArray[np.float32],
    triangles: NDArray[np.int32],
    lists: TileLists,
    width: int,
    height: int,
    simt: Simt,
    *,
    tile: int,
    gaps: bool = True,
) -> StageResult[Visible]:
    """Find the nearest triangle of each pixel.

    Parameters
    ----------
    screen : ndarray, (V, 4), float32
    triangles : ndarray, (F, 3), int32
    lists : TileLists
    width, height, tile : int
        Pixels.
    simt : Simt
    gaps : bool
        Whether fragments leave the padding at their end as it was; with ambient occlusion they have none.

    Returns
    -------
    outputs : Visible
    works : one, a row a tile
    """
    visible = Visible(np.full((height, width), -1, np.int32), np.full((height, width), FAR, np.float32))
    tiles = len(lists.starts) - 1
    events = np.zeros((tiles, len(TiledRasterEvent)), np.int64)
    parts = parts_of(-(-height // tile))
    for_parts(_tiled_raster, parts, screen, triangles, *lists, tile, simt.warp, *visible, events)
    _add_traffic(events, simt, tile)
    drawn = int(np.count_nonzero(np.bincount(lists.entries)))
    entries = len(lists.entries)
    streams = (  # of a primitive, what the first warp of a block fetches: the others find it in L2
        Stream("tile_lists", "load", SECTOR_BYTES * entries, 4 * entries),
        Stream("primitives", "load", 3 * SECTOR_BYTES * entries, drawn * 3 * SECTOR_BYTES),
        Stream(  # each store takes a sector of L2, where the words of a fragment meet
            "fragments",
            "store",
            width * height * (len(words(simt).fragment) * SECTOR_BYTES + 4),
            width * height * (FRAGMENT_BYTES + 4),
            span_bytes=simt.sms * words(simt).raster_threads * FRAGMENT_BYTES,
            partial_lines=_lines(simt, tile) * int(events[:, TiledRasterEvent.WARPS].sum()),
            gaps=gaps,
        ),
    )
    return StageResult(visible, (raster_work(events, tile, streams),))


def raster_work(table: NDArray[np.int64], tile: int, streams: tuple[Stream, ...] = ()) -> Work:
    """Work of the kernel, a row and a block a tile, a thread a pixel."""
    return Work("tiled_raster", TiledRasterEvent, table, tile * tile, streams=streams)


def _add_traffic(events: NDArray[np.int64], simt: Simt, tile: int) -> None:
    """All lanes read the same words, a transaction each; fragments are stored in parts, 56 bytes apart."""
    segment = smallest_transaction_bytes(int(simt.coalescing))
    reads = (
        events[:, TiledRasterEvent.WARPS]  # the length of the list
        + events[:, TiledRasterEvent.TEST_WARPS] * TEST_LOADS
        + events[:, TiledRasterEvent.HIT_WARPS] * HIT_LOADS
        + events[:, TiledRasterEvent.NEARER_WARPS] * words(simt).nearer
    )
    addresses = _fragments(simt, tile)
    rule = int(simt.coalescing)
    stores = [transactions(addresses, simt.warp, bytes_, rule) for bytes_ in words(simt).fragment]
    stores.append(transactions(addresses // FRAGMENT_BYTES * 4, simt.warp, 4, rule))
    count, size = (sum(part) for part in zip(*stores, strict=True))
    writes = events[:, TiledRasterEvent.WARPS]
    events[:, TiledRasterEvent.LOAD_TRANSACTIONS] = reads
    events[:, TiledRasterEvent.LOAD_BYTES] = reads * segment
    events[:, TiledRasterEvent.STORE_TRANSACTIONS] = writes * count
    events[:, TiledRasterEvent.STORE_BYTES] = writes * size


def _fragments(simt: Simt, tile: int) -> NDArray[np.int64]:
    """Address of each lane's fragment; -1 for lanes that a small tile leaves idle."""
    lanes = np.arange(simt.warp)
    return np.where(lanes < tile * tile, (lanes // tile * 800 + lanes % tile) * FRAGMENT_BYTES, -1)


def _lines(simt: Simt, tile: int) -> int:
    """Lines of 128 bytes that the stores of a warp's fragments touch, each in part."""
    addresses = _fragments(simt, tile)
    addresses = addresses[addresses >= 0]
    places = np.cumsum((0, *words(simt).fragment))[:-1]
    return sum(len(np.unique((addresses + place) // LINE_BYTES)) for place in places)
