"""One bin of the CoarseRasterizer (Zhang 2025, stage 6): box, edges, Hi-Z, queues of its tiles (device functions)."""

from enum import IntEnum
from typing import Any

import numpy as np

from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.zhang2025.depth import NO_DEPTH, depth_24_bit
from tilestamp.simulator.stages.zhang2025.primitive_binning import BIN
from tilestamp.simulator.stages.zhang2025.triangle_setup import DEPTH

BLOCK = 256  # threads, and primitives a round
TILE = 8  # pixels
TILES_A_ROW = BIN // TILE
HI_Z_MARGIN = 4  # units of 24 bits
_ZERO = np.float32(0.0)


class CoarseRasterizerEvent(IntEnum):
    """Events of one block, that is of one bin."""

    ROUNDS = 0
    WARPS = 1  # warps with a primitive, over the rounds: each tests the boxes and edges of 256 tiles
    WARP_LANES = 2
    EDGE_STEPS = 3  # warp steps over tiles that the box of a lane meets
    EDGE_LANES = 4
    HI_Z_STEPS = 5  # warp executions of the depth test
    HI_Z_LANES = 6
    HI_Z_REJECTED = 7
    HI_Z_UPDATES = 8  # lanes that lower a tile's depth
    APPEND_STEPS = 9  # warp steps of the serial append in which a lane writes
    ENTRIES = 10
    SHARED_ATOMIC = 11
    BANK_REPLAYS = 12
    ATOMIC = 13
    ATOMIC_LANES = 14
    ATOMIC_REQUESTS = 15
    ATOMIC_DEPTH = 16
    LOAD_TRANSACTIONS = 17
    LOAD_BYTES = 18
    STORE_TRANSACTIONS = 19
    STORE_BYTES = 20
    SUB_QUEUES = 21  # of the binning blocks, asked one after another
    FILLS = 22  # of them, those with primitives of this bin
    CRITICAL_HI_Z_STEPS = 23  # of the warp with most of them, round by round: the others wait for it
    CRITICAL_APPEND_STEPS = 24  # the same of the appends


@kernel(error_model="numpy")
def _corner(edge: Any, left: Any, bottom: Any, far: bool) -> Any:
    """Evaluate an edge function at the tile's corner that lies farthest inside, or farthest outside."""
    side = np.float32(TILE)
    x = left + side if (edge[0] >= _ZERO) != far else left
    y = bottom + side if (edge[1] >= _ZERO) != far else bottom
    return edge[0] * x + edge[1] * y + edge[2]


@kernel(error_model="numpy")
def _depth_range(plane: Any, left: Any, bottom: Any) -> tuple[int, int]:
    """Least and greatest depth of a plane over a tile, in 24 bits."""
    side = np.float32(TILE)
    x0, x1 = plane[0] * left, plane[0] * (left + side)
    y0, y1 = plane[1] * bottom, plane[1] * (bottom + side)
    return depth_24_bit(min(x0, x1) + min(y0, y1) + plane[2]), depth_24_bit(max(x0, x1) + max(y0, y1) + plane[2])


@kernel(error_model="numpy")
def _tile_of_warp(
    edges: Any, planes: Any, boxes: Any, listed: Any, left: Any, bottom: Any, hi_z: Any, tile: int, masks: Any, row: Any
) -> None:
    """All lanes of a warp at one tile; sets the lanes' bits in ``masks``."""
    side = np.float32(TILE)
    tested = 0
    passed = 0
    updates = 0
    cached = hi_z[tile]
    for lane in range(len(listed)):
        p = listed[lane]
        if max(boxes[p, 0], left) >= min(boxes[p, 2], left + side):
            continue
        if max(boxes[p, 1], bottom) >= min(boxes[p, 3], bottom + side):
            continue
        tested += 1
        outside = False
        covers = True
        for k in range(3):
            outside |= _corner(edges[p, k], left, bottom, False) < _ZERO
            covers &= _corner(edges[p, k], left, bottom, True) > _ZERO
        if outside:
            continue
        passed += 1
        low, high = _depth_range(planes[p, DEPTH], left, bottom)
        if cached + HI_Z_MARGIN < low:
            row[CoarseRasterizerEvent.HI_Z_REJECTED] += 1
            continue
        if covers:
            updates += 1
            hi_z[tile] = min(hi_z[tile], high)
        masks[tile, lane] = True
    row[CoarseRasterizerEvent.EDGE_STEPS] += tested > 0
    row[CoarseRasterizerEvent.EDGE_LANES] += tested
    row[CoarseRasterizerEvent.HI_Z_STEPS] += passed > 0
    row[CoarseRasterizerEvent.HI_Z_LANES] += passed
    row[CoarseRasterizerEvent.HI_Z_UPDATES] += updates
    row[CoarseRasterizerEvent.SHARED_ATOMIC] += updates > 0
    row[CoarseRasterizerEvent.BANK_REPLAYS] += max(0, updates - 1)  # one address


@kernel(error_model="numpy")
def rasterize_bin(
    edges: Any, planes: Any, boxes: Any, queue: Any, origin_x: int, origin_y: int, warp: int, use_hi_z: bool,
    counts: Any, entries: Any, cursors: Any, row: Any,
) -> None:  # fmt: skip
    """One bin: fill ``counts`` (256,) where ``entries`` is None, else the queues."""
    hi_z = np.full(TILES_A_ROW * TILES_A_ROW, NO_DEPTH, np.int64)
    masks = np.zeros((TILES_A_ROW * TILES_A_ROW, warp), np.bool_)
    slowest = 0
    for first in range(0, len(queue), warp):
        listed = queue[first : first + warp]
        if first % BLOCK == 0:
            row[CoarseRasterizerEvent.ROUNDS] += 1
            slowest = 0
        before = row[CoarseRasterizerEvent.HI_Z_STEPS]
        row[CoarseRasterizerEvent.WARPS] += 1
        row[CoarseRasterizerEvent.WARP_LANES] += len(listed)
        low_x, low_y, high_x, high_y = _tiles_of(boxes, listed, origin_x, origin_y)
        for y in range(low_y, high_y + 1):
            for x in range(low_x, high_x + 1):
                tile = y * TILES_A_ROW + x
                left, bottom = np.float32(origin_x + x * TILE), np.float32(origin_y + y * TILE)
                _tile_of_warp(edges, planes, boxes, listed, left, bottom, hi_z, tile, masks, row)
                for lane in range(len(listed)):
                    if masks[tile, lane]:
                        masks[tile, lane] = False
                        row[CoarseRasterizerEvent.ENTRIES] += 1
                        if entries is not None:
                            entries[cursors[tile]] = listed[lane]
                            cursors[tile] += 1
                        else:
                            counts[tile] += 1
                if not use_hi_z:
                    hi_z[tile] = NO_DEPTH
        row[CoarseRasterizerEvent.CRITICAL_HI_Z_STEPS] += max(
            0, row[CoarseRasterizerEvent.HI_Z_STEPS] - before - slowest
        )
        slowest = max(slowest, row[CoarseRasterizerEvent.HI_Z_STEPS] - before)


@kernel(error_model="numpy")
def _tiles_of(boxes: Any, listed: Any, origin_x: int, origin_y: int) -> tuple[int, int, int, int]:
    """Tiles of the bin that the boxes of a warp's primitives span: the others fail every box test."""
    low_x, low_y, high_x, high_y = TILES_A_ROW - 1, TILES_A_ROW - 1, 0, 0
    for p in listed:
        low_x = min(low_x, (int(boxes[p, 0]) - origin_x) // TILE)
        low_y = min(low_y, (int(boxes[p, 1]) - origin_y) // TILE)
        high_x = max(high_x, (int(boxes[p, 2]) - origin_x) // TILE)
        high_y = max(high_y, (int(boxes[p, 3]) - origin_y) // TILE)
    last = TILES_A_ROW - 1
    return max(low_x, 0), max(low_y, 0), min(high_x, last), min(high_y, last)
