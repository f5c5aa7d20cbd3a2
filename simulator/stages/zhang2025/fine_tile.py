"""One tile of the FineRasterizer (Zhang 2025, stage 7): coverage, early z, quads (device functions)."""

from enum import IntEnum
from typing import Any

import numpy as np

from tilestamp.models.bits import lowest_bit, popcount
from tilestamp.models.counters import shown
from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.sample_tests import SAMPLE_COUNTERS
from tilestamp.simulator.stages.zhang2025.coarse_bin import TILE
from tilestamp.simulator.stages.zhang2025.depth import depth_24_bit
from tilestamp.simulator.stages.zhang2025.stepped_tile import stepped_tile
from tilestamp.simulator.stages.zhang2025.triangle_setup import DEPTH, evaluate

_QUADS = np.uint64(0x0055005500550055)  # left lower pixels of the 16 quads of a tile
GROUP = 8  # primitives whose quads four lanes each write side by side
_HALF = np.float32(0.5)


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


@kernel(error_model="numpy", lent=True)
def coverage(edges: Any, left: int, bottom: int, columns: int, rows: int) -> Any:
    """64-bit coverage of a tile by one primitive, limited to ``columns`` x ``rows`` pixels on the screen."""
    x, y = np.float32(left) + _HALF, np.float32(bottom) + _HALF
    mask = stepped_tile(
        (edges[0, 0] * x + edges[0, 1] * y + edges[0, 2], edges[0, 0], edges[0, 1]),
        (edges[1, 0] * x + edges[1, 1] * y + edges[1, 2], edges[1, 0], edges[1, 1]),
        (edges[2, 0] * x + edges[2, 1] * y + edges[2, 2], edges[2, 0], edges[2, 1]),
    )
    right = np.uint64(0x0101010101010101) * np.uint64((1 << columns) - 1)
    return mask & right & (~np.uint64(0) >> np.uint64(TILE * (TILE - rows)))


@kernel(error_model="numpy", lent=True)
def _early_z(plane: Any, mask: Any, left: int, bottom: int, depth: Any, early_z: bool) -> Any:
    """Depth-test the covered pixels of one primitive; returns those that pass."""
    passed = untested = mask
    while untested != np.uint64(0):
        i = lowest_bit(untested)
        bit = np.uint64(1) << np.uint64(i)
        untested ^= bit
        x, y = left + i % TILE, bottom + i // TILE
        z = depth_24_bit(evaluate(plane, np.float32(x) + _HALF, np.float32(y) + _HALF))
        if early_z and z > depth[y, x]:
            passed ^= bit
        depth[y, x] = min(depth[y, x], z)
    return passed


@kernel(error_model="numpy", lent=True)
def live_quads(mask: Any) -> Any:
    """Bits of the left lower pixels of those of the 16 quads of a tile that have a live pixel."""
    pairs = mask | mask >> np.uint64(1)
    return (pairs | pairs >> np.uint64(TILE)) & _QUADS


@kernel(error_model="numpy", lent=True)
def rasterize_tile(
    edges: Any, planes: Any, queue: Any, left: int, bottom: int, warp: int, early_z: bool, optimized: bool,
    masks: Any, depth: Any, row: Any,
) -> None:  # fmt: skip
    """One tile: its primitives in rounds of a warp."""
    columns, rows = min(TILE, depth.shape[1] - left), min(TILE, depth.shape[0] - bottom)
    together = GROUP if optimized else warp  # primitives whose quads are written in the same steps
    row[FineRasterizerEvent.WARPS] += 1
    for first in range(0, len(queue), warp):
        end = min(len(queue), first + warp)
        hits = quads = quad_steps = 0
        covered = written = np.uint64(0)  # by a lane of the round, of the group
        for i in range(first, end):
            p = queue[i]
            mask = coverage(edges[p], left, bottom, columns, rows)
            masks[i] = _early_z(planes[p, DEPTH], mask, left, bottom, depth, early_z)
            hits += popcount(mask)
            covered |= mask
            quads += popcount(live_quads(masks[i]))
            written |= live_quads(masks[i])
            if (i - first) % together == together - 1 or i == end - 1:
                quad_steps += popcount(written)
                written = np.uint64(0)
        row[FineRasterizerEvent.ROUNDS] += 1
        row[FineRasterizerEvent.ROUND_LANES] += end - first
        row[FineRasterizerEvent.GROUP_STEPS] += -(-(end - first) // GROUP)
        row[FineRasterizerEvent.GROUP_LANES] += 4 * (end - first)
        row[FineRasterizerEvent.SAMPLE_TESTS] += TILE * TILE * (end - first)
        row[FineRasterizerEvent.SAMPLE_HITS] += hits
        row[FineRasterizerEvent.EARLY_Z_STEPS] += popcount(covered)
        row[FineRasterizerEvent.SHARED_ATOMIC] += popcount(covered)
        row[FineRasterizerEvent.BANK_REPLAYS] += hits - popcount(covered)
        row[FineRasterizerEvent.QUAD_STEPS] += quad_steps
        row[FineRasterizerEvent.QUADS] += quads
        row[FineRasterizerEvent.QUAD_LANES] += 4 * quads if optimized else quads
