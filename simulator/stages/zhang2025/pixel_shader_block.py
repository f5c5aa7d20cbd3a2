"""One block of the PixelShader (Zhang 2025, stage 8): quads, derivatives, texels, light (device functions)."""

from enum import IntEnum
from typing import Any

import numpy as np

from tilestamp.models.atomics import SECTOR, count_atomics
from tilestamp.models.coalescing import transactions
from tilestamp.models.counters import shown, size
from tilestamp.models.kernel import kernel
from tilestamp.simulator.scenes.texture import (
    TEXEL_BYTES,
    add_bilinear,
    add_trilinear,
    footprint,
    level_of_detail,
    nearest,
    texel_index,
    texel_step,
)
from tilestamp.simulator.stages.zhang2025.triangle_setup import COLOR, NORMAL, ONE_OVER_W, UV, evaluate

BLOCK = 256  # threads
QUADS_A_WARP = 8
NEAREST, BILINEAR, TRILINEAR = 0, 1, 2
AMBIENT = np.float32(0.2)
DIFFUSE = np.float32(0.8)
MAGNIFIED = np.float32(0.25)  # texels a pixel, squared: half a texel, level -1
_HALF = np.float32(0.5)
_ONE = np.float32(1.0)
_ZERO = np.float32(0.0)


@shown(size("TEXTURE_BYTES", "bytes of the segments that texels are read in"))
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
    TEXTURED_WARPS = 15
    WARPS_LAUNCHED = 16  # each reads how long the stream is
    ATOMIC_CONFLICTS = 17
    MAGNIFIED_WARPS = 18  # warps with a quad of which a texel covers two pixels each way


@kernel(error_model="numpy", lent=True)
def quad_coordinates(planes: Any, place: Any, uv: Any) -> None:
    """Perspective-correct texture coordinates of a quad's four pixels, (4, 2)."""
    for k in range(4):
        x, y = np.float32(place[0] + k % 2) + _HALF, np.float32(place[1] + k // 2) + _HALF
        w = _ONE / evaluate(planes[ONE_OVER_W], x, y)
        uv[k, 0] = evaluate(planes[UV], x, y) * w
        uv[k, 1] = evaluate(planes[UV + 1], x, y) * w


@kernel(error_model="numpy", lent=True)
def _light(planes: Any, x: Any, y: Any) -> Any:
    """Light from the eye; the factor w of the normal cancels in its direction."""
    nx, ny = evaluate(planes[NORMAL], x, y), evaluate(planes[NORMAL + 1], x, y)
    nz = evaluate(planes[NORMAL + 2], x, y)
    length = nx * nx + ny * ny + nz * nz
    return AMBIENT + DIFFUSE * abs(nz) / np.sqrt(length) if length > _ZERO else _ONE


@kernel(error_model="numpy", lent=True)
def shade_pixel(
    planes: Any, chains: Any, texture: int, method: int, opacity: Any, x: Any, y: Any, lod: Any, uv: Any, out: Any
) -> None:
    """Colour of one pixel at (x, y), texture coordinate ``uv``."""
    out[:] = _ONE if texture < 0 else _ZERO
    if texture >= 0 and method == TRILINEAR:
        add_trilinear(chains, texture, lod, uv[0], uv[1], out)
    elif texture >= 0 and method == BILINEAR:
        add_bilinear(chains, texture, 0, uv[0], uv[1], _ONE, out)
    elif texture >= 0:
        nearest(chains, texture, uv[0], uv[1], out)
    w = _ONE / evaluate(planes[ONE_OVER_W], x, y)
    light = _light(planes, x, y)
    for c in range(3):
        out[c] *= evaluate(planes[COLOR + c], x, y) * w * light
    out[3] *= evaluate(planes[COLOR + 3], x, y) * w * opacity


@kernel(error_model="numpy", lent=True)
def _shade_quad(
    planes: Any, chains: Any, texture: int, method: int, opacity: Any, place: Any, uv: Any, out: Any
) -> Any:
    """Colours of a quad; returns its level of detail, and whether a texel covers more than two pixels each way."""
    lod, step = _ZERO, _ONE
    if texture >= 0:
        quad_coordinates(planes, place, uv)
        if method == TRILINEAR:
            step = texel_step(
                chains, texture, uv[1, 0] - uv[0, 0], uv[1, 1] - uv[0, 1], uv[2, 0] - uv[0, 0], uv[2, 1] - uv[0, 1]
            )
            lod = level_of_detail(chains, texture, step)
    for k in range(4):
        x, y = np.float32(place[0] + k % 2) + _HALF, np.float32(place[1] + k // 2) + _HALF
        shade_pixel(planes, chains, texture, method, opacity, x, y, lod, uv[k], out[k])
    return lod, step <= MAGNIFIED


@kernel(error_model="numpy", lent=True)
def texel_addresses(chains: Any, texture: int, method: int, lod: Any, uv: Any, lane: int, addresses: Any) -> None:
    """Byte addresses of the texels that a lane loads, column ``lane`` of ``addresses`` (8, lanes)."""
    levels = 2 if method == TRILINEAR else 1
    for n in range(levels):
        level = min(int(lod) + n, chains.counts[texture] - 1)
        x, y, _, _ = footprint(chains, texture, level, uv[0], uv[1])
        if method == NEAREST:
            x = int(np.floor(uv[0] * np.float32(chains.levels[texture, 0, 1])))
            y = int(np.floor(uv[1] * np.float32(chains.levels[texture, 0, 2])))
        for corner in range(1 if method == NEAREST else 4):
            i = texel_index(chains, texture, level, x + corner % 2, y + corner // 2)
            addresses[4 * n + corner, lane] = i * TEXEL_BYTES


@kernel(lent=True)
def count_shader_warp(
    lanes: int, textured: int, magnified: int, method: int, links: Any, pair: int, addresses: Any, rule: int,
    merge: int, row: Any,
) -> None:  # fmt: skip
    """Count one warp: its fragments, their links to pixels (one for ``pair`` of them), its texels."""
    row[PixelShaderEvent.WARPS] += 1
    row[PixelShaderEvent.WARP_LANES] += lanes
    row[PixelShaderEvent.TEXTURED_WARPS] += textured > 0
    row[PixelShaderEvent.MAGNIFIED_WARPS] += magnified > 0
    linked, requests, conflicts, depth = count_atomics(links, 4 * QUADS_A_WARP // pair, merge)
    row[PixelShaderEvent.ATOMIC] += 1
    row[PixelShaderEvent.ATOMIC_LANES] += pair * linked
    row[PixelShaderEvent.ATOMIC_REQUESTS] += requests if merge == SECTOR else pair * requests
    row[PixelShaderEvent.ATOMIC_CONFLICTS] += pair * conflicts
    row[PixelShaderEvent.ATOMIC_DEPTH] += depth
    loads = (1 if method == NEAREST else 4 if method == BILINEAR else 8) if textured else 0
    row[PixelShaderEvent.TEXEL_LOADS] += loads
    row[PixelShaderEvent.TEXEL_LANES] += loads * textured
    for n in range(loads):
        count, size = transactions(addresses[n], 4 * QUADS_A_WARP, TEXEL_BYTES, rule)
        row[PixelShaderEvent.TEXTURE_TRANSACTIONS] += count
        row[PixelShaderEvent.TEXTURE_BYTES] += size


@kernel(error_model="numpy")
def shade_block(
    quads: Any, places: Any, queue: Any, planes: Any, ids: Any, texture_ids: Any, chains: Any, method: int,
    opacity: Any, rule: int, merge: int, width: int, first: int, colors: Any, row: Any,
) -> None:  # fmt: skip
    """One block: eight warps of eight quads."""
    links = np.empty(4 * QUADS_A_WARP, np.int64)
    pair = 2 - width % 2  # two pixels of a quad side by side lie in one sector, where rows are even
    uv = np.zeros((4, 2), np.float32)
    addresses = np.empty((8, 4 * QUADS_A_WARP), np.int64)
    for warp in range(first, min(first + BLOCK // 4, len(quads)), QUADS_A_WARP):
        addresses[:] = links[:] = -1
        textured = magnified = 0
        end = min(warp + QUADS_A_WARP, len(quads))
        for q in range(warp, end):
            p = queue[quads[q]]
            texture = texture_ids[ids[p]]
            for k in range(0, 4, pair):
                at = places[q, 0] + k % 2 + width * (places[q, 1] + k // 2)
                links[(4 * (q - warp) + k) // pair] = 4 * at
            lod, large = _shade_quad(planes[p], chains, texture, method, opacity, places[q], uv, colors[q])
            if row is not None and texture >= 0:
                for k in range(4):
                    texel_addresses(chains, texture, method, lod, uv[k], 4 * (q - warp) + k, addresses)
                textured += 4
                magnified += large
        if row is not None:
            count_shader_warp(4 * (end - warp), textured, magnified, method, links, pair, addresses, rule, merge, row)
