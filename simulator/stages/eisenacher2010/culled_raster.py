"""Tile raster that leaves out grids behind what a tile shows already, in list order or sorted front to back.

"High overlap results in unnecessary coverage tests" (Eisenacher & Loop 2010, section 5). Dicing leaves the nearest
depth of each grid. A block keeps the farthest depth that its pixels show; before it fills its shared memory with grids,
it passes over those that are nowhere nearer. Where the list is sorted first (a bitonic sort in shared memory, by pieces
of what that holds), the first such grid of the last piece ends it. Not in the paper; one sample a pixel, box tests on.

A sample's depth is rounded, and may lie a little before the nearest vertex: by ``MARGIN``, at most.
"""

from dataclasses import replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tilestamp.models.coalescing import contiguous, transactions
from tilestamp.models.counters import count, ratio, shown
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.eisenacher2010.bound_and_split import SubPatches
from tilestamp.simulator.stages.eisenacher2010.dice import Grids, dice
from tilestamp.simulator.stages.eisenacher2010.dice_counts import DiceEvent
from tilestamp.simulator.stages.eisenacher2010.tile_range import Tiles
from tilestamp.simulator.stages.eisenacher2010.tile_raster import Pixels, raster_streams, shared_bytes
from tilestamp.simulator.stages.eisenacher2010.tile_raster_events import (
    SEGMENT_WORDS,
    WORD_BYTES,
    BlockShape,
    TileRasterEvent,
    block_traffic,
    count_block,
    count_stores,
    events_with,
    grids_together,
    shape_for,
)
from tilestamp.simulator.stages.eisenacher2010.tile_raster_quads import new_quads, raster_grids
from tilestamp.simulator.stages.eisenacher2010.tile_raster_resolve import resolve
from tilestamp.simulator.stages.eisenacher2010.tile_raster_samples import BACKGROUND, FAR, Samples, new_tests
from tilestamp.simulator.stages.sample_tests import SAMPLE_COUNTERS
from tilestamp.simulator.work import Work

Cull = Literal["none", "behind", "sorted"]
MARGIN = np.float32(2.0**-20)  # of depths in [-1, 1]: eight units in the last place
SORTED_TOGETHER = 1024  # grids: a depth and a number each in shared memory
PAIR_BYTES = 8
NONE = np.uint32(0xFFFFFFFF)  # no grid
_PART_TILES = 32  # that one call of the worker takes, at least
_E = TileRasterEvent
_IN_PLACE = {  # of events that do not occur here
    _E.EDGE_GATHER_WARPS: "LISTED",  # grids in the list; GRIDS are those that are drawn
    _E.EDGE_GATHER_LANES: "READ_LANES",  # grids whose number and depth are read
    _E.RESOLVE_WARPS: "READ_WARPS",
}
_MORE = (
    "CULLED",  # grids passed over
    "CULL_WARPS",  # a warp picks the next grids of a batch, by a vote
    "ZMAX_WARPS",  # warps that find the farthest depth of the tile after a batch
    "SORT_WARPS",  # warps that compare and exchange two grids a lane
    "SORT_STEPS",  # steps of the sorting network, a barrier after each
)
CulledRasterEvent: Any = events_with("CulledRasterEvent", _IN_PLACE, _MORE)
"""Events of one block: those of the tile raster, of culling and of sorting."""
shown(
    *SAMPLE_COUNTERS, count("CULLED", "grids culled"), ratio("culled share", "CULLED", "LISTED", "grids culled, share")
)(CulledRasterEvent)
_C = CulledRasterEvent


def dice_nearest(
    points: NDArray[np.float32], subpatches: SubPatches, matrix: ArrayLike, width: int, height: int, simt: Simt,
    **options: Any,
) -> StageResult[Grids]:  # fmt: skip
    """Dice, and leave the nearest depth of each grid; as ``dice``."""
    grids, works, _ = dice(points, subpatches, matrix, width, height, simt, **options)
    return StageResult(grids, tuple(_with_depths(work, simt) for work in works))


def _with_depths(work: Work, simt: Simt) -> Work:
    """Dicing that stores one word more a grid."""
    table = work.table.copy()
    for row in table:
        moved = contiguous(0, int(row[DiceEvent.PATCHES]) * WORD_BYTES, int(simt.coalescing))
        row[[DiceEvent.STORE_TRANSACTIONS, DiceEvent.STORE_BYTES]] += moved
    size = work.total(DiceEvent.PATCHES) * WORD_BYTES
    stream = Stream("nearest", "store", size, size, partial_lines=0)
    return replace(work, table=table, variant="nearest", streams=(*work.streams, stream))


@kernel
def _sort(members: Any, depths: Any, number: int, warp: int, row: Any) -> None:
    """Sort by depth the pieces that shared memory holds; equal ones stay as they are."""
    for first in range(0, number, SORTED_TOGETHER):
        last = min(first + SORTED_TOGETHER, number)
        order = np.argsort(depths[first:last], kind="mergesort")
        members[first:last] = members[first:last][order]
        depths[first:last] = depths[first:last][order]
        bits, size = 0, 1
        while size < last - first:
            bits, size = bits + 1, 2 * size
        steps = bits * (bits + 1) // 2
        row[_C.SORT_STEPS] += steps
        row[_C.SORT_WARPS] += steps * ((size // 2 + warp - 1) // warp)


@kernel(lent=True)
def _farthest(samples: Samples, width: int, height: int) -> Any:
    """Farthest depth of the pixels of a tile that are on screen."""
    far = -FAR
    for y in range(min(samples.depth.shape[0], height)):
        for x in range(min(samples.depth.shape[1], width)):
            far = max(far, samples.depth[y, x])
    return far


@kernel
def _raster_tiles(
    part: int, parts: int, points: Any, words: Any, nearest: Any, count: Any, start: Any, lists: Any, tiles: Tiles,
    shape: BlockShape, traffic: Any, by_depth: bool, kept: Any, image: Any, depth: Any, overdraw: Any, table: Any,
) -> None:  # fmt: skip
    """One part of the tiles."""
    size, batch = shape.tile, grids_together(shape)
    samples = Samples(
        np.empty((size, size), np.float32), np.empty((size, size), np.uint32), np.zeros((size, size), np.int32)
    )
    quads, tests = new_quads(shape.grid), new_tests()
    addresses, stores = np.empty(shape.warp, np.int64), np.zeros((SEGMENT_WORDS, 2), np.int64)
    members, drawn = np.empty(count.max(), np.uint32), np.empty(count.max(), np.uint32)
    depths = np.empty(count.max(), np.float32)
    height, width = depth.shape
    for block in range(count.size * part // parts, count.size * (part + 1) // parts):
        first, number, row = np.int64(start[block]), np.int64(count[block]), table[block]
        x, y = block % tiles.columns * size, block // tiles.columns * size
        origin = (np.float64(x), np.float64(y))
        samples.depth[:] = FAR
        samples.color[:] = BACKGROUND
        samples.hits[:] = 0
        for k in range(number):
            members[k] = lists[first + k]
            depths[k] = nearest[members[k]]
        if by_depth:
            _sort(members, depths, number, shape.warp, row)
        far, taken = FAR, 0
        for k in range(number):
            if depths[k] - MARGIN >= far:
                if by_depth and k >= (number - 1) // SORTED_TOGETHER * SORTED_TOGETHER:
                    break  # all others of the last piece are farther
                continue
            raster_grids(points, words, None, members, k, k + 1, origin, shape, samples, quads, tests, row)
            drawn[taken] = kept[first + taken] = members[k]
            taken += 1
            if taken % batch == 0:
                far = _farthest(samples, width - x, height - y)
        resolve(samples, 1, x, y, image, depth, overdraw)
        count_block(block, drawn, 0, taken, shape, traffic, row)
        _count_list(first, number, lists, shape, addresses, row)
        row[_C.LISTED] = number
        row[_C.CULLED] = number - taken
        row[_E.BARRIERS] += row[_C.SORT_STEPS] * shape.warps
        count_stores(x, y, width, height, shape, addresses, stores, row)


@kernel(lent=True)
def _count_list(first: int, number: int, lists: Any, shape: BlockShape, addresses: Any, row: Any) -> None:
    """Numbers and depths of a whole list, read as many together as the block has threads; then a vote a batch."""
    for base in range(0, number, shape.warp):
        lanes = min(shape.warp, number - base)
        for lane in range(lanes):
            addresses[lane] = np.int64(lists[first + base + lane]) * WORD_BYTES
        moved, size = transactions(addresses, lanes, WORD_BYTES, shape.coalescing)
        entries, entry_bytes = contiguous((first + base) * WORD_BYTES, lanes * WORD_BYTES, shape.coalescing)
        row[_C.READ_WARPS] += 1
        row[_C.READ_LANES] += lanes
        row[_E.LOAD_TRANSACTIONS] += moved + entries
        row[_E.LOAD_BYTES] += size + entry_bytes
    row[_C.CULL_WARPS] = row[_E.BATCHES] * shape.warps
    row[_C.ZMAX_WARPS] = row[_E.BATCHES] * shape.warps
    row[_E.BARRIERS] += row[_E.BATCHES] * shape.warps


def culled_raster(
    vertices: NDArray[np.float32],
    count: NDArray[np.uint32],
    start: NDArray[np.uint32],
    lists: NDArray[np.uint32],
    tiles: Tiles,
    width: int,
    height: int,
    simt: Simt,
    *,
    by_depth: bool,
) -> StageResult[Pixels]:
    """Draw the grids of each tile that are not behind what it shows.

    Parameters
    ----------
    vertices, count, start, lists, tiles, width, height, simt
        As for ``tile_raster``.
    by_depth : bool
        Sort each list front to back before.

    Returns
    -------
    Pixels
    works : one, a row a tile
    """
    shape = shape_for(vertices, tiles, simt, spp=1, box_tests=True, edges="computed")
    image, depth = np.empty((height, width, 3), np.uint8), np.empty((height, width), np.float32)
    overdraw, table = np.empty((height, width), np.int32), np.zeros((tiles.total, len(CulledRasterEvent)), np.int64)
    kept = np.full(len(lists), NONE, np.uint32)
    nearest, points = vertices[:, :, 2].min(axis=1), vertices.reshape(-1)
    for_parts(
        _raster_tiles, parts_of(tiles.total, _PART_TILES), points, points.view(np.uint32), nearest, count, start, lists,
        tiles, shape, block_traffic(shape, simt), by_depth, kept, image, depth, overdraw, table,
    )  # fmt: skip
    return StageResult(
        Pixels(image, depth, overdraw), (_work(table, len(vertices), kept[kept != NONE], tiles, shape, simt, by_depth),)
    )


def _work(
    table: NDArray[np.int64], grids: int, drawn: NDArray[np.uint32], tiles: Tiles,
    shape: BlockShape, simt: Simt, by_depth: bool,
) -> Work:  # fmt: skip
    """Work of the kernel: vertices of the grids that are drawn, depths of all in the lists."""
    depths = int(table[:, _C.READ_LANES].sum()) * WORD_BYTES
    streams = raster_streams(table, drawn, grids, shape, simt, tiles.rows, others=depths)
    sorting = (
        min(SORTED_TOGETHER, 1 << int(table[:, _C.LISTED].max(initial=1) - 1).bit_length()) * PAIR_BYTES * by_depth
    )
    return Work(
        stage="tile_raster", kernel="culled_raster", events=CulledRasterEvent, table=table, grid=len(table),
        block=shape.tile**2, shared_bytes=shared_bytes(shape) + sorting + 2 * shape.tile**2 * WORD_BYTES,
        streams=(*streams, Stream("nearest", "load", depths, grids * WORD_BYTES)),
        variant=f"tile {shape.tile} spp 1",
    )  # fmt: skip
