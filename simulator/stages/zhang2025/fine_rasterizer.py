"""FineRasterizer: pixel coverage in 2x2 quads and early z (Zhang 2025, stage 7).

A warp a tile; blocks of 4 tiles after optimization, of 1 before. In rounds of 32 primitives each lane takes one: 64-bit
coverage from three float edge functions, stepped pixel by pixel as in the original, then 64 serial steps of early z, a
shared atomicMin for each covered pixel. Quads with a live pixel go to the fragment stream, which one atomicAdd a warp
and round allots; after optimization four lanes write a quad, before it each lane writes all of its own quads. Here all
rows of tiles are drawn; the original divides their number by the block's 4 and drops the rest: for 1080 rows of pixels
it launches 33 rows of blocks, and never draws the top 24 (``whole_blocks``).

Lanes reach a pixel in the same step and the atomic serves them in lane order, so early z goes in primitive order.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.coalescing import smallest_transaction_bytes
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.zhang2025.coarse_bin import TILE
from tilestamp.simulator.stages.zhang2025.coarse_rasterizer import TileQueues
from tilestamp.simulator.stages.zhang2025.depth import NO_DEPTH
from tilestamp.simulator.stages.zhang2025.fine_tile import FineRasterizerEvent, rasterize_tile
from tilestamp.simulator.stages.zhang2025.triangle_setup import SETUP_BYTES, TriangleSetupData
from tilestamp.simulator.work import Work

TILES_A_BLOCK = 4  # after optimization
FRAGMENT_BYTES = 48
FRAGMENT_STORES = 4  # of 16, 16, 8 and 4 bytes, a sector each; 4 bytes of a fragment stay as they were
EDGE_WORDS, DEPTH_WORDS, QUAD_WORDS = 9, 3, 22  # that are loaded of a primitive: for coverage, at each pixel, for quads
FRAGMENT_OUT = 84  # bytes of a fragment that leave L1 for its four stores of 44 bytes in all: measured on an H200


class TileFragments(NamedTuple):
    """Fragments that passed early z.

    Parameters
    ----------
    masks : ndarray, (entries,), uint64
        By entry of the tile queues: bit 8 y + x is pixel (x, y) of the tile.
    depth : ndarray, (H, W), uint32
        Depth buffer after early z, 24 bits, rows from the bottom.
    """

    masks: NDArray[np.uint64]
    depth: NDArray[np.uint32]


@kernel(error_model="numpy", lent=True)
def _fine_rasterizer(
    part: int, parts: int, edges: Any, planes: Any, starts: Any, entries: Any, tile_columns: int, warp: int,
    early_z: bool, optimized: bool, masks: Any, depth: Any, events: Any,
) -> None:  # fmt: skip
    for row in range(part * len(events) // parts, (part + 1) * len(events) // parts):
        for column in range(events.shape[1]):
            i = row * tile_columns + column
            queue = entries[starts[i] : starts[i + 1]]
            tile_masks = masks[starts[i] : starts[i + 1]]
            rasterize_tile(
                edges, planes, queue, column * TILE, row * TILE, warp, early_z, optimized,
                tile_masks, depth, events[row, column],
            )  # fmt: skip


def fine_rasterizer(
    data: TriangleSetupData,
    tiles: TileQueues,
    width: int,
    height: int,
    simt: Simt,
    *,
    early_z: bool,
    optimized: bool,
    whole_blocks: bool = False,
) -> StageResult[TileFragments]:
    """Rasterize all tiles.

    Parameters
    ----------
    data : TriangleSetupData
    tiles : TileQueues
    width, height : int
        Pixels.
    simt : Simt
    early_z : bool
        Whether early z rejects (not with transparency).
    optimized : bool
        Blocks of four tiles and four lanes a quad; or the kernel before that.
    whole_blocks : bool
        Launch whole blocks of four tiles only, as the original does: rows of tiles beyond them are never drawn.

    Returns
    -------
    outputs : TileFragments
    works : one
    """
    rows, columns = -(-height // TILE), -(-width // TILE)
    rows -= rows % TILES_A_BLOCK if whole_blocks and optimized else 0
    out = TileFragments(np.zeros(len(tiles.entries), np.uint64), np.full((height, width), NO_DEPTH, np.uint32))
    events = np.zeros((rows, columns, len(FineRasterizerEvent)), np.int64)
    for_parts(
        _fine_rasterizer, parts_of(rows), *data[:2], tiles.starts, tiles.entries, tiles.columns, simt.warp, early_z,
        optimized, *out, events,
    )  # fmt: skip
    group = TILES_A_BLOCK if optimized else 1
    table = _by_block(events, group)
    _add_costs(table, simt, optimized)
    total = table.sum(axis=0)
    pixels = width * height
    drawn = int(np.count_nonzero(np.bincount(tiles.entries)))
    quads = 4 * int(total[FineRasterizerEvent.QUADS])
    streams = (
        Stream("tile_queue", "load", 4 * len(tiles.entries), 4 * len(tiles.entries)),
        Stream("setup", "load", 160 * int(total[FineRasterizerEvent.ROUND_LANES]), drawn * SETUP_BYTES),
        Stream("depth", "load", 4 * pixels, 4 * pixels),
        Stream("fragments", "store", FRAGMENT_OUT * quads, FRAGMENT_BYTES * quads, 4 * FRAGMENT_BYTES, gaps=True),
        Stream("depth", "store", 4 * pixels, 4 * pixels),
    )
    kernel = "FineRasterizer" if optimized else "FineRasterizer_before"
    shared = group * 4 * (64 + 64 + 4 + 4 + 1)
    work = Work(
        "FineRasterizer", FineRasterizerEvent, table, 32 * group, kernel=kernel, shared_bytes=shared, streams=streams
    )
    return StageResult(out, (work,))


def _by_block(events: NDArray[np.int64], group: int) -> NDArray[np.int64]:
    """Add up the tiles of each block, ``group`` rows of tiles in one; its slowest tile is its critical one."""
    event = FineRasterizerEvent
    rows, columns, count = events.shape
    padded = np.zeros((-(-rows // group) * group, columns, count), np.int64)
    padded[:rows] = events
    tiles = padded.reshape(-1, group, columns, count)
    slowest = tiles[..., event.EARLY_Z_STEPS].argmax(axis=1)[:, None, :, None]
    critical = np.take_along_axis(tiles, slowest, axis=1)[:, 0]
    table: NDArray[np.int64] = tiles.sum(axis=1)
    table[..., event.CRITICAL_ROUNDS] = critical[..., event.ROUNDS]
    table[..., event.CRITICAL_Z_STEPS] = critical[..., event.EARLY_Z_STEPS]
    table[..., event.CRITICAL_QUAD_STEPS] = critical[..., event.QUAD_STEPS]
    return np.reshape(table, (-1, count))


def _add_costs(events: NDArray[np.int64], simt: Simt, optimized: bool) -> None:
    """Add what follows from the counts: one atomicAdd a round, memory."""
    event = FineRasterizerEvent
    segment = smallest_transaction_bytes(int(simt.coalescing))
    rounds, quads = events[:, event.ROUNDS], events[:, event.QUADS]
    for name in (event.ATOMIC, event.ATOMIC_LANES, event.ATOMIC_REQUESTS, event.ATOMIC_DEPTH):
        events[:, name] = rounds
    depths = 8 * events[:, event.WARPS]  # eight rows of 32 bytes, read and written
    lanes = events[:, event.ROUND_LANES]
    setup = SETUP_BYTES // 4 * lanes
    if optimized:
        setup = (EDGE_WORDS + QUAD_WORDS) * lanes + DEPTH_WORDS * events[:, event.SAMPLE_HITS]
    queues = 2 * events[:, event.WARPS] + events[:, event.GROUP_STEPS]  # eight numbers of primitives a sector
    sectors = quads * (4 * FRAGMENT_STORES if optimized else 4 * FRAGMENT_BYTES // 16)
    events[:, event.LOAD_TRANSACTIONS] = depths + setup + queues
    events[:, event.LOAD_BYTES] = events[:, event.LOAD_TRANSACTIONS] * segment
    events[:, event.STORE_TRANSACTIONS] = depths + sectors
    events[:, event.STORE_BYTES] = (depths + sectors) * 32
