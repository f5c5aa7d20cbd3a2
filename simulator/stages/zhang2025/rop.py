"""ROP: order, depth test and blend the fragments of each pixel (Zhang 2025, stage 9).

One thread a pixel, 16x16 a block. Each walks its pixel's list (the newest fragment first) and keeps the covered
fragments, sorts them by primitive identifier (API order) or by depth (order-independent transparency), and tests and
blends them. The original keeps four in shared memory and does not check for more; here the first four found are kept
and the rest is reported, and 0 asks for no limit. Before optimization the four lay in local memory.
"""

from enum import IntEnum
from typing import Any, Literal

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from models.launch import Stream
from models.simt import Simt
from simulator.stages.zhang2025.coarse_rasterizer import DEPTH_STEPS, TILE, TileQueues, depth_24_bit
from simulator.stages.zhang2025.fine_rasterizer import TileFragments
from simulator.stages.zhang2025.pixel_shader import FRAGMENT_OUT_BYTES, FragmentStream
from simulator.stages.zhang2025.triangle_setup import DEPTH, TriangleSetupData, evaluate
from simulator.work import Work

BLOCK_SIDE = 16  # threads
KEPT = 4  # fragments a pixel
Order = Literal["api", "oit"]
_HALF = np.float32(0.5)
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


@njit(cache=True, nogil=True, error_model="numpy")
def _link(quads: Any, places: Any, heads: Any, links: Any) -> None:
    """Link the lists as PixelShader's atomicExch leaves them, in stream order."""
    height, width = heads.shape
    for q in range(len(quads)):
        for k in range(4):
            x, y = places[q, 0] + k % 2, places[q, 1] + k // 2
            if x < width and y < height:
                links[4 * q + k] = heads[y, x]
                heads[y, x] = 4 * q + k


@njit(cache=True, nogil=True, error_model="numpy")
def _gather(
    head: int, links: Any, quads: Any, masks: Any, queue: Any, planes: Any, ids: Any, bit: Any, x: int, y: int,
    order: int, kept: Any, keys: Any, row: Any, lane: Any,
) -> int:  # fmt: skip
    """Walk one pixel's list; returns the fragments kept, sorted by key."""
    count = 0
    while head >= 0:
        lane[0] += 1
        entry = quads[head // 4]
        if masks[entry] & bit != np.uint64(0):
            if count < len(kept):
                p = queue[entry]
                z = depth_24_bit(evaluate(planes[p, DEPTH], np.float32(x) + _HALF, np.float32(y) + _HALF))
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
                row[7] += 1  # LOST
        head = links[head]
    return count


@njit(cache=True, nogil=True, error_model="numpy")
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


@njit(cache=True, nogil=True, error_model="numpy")
def _rop_block(
    heads: Any, links: Any, quads: Any, colors: Any, masks: Any, queue: Any, planes: Any, ids: Any, left: int,
    bottom: int, warp: int, order: int, limit: int, target: Any, depth: Any, winners: Any, row: Any,
) -> None:  # fmt: skip
    """One block of 16x16 pixels, warp by warp."""
    height, width = heads.shape
    kept = np.empty(limit, np.int64)
    keys = np.empty((limit, 3), np.int64)
    lane = np.zeros(1, np.int64)
    for first in range(0, BLOCK_SIDE * BLOCK_SIDE, warp):
        walked = sorted_steps = blended = live = 0
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
                heads[y, x], links, quads, masks, queue, planes, ids, bit, x, y, order, kept, keys, row, lane
            )
            winners[y, x] = _resolve(kept, keys, count, colors, ids, order, target[y, x], depth[y, x : x + 1])
            walked = max(walked, lane[0])
            blended = max(blended, count)
            sorted_steps = max(sorted_steps, count * (count - 1) // 2)
            if row is not None:
                row[3] += lane[0]
                row[6] += count
        if row is not None and live:
            row[0] += 1
            row[1] += live
            row[2] += walked
            row[4] += sorted_steps
            row[5] += blended


@njit(cache=True, nogil=True, error_model="numpy", parallel=True)
def _rop(
    heads: Any, links: Any, quads: Any, colors: Any, masks: Any, queue: Any, planes: Any, ids: Any, columns: int,
    warp: int, order: int, limit: int, target: Any, depth: Any, winners: Any, events: Any,
) -> None:  # fmt: skip
    for block in prange(len(events)):
        left, bottom = block % columns * BLOCK_SIDE, block // columns * BLOCK_SIDE
        _rop_block(
            heads, links, quads, colors, masks, queue, planes, ids, left, bottom,
            warp, order, limit, target, depth, winners, events[block],
        )  # fmt: skip


def rop(
    data: TriangleSetupData,
    tiles: TileQueues,
    fragments: TileFragments,
    stream: FragmentStream,
    simt: Simt,
    *,
    order: Order,
    limit: int,
    optimized: bool,
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.int32], Work]:
    """Resolve all pixels.

    Parameters
    ----------
    data : TriangleSetupData
    tiles : TileQueues
    fragments : TileFragments
    stream : FragmentStream
    simt : Simt
    order : {"api", "oit"}
    limit : int
        Fragments a pixel can keep; 0 for all.
    optimized : bool
        Shared memory; or the local memory of before.

    Returns
    -------
    target : ndarray, (H, W, 4), float32
        Rows from the bottom.
    depth : ndarray, (H, W), float32
    winners : ndarray, (H, W), int32
        Triangle drawn last, -1 for none.
    work : Work
        One row a block.
    """
    height, width = fragments.depth.shape
    heads, links = np.full((height, width), -1, np.int64), np.full(4 * len(stream.entries), -1, np.int64)
    _link(stream.entries, stream.places, heads, links)
    target, winners = np.zeros((height, width, 4), np.float32), np.full((height, width), -1, np.int32)
    depth = fragments.depth.astype(np.int64)
    columns, rows = -(-width // BLOCK_SIDE), -(-height // BLOCK_SIDE)
    events = np.zeros((columns * rows, len(RopEvent)), np.int64)
    room = limit or max(1, int(np.diff(tiles.starts).max(initial=1)))
    _rop(
        heads, links, stream.entries, stream.colors, fragments.masks, tiles.entries, data.planes, data.ids, columns,
        simt.warp, 0 if order == "api" else 1, room, target, depth, winners, events,
    )  # fmt: skip
    _add_costs(events)
    total = events.sum(axis=0)
    pixels = width * height
    streams = (
        Stream("pixel_base", "load", 4 * pixels, 4 * pixels),
        Stream(
            "fragments_out", "load", 32 * int(total[RopEvent.LIST_LANES]), 4 * len(stream.entries) * FRAGMENT_OUT_BYTES
        ),
        Stream("depth", "load", 4 * pixels, 4 * pixels),
        Stream("target", "load", 16 * pixels, 16 * pixels),
        Stream("target", "store", 16 * pixels, 16 * pixels),
        Stream("depth", "store", 4 * pixels, 4 * pixels),
    )
    kernel, shared = ("ROP", 2 * 4 * KEPT * 256) if optimized else ("ROP_before", 0)
    work = Work("ROP", kernel, RopEvent, events, len(events), BLOCK_SIDE**2, shared, streams=streams)
    far = depth > int(DEPTH_STEPS)
    return target, np.where(far, np.float32(1.0), depth / DEPTH_STEPS).astype(np.float32), winners, work


def _add_costs(events: NDArray[np.int64]) -> None:
    """Memory: a fragment's 32 bytes are a sector of their own; a pixel's own buffers are read and written in rows."""
    event = RopEvent
    lists, blends = events[:, event.LIST_LANES], events[:, event.BLEND_LANES]
    rows = events[:, event.WARPS]
    loads = lists + 2 * blends + rows * (4 + 4 + 16)
    stores = rows * (4 + 16)
    events[:, event.LOAD_TRANSACTIONS] = loads
    events[:, event.LOAD_BYTES] = 32 * loads
    events[:, event.STORE_TRANSACTIONS] = stores
    events[:, event.STORE_BYTES] = 32 * stores
