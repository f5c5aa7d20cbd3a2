"""One block of the ROP (Zhang 2025, stage 9): walk the lists, sort, test and blend (device functions)."""

from enum import IntEnum
from typing import Any

import numpy as np

from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.zhang2025.coarse_bin import TILE
from tilestamp.simulator.stages.zhang2025.depth import fragment_depth

BLOCK_SIDE = 16  # threads
_ONE = np.float32(1.0)


class RopEvent(IntEnum):
    """Events of one block."""

    WARPS = 0
    WARP_LANES = 1
    LIST_STEPS = 2  # warp steps along the lists
    LIST_LANES = 3
    SORT_STEPS = 4  # warp steps of the insertion sort
    BLEND_STEPS = 5  # warp steps of test and blend
    BLEND_LANES = 6
    LOST = 7  # covered fragments beyond the limit
    LOAD_TRANSACTIONS = 8
    LOAD_BYTES = 9
    STORE_TRANSACTIONS = 10
    STORE_BYTES = 11
    HOLES = 12  # pixels whose fragments all fail the depth test
    LIST_WARPS = 13  # warps with a list
    LIST_WARP_LANES = 14
    SORT_LANES = 15


@kernel(error_model="numpy")
def _gather(
    head: int, links: Any, quads: Any, masks: Any, queue: Any, planes: Any, ids: Any, bit: Any, x: int, y: int,
    order: int, way: int, kept: Any, keys: Any, row: Any, lane: Any,
) -> int:  # fmt: skip
    """Walk one pixel's list; returns the fragments kept, sorted by key."""
    count = 0
    while head >= 0:
        lane[0] += 1
        entry = quads[head // 4]
        if masks[entry] & bit != np.uint64(0):
            if count < len(kept):
                p = queue[entry]
                z = fragment_depth(planes[p], x, y, way)
                key = np.int64(ids[p]) if order == 0 else -np.int64(z) * (1 << 32) + ids[p]
                at = count
                while at > 0 and (keys[at - 1, 0] > key or (keys[at - 1, 0] == key and keys[at - 1, 1] > p)):
                    keys[at] = keys[at - 1]
                    kept[at] = kept[at - 1]
                    at -= 1
                keys[at, 0], keys[at, 1], keys[at, 2] = key, p, z
                kept[at] = head
                count += 1
            elif row is not None:
                row[RopEvent.LOST] += 1
        head = links[head]
    return count


@kernel(error_model="numpy")
def _resolve(kept: Any, keys: Any, count: int, colors: Any, ids: Any, order: int, target: Any, pixel_depth: Any) -> int:
    """Test and blend the kept fragments; returns the triangle last written, -1 for none."""
    nearest = pixel_depth[0]
    written = -1
    for i in range(count):
        if order == 0 and keys[i, 2] > nearest:
            continue
        color = colors[kept[i] // 4, kept[i] % 4]
        alpha = _ONE if order == 0 else color[3]
        for c in range(3):
            target[c] = alpha * color[c] + (_ONE - alpha) * target[c]
        target[3] = _ONE
        nearest = min(nearest, keys[i, 2])
        written = ids[keys[i, 1]]
    pixel_depth[0] = nearest
    return written


@kernel(error_model="numpy")
def resolve_block(
    heads: Any, links: Any, quads: Any, colors: Any, masks: Any, queue: Any, planes: Any, ids: Any, left: int,
    bottom: int, warp: int, order: int, way: int, limit: int, target: Any, depth: Any, winners: Any, row: Any,
) -> None:  # fmt: skip
    """One block of 16x16 pixels, warp by warp."""
    height, width = heads.shape
    kept = np.empty(limit, np.int64)
    keys = np.empty((limit, 3), np.int64)
    lane = np.zeros(1, np.int64)
    for first in range(0, BLOCK_SIDE * BLOCK_SIDE, warp):
        walked = sorted_steps = blended = live = lists = 0
        for thread in range(first, first + warp):
            x, y = left + thread % BLOCK_SIDE, bottom + thread // BLOCK_SIDE
            if x >= width or y >= height:
                continue
            live += 1
            if heads[y, x] < 0:
                continue
            lane[0] = 0
            bit = np.uint64(1) << np.uint64(y % TILE * TILE + x % TILE)
            count = _gather(
                heads[y, x], links, quads, masks, queue, planes, ids, bit, x, y, order, way, kept, keys, row, lane
            )
            winners[y, x] = _resolve(kept, keys, count, colors, ids, order, target[y, x], depth[y, x : x + 1])
            walked = max(walked, lane[0])
            blended = max(blended, count)
            lists += 1
            sorted_steps = max(sorted_steps, count * (count - 1) // 2)
            if row is not None:
                row[RopEvent.LIST_LANES] += lane[0]
                row[RopEvent.BLEND_LANES] += count
                row[RopEvent.SORT_LANES] += count * (count - 1) // 2
                row[RopEvent.HOLES] += count > 0 and winners[y, x] < 0
        if row is not None and live:
            row[RopEvent.WARPS] += 1
            row[RopEvent.WARP_LANES] += live
            row[RopEvent.LIST_WARPS] += lists > 0
            row[RopEvent.LIST_WARP_LANES] += lists
            row[RopEvent.LIST_STEPS] += walked
            row[RopEvent.SORT_STEPS] += sorted_steps
            row[RopEvent.BLEND_STEPS] += blended
