"""One bin of the CoarseRasterizer (Zhang 2025, stage 6): box, edges, Hi-Z, queues of its tiles (device functions).

The warps of a round walk the tiles side by side, and a warp's lanes test a tile's depth before any of them lowers it.
So a primitive is rejected by those of earlier rounds, and of its own round by those of a warp that is ahead. Who is
ahead is decided here by the steps that each has made: on a GPU by cycles, which differ a little from frame to frame.
"""

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
TILES = TILES_A_ROW**2
CHUNK = 512  # queue entries
# how long a warp is at a tile, in cycles of one alone by the compiler's schedule: all fail the tests before depth; some
# lane has its depth tested; passes; lowers the tile's; and for each lane that does, at one address
_TILE, _TESTED, _KEPT, _UPDATED, _LANE = 66, 76, 98, 56, 16
_ARRIVED = 2**62
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
    CRITICAL_HI_Z_STEPS = 23  # of the warp that takes longest, round by round: the others wait for it
    CRITICAL_APPEND_STEPS = 24  # the same of the appends
    KEPT_STEPS = 25  # warp executions of what follows a depth test that some lane passes
    KEPT_LANES = 26
    CHUNK_STEPS = 27  # warp steps of the append in which a lane goes on to a new chunk of its queue
    CHUNK_SECTORS = 28  # pairs of tiles that do so in one step: their numbers of chunks share a sector
    BLOCKS = 29
    CRITICAL_UPDATE_STEPS = 30  # of the warp of CRITICAL_HI_Z_STEPS: steps in which a lane lowers a tile's depth


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
    edges: Any, planes: Any, boxes: Any, listed: Any, left: Any, bottom: Any, cached: int, tile: int, margin: int,
    masks: Any, row: Any,
) -> tuple[int, int]:  # fmt: skip
    """All lanes of a warp at one tile; sets their bits in ``masks``; returns how long they take and the new depth."""
    side = np.float32(TILE)
    tested = passed = kept = updates = 0
    lowered = NO_DEPTH
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
        if cached + margin < low:
            continue
        kept += 1
        if covers:
            updates += 1
            lowered = min(lowered, high)
        masks[tile, lane] = True
    row[CoarseRasterizerEvent.EDGE_STEPS] += tested > 0
    row[CoarseRasterizerEvent.EDGE_LANES] += tested
    row[CoarseRasterizerEvent.HI_Z_STEPS] += passed > 0
    row[CoarseRasterizerEvent.HI_Z_LANES] += passed
    row[CoarseRasterizerEvent.HI_Z_REJECTED] += passed - kept
    row[CoarseRasterizerEvent.KEPT_STEPS] += kept > 0
    row[CoarseRasterizerEvent.KEPT_LANES] += kept
    row[CoarseRasterizerEvent.HI_Z_UPDATES] += updates
    row[CoarseRasterizerEvent.SHARED_ATOMIC] += updates > 0
    row[CoarseRasterizerEvent.BANK_REPLAYS] += max(0, updates - 1)  # one address
    return _TESTED * (passed > 0) + _KEPT * (kept > 0) + (_UPDATED + _LANE * updates) * (updates > 0), lowered


@kernel(error_model="numpy")
def _test_round(
    edges: Any, planes: Any, boxes: Any, listed: Any, origin_x: int, origin_y: int, warp: int, margin: int, hi_z: Any,
    masks: Any, row: Any,
) -> None:  # fmt: skip
    """Walk the tiles with all warps of a round, always the one that is behind; sets ``masks`` (256, primitives)."""
    warps = -(-len(listed) // warp)
    clock, following, steps = np.zeros(warps, np.int64), np.zeros(warps, np.int64), np.zeros((warps, 2), np.int64)
    longest = 0
    lowered = np.full(warps, NO_DEPTH, np.int64)  # by a warp that still is at its last tile
    spans = np.empty((warps, 4), np.int64)
    for w in range(warps):
        spans[w] = _tiles_of(boxes, listed[w * warp : (w + 1) * warp], origin_x, origin_y)
    for _ in range(warps * TILES):
        w = int(clock.argmin())
        tile = following[w]
        hi_z[tile - 1] = min(hi_z[tile - 1], lowered[w])
        lowered[w] = NO_DEPTH
        x, y = tile % TILES_A_ROW, tile // TILES_A_ROW
        low_x, low_y, high_x, high_y = spans[w]
        clock[w] += _TILE
        if low_x <= x <= high_x and low_y <= y <= high_y:
            before = row[CoarseRasterizerEvent.HI_Z_STEPS]
            left, bottom = np.float32(origin_x + x * TILE), np.float32(origin_y + y * TILE)
            lanes = slice(w * warp, (w + 1) * warp)
            taken, lowered[w] = _tile_of_warp(
                edges, planes, boxes, listed[lanes], left, bottom, hi_z[tile], tile, margin, masks[:, lanes], row
            )
            clock[w] += taken
            steps[w, 0] += row[CoarseRasterizerEvent.HI_Z_STEPS] - before
            steps[w, 1] += lowered[w] != NO_DEPTH
        following[w] += 1
        if following[w] == TILES:
            longest = w  # the last one to arrive
            clock[w] = _ARRIVED
    hi_z[TILES - 1] = min(hi_z[TILES - 1], lowered.min())
    row[CoarseRasterizerEvent.WARPS] += warps
    row[CoarseRasterizerEvent.WARP_LANES] += len(listed)
    row[CoarseRasterizerEvent.CRITICAL_HI_Z_STEPS] += steps[longest, 0]
    row[CoarseRasterizerEvent.CRITICAL_UPDATE_STEPS] += steps[longest, 1]


@kernel(error_model="numpy")
def _append(masks: Any, listed: Any, warp: int, counts: Any, entries: Any, cursors: Any, row: Any) -> None:
    """Append a round's primitives to the tiles' queues, as a warp's lanes do for theirs."""
    most = 0
    for first in range(0, len(counts), warp):
        before = row[CoarseRasterizerEvent.APPEND_STEPS]
        for i in range(len(listed)):
            some, pair, new = 0, -1, 0
            for tile in range(first, first + warp):
                if not masks[tile, i]:
                    continue
                some += 1
                if counts[tile] % CHUNK == 0:
                    new += pair != tile // 2
                    pair = tile // 2
                counts[tile] += 1
                if entries is not None:
                    entries[cursors[tile]] = listed[i]
                    cursors[tile] += 1
            row[CoarseRasterizerEvent.APPEND_STEPS] += some > 0
            row[CoarseRasterizerEvent.ENTRIES] += some
            row[CoarseRasterizerEvent.CHUNK_STEPS] += new > 0
            row[CoarseRasterizerEvent.CHUNK_SECTORS] += new
        most = max(most, row[CoarseRasterizerEvent.APPEND_STEPS] - before)
    row[CoarseRasterizerEvent.CRITICAL_APPEND_STEPS] += most


@kernel(error_model="numpy")
def rasterize_bin(
    edges: Any, planes: Any, boxes: Any, queue: Any, origin_x: int, origin_y: int, warp: int, margin: int,
    counts: Any, entries: Any, cursors: Any, row: Any,
) -> None:  # fmt: skip
    """One bin: fill ``counts`` (256,), and the queues where ``entries`` is not None."""
    hi_z = np.full(TILES, NO_DEPTH, np.int64)
    masks = np.empty((TILES, BLOCK), np.bool_)
    for first in range(0, len(queue), BLOCK):
        listed = queue[first : first + BLOCK]
        masks[:] = False
        row[CoarseRasterizerEvent.ROUNDS] += 1
        _test_round(edges, planes, boxes, listed, origin_x, origin_y, warp, margin, hi_z, masks, row)
        _append(masks, listed, warp, counts, entries, cursors, row)


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
