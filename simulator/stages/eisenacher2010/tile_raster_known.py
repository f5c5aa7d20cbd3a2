"""What is known of tiles before they are drawn: their lists, and how much of the grids in them lies in the tile.

What a block does whatever its quads cover follows from its list alone, and so is known exactly. For the rest a list's
length foretells the quads that are looked at, and the share of a grid's box, and of its area, that lies in the tile the
samples that are tested and hit there.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kernel import kernel
from tilestamp.models.simt import Simt
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stage import Known
from tilestamp.simulator.stages.eisenacher2010.tile_range import Tiles
from tilestamp.simulator.stages.eisenacher2010.tile_raster_events import (
    SEGMENT_WORDS,
    BlockShape,
    TileRasterEvent,
    block_traffic,
    count_block,
    count_stores,
    shape_for,
)

SAMPLE_SECONDS, ENTRY_SECONDS = 40e-9, 0.4e-6  # CPU time of a sample, and of an entry of a list
_PART_TILES = 256  # that one call of the worker takes, at least
_E = TileRasterEvent
LISTED = (  # events that follow from the lists
    _E.PIXEL_WARPS, _E.PIXEL_LANES, _E.LIST_WARPS, _E.GRIDS, _E.BATCHES, _E.BATCH_WARPS, _E.GATHER_WARPS,
    _E.GATHER_LANES, _E.EDGE_GATHER_WARPS, _E.EDGE_GATHER_LANES, _E.QUAD_WARPS, _E.QUAD_LANES, _E.SUBTILE_TEST_WARPS,
    _E.SUBTILE_TEST_LANES, _E.RESOLVE_WARPS, _E.BANK_REPLAYS, _E.BARRIERS, _E.LOAD_TRANSACTIONS, _E.LOAD_BYTES,
    _E.STORE_TRANSACTIONS, _E.STORE_BYTES,
)  # fmt: skip


@kernel(lent=True)
def _add_grids(
    part: int, parts: int, vertices: Any, side: int, count: Any, start: Any, lists: Any, tiles: Tiles, known: Any
) -> None:
    """Pixels of boxes and of grids in each tile of one part; a grid's area is that of its two triangles."""
    for t in range(count.size * part // parts, count.size * (part + 1) // parts):
        left, top = np.float32(t % tiles.columns * tiles.size), np.float32(t // tiles.columns * tiles.size)
        for k in range(np.int64(start[t]), np.int64(start[t]) + np.int64(count[t])):
            v = vertices[lists[k]]
            ax, ay, bx, by = v[0, 0], v[0, 1], v[side - 1, 0], v[side - 1, 1]
            cx, cy, dx, dy = v[-side, 0], v[-side, 1], v[-1, 0], v[-1, 1]
            x0, x1 = min(ax, bx, cx, dx), max(ax, bx, cx, dx)
            y0, y1 = min(ay, by, cy, dy), max(ay, by, cy, dy)
            along = max(min(x1, left + tiles.size) - max(x0, left), np.float32(0))
            down = max(min(y1, top + tiles.size) - max(y0, top), np.float32(0))
            twice = abs((bx - ax) * (cy - ay) - (cx - ax) * (by - ay))
            twice += abs((bx - dx) * (cy - dy) - (cx - dx) * (by - dy))
            known[0, t] += along * down
            known[1, t] += along * down * twice / max(2 * (x1 - x0) * (y1 - y0), np.float32(1e-6))


@kernel
def _count_lists(
    part: int, parts: int, count: Any, start: Any, lists: Any, tiles: Tiles, shape: BlockShape, traffic: Any, size: Any,
    table: Any,
) -> None:  # fmt: skip
    """Rows of the tiles of one part, had no grid a quad in its tile."""
    addresses, stores = np.empty(shape.warp, np.int64), np.zeros((SEGMENT_WORDS, 2), np.int64)
    for t in range(count.size * part // parts, count.size * (part + 1) // parts):
        x, y = t % tiles.columns * tiles.size, t // tiles.columns * tiles.size
        count_block(t, lists, np.int64(start[t]), np.int64(count[t]), shape, traffic, table[t])
        count_stores(x, y, size[0], size[1], shape, addresses, stores, table[t])


def known_tiles(
    vertices: NDArray[np.float32],
    count: NDArray[np.uint32],
    start: NDArray[np.uint32],
    lists: NDArray[np.uint32],
    tiles: Tiles,
    width: int,
    height: int,
    simt: Simt,
    *,
    spp: int,
    box_tests: bool,
    edges: str,
    **_: Any,
) -> Known:
    """What is known of each tile; inputs of ``tile_raster``."""
    pixels, rows = np.zeros((2, tiles.total)), np.zeros((tiles.total, len(TileRasterEvent)), np.int64)
    shape = shape_for(vertices, tiles, simt, spp=spp, box_tests=box_tests, edges=edges)
    parts, listed = parts_of(tiles.total, _PART_TILES), (count, start, lists, tiles)
    for_parts(_add_grids, parts, vertices, shape.grid, *listed, pixels)
    for_parts(_count_lists, parts, *listed, shape, block_traffic(shape, simt), (width, height), rows)
    seconds = SAMPLE_SECONDS * width * height * spp + ENTRY_SECONDS * len(lists)
    return Known(seconds, count, (pixels[1], pixels[0]), {event: rows[:, event] for event in LISTED})
