"""One block of the PixelShader without quads: each pixel has its derivatives from the planes of its triangle.

With u = U / Q, U and Q planes over the screen, du/dx = (U_x - u Q_x) / Q: a multiply-add and a multiplication for each
of four derivatives, and no pixel has to be shaded for its neighbours' sake. So the stream is one of covered fragments.
"""

from typing import Any

import numpy as np

from tilestamp.models.kernel import kernel
from tilestamp.simulator.scenes.texture import level_of_detail, texel_step
from tilestamp.simulator.stages.zhang2025.pixel_shader_block import (
    BLOCK,
    MAGNIFIED,
    QUADS_A_WARP,
    TRILINEAR,
    count_shader_warp,
    shade_pixel,
    texel_addresses,
)
from tilestamp.simulator.stages.zhang2025.triangle_setup import ONE_OVER_W, UV, evaluate

WARP = 4 * QUADS_A_WARP
_HALF = np.float32(0.5)
_ONE = np.float32(1.0)


@kernel(error_model="numpy", lent=True)
def plane_derivatives(planes: Any, x: Any, y: Any, uv: Any, derivatives: Any) -> None:
    """Texture coordinate (2,) of a pixel, and its derivatives: (2, 2), by coordinate, along x and along y."""
    w = _ONE / evaluate(planes[ONE_OVER_W], x, y)
    for n in range(2):
        uv[n] = evaluate(planes[UV + n], x, y) * w
        for d in range(2):
            derivatives[n, d] = (planes[UV + n, d] - uv[n] * planes[ONE_OVER_W, d]) * w


@kernel(error_model="numpy")
def shade_fragments(
    fragments: Any, quads: Any, places: Any, queue: Any, planes: Any, ids: Any, texture_ids: Any, chains: Any,
    method: int, opacity: Any, rule: int, merge: int, width: int, first: int, colors: Any, row: Any,
) -> None:  # fmt: skip
    """One block: eight warps of 32 covered fragments; fragment 4 q + k is pixel k of quad q."""
    links = np.empty(WARP, np.int64)
    uv, derivatives = np.zeros(2, np.float32), np.zeros((2, 2), np.float32)
    addresses = np.empty((8, WARP), np.int64)
    for warp in range(first, min(first + BLOCK, len(fragments)), WARP):
        addresses[:] = links[:] = -1
        textured = magnified = 0
        end = min(warp + WARP, len(fragments))
        for f in range(warp, end):
            q, k = fragments[f] // 4, fragments[f] % 4
            p = queue[quads[q]]
            texture, lod = texture_ids[ids[p]], np.float32(0.0)
            i, j = places[q, 0] + k % 2, places[q, 1] + k // 2
            x, y = np.float32(i) + _HALF, np.float32(j) + _HALF
            links[f - warp] = 4 * (i + width * j)
            if texture >= 0:
                plane_derivatives(planes[p], x, y, uv, derivatives)
                if method == TRILINEAR:
                    step = texel_step(
                        chains, texture, derivatives[0, 0], derivatives[1, 0], derivatives[0, 1], derivatives[1, 1]
                    )
                    lod = level_of_detail(chains, texture, step)
                    magnified += step <= MAGNIFIED
                texel_addresses(chains, texture, method, lod, uv, f - warp, addresses)
                textured += 1
            shade_pixel(planes[p], chains, texture, method, opacity, x, y, lod, uv, colors[q, k])
        count_shader_warp(end - warp, textured, magnified, method, links, 1, addresses, rule, merge, row)
