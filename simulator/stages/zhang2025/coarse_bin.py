"""One bin of the CoarseRasterizer (Zhang 2025, stage 6): box, edges, Hi-Z, queues of its tiles (device functions).

The warps of a round walk the tiles side by side, and a warp's lanes test a tile's depth before any of them lowers it.
So a primitive is rejected by those of earlier rounds, and of its own round by those of a warp that is ahead. Who is
ahead is decided here by the steps that each has made: on a GPU by cycles, which differ a little from frame to frame.
"""

from enum import IntEnum
from typing import Any

import numpy as np

from tilestamp.models.bits import lowest_bit, popcount
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


@kernel(error_model="numpy", lent=True)
def _corner(edge: Any, left: Any, bottom: Any, far: bool) -> Any:
    """Evaluate an edge function at the tile's corner that lies farthest inside, or farthest outside."""
    side = np.float32(TILE)
    x = left + side if (edge[0] >= _ZERO) != far else left
    y = bottom + side if (edge[1] >= _ZERO) != far else bottom
    return edge[0] * x + edge[1] * y + edge[2]


@kernel(error_model="numpy", lent=True)
def _depth_range(plane: Any, left: Any, bottom: Any) -> tuple[int, int]:
    """Least and greatest depth of a plane over a tile, in 24 bits."""
    side = np.float32(TILE)
    x0, x1 = plane[0] * left, plane[0] * (left + side)
    y0, y1 = plane[1] * bottom, plane[1] * (bottom + side)
    return depth_24_bit(min(x0, x1) + min(y0, y1) + plane[2]), depth_24_bit(max(x0, x1) + max(y0, y1) + plane[2])


@kernel(error_model="numpy", lent=True)
def _tile_of_warp(
    edges: Any, planes: Any, boxes: Any, listed: Any, left: Any, bottom: Any, cached: int, tile: int, margin: int,
    warp: int, masks: Any, row: Any,
) -> tuple[int, int]:  # fmt: skip
    """All lanes of a warp at one tile; sets its bit in ``masks``; returns how long they take and the new depth.

    ``boxes`` (4, lanes) are of the warp's primitives, ``listed``.
    """
    side = np.float32(TILE)
    meets = 0  # bit i: the box of lane i meets the tile
    for lane in range(len(listed)):
        beside = (boxes[0, lane] >= left + side) | (boxes[2, lane] <= left) | (boxes[0, lane] >= boxes[2, lane])
        beside |= (boxes[1, lane] >= bottom + side) | (boxes[3, lane] <= bottom) | (boxes[1, lane] >= boxes[3, lane])
        meets |= (0 if beside else 1) << lane
    untested = np.uint64(meets)
    tested = popcount(untested)
    passed = kept = updates = 0
    lowered = NO_DEPTH
    while untested:
        lane = lowest_bit(untested)
        untested &= untested - np.uint64(1)
        p = listed[lane]
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
        masks[lane, tile // warp] |= np.uint64(1) << np.uint64(tile % warp)
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


@kernel(error_model="numpy", lent=True)
def _next_tile(span: Any, tile: int) -> int:
    """Find the first tile from ``tile`` on that a warp's boxes span; ``TILES`` where there is none."""
    x, y = tile % TILES_A_ROW, tile // TILES_A_ROW
    if x > span[2]:
        x, y = 0, y + 1
    if y < span[1]:
        x, y = 0, span[1]
    return max(x, span[0]) + y * TILES_A_ROW if y <= span[3] and span[0] <= span[2] else TILES


@kernel(error_model="numpy", lent=True)
def _test_round(
    edges: Any, planes: Any, boxes: Any, listed: Any, origin_x: int, origin_y: int, warp: int, margin: int, hi_z: Any,
    masks: Any, walk: Any, row: Any,
) -> None:  # fmt: skip
    """Walk the tiles with all warps of a round, always the one that is behind; sets ``masks``.

    Tiles at which a warp neither tests a box nor lowers the depth of the one before take it ``_TILE`` cycles each and
    do nothing else: they are passed over.
    """
    clock, following, taken, lowered, arrival, spans, steps = walk
    warps = (len(listed) + warp - 1) // warp
    for w in range(warps):
        _tiles_of(boxes[:, w * warp : min((w + 1) * warp, len(listed))], origin_x, origin_y, spans[w])
        following[w] = _next_tile(spans[w], 0)
        clock[w] = following[w] * _TILE if following[w] < TILES else _ARRIVED
        taken[w] = steps[w, 0] = steps[w, 1] = 0
        lowered[w] = NO_DEPTH  # by a warp that still is at its last tile
        arrival[w] = (TILES - 1) * _TILE  # at the last tile
    while True:
        w = 0
        for other in range(1, warps):
            w = other if clock[other] < clock[w] else w
        if clock[w] == _ARRIVED:
            break
        tile = following[w]
        hi_z[tile - 1] = min(hi_z[tile - 1], lowered[w])
        lowered[w] = NO_DEPTH
        if _next_tile(spans[w], tile) == tile:
            before = row[CoarseRasterizerEvent.HI_Z_STEPS]
            left = np.float32(origin_x + tile % TILES_A_ROW * TILE)
            bottom = np.float32(origin_y + tile // TILES_A_ROW * TILE)
            lanes = slice(w * warp, min((w + 1) * warp, len(listed)))
            cycles, lowered[w] = _tile_of_warp(
                edges, planes, boxes[:, lanes], listed[lanes], left, bottom, hi_z[tile], tile, margin, warp,
                masks[lanes], row,
            )  # fmt: skip
            taken[w] += cycles
            steps[w, 0] += row[CoarseRasterizerEvent.HI_Z_STEPS] - before
            steps[w, 1] += lowered[w] != NO_DEPTH
        if tile < TILES - 1:
            arrival[w] = (TILES - 1) * _TILE + taken[w]
        following[w] = tile + 1 if lowered[w] != NO_DEPTH else _next_tile(spans[w], tile + 1)
        clock[w] = following[w] * _TILE + taken[w] if following[w] < TILES else _ARRIVED
    longest = 0  # the last one to arrive
    for w in range(warps):
        hi_z[TILES - 1] = min(hi_z[TILES - 1], lowered[w])
        longest = w if arrival[w] >= arrival[longest] else longest
    row[CoarseRasterizerEvent.WARPS] += warps
    row[CoarseRasterizerEvent.WARP_LANES] += len(listed)
    row[CoarseRasterizerEvent.CRITICAL_HI_Z_STEPS] += steps[longest, 0]
    row[CoarseRasterizerEvent.CRITICAL_UPDATE_STEPS] += steps[longest, 1]


@kernel(error_model="numpy", lent=True)
def _append(masks: Any, listed: Any, warp: int, counts: Any, appended: Any, used: int, row: Any) -> int:
    """Append a round's primitives to the tiles' queues, as a warp's lanes do for theirs; returns ``appended`` in use.

    ``appended`` (n, 2) takes tile and primitive of each entry.
    """
    most = 0
    for group in range(TILES // warp):
        steps = 0
        for i in range(len(listed)):
            left = masks[i, group]
            if left == np.uint64(0):
                continue
            masks[i, group] = 0
            steps += 1
            row[CoarseRasterizerEvent.ENTRIES] += popcount(left)
            pair, new = -1, 0
            while left:
                tile = group * warp + lowest_bit(left)
                left &= left - np.uint64(1)
                if counts[tile] % CHUNK == 0:
                    new += pair != tile // 2
                    pair = tile // 2
                counts[tile] += 1
                appended[used, 0], appended[used, 1] = tile, listed[i]
                used += 1
            row[CoarseRasterizerEvent.CHUNK_STEPS] += new > 0
            row[CoarseRasterizerEvent.CHUNK_SECTORS] += new
        row[CoarseRasterizerEvent.APPEND_STEPS] += steps
        most = max(most, steps)
    row[CoarseRasterizerEvent.CRITICAL_APPEND_STEPS] += most
    return used


@kernel(error_model="numpy")
def rasterize_bin(
    edges: Any, planes: Any, boxes: Any, queue: Any, origin_x: int, origin_y: int, warp: int, margin: int,
    counts: Any, appended: Any, row: Any,
) -> None:  # fmt: skip
    """One bin: fill ``counts`` (256,), and ``appended`` with tile and primitive of each entry in order."""
    hi_z = np.full(TILES, NO_DEPTH, np.int64)
    masks = np.zeros((BLOCK, TILES // warp), np.uint64)  # of each primitive, a word for the tiles of each warp
    near = np.empty((4, BLOCK), np.float32)
    warps = BLOCK // warp
    clock, following, taken = np.empty(warps, np.int64), np.empty(warps, np.int64), np.empty(warps, np.int64)
    lowered, arrival = np.empty(warps, np.int64), np.empty(warps, np.int64)
    walk = clock, following, taken, lowered, arrival, np.empty((warps, 4), np.int64), np.empty((warps, 2), np.int64)
    used = 0
    for first in range(0, len(queue), BLOCK):
        listed = queue[first : first + BLOCK]
        for i in range(len(listed)):
            for k in range(4):
                near[k, i] = boxes[listed[i], k]
        row[CoarseRasterizerEvent.ROUNDS] += 1
        _test_round(edges, planes, near, listed, origin_x, origin_y, warp, margin, hi_z, masks, walk, row)
        used = _append(masks, listed, warp, counts, appended, used, row)


@kernel(error_model="numpy", lent=True)
def _tiles_of(boxes: Any, origin_x: int, origin_y: int, span: Any) -> None:
    """Tiles of the bin that some boxes, (4, n), span: the others fail every box test."""
    span[0] = span[1] = TILES_A_ROW - 1
    span[2] = span[3] = 0
    for i in range(boxes.shape[1]):
        span[0] = min(span[0], (int(boxes[0, i]) - origin_x) // TILE)
        span[1] = min(span[1], (int(boxes[1, i]) - origin_y) // TILE)
        span[2] = max(span[2], (int(boxes[2, i]) - origin_x) // TILE)
        span[3] = max(span[3], (int(boxes[3, i]) - origin_y) // TILE)
    span[0], span[1] = max(span[0], 0), max(span[1], 0)
    span[2], span[3] = min(span[2], TILES_A_ROW - 1), min(span[3], TILES_A_ROW - 1)


@kernel(error_model="numpy")
def most_entries(boxes: Any, queue: Any, origin_x: int, origin_y: int) -> int:
    """Count the tiles of a bin that the boxes of its primitives meet: as many entries it makes at most."""
    span = np.empty(4, np.int64)
    near = np.empty((4, 1), np.float32)
    count = 0
    for p in queue:
        near[:, 0] = boxes[p]
        _tiles_of(near, origin_x, origin_y, span)
        count += max(0, span[2] - span[0] + 1) * max(0, span[3] - span[1] + 1)
    return count
