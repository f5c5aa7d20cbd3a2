"""FineRasterizer: pixel coverage in 2x2 quads and early z (Zhang 2025, stage 7).

A warp a tile; blocks of 4 tiles after optimization, of 1 before. In rounds of 32 primitives each lane takes one: 64-bit
coverage from three float edge functions, stepped pixel by pixel as in the original, then 64 serial steps of early z, a
shared atomicMin for each covered pixel. Quads with a live pixel go to the fragment stream, which one atomicAdd a warp
and round allots; after optimization four lanes write a quad, before it each lane writes all of its own quads.

Lanes reach a pixel in the same step and the atomic serves them in lane order, so early z goes in primitive order.
"""

from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from models.launch import Stream
from models.simt import Simt
from simulator.stages.zhang2025.coarse_rasterizer import NO_DEPTH, TILE, TileQueues, depth_24_bit
from simulator.stages.zhang2025.triangle_setup import DEPTH, SETUP_BYTES, TriangleSetupData, evaluate
from simulator.work import Work

TILES_A_BLOCK = 4  # after optimization
FRAGMENT_BYTES = 48
QUADS = 16  # of a tile
_HALF = np.float32(0.5)
_ZERO = np.float32(0.0)


class FineRasterizerEvent(IntEnum):
    """Events of one block."""

    WARPS = 0  # tiles: each loads and stores its 64 depths
    ROUNDS = 1  # warp rounds of up to 32 primitives: coverage, quad masks, scan
    ROUND_LANES = 2
    SAMPLE_TESTS = 3
    SAMPLE_HITS = 4
    EARLY_Z_STEPS = 5  # warp steps over pixels that a lane covers
    QUAD_STEPS = 6  # warp steps that write quads
    QUADS = 7
    SHARED_ATOMIC = 8
    BANK_REPLAYS = 9  # lanes beyond the first at a pixel
    ATOMIC = 10
    ATOMIC_LANES = 11
    ATOMIC_REQUESTS = 12
    ATOMIC_DEPTH = 13
    LOAD_TRANSACTIONS = 14
    LOAD_BYTES = 15
    STORE_TRANSACTIONS = 16
    STORE_BYTES = 17


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


@njit(cache=True, nogil=True, error_model="numpy")
def coverage(edges: Any, left: int, bottom: int, columns: int, rows: int) -> Any:
    """64-bit coverage of a tile by one primitive, limited to ``columns`` x ``rows`` pixels on the screen."""
    mask = np.uint64(0)
    x, y = np.float32(left) + _HALF, np.float32(bottom) + _HALF
    e0 = edges[0, 0] * x + edges[0, 1] * y + edges[0, 2]
    e1 = edges[1, 0] * x + edges[1, 1] * y + edges[1, 2]
    e2 = edges[2, 0] * x + edges[2, 1] * y + edges[2, 2]
    for column in range(columns):  # each column of the original's chain steps up by itself
        d0, d1, d2 = e0, e1, e2
        for row in range(rows):
            if d0 >= _ZERO and d1 >= _ZERO and d2 >= _ZERO:
                mask |= np.uint64(1) << np.uint64(row * TILE + column)
            d0 += edges[0, 1]
            d1 += edges[1, 1]
            d2 += edges[2, 1]
        e0 += edges[0, 0]
        e1 += edges[1, 0]
        e2 += edges[2, 0]
    return mask


@njit(cache=True, nogil=True, error_model="numpy")
def _early_z(plane: Any, mask: Any, left: int, bottom: int, depth: Any, hits: Any, early_z: bool) -> Any:
    """Depth-test the covered pixels of one primitive; returns those that pass."""
    passed = mask
    for i in range(TILE * TILE):
        bit = np.uint64(1) << np.uint64(i)
        if mask & bit == np.uint64(0):
            continue
        hits[i] += 1
        x, y = left + i % TILE, bottom + i // TILE
        z = depth_24_bit(evaluate(plane, np.float32(x) + _HALF, np.float32(y) + _HALF))
        if early_z and z > depth[y, x]:
            passed &= ~bit
        depth[y, x] = min(depth[y, x], z)
    return passed


@njit(cache=True, nogil=True, error_model="numpy")
def quad_mask(mask: Any) -> int:
    """Which of the 16 quads of a tile have a live pixel."""
    quads = 0
    for q in range(QUADS):
        corner = np.uint64(0x303) << np.uint64((q // 4) * 16 + (q % 4) * 2)
        if mask & corner != np.uint64(0):
            quads |= 1 << q
    return quads


@njit(cache=True, nogil=True, error_model="numpy")
def _tile(
    edges: Any, planes: Any, queue: Any, left: int, bottom: int, warp: int, early_z: bool, optimized: bool,
    masks: Any, depth: Any, row: Any,
) -> None:  # fmt: skip
    """One tile: its primitives in rounds of a warp."""
    hits = np.zeros(TILE * TILE, np.int64)
    columns, rows = min(TILE, depth.shape[1] - left), min(TILE, depth.shape[0] - bottom)
    row[0] += 1  # WARPS
    for first in range(0, len(queue), warp):
        end = min(len(queue), first + warp)
        hits[:] = 0
        written = np.zeros(warp, np.int64)  # quads of each lane
        for i in range(first, end):
            p = queue[i]
            mask = coverage(edges[p], left, bottom, columns, rows)
            masks[i] = _early_z(planes[p, DEPTH], mask, left, bottom, depth, hits, early_z)
            written[i - first] = quad_mask(masks[i])
        row[1] += 1  # ROUNDS
        row[2] += end - first
        row[3] += TILE * TILE * (end - first)
        for i in range(TILE * TILE):
            row[4] += hits[i]
            row[5] += hits[i] > 0
            row[8] += hits[i] > 0
            row[9] += max(0, hits[i] - 1)
        row[6] += _quad_steps(written, optimized)
        for lane in range(warp):
            row[7] += _bits(written[lane])


@njit(cache=True, nogil=True, error_model="numpy")
def _bits(quads: int) -> int:
    count = 0
    while quads:
        quads &= quads - 1
        count += 1
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def _quad_steps(written: Any, optimized: bool) -> int:
    """Warp steps that write: over 16 quads for each group of 8 lanes' primitives, or for all lanes at once."""
    group = 8 if optimized else len(written)
    steps = 0
    for first in range(0, len(written), group):
        some = 0
        for lane in range(first, first + group):
            some |= written[lane]
        steps += _bits(some)
    return steps


@njit(cache=True, nogil=True, error_model="numpy")
def _band(
    edges: Any, planes: Any, starts: Any, entries: Any, tile_columns: int, tile_row: int, warp: int, early_z: bool,
    optimized: bool, masks: Any, depth: Any, events: Any,
) -> None:  # fmt: skip
    """Rasterize a row of tiles; ``events`` (tile columns, ...) of this row alone."""
    for column in range(len(events)):
        i = tile_row * tile_columns + column
        queue = entries[starts[i] : starts[i + 1]]
        tile_masks = masks[starts[i] : starts[i + 1]]
        _tile(
            edges, planes, queue, column * TILE, tile_row * TILE, warp, early_z, optimized,
            tile_masks, depth, events[column],
        )  # fmt: skip


@njit(cache=True, nogil=True, error_model="numpy", parallel=True)
def _fine_rasterizer(
    edges: Any, planes: Any, starts: Any, entries: Any, tile_columns: int, warp: int, early_z: bool, optimized: bool,
    masks: Any, depth: Any, events: Any,
) -> None:  # fmt: skip
    for tile_row in prange(len(events)):
        _band(
            edges, planes, starts, entries, tile_columns, tile_row, warp, early_z, optimized,
            masks, depth, events[tile_row],
        )  # fmt: skip


def fine_rasterizer(
    data: TriangleSetupData, tiles: TileQueues, width: int, height: int, simt: Simt, *, early_z: bool, optimized: bool
) -> tuple[TileFragments, Work]:
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

    Returns
    -------
    TileFragments, Work
    """
    rows, columns = -(-height // TILE), -(-width // TILE)
    out = TileFragments(np.zeros(len(tiles.entries), np.uint64), np.full((height, width), NO_DEPTH, np.uint32))
    events = np.zeros((rows, columns, len(FineRasterizerEvent)), np.int64)
    _fine_rasterizer(*data[:2], tiles.starts, tiles.entries, tiles.columns, simt.warp, early_z, optimized, *out, events)
    _add_costs(events, simt, optimized)
    group = TILES_A_BLOCK if optimized else 1
    padded = np.zeros((-(-rows // group) * group, columns, events.shape[2]), np.int64)
    padded[:rows] = events
    table = padded.reshape(-1, group, columns, events.shape[2]).sum(axis=1).reshape(-1, events.shape[2])
    total = table.sum(axis=0)
    pixels = width * height
    drawn = len(np.unique(tiles.entries))
    streams = (
        Stream("tile_queue", "load", 4 * len(tiles.entries), 4 * len(tiles.entries)),
        Stream("setup", "load", 160 * int(total[FineRasterizerEvent.ROUND_LANES]), drawn * SETUP_BYTES),
        Stream("depth", "load", 4 * pixels, 4 * pixels),
        Stream("fragments", "store", 4 * FRAGMENT_BYTES * int(total[7]), 4 * FRAGMENT_BYTES * int(total[7])),
        Stream("depth", "store", 4 * pixels, 4 * pixels),
    )
    kernel = "FineRasterizer" if optimized else "FineRasterizer_before"
    shared = group * 4 * (64 + 64 + 4 + 4 + 1)
    return out, Work(
        "FineRasterizer", kernel, FineRasterizerEvent, table, len(table), 32 * group, shared, streams=streams
    )


def _add_costs(events: NDArray[np.int64], simt: Simt, optimized: bool) -> None:
    """Add what follows from the counts: one atomicAdd a round, memory."""
    event = FineRasterizerEvent
    segment = 128 if simt.coalescing == 2 else 32
    rounds, quads = events[..., event.ROUNDS], events[..., event.QUADS]
    for name in (event.ATOMIC, event.ATOMIC_LANES, event.ATOMIC_REQUESTS, event.ATOMIC_DEPTH):
        events[..., name] = rounds
    depths = 8 * events[..., event.WARPS]  # eight rows of 32 bytes, read and written
    setup = events[..., event.ROUND_LANES] * (SETUP_BYTES // 4) + quads * (
        -(-SETUP_BYTES // segment) if optimized else 0
    )
    a_quad = 4 * FRAGMENT_BYTES // 16 // (4 * FRAGMENT_BYTES // 16 // 3 if optimized else 1)  # stores of 16 bytes
    sectors = quads * (4 * FRAGMENT_BYTES // 32 if optimized else a_quad)
    events[..., event.LOAD_TRANSACTIONS] = depths + setup + rounds * 4
    events[..., event.LOAD_BYTES] = (depths + setup + rounds * 4) * segment
    events[..., event.STORE_TRANSACTIONS] = depths + sectors
    events[..., event.STORE_BYTES] = (depths + sectors) * 32
