"""Tile raster in two scales: a block a coarse tile, and masks in shared memory of the fine tiles that each grid is in.

"Larger and hierarchical tiles" are future work of Eisenacher & Loop 2010; masks follow HiGS (2026), which blends splats
so. Lists of coarse tiles are shorter in all; a block loads a batch of them once for all its pixels. A thread a grid
loads its box, and makes a mask of the fine tiles in it; warps turn 32 masks into one word a fine tile; and each warp
walks through the grids of its own fine tile alone: two warps a tile of 8x8, one warp two tiles of 4x4 in turn. The
batch ends for all when the warp with the most grids is done, which is counted. One sample a pixel, box tests on.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.coalescing import transactions
from tilestamp.models.counters import distribution, shown
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.eisenacher2010.tile_range import Tiles, tile_range
from tilestamp.simulator.stages.eisenacher2010.tile_raster import Pixels, raster_streams, shared_bytes
from tilestamp.simulator.stages.eisenacher2010.tile_raster_events import (
    BROADCAST_LOADS,
    SEGMENT_WORDS,
    VECTOR_BYTES,
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
from tilestamp.simulator.stages.eisenacher2010.tile_raster_quads import Quads, new_quads, raster_grids
from tilestamp.simulator.stages.eisenacher2010.tile_raster_resolve import resolve
from tilestamp.simulator.stages.eisenacher2010.tile_raster_samples import (
    BACKGROUND,
    FAR,
    QUADS,
    Samples,
    Tests,
    new_tests,
)
from tilestamp.simulator.stages.sample_tests import SAMPLE_COUNTERS
from tilestamp.simulator.work import Work

_PART_TILES = 8  # that one call of the worker takes, at least
MASK_GRIDS = 32  # whose masks are turned together
_E = TileRasterEvent
_IN_PLACE = {  # of events that do not occur here
    _E.EDGE_GATHER_WARPS: "MASK_WARPS",  # a grid a lane: its box loaded, its mask made, 32 masks turned
    _E.EDGE_GATHER_LANES: "MASK_LANES",
    _E.RESOLVE_WARPS: "WORD_WARPS",  # a warp reads the word of a fine tile of its own
}
_MORE = (
    "WALK_WARPS",  # a warp goes on to the next grid that is in its fine tile
    "CRITICAL_GRIDS",  # grids that the busiest warp of each batch walks through
    "CRITICAL_PASSES",  # pairs of quad and fine tile that go on, in that warp
)
MacroRasterEvent: Any = events_with("MacroRasterEvent", _IN_PLACE, _MORE)
"""Events of one block: those of the tile raster, and of masks."""
shown(*SAMPLE_COUNTERS, distribution("grids", "GRIDS", "grids in the list of a coarse tile"))(MacroRasterEvent)
_M = MacroRasterEvent


@kernel(lent=True)
def _draw_fine(
    column: int, line: int, first: int, grids: int, batch: int, points: Any, words: Any, boxes: Any, lists: Any,
    fine: Tiles, shape: BlockShape, samples: Samples, quads: Quads, tests: Tests,
    walked: Any, passes: Any, row: Any,
) -> None:  # fmt: skip
    """One fine tile: the grids whose box is in it; by batch how many those are, and their quads that go on."""
    origin = (np.float64(column * shape.tile), np.float64(line * shape.tile))
    samples.depth[:] = FAR
    samples.color[:] = BACKGROUND
    samples.hits[:] = 0
    for k in range(grids):
        x0, y0, x1, y1 = tile_range(boxes[lists[first + k]], fine)
        if column < x0 or column > x1 or line < y0 or line > y1:
            continue
        before = row[_E.SUBTILE_PASS]
        raster_grids(points, words, None, lists, first + k, first + k + 1, origin, shape, samples, quads, tests, row)
        walked[k // batch] += 1
        passes[k // batch] += row[_E.SUBTILE_PASS] - before


@kernel
def _raster_tiles(
    part: int, parts: int, points: Any, words: Any, boxes: Any, count: Any, start: Any, lists: Any, coarse: Tiles,
    fine: Tiles, large: BlockShape, shape: BlockShape, traffic: Any, image: Any, depth: Any, overdraw: Any, table: Any,
) -> None:  # fmt: skip
    """One part of the coarse tiles."""
    size, sides, batch = shape.tile, large.tile // shape.tile, grids_together(large)
    samples = Samples(
        np.empty((size, size), np.float32), np.empty((size, size), np.uint32), np.zeros((size, size), np.int32)
    )
    quads, tests = new_quads(shape.grid), new_tests()
    addresses, stores = np.empty(shape.warp, np.int64), np.zeros((SEGMENT_WORDS, 2), np.int64)
    in_turn = max(1, shape.warp // (size * size))  # fine tiles of one warp
    most = 1 + np.int64(count.max()) // batch
    walked, passes = np.zeros(most, np.int64), np.zeros(most, np.int64)
    busiest, its_passes = np.zeros(most, np.int64), np.zeros(most, np.int64)
    height, width = depth.shape
    for block in range(
        coarse.columns * coarse.rows * part // parts, coarse.columns * coarse.rows * (part + 1) // parts
    ):
        first, grids, row = np.int64(start[block]), np.int64(count[block]), table[block]
        busiest[:] = 0
        its_passes[:] = 0
        all_walked = 0
        for f in range(sides * sides):
            column = block % coarse.columns * sides + f % sides
            line = block // coarse.columns * sides + f // sides
            if f % in_turn == 0:
                walked[:] = 0
                passes[:] = 0
            _draw_fine(
                column,
                line,
                first,
                grids,
                batch,
                points,
                words,
                boxes,
                lists,
                fine,
                shape,
                samples,
                quads,
                tests,
                walked,
                passes,
                row,
            )
            if (f + 1) % in_turn == 0:
                all_walked += walked.sum()
                for b in range(most):
                    if walked[b] > busiest[b]:
                        busiest[b], its_passes[b] = walked[b], passes[b]
            if column * size < width and line * size < height:
                resolve(samples, 1, column * size, line * size, image, depth, overdraw)
                count_stores(column * size, line * size, width, height, shape, addresses, stores, row)
        count_block(block, lists, first, grids, large, traffic, row)
        _count_masks(lists, first, grids, batch, large, shape, all_walked, addresses, row)
        row[_M.CRITICAL_GRIDS] = busiest.sum()
        row[_M.CRITICAL_PASSES] = its_passes.sum()


@kernel(lent=True)
def _count_masks(
    lists: Any, first: int, grids: int, batch: int, large: BlockShape, shape: BlockShape, walked: int,
    addresses: Any, row: Any,
) -> None:  # fmt: skip
    """Put what a warp does for its own fine tile in place of what all do for the whole tile, and add the masks."""
    threads = shape.tile * shape.tile
    warps = shape.warps
    row[_E.SHARED_ACCESSES] += BROADCAST_LOADS * (QUADS * walked * warps - row[_E.QUAD_WARPS])
    row[_E.QUAD_WARPS] = row[_E.SUBTILE_TEST_WARPS] = QUADS * walked * warps
    row[_E.QUAD_LANES] = row[_E.SUBTILE_TEST_LANES] = QUADS * walked * threads
    row[_E.BOX_TEST_WARPS] = row[_E.SUBTILE_PASS] * warps
    row[_E.BOX_TEST_LANES] = row[_E.SUBTILE_PASS] * threads
    row[_E.SAMPLE_TESTS] = row[_E.BOX_WARPS] * min(shape.warp, threads)
    row[_M.WALK_WARPS] = walked * warps
    row[_M.MASK_LANES] = grids
    tiles = (large.tile // shape.tile) * (large.tile // shape.tile)
    for base in range(0, grids, batch):
        loaded = min(batch, grids - base)
        row[_M.WORD_WARPS] += (loaded + MASK_GRIDS - 1) // MASK_GRIDS * tiles * warps
        for i in range(base, base + loaded, shape.warp):
            lanes = min(shape.warp, base + loaded - i)
            for lane in range(lanes):
                addresses[lane] = np.int64(lists[first + i + lane]) * VECTOR_BYTES
            moved, size = transactions(addresses, lanes, VECTOR_BYTES, shape.coalescing)
            row[_M.MASK_WARPS] += 1
            row[_E.LOAD_TRANSACTIONS] += moved
            row[_E.LOAD_BYTES] += size


def macro_raster(
    vertices: NDArray[np.float32],
    boxes: NDArray[np.float32],
    count: NDArray[np.uint32],
    start: NDArray[np.uint32],
    lists: NDArray[np.uint32],
    coarse: Tiles,
    fine: Tiles,
    width: int,
    height: int,
    simt: Simt,
) -> StageResult[Pixels]:
    """Draw the grids of each coarse tile, a warp those of its own fine tile.

    Parameters
    ----------
    vertices : ndarray, (N, 16, 4), float32
        As for ``tile_raster``.
    boxes : ndarray, (N, 4), float32
    count, start, lists : ndarray
        Of coarse tiles.
    coarse, fine : Tiles
    width, height : int
        Pixels.
    simt : Simt

    Returns
    -------
    Pixels
    works : one, a row a coarse tile
    """
    rules: dict[str, Any] = {"spp": 1, "box_tests": True, "edges": "computed"}
    large, shape = (shape_for(vertices, tiles, simt, **rules) for tiles in (coarse, fine))
    image, depth = np.empty((height, width, 3), np.uint8), np.empty((height, width), np.float32)
    overdraw, table = np.empty((height, width), np.int32), np.zeros((coarse.total, len(MacroRasterEvent)), np.int64)
    points, traffic = vertices.reshape(-1), block_traffic(large, simt)
    for_parts(
        _raster_tiles, parts_of(coarse.total, _PART_TILES), points, points.view(np.uint32), boxes, count, start, lists,
        coarse, fine, large, shape, traffic, image, depth, overdraw, table,
    )  # fmt: skip
    return StageResult(Pixels(image, depth, overdraw), (_work(table, vertices, lists, coarse, large, shape, simt),))


def _work(
    table: NDArray[np.int64], vertices: NDArray[np.float32], lists: NDArray[np.uint32], coarse: Tiles,
    large: BlockShape, shape: BlockShape, simt: Simt,
) -> Work:  # fmt: skip
    """Work of the kernel: buffers as of the tile raster, and boxes."""
    boxes = len(lists) * VECTOR_BYTES
    streams = raster_streams(table, lists, len(vertices), large, simt, coarse.rows, others=boxes)
    masks = grids_together(large) * WORD_BYTES + (large.tile // shape.tile) ** 2 * WORD_BYTES
    return Work(
        stage="tile_raster", kernel="macro_raster", events=MacroRasterEvent, table=table, grid=len(table),
        block=large.tile**2, shared_bytes=shared_bytes(large) + masks,
        streams=(*streams, Stream("boxes", "load", boxes, len(vertices) * VECTOR_BYTES)),
        variant=f"tile {large.tile} in {shape.tile}",
    )  # fmt: skip
