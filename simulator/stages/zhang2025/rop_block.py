"""One block of the ROP (Zhang 2025, stage 9): walk the lists, sort, test and blend (device functions)."""

from enum import IntEnum
from typing import Any

import numpy as np

from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.zhang2025.coarse_bin import TILE
from tilestamp.simulator.stages.zhang2025.depth import DEPTH_STEPS, fragment_depth

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


@kernel(error_model="numpy", lent=True)
def _gather(head: int, links: Any, fragments: Any, primitives: Any, bit: Any, pixel: Any, keys: Any) -> Any:
    """Walk one pixel's list; returns its length, the fragments kept, and those lost. ``keys`` are sorted by the first.

    ``pixel`` is where it lies, whether the key is depth, and how depth is evaluated; ``keys`` (limit, 4) takes key,
    primitive, depth and place in the stream.
    """
    quads, _, masks, queue = fragments
    planes, ids = primitives
    x, y, order, way = pixel
    count = walked = lost = 0
    while head >= 0:
        walked += 1
        entry = quads[head // 4]
        if masks[entry] & bit != np.uint64(0):
            if count < len(keys):
                p = queue[entry]
                z = fragment_depth(planes[p], x, y, way)
                key = np.int64(ids[p]) if order == 0 else -np.int64(z) * (1 << 32) + ids[p]
                at = count
                while at > 0 and (keys[at - 1, 0] > key or (keys[at - 1, 0] == key and keys[at - 1, 1] > p)):
                    for k in range(4):
                        keys[at, k] = keys[at - 1, k]
                    at -= 1
                keys[at, 0], keys[at, 1], keys[at, 2], keys[at, 3] = key, p, z, head
                count += 1
            else:
                lost += 1
        head = links[head]
    return walked, count, lost


@kernel(error_model="numpy", lent=True)
def _resolve(keys: Any, count: int, colors: Any, ids: Any, order: int, nearest: int, target: Any) -> Any:
    """Test and blend the kept fragments; returns the triangle last written, -1 for none, and the nearest depth."""
    written = -1
    for i in range(count):
        if order == 0 and keys[i, 2] > nearest:
            continue
        color = colors[keys[i, 3] // 4, keys[i, 3] % 4]
        alpha = _ONE if order == 0 else color[3]
        for c in range(3):
            target[c] = alpha * color[c] + (_ONE - alpha) * target[c]
        target[3] = _ONE
        nearest = min(nearest, keys[i, 2])
        written = ids[keys[i, 1]]
    return written, nearest


@kernel(error_model="numpy", lent=True)
def _shown_depth(nearest: Any) -> Any:
    """A depth in [0, 1] of one of 24 bits, 1 where nothing was drawn."""
    return np.float32(nearest / np.float64(DEPTH_STEPS)) if nearest <= int(DEPTH_STEPS) else _ONE


@kernel(error_model="numpy", lent=True)
def _resolve_bare_block(heads: Any, left: int, bottom: int, warp: int, depth: Any, shown: Any, row: Any) -> bool:
    """One whole block without a list, where it is one: a row of pixels at once."""
    height, width = heads.shape
    if left + BLOCK_SIDE > width or bottom + BLOCK_SIDE > height or BLOCK_SIDE * BLOCK_SIDE % warp:
        return False
    highest = np.int32(-1)
    for y in range(bottom, bottom + BLOCK_SIDE):
        pixels = heads[y, left : left + BLOCK_SIDE]
        for x in range(BLOCK_SIDE):
            highest = max(highest, pixels[x])
    if highest >= 0:
        return False
    for y in range(bottom, bottom + BLOCK_SIDE):
        pixels, nearest = shown[y, left : left + BLOCK_SIDE], depth[y, left : left + BLOCK_SIDE]
        for x in range(BLOCK_SIDE):
            pixels[x] = _shown_depth(nearest[x])
    row[RopEvent.WARPS] += BLOCK_SIDE * BLOCK_SIDE // warp
    row[RopEvent.WARP_LANES] += BLOCK_SIDE * BLOCK_SIDE
    return True


@kernel(error_model="numpy", lent=True)
def resolve_block(
    heads: Any, links: Any, fragments: Any, primitives: Any, left: int, bottom: int, warp: int, order: int, way: int,
    keys: Any, depth: Any, resolved: Any, row: Any,
) -> None:  # fmt: skip
    """One block of 16x16 pixels, warp by warp."""
    target, shown, winners = resolved
    height, width = heads.shape
    if _resolve_bare_block(heads, left, bottom, warp, depth, shown, row):
        return
    for first in range(0, BLOCK_SIDE * BLOCK_SIDE, warp):
        longest = sorted_steps = blended = live = lists = 0
        steps = kept = swaps = holes = left_out = 0
        for thread in range(first, first + warp):
            x, y = left + thread % BLOCK_SIDE, bottom + thread // BLOCK_SIDE
            if x >= width or y >= height:
                continue
            live += 1
            nearest = np.int64(depth[y, x])
            if heads[y, x] >= 0:
                bit = np.uint64(1) << np.uint64(y % TILE * TILE + x % TILE)
                walked, count, lost = _gather(
                    heads[y, x], links, fragments, primitives, bit, (x, y, order, way), keys
                )  # fmt: skip
                winner, nearest = _resolve(keys, count, fragments[1], primitives[1], order, nearest, target[y, x])
                winners[y, x] = winner
                longest = max(longest, walked)
                blended = max(blended, count)
                lists += 1
                sorted_steps = max(sorted_steps, count * (count - 1) // 2)
                steps += walked
                kept += count
                swaps += count * (count - 1) // 2
                holes += count > 0 and winner < 0
                left_out += lost
            shown[y, x] = _shown_depth(nearest)
        if live:
            row[RopEvent.WARPS] += 1
            row[RopEvent.WARP_LANES] += live
            row[RopEvent.LIST_WARPS] += lists > 0
            row[RopEvent.LIST_WARP_LANES] += lists
            row[RopEvent.LIST_STEPS] += longest
            row[RopEvent.SORT_STEPS] += sorted_steps
            row[RopEvent.BLEND_STEPS] += blended
            row[RopEvent.LIST_LANES] += steps
            row[RopEvent.BLEND_LANES] += kept
            row[RopEvent.SORT_LANES] += swaps
            row[RopEvent.HOLES] += holes
            row[RopEvent.LOST] += left_out
