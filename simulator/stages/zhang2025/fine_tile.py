"""One tile of the FineRasterizer (Zhang 2025, stage 7): coverage, early z, quads (device functions)."""

from enum import IntEnum
from typing import Any

import numpy as np

from tilestamp.models.counters import shown
from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.sample_tests import SAMPLE_COUNTERS
from tilestamp.simulator.stages.zhang2025.coarse_bin import TILE
from tilestamp.simulator.stages.zhang2025.depth import depth_24_bit
from tilestamp.simulator.stages.zhang2025.triangle_setup import DEPTH, evaluate

QUADS = 16  # of a tile
GROUP = 8  # primitives whose quads four lanes each write side by side
_HALF = np.float32(0.5)
_ZERO = np.float32(0.0)


@shown(*SAMPLE_COUNTERS)
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
    CRITICAL_ROUNDS = 18  # of the block's tile with the most early z steps: the block ends with it
    CRITICAL_Z_STEPS = 19
    CRITICAL_QUAD_STEPS = 20
    QUAD_LANES = 21  # four of each quad
    GROUP_STEPS = 22  # groups of eight primitives of a round, with one at least
    GROUP_LANES = 23  # four of each primitive


@kernel(error_model="numpy")
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


@kernel(error_model="numpy")
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


@kernel(error_model="numpy")
def quad_mask(mask: Any) -> int:
    """Which of the 16 quads of a tile have a live pixel."""
    quads = 0
    for q in range(QUADS):
        corner = np.uint64(0x303) << np.uint64((q // 4) * 16 + (q % 4) * 2)
        if mask & corner != np.uint64(0):
            quads |= 1 << q
    return quads


@kernel(error_model="numpy")
def rasterize_tile(
    edges: Any, planes: Any, queue: Any, left: int, bottom: int, warp: int, early_z: bool, optimized: bool,
    masks: Any, depth: Any, row: Any,
) -> None:  # fmt: skip
    """One tile: its primitives in rounds of a warp."""
    hits = np.zeros(TILE * TILE, np.int64)
    columns, rows = min(TILE, depth.shape[1] - left), min(TILE, depth.shape[0] - bottom)
    row[FineRasterizerEvent.WARPS] += 1
    for first in range(0, len(queue), warp):
        end = min(len(queue), first + warp)
        hits[:] = 0
        written = np.zeros(warp, np.int64)  # quads of each lane
        for i in range(first, end):
            p = queue[i]
            mask = coverage(edges[p], left, bottom, columns, rows)
            masks[i] = _early_z(planes[p, DEPTH], mask, left, bottom, depth, hits, early_z)
            written[i - first] = quad_mask(masks[i])
        row[FineRasterizerEvent.ROUNDS] += 1
        row[FineRasterizerEvent.ROUND_LANES] += end - first
        row[FineRasterizerEvent.GROUP_STEPS] += -(-(end - first) // GROUP)
        row[FineRasterizerEvent.GROUP_LANES] += 4 * (end - first)
        row[FineRasterizerEvent.SAMPLE_TESTS] += TILE * TILE * (end - first)
        for i in range(TILE * TILE):
            row[FineRasterizerEvent.SAMPLE_HITS] += hits[i]
            row[FineRasterizerEvent.EARLY_Z_STEPS] += hits[i] > 0
            row[FineRasterizerEvent.SHARED_ATOMIC] += hits[i] > 0
            row[FineRasterizerEvent.BANK_REPLAYS] += max(0, hits[i] - 1)
        row[FineRasterizerEvent.QUAD_STEPS] += _quad_steps(written, optimized)
        for lane in range(warp):
            quads = _bits(written[lane])
            row[FineRasterizerEvent.QUADS] += quads
            row[FineRasterizerEvent.QUAD_LANES] += 4 * quads if optimized else quads


@kernel(error_model="numpy")
def _bits(quads: int) -> int:
    count = 0
    while quads:
        quads &= quads - 1
        count += 1
    return count


@kernel(error_model="numpy")
def _quad_steps(written: Any, optimized: bool) -> int:
    """Warp steps that write: over 16 quads for each group of 8 lanes' primitives, or for all lanes at once."""
    group = GROUP if optimized else len(written)
    steps = 0
    for first in range(0, len(written), group):
        some = 0
        for lane in range(first, first + group):
            some |= written[lane]
        steps += _bits(some)
    return steps
