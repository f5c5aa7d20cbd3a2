"""Tile raster: one block a tile, one thread a pixel (Eisenacher & Loop 2010, section 3.3).

The block loads the grids of its list to shared memory, batch by batch, and every thread walks through all quads: box
tests, four edge functions, z, z-test, colour; depth and colour stay in registers. With 4 or 16 samples a pixel the tile
is drawn in 2x2 or 4x4 sub-tiles, so that neighbouring threads test neighbouring samples.

What runs here is smarter than what is charged: only the samples inside a quad's box are evaluated, while the machine is
charged for every warp and lane that its kernel would keep busy (``tile_raster_events``). With the box tests off, lanes
outside a quad's box are charged for the edge functions and taken as misses.
"""

from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import LINE_BYTES, SECTOR_BYTES, Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.eisenacher2010.edge_equations import stored_edges
from tilestamp.simulator.stages.eisenacher2010.tile_range import Tiles
from tilestamp.simulator.stages.eisenacher2010.tile_raster_events import (
    ALIGNMENTS,
    EDGE_VECTORS,
    SEGMENT_WORDS,
    VECTOR_BYTES,
    WORD_BYTES,
    BlockShape,
    TileRasterEvent,
    block_traffic,
    count_block,
    count_stores,
    grids_together,
    shape_for,
)
from tilestamp.simulator.stages.eisenacher2010.tile_raster_quads import new_quads, raster_grids
from tilestamp.simulator.stages.eisenacher2010.tile_raster_resolve import resolve
from tilestamp.simulator.stages.eisenacher2010.tile_raster_samples import (
    BACKGROUND,
    FAR,
    Samples,
    new_tests,
)
from tilestamp.simulator.work import Work

Edges = Literal["computed", "loaded", "half", "fixed", "snapped"]
_PART_TILES = 32  # tiles that one call of the worker takes, at least
SMALLEST_WARP = 16  # lanes: 16 load a grid together

_E = TileRasterEvent


@kernel
def _raster_tiles(
    part: int,
    parts: int,
    points: Any,
    words: Any,
    stored: Any,
    count: Any,
    start: Any,
    lists: Any,
    tiles: Tiles,
    shape: BlockShape,
    traffic: Any,
    image: Any,
    depth: Any,
    overdraw: Any,
    ids: Any,
    table: Any,
) -> None:
    """One part of the tiles."""
    size = shape.tile * shape.side
    samples = Samples(
        np.empty((size, size), np.float32), np.empty((size, size), np.uint32), np.zeros((size, size), np.int32)
    )
    quads, tests = new_quads(shape.grid), new_tests()
    addresses, stores = np.empty(shape.warp, np.int64), np.zeros((SEGMENT_WORDS, 2), np.int64)
    height, width = depth.shape
    for block in range(count.size * part // parts, count.size * (part + 1) // parts):
        tile_row, column = block // tiles.columns, block % tiles.columns
        first, grids = np.int64(start[block]), np.int64(count[block])
        row = None if table is None else table[block]
        origin = (np.float64(column * shape.tile), np.float64(tile_row * shape.tile))
        if grids > 0:
            samples.depth[:] = FAR
            samples.color[:] = BACKGROUND
            samples.hits[:] = 0
            raster_grids(points, words, stored, lists, first, first + grids, origin, shape, samples, quads, tests, row)
            resolve(samples, shape.side, column * shape.tile, tile_row * shape.tile, image, depth, overdraw)
            if ids is not None:
                y, x = tile_row * shape.tile, column * shape.tile
                ids[y : y + size, x : x + size] = samples.color[: height - y, : width - x]
        if row is not None:
            count_block(block, lists, first, grids, shape, traffic, row)
            count_stores(column * shape.tile, tile_row * shape.tile, width, height, shape, addresses, stores, row)


class Pixels(NamedTuple):
    """What the tiles show."""

    image: NDArray[Any]  # (H, W, 3) bytes; with ``ids`` the number of the first vertex of each quad seen, (H, W) uint32
    depth: NDArray[np.float32]  # (H, W) of the nearest sample of each pixel; 1 where nothing was drawn
    overdraw: NDArray[np.int32] | None  # (H, W) quads that cover a sample, summed over the samples of each pixel


def shared_bytes(shape: BlockShape) -> int:
    """Shared memory a block: a batch of grids, their edge equations if loaded, all samples where they are resolved."""
    grids: int = grids_together(shape)
    samples = shape.tile**2 * shape.side**2 * WORD_BYTES if shape.side > 1 else WORD_BYTES
    return grids * (shape.grid**2 + shape.loaded) * VECTOR_BYTES + samples


def raster_streams(
    table: NDArray[np.int64],
    lists: NDArray[np.uint32],
    grids: int,
    shape: BlockShape,
    simt: Simt,
    rows: int,
    others: int = 0,
) -> tuple[Stream, ...]:
    """Buffers that the kernel touches, by the rows of all tiles; of ``grids`` those that are in a list.

    Tiles that share a grid are neighbours, at most a row of tiles apart. ``others``: bytes that it loads besides.
    """
    total = table.sum(axis=0)
    seen = np.zeros(grids, np.bool_)
    seen[lists] = True
    drawn = int(np.count_nonzero(seen))
    alignments = np.bincount(lists & np.uint32(ALIGNMENTS - 1), minlength=ALIGNMENTS)
    vertex_bytes = int(alignments @ block_traffic(shape, simt).grid[:, 1])
    edge_bytes = len(lists) * shape.loaded * VECTOR_BYTES
    rest = int(total[_E.LOAD_BYTES]) - vertex_bytes - edge_bytes - others
    stored, row = int(total[_E.STORE_BYTES]), max(SECTOR_BYTES, shape.tile * WORD_BYTES)
    streams = [
        Stream("grids", "load", vertex_bytes, drawn * shape.grid**2 * VECTOR_BYTES, 2 * vertex_bytes // rows),
        Stream("LISTS", "load", rest, len(lists) * WORD_BYTES + 2 * len(table) * WORD_BYTES),
        Stream("framebuffer", "store", stored, stored, partial_lines=0 if row >= LINE_BYTES else stored // row),
    ]
    if shape.loaded:
        streams.append(Stream("edges", "load", edge_bytes, drawn * shape.loaded * VECTOR_BYTES))
    return tuple(streams)


def raster_work(
    shape: BlockShape, table: NDArray[np.int64], streams: tuple[Stream, ...] = (), *, ids: bool = False
) -> Work:
    """Work of the kernel, a row a tile; ``ids`` where it leaves numbers of quads in place of colours."""
    return Work(
        stage="tile_raster",
        kernel="tile_raster" + "_ids" * ids + "_stored" * (0 < shape.loaded < EDGE_VECTORS),
        events=_E,
        table=table,
        grid=len(table),
        block=shape.tile**2,
        shared_bytes=shared_bytes(shape),
        streams=streams,
        variant=f"tile {shape.tile} spp {shape.side**2}" + ("" if shape.box_tests else " no box"),
    )


def tile_raster(
    vertices: NDArray[np.float32],
    count: NDArray[np.uint32],
    start: NDArray[np.uint32],
    lists: NDArray[np.uint32],
    tiles: Tiles,
    width: int,
    height: int,
    simt: Simt,
    *,
    spp: int = 1,
    box_tests: bool = True,
    edges: Edges = "computed",
    ids: bool = False,
    counting: bool = True,
) -> StageResult[Pixels]:
    """Draw the grids of each tile.

    Parameters
    ----------
    vertices : ndarray, (N, side**2, 4), float32
        Screen x and y (pixels, y down), z (smaller is nearer), and the packed colour's bits, of 4x4 vertices a grid
        (or of more, which the paper has not).
    count, start : ndarray, (tiles,), uint32
        COUNT and START.
    lists : ndarray, uint32
        LISTS: the grids of each tile.
    tiles : Tiles
    width, height : int
        Pixels.
    simt : Simt
    spp : int
        Samples a pixel: 1, 4 or 16.
    box_tests : bool
        Test a quad's box against sub-tiles and samples before the edge functions.
    edges : {"computed", "loaded", "half", "fixed", "snapped"}
        Edge equations computed by each thread, or computed while dicing and loaded: other costs, the same picture. Or
        in 16 bits (``edge_equations``; of vertices that have been snapped): another picture.
    ids : bool
        Leave the number of the quad that is seen in place of its colour (not in the paper); one sample a pixel.
    counting : bool
        Without it no events are counted and no works come back.

    Returns
    -------
    outputs : Pixels
    works : one, a row a tile

    Raises
    ------
    TilestampError
        A warp that the kernel does not have.
    """
    if simt.warp < SMALLEST_WARP or simt.warp.bit_count() > 1:
        raise TilestampError(f"tile_raster needs warps of 16, 32 or 64 lanes, not {simt.warp}")
    shape = shape_for(vertices, tiles, simt, spp=spp, box_tests=box_tests, edges=edges)
    image = np.empty((height, width, 3), np.uint8)
    image[:] = np.tile(np.frombuffer(BACKGROUND.tobytes(), np.uint8)[:3], (width, 1))  # by rows, which is quick
    depth = np.full((height, width), FAR)
    overdraw = np.zeros((height, width), np.int32) if counting else None
    table = np.zeros((tiles.total, len(_E)), np.int64) if counting else None
    traffic = block_traffic(shape, simt)
    points = vertices.reshape(-1)
    words = None if ids else points.view(np.uint32)
    stored = stored_edges(vertices, edges) if edges in {"half", "fixed"} else None
    seen = np.full((height, width), BACKGROUND, np.uint32) if ids else None
    buffers = (image, depth, overdraw, seen, table)
    parts = parts_of(tiles.total, _PART_TILES)
    for_parts(_raster_tiles, parts, points, words, stored, count, start, lists, tiles, shape, traffic, *buffers)
    pixels = Pixels(image if seen is None else seen, depth, overdraw)
    if table is None:
        return StageResult(pixels)
    streams = raster_streams(table, lists, len(vertices), shape, simt, -(-tiles.total // tiles.columns))
    return StageResult(pixels, (raster_work(shape, table, streams, ids=ids),))
