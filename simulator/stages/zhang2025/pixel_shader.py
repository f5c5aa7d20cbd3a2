"""PixelShader: shade every fragment of the stream (Zhang 2025, stage 8).

One thread a fragment, 256 a block, launched for the whole stream of 4 fragments a pixel. Lanes 4i..4i+3 are a quad, so
differences between them give the derivatives of the texture coordinates, and those the level of detail of trilinear
filtering. Every fragment, helper pixels of a quad included, links itself to its pixel by an atomicExch.
"""

from enum import IntEnum
from typing import Any, Literal, NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from models.coalescing import transactions
from models.launch import Stream
from models.simt import Simt
from simulator.scenes.texture import (
    TEXEL_BYTES,
    TextureChains,
    add_bilinear,
    add_trilinear,
    footprint,
    level_of_detail,
    nearest,
    texel_index,
)
from simulator.stages.zhang2025.coarse_rasterizer import TILE, TileQueues
from simulator.stages.zhang2025.fine_rasterizer import FRAGMENT_BYTES, TileFragments
from simulator.stages.zhang2025.triangle_setup import COLOR, NORMAL, ONE_OVER_W, UV, TriangleSetupData, evaluate
from simulator.work import Work

BLOCK = 256  # threads
OVERDRAW = 4  # fragments a pixel that the stream has room for
FRAGMENT_OUT_BYTES = 32
QUADS_A_WARP = 8
NEAREST, BILINEAR, TRILINEAR = 0, 1, 2
FILTERS = {"nearest": NEAREST, "bilinear": BILINEAR, "trilinear": TRILINEAR}
Filter = Literal["nearest", "bilinear", "trilinear"]
AMBIENT = np.float32(0.2)
DIFFUSE = np.float32(0.8)
_HALF = np.float32(0.5)
_ONE = np.float32(1.0)
_ZERO = np.float32(0.0)


class PixelShaderEvent(IntEnum):
    """Events of one block."""

    WARPS = 0  # warps with a fragment
    WARP_LANES = 1
    EMPTY_WARPS = 2  # warps beyond the stream's end, that return at once
    TEXEL_LOADS = 3  # warp loads of texels
    TEXEL_LANES = 4
    TEXTURE_TRANSACTIONS = 5
    TEXTURE_BYTES = 6
    ATOMIC = 7
    ATOMIC_LANES = 8
    ATOMIC_REQUESTS = 9
    ATOMIC_DEPTH = 10
    LOAD_TRANSACTIONS = 11
    LOAD_BYTES = 12
    STORE_TRANSACTIONS = 13
    STORE_BYTES = 14


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
    """

    entries: NDArray[np.int32]
    places: NDArray[np.int32]
    colors: NDArray[np.float32]


@njit(cache=True, nogil=True, error_model="numpy")
def _quads(starts: Any, masks: Any, tile_columns: int, entries: Any, places: Any) -> int:
    """Lay the quads out in stream order: by tile, entry, place; with ``entries`` None only count."""
    count = 0
    for tile in range(len(starts) - 1):
        for i in range(starts[tile], starts[tile + 1]):
            if masks[i] == np.uint64(0):
                continue
            for q in range(16):
                corner = np.uint64(0x303) << np.uint64((q // 4) * 16 + (q % 4) * 2)
                if masks[i] & corner == np.uint64(0):
                    continue
                if entries is not None:
                    entries[count] = i
                    places[count, 0] = tile % tile_columns * TILE + q % 4 * 2
                    places[count, 1] = tile // tile_columns * TILE + q // 4 * 2
                count += 1
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def _coordinates(planes: Any, place: Any, uv: Any) -> None:
    """Perspective-correct texture coordinates of a quad's four pixels, (4, 2)."""
    for k in range(4):
        x, y = np.float32(place[0] + k % 2) + _HALF, np.float32(place[1] + k // 2) + _HALF
        w = _ONE / evaluate(planes[ONE_OVER_W], x, y)
        uv[k, 0] = evaluate(planes[UV], x, y) * w
        uv[k, 1] = evaluate(planes[UV + 1], x, y) * w


@njit(cache=True, nogil=True, error_model="numpy")
def _light(planes: Any, x: Any, y: Any) -> Any:
    """Light from the eye; the factor w of the normal cancels in its direction."""
    nx, ny = evaluate(planes[NORMAL], x, y), evaluate(planes[NORMAL + 1], x, y)
    nz = evaluate(planes[NORMAL + 2], x, y)
    length = nx * nx + ny * ny + nz * nz
    return AMBIENT + DIFFUSE * abs(nz) / np.sqrt(length) if length > _ZERO else _ONE


@njit(cache=True, nogil=True, error_model="numpy")
def _shade_quad(
    planes: Any, chains: Any, texture: int, method: int, opacity: Any, place: Any, uv: Any, out: Any
) -> Any:
    """Colours of a quad; returns its level of detail."""
    lod = _ZERO
    if texture >= 0:
        _coordinates(planes, place, uv)
        if method == TRILINEAR:
            lod = level_of_detail(
                chains, texture, uv[1, 0] - uv[0, 0], uv[1, 1] - uv[0, 1], uv[2, 0] - uv[0, 0], uv[2, 1] - uv[0, 1]
            )
    for k in range(4):
        x, y = np.float32(place[0] + k % 2) + _HALF, np.float32(place[1] + k // 2) + _HALF
        out[k] = _ONE if texture < 0 else _ZERO
        if texture >= 0 and method == TRILINEAR:
            add_trilinear(chains, texture, lod, uv[k, 0], uv[k, 1], out[k])
        elif texture >= 0 and method == BILINEAR:
            add_bilinear(chains, texture, 0, uv[k, 0], uv[k, 1], _ONE, out[k])
        elif texture >= 0:
            nearest(chains, texture, uv[k, 0], uv[k, 1], out[k])
        w = _ONE / evaluate(planes[ONE_OVER_W], x, y)
        light = _light(planes, x, y)
        for c in range(3):
            out[k, c] *= evaluate(planes[COLOR + c], x, y) * w * light
        out[k, 3] *= evaluate(planes[COLOR + 3], x, y) * w * opacity
    return lod


@njit(cache=True, nogil=True, error_model="numpy")
def _addresses(chains: Any, texture: int, method: int, lod: Any, uv: Any, lane: int, addresses: Any) -> None:
    """Byte addresses of the texels that a quad's four lanes load, ``addresses`` (8, lanes)."""
    levels = 2 if method == TRILINEAR else 1
    for k in range(4):
        for n in range(levels):
            level = min(int(lod) + n, chains.counts[texture] - 1)
            x, y, _, _ = footprint(chains, texture, level, uv[k, 0], uv[k, 1])
            if method == NEAREST:
                x = int(np.floor(uv[k, 0] * np.float32(chains.levels[texture, 0, 1])))
                y = int(np.floor(uv[k, 1] * np.float32(chains.levels[texture, 0, 2])))
            for corner in range(1 if method == NEAREST else 4):
                i = texel_index(chains, texture, level, x + corner % 2, y + corner // 2)
                addresses[4 * n + corner, lane + k] = i * TEXEL_BYTES


@njit(cache=True, nogil=True, error_model="numpy")
def _block(
    quads: Any, places: Any, queue: Any, planes: Any, ids: Any, texture_ids: Any, chains: Any, method: int,
    opacity: Any, rule: int, first: int, colors: Any, row: Any,
) -> None:  # fmt: skip
    """One block: eight warps of eight quads."""
    uv = np.zeros((4, 2), np.float32)
    addresses = np.empty((8, 4 * QUADS_A_WARP), np.int64)
    for warp in range(first, min(first + BLOCK // 4, len(quads)), QUADS_A_WARP):
        addresses[:] = -1
        textured = 0
        end = min(warp + QUADS_A_WARP, len(quads))
        for q in range(warp, end):
            p = queue[quads[q]]
            texture = texture_ids[ids[p]]
            lod = _shade_quad(planes[p], chains, texture, method, opacity, places[q], uv, colors[q])
            if row is not None and texture >= 0:
                _addresses(chains, texture, method, lod, uv, 4 * (q - warp), addresses)
                textured += 4
        if row is not None:
            row[0] += 1
            row[1] += 4 * (end - warp)
            loads = (1 if method == NEAREST else 4 if method == BILINEAR else 8) if textured else 0
            row[3] += loads
            row[4] += loads * textured
            for n in range(loads):
                count, size = transactions(addresses[n], 4 * QUADS_A_WARP, TEXEL_BYTES, rule)
                row[5] += count
                row[6] += size


@njit(cache=True, nogil=True, error_model="numpy", parallel=True)
def _pixel_shader(
    quads: Any, places: Any, queue: Any, planes: Any, ids: Any, texture_ids: Any, chains: Any, method: int,
    opacity: Any, rule: int, colors: Any, events: Any,
) -> None:  # fmt: skip
    for block in prange((len(quads) + BLOCK // 4 - 1) // (BLOCK // 4)):
        _block(
            quads, places, queue, planes, ids, texture_ids, chains, method,
            opacity, rule, block * (BLOCK // 4), colors, events[block],
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
) -> tuple[FragmentStream, Work]:
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

    Returns
    -------
    FragmentStream, Work
    """
    count = _quads(tiles.starts, fragments.masks, tiles.columns, None, None)
    stream = FragmentStream(
        np.empty(count, np.int32), np.empty((count, 2), np.int32), np.empty((count, 4, 4), np.float32)
    )
    _quads(tiles.starts, fragments.masks, tiles.columns, stream.entries, stream.places)
    pixels = fragments.depth.size
    blocks = -(-max(4 * count, OVERDRAW * pixels) // BLOCK)
    events = np.zeros((blocks, len(PixelShaderEvent)), np.int64)
    _pixel_shader(
        stream.entries, stream.places, tiles.entries, data.planes, data.ids, texture_ids, chains,
        FILTERS[texture_filter], np.float32(opacity), int(simt.coalescing), stream.colors, events,
    )  # fmt: skip
    _add_costs(events, simt, optimized)
    total = events.sum(axis=0)
    texels = min(
        int(total[PixelShaderEvent.TEXTURE_BYTES]), len(chains.texels) * TEXEL_BYTES
    )  # neighbours reuse them at once
    streams = (
        Stream("fragments", "load", 4 * count * FRAGMENT_BYTES, 4 * count * FRAGMENT_BYTES),
        Stream("texture", "load", texels, texels),
        Stream("fragments_out", "store", 4 * count * FRAGMENT_OUT_BYTES, 4 * count * FRAGMENT_OUT_BYTES),
        Stream("pixel_base", "atomic", 16 * count, min(16 * count, 4 * pixels)),
    )
    kernel = "PixelShader" if optimized else "PixelShader_before"
    return stream, Work("PixelShader", kernel, PixelShaderEvent, events, blocks, BLOCK, streams=streams)


def _add_costs(events: NDArray[np.int64], simt: Simt, optimized: bool) -> None:
    """Add what follows from the counts: fragments in and out, the links."""
    event = PixelShaderEvent
    warps, lanes = events[:, event.WARPS], events[:, event.WARP_LANES]
    events[:, event.EMPTY_WARPS] = BLOCK // simt.warp - warps
    events[:, event.ATOMIC] = warps
    events[:, event.ATOMIC_LANES] = lanes
    events[:, event.ATOMIC_REQUESTS] = lanes // 2 if simt.atomic_merge else lanes  # the two pixels of a quad's row
    events[:, event.ATOMIC_DEPTH] = warps
    sectors = 32 * FRAGMENT_BYTES // 32
    # by words of a structure every word's load touches a sector a lane; by 16 bytes a warp reads its sectors twice
    reads = warps * (sectors * 2 if optimized else sectors * FRAGMENT_BYTES // 4 * 2 // 3)
    writes = warps * (32 if optimized else 32 * FRAGMENT_OUT_BYTES // 4)
    events[:, event.LOAD_TRANSACTIONS] = reads + events[:, event.TEXTURE_TRANSACTIONS]
    events[:, event.LOAD_BYTES] = 32 * reads + events[:, event.TEXTURE_BYTES]
    events[:, event.STORE_TRANSACTIONS] = writes
    events[:, event.STORE_BYTES] = 32 * writes
