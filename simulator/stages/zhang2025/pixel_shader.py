"""PixelShader: shade every fragment of the stream (Zhang 2025, stage 8).

One thread a fragment, 256 a block, launched for the whole stream of 4 fragments a pixel. Lanes 4i..4i+3 are a quad, so
differences between them give the derivatives of the texture coordinates, and those the level of detail of trilinear
filtering. Every fragment, helper pixels of a quad included, links itself to its pixel by an atomicExch. With
derivatives from planes (the "non-quad derivatives" of Laine & Karras 2011) the stream has covered fragments alone.
"""

from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.bits import lowest_bit, popcount
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.scenes.texture import TEXEL_BYTES, TextureChains
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.zhang2025.coarse_bin import TILE
from tilestamp.simulator.stages.zhang2025.coarse_rasterizer import TileQueues
from tilestamp.simulator.stages.zhang2025.fine_rasterizer import FRAGMENT_BYTES, TileFragments
from tilestamp.simulator.stages.zhang2025.fine_tile import live_quads
from tilestamp.simulator.stages.zhang2025.pixel_shader_block import (
    BILINEAR,
    BLOCK,
    NEAREST,
    TRILINEAR,
    PixelShaderEvent,
    shade_block,
)
from tilestamp.simulator.stages.zhang2025.pixel_shader_planes import shade_fragments
from tilestamp.simulator.stages.zhang2025.triangle_setup import TriangleSetupData
from tilestamp.simulator.work import Work

OVERDRAW = 4  # fragments a pixel that the stream has room for
FRAGMENT_OUT_BYTES = 32
LINES_IN, LINES_OUT = 12, 8  # of 128 bytes that a warp's records lie in
AT_ONCE = 1 << 16  # bytes: what a warp stores again, or another one of the tile, it does at once
FILTERS = {"nearest": NEAREST, "bilinear": BILINEAR, "trilinear": TRILINEAR}
Filter = Literal["nearest", "bilinear", "trilinear"]
Derivatives = Literal["quads", "planes"]


class FragmentStream(NamedTuple):
    """The stream after shading, four fragments a quad.

    Parameters
    ----------
    entries : ndarray, (Q,), int32
        Entry of the tile queues that each quad comes from.
    places : ndarray, (Q, 2), int32
        Left lower pixel of each quad.
    colors : ndarray, (Q, 4, 4), float32
        RGBA of its fragments.
    shaded : ndarray, (Q,), uint8
        Bit k: whether fragment k is in the stream; of quads all four are.
    """

    entries: NDArray[np.int32]
    places: NDArray[np.int32]
    colors: NDArray[np.float32]
    shaded: NDArray[np.uint8]


@kernel(error_model="numpy", lent=True)
def _quads(starts: Any, masks: Any, tile_columns: int, entries: Any, places: Any, covered: Any) -> int:
    """Lay the quads out in stream order: by tile, entry, place; with ``entries`` None only count."""
    count = 0
    for tile in range(len(starts) - 1):
        for i in range(starts[tile], starts[tile + 1]):
            quads = live_quads(masks[i])
            if entries is None:
                count += popcount(quads)
                continue
            while quads != np.uint64(0):
                corner = lowest_bit(quads)
                quads &= quads - np.uint64(1)
                entries[count] = i
                places[count, 0] = tile % tile_columns * TILE + corner % TILE
                places[count, 1] = tile // tile_columns * TILE + corner // TILE
                bits = masks[i] >> np.uint64(corner)
                covered[count] = bits & np.uint64(3) | bits >> np.uint64(6) & np.uint64(12)
                count += 1
    return count


@kernel(error_model="numpy", lent=True)
def _pixel_shader(
    part: int, parts: int, quads: Any, places: Any, queue: Any, planes: Any, ids: Any, texture_ids: Any, chains: Any,
    method: int, opacity: Any, rule: int, merge: int, width: int, colors: Any, events: Any,
) -> None:  # fmt: skip
    blocks = (len(quads) + BLOCK // 4 - 1) // (BLOCK // 4)
    for block in range(part * blocks // parts, (part + 1) * blocks // parts):
        shade_block(
            quads, places, queue, planes, ids, texture_ids, chains, method,
            opacity, rule, merge, width, block * (BLOCK // 4), colors, events[block],
        )  # fmt: skip


@kernel(error_model="numpy", lent=True)
def _pixel_shader_planes(
    part: int, parts: int, fragments: Any, quads: Any, places: Any, queue: Any, planes: Any, ids: Any, texture_ids: Any,
    chains: Any, method: int, opacity: Any, rule: int, merge: int, width: int, colors: Any, events: Any,
) -> None:  # fmt: skip
    blocks = (len(fragments) + BLOCK - 1) // BLOCK
    for block in range(part * blocks // parts, (part + 1) * blocks // parts):
        shade_fragments(
            fragments, quads, places, queue, planes, ids, texture_ids, chains, method,
            opacity, rule, merge, width, block * BLOCK, colors, events[block],
        )  # fmt: skip


def pixel_shader(
    data: TriangleSetupData,
    tiles: TileQueues,
    fragments: TileFragments,
    chains: TextureChains,
    texture_ids: NDArray[np.int32],
    simt: Simt,
    *,
    texture_filter: Filter,
    opacity: float,
    optimized: bool,
    derivatives: Derivatives = "quads",
) -> StageResult[FragmentStream]:
    """Shade the stream.

    Parameters
    ----------
    data : TriangleSetupData
    tiles : TileQueues
    fragments : TileFragments
    chains : TextureChains
    texture_ids : ndarray, (F,), int32
        By triangle.
    simt : Simt
    texture_filter : {"nearest", "bilinear", "trilinear"}
    opacity : float
        Multiplies every alpha.
    optimized : bool
        16-byte accesses to packed fragments; or words of a 48-byte structure and a texture that spills.
    derivatives : {"quads", "planes"}
        From differences in a quad, or from the planes of the triangle: then helper pixels are left out.

    Returns
    -------
    outputs : FragmentStream
    works : one
    """
    found = _quads(tiles.starts, fragments.masks, tiles.columns, None, None, None)
    stream = FragmentStream(
        np.empty(found, np.int32), np.empty((found, 2), np.int32), np.zeros((found, 4, 4), np.float32),
        np.empty(found, np.uint8),
    )  # fmt: skip
    _quads(tiles.starts, fragments.masks, tiles.columns, stream.entries, stream.places, stream.shaded)
    if derivatives == "quads":
        stream.shaded[:] = 15
    lanes = np.flatnonzero((stream.shaded[:, None] >> np.arange(4)) & 1) if derivatives == "planes" else None
    count, pixels = 4 * found if lanes is None else len(lanes), fragments.depth.size
    blocks = -(-max(count, OVERDRAW * pixels) // BLOCK)
    events = np.zeros((blocks, len(PixelShaderEvent)), np.int64)
    inputs = (
        stream.entries, stream.places, tiles.entries, data.planes, data.ids, texture_ids, chains,
        FILTERS[texture_filter], np.float32(opacity), int(simt.coalescing), int(simt.atomic_merge),
        fragments.depth.shape[1], stream.colors, events,
    )  # fmt: skip
    if lanes is None:
        for_parts(_pixel_shader, parts_of(count, BLOCK), *inputs)
    else:
        for_parts(_pixel_shader_planes, parts_of(count, BLOCK), lanes, *inputs)
    used = -(-count // BLOCK)
    _add_costs(events[: used + 1], optimized)
    events[used + 1 :] = events[used : used + 1]  # blocks without a fragment
    total = dict(zip(PixelShaderEvent, events.sum(axis=0).tolist(), strict=True))
    texels = min(total[PixelShaderEvent.TEXTURE_BYTES], len(chains.texels) * TEXEL_BYTES)  # neighbours reuse them
    read, stored = count * FRAGMENT_BYTES, total[PixelShaderEvent.STORE_BYTES]
    lines_in = LINES_IN * (3 * total[PixelShaderEvent.WARPS] - total[PixelShaderEvent.TEXTURED_WARPS])
    lines_out = 2 * LINES_OUT * total[PixelShaderEvent.WARPS]
    linked = 32 * total[PixelShaderEvent.ATOMIC_REQUESTS]
    streams = (
        Stream("fragments", "load", read, read, partial_lines=lines_in),
        Stream("texture", "load", texels, texels),
        Stream("fragments_out", "store", stored, count * FRAGMENT_OUT_BYTES, AT_ONCE, partial_lines=lines_out),
        Stream("pixel_base", "atomic", linked, min(4 * count, 4 * pixels), AT_ONCE),
    )
    kernel = "PixelShader" if optimized else "PixelShader_before"
    variant = "" if derivatives == "quads" else derivatives
    work = Work(
        "PixelShader", PixelShaderEvent, events, BLOCK, kernel=kernel, grid=blocks, streams=streams, variant=variant
    )
    return StageResult(stream, (work,))


def _add_costs(events: NDArray[np.int64], optimized: bool) -> None:
    """Add what follows from the counts: the stream's length, fragments in and out.

    Records lie 48 and 32 bytes apart, so that each load or store touches a sector a lane: after optimization two
    stores of 16 bytes and as many loads, or three where the normal is read and no texture; before it the seven words
    read of a fragment, and the eight written.
    """
    event = PixelShaderEvent
    warps = events[:, event.WARPS]
    events[:, event.WARPS_LAUNCHED] = BLOCK // 32
    events[:, event.EMPTY_WARPS] = BLOCK // 32 - warps
    words = 3 * warps - events[:, event.TEXTURED_WARPS] if optimized else 7 * warps
    reads = 32 * words + BLOCK // 32
    writes = warps * 32 * (2 if optimized else FRAGMENT_OUT_BYTES // 4)
    events[:, event.LOAD_TRANSACTIONS] = reads + events[:, event.TEXTURE_TRANSACTIONS]
    events[:, event.LOAD_BYTES] = 32 * reads + events[:, event.TEXTURE_BYTES]
    events[:, event.STORE_TRANSACTIONS] = writes
    events[:, event.STORE_BYTES] = 32 * writes
