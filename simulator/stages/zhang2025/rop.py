"""ROP: order, depth test and blend the fragments of each pixel (Zhang 2025, stage 9).

One thread a pixel, 16x16 a block. Each walks its pixel's list (the newest fragment first) and keeps the covered
fragments, sorts them by primitive identifier (API order) or by depth (order-independent transparency), and tests and
blends them. The original keeps four in shared memory and does not check for more: it writes past the end, and an H200
stops it ("illegal memory access"). Here the first four found are kept and the rest is reported, and 0 asks for no
limit. Before optimization the four lay in local memory. A list ends with number -1 here; in the original with 0, which
is also the number of the frame's first fragment: it is never drawn (``zero_ends``).
"""

from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.zhang2025.coarse_rasterizer import TileQueues
from tilestamp.simulator.stages.zhang2025.depth import FRAGMENT_DEPTHS
from tilestamp.simulator.stages.zhang2025.fine_rasterizer import TileFragments
from tilestamp.simulator.stages.zhang2025.pixel_shader import FRAGMENT_OUT_BYTES, FragmentStream
from tilestamp.simulator.stages.zhang2025.rop_block import BLOCK_SIDE, RopEvent, resolve_block
from tilestamp.simulator.stages.zhang2025.triangle_setup import TriangleSetupData
from tilestamp.simulator.work import Work

KEPT = 4  # fragments a pixel
Order = Literal["api", "oit"]
FragmentDepth = Literal["direct", "stepped", "biased"]


@kernel(error_model="numpy", lent=True)
def _link(shaded: Any, places: Any, heads: Any, links: Any) -> None:
    """Link the lists as PixelShader's atomicExch leaves them, in stream order."""
    height, width = heads.shape
    for q in range(len(shaded)):
        for k in range(4):
            x, y = places[q, 0] + k % 2, places[q, 1] + k // 2
            if x < width and y < height and (shaded[q] >> k) & 1:
                links[4 * q + k] = heads[y, x]
                heads[y, x] = 4 * q + k


@kernel(error_model="numpy")
def _rop(
    part: int, parts: int, heads: Any, links: Any, fragments: Any, primitives: Any, columns: int, warp: int,
    order: int, way: int, limit: int, depth: Any, resolved: Any, events: Any,
) -> None:  # fmt: skip
    keys = np.empty((limit, 4), np.int64)
    for block in range(part * len(events) // parts, (part + 1) * len(events) // parts):
        left, bottom = block % columns * BLOCK_SIDE, block // columns * BLOCK_SIDE
        resolve_block(
            heads, links, fragments, primitives, left, bottom, warp, order, way, keys, depth, resolved, events[block]
        )


class Resolved(NamedTuple):
    """Pixels, rows from the bottom."""

    target: NDArray[np.float32]  # (H, W, 4)
    depth: NDArray[np.float32]  # (H, W)
    winners: NDArray[np.int32]  # (H, W) triangle drawn last, -1 for none


def rop(
    data: TriangleSetupData,
    tiles: TileQueues,
    fragments: TileFragments,
    stream: FragmentStream,
    simt: Simt,
    *,
    order: Order,
    fragment_depth: FragmentDepth = "direct",
    limit: int,
    optimized: bool,
    zero_ends: bool = False,
) -> StageResult[Resolved]:
    """Resolve all pixels.

    Parameters
    ----------
    data : TriangleSetupData
    tiles : TileQueues
    fragments : TileFragments
    stream : FragmentStream
    simt : Simt
    order : {"api", "oit"}
    fragment_depth : {"direct", "stepped", "biased"}
        How the depth of a fragment is evaluated; early z is direct.
    limit : int
        Fragments a pixel can keep; 0 for all.
    optimized : bool
        Shared memory; or the local memory of before.
    zero_ends : bool
        Number 0 ends a list, as in the original, which so loses fragment 0.

    Returns
    -------
    outputs : Resolved
    works : one, a row a block
    """
    height, width = fragments.depth.shape
    heads, links = np.full((height, width), -1, np.int32), np.full(4 * len(stream.entries), -1, np.int32)
    _link(stream.shaded, stream.places, heads, links)
    if zero_ends:
        heads[heads == 0] = links[links == 0] = -1
    out = Resolved(
        np.zeros((height, width, 4), np.float32),
        np.empty((height, width), np.float32),
        np.full((height, width), -1, np.int32),
    )
    columns, rows = -(-width // BLOCK_SIDE), -(-height // BLOCK_SIDE)
    events = np.zeros((columns * rows, len(RopEvent)), np.int64)
    room = limit or max(1, int(np.diff(tiles.starts).max(initial=1)))
    for_parts(
        _rop, parts_of(len(events)), heads, links,
        (stream.entries, stream.colors, fragments.masks, tiles.entries), (data.planes, data.ids), columns, simt.warp,
        0 if order == "api" else 1, FRAGMENT_DEPTHS[fragment_depth], room, fragments.depth, tuple(out), events,
    )  # fmt: skip
    _add_costs(events)
    total = events.sum(axis=0)
    pixels = width * height
    lists, halves = int(total[RopEvent.LIST_LANES]), 2 * int(total[RopEvent.WARPS])  # of lines: 16 pixels of 4 bytes
    streams = (
        Stream("pixel_base", "load", 4 * pixels, 4 * pixels, partial_lines=halves),
        Stream("fragments_out", "load", 32 * lists, 4 * len(stream.entries) * FRAGMENT_OUT_BYTES, partial_lines=lists),
        Stream("depth", "load", 4 * pixels, 4 * pixels, partial_lines=halves),
        Stream("target", "load", 16 * pixels, 16 * pixels),
        Stream("target", "store", 16 * pixels, 16 * pixels, partial_lines=0),
        Stream("depth", "store", 4 * pixels, 4 * pixels, partial_lines=halves),
    )
    kernel, shared = ("ROP", 2 * 4 * KEPT * 256) if optimized else ("ROP_before", 0)
    work = Work("ROP", RopEvent, events, BLOCK_SIDE**2, kernel=kernel, shared_bytes=shared, streams=streams)
    return StageResult(out, (work,))


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
