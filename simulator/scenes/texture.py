"""Textures as kernels read them: mip chains of all textures in one array, row-major or in small tiles; filters.

Zhang keeps texels in "tile linear storage" so that a quad's texels share a cache line; his README gives no tile size,
so 4x4 texels of 4 bytes (64 bytes, two sectors) are an assumption; ``zhang2025/texture_traffic`` compares 8x8.
Coordinates wrap (glTF's default, REPEAT).
Sizes need not be powers of two: a level is half its parent, rounded down, by a box filter whose last row or column
of an odd parent is dropped.
"""

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kernel import kernel

TEXEL_BYTES = 4
TILE: Final = 4  # texels on a side of a storage tile, by default: 64 bytes
MAX_LEVELS = 16  # up to 32768 texels on a side
_HALF = np.float32(0.5)
_ONE = np.float32(1.0)


class TextureChains(NamedTuple):
    """All levels of all textures, for kernels.

    Parameters
    ----------
    texels : ndarray, (T, 4), float32
        RGBA in [0, 1]; a texel counts as 4 bytes (RGBA8) in memory traffic.
    levels : ndarray, (textures, MAX_LEVELS, 3), int32
        First texel, width, height of each level.
    counts : ndarray, (textures,), int32
        Levels of each texture.
    tile : int
        Texels on a side of a storage tile; 0: row after row.
    """

    texels: NDArray[np.float32]
    levels: NDArray[np.int32]
    counts: NDArray[np.int32]
    tile: int


def texture_chains(
    textures: Sequence[NDArray[np.uint8]], *, tile: int = 0, mips: bool = True, levels: int = 0
) -> TextureChains:
    """Build the mip chains.

    Parameters
    ----------
    textures : sequence of ndarray, (H, W, 4), uint8
    tile : int
        Texels on a side of a storage tile; 0: row after row.
    mips : bool
        Whether to build levels below the first.
    levels : int
        How many at most; 0: down to one texel.
    """
    most = 1 if not mips else levels or MAX_LEVELS
    places = np.zeros((max(1, len(textures)), MAX_LEVELS, 3), np.int32)
    counts = np.ones(max(1, len(textures)), np.int32)
    parts: list[NDArray[np.float32]] = []
    first = 0
    for t, texture in enumerate(textures):
        image = texture.astype(np.float32) / np.float32(255.0)
        chain = _chain(image, most)
        counts[t] = len(chain)
        for k, level in enumerate(chain):
            places[t, k] = first, level.shape[1], level.shape[0]
            parts.append(_stored(level, tile))
            first += len(parts[-1])
    texels = np.concatenate(parts) if parts else np.ones((1, 4), np.float32)
    return TextureChains(texels, places, counts, tile)


def _chain(image: NDArray[np.float32], most: int) -> list[NDArray[np.float32]]:
    """All levels down to one texel, or the first ``most``."""
    chain = [image]
    while max(chain[-1].shape[:2]) > 1 and len(chain) < most:
        parent = chain[-1]
        rows, columns = (max(1, size // 2) for size in parent.shape[:2])
        step_r, step_c = min(2, parent.shape[0]), min(2, parent.shape[1])
        blocks = parent[: rows * step_r, : columns * step_c].reshape(rows, step_r, columns, step_c, 4)
        chain.append(blocks.mean(axis=(1, 3), dtype=np.float32))
    return chain


def _stored(level: NDArray[np.float32], tile: int) -> NDArray[np.float32]:
    """Lay out a level's texels in memory order, (n, 4)."""
    if tile == 0:
        return level.reshape(-1, 4)
    rows, columns = (-(-size // tile) for size in level.shape[:2])
    padded = np.zeros((rows * tile, columns * tile, 4), np.float32)
    padded[: level.shape[0], : level.shape[1]] = level
    return padded.reshape(rows, tile, columns, tile, 4).swapaxes(1, 2).reshape(-1, 4)


@kernel(lent=True)
def texel_index(chains: TextureChains, texture: int, level: int, x: int, y: int) -> Any:
    """Where texel (x, y) of a level lies, in texels; x and y wrap."""
    first = chains.levels[texture, level, 0]
    width = chains.levels[texture, level, 1]
    x = x % width
    y = y % chains.levels[texture, level, 2]
    side = chains.tile
    if side == 0:
        return first + y * width + x
    tile = (y // side) * ((width + side - 1) // side) + x // side
    return first + tile * side * side + (y % side) * side + x % side


@kernel(lent=True)
def nearest(chains: TextureChains, texture: int, u: Any, v: Any, out: Any) -> None:
    """Write the RGBA of the texel that (u, v) falls into, level 0, to ``out``."""
    x = int(np.floor(u * np.float32(chains.levels[texture, 0, 1])))
    y = int(np.floor(v * np.float32(chains.levels[texture, 0, 2])))
    i = texel_index(chains, texture, 0, x, y)
    for c in range(4):
        out[c] = chains.texels[i, c]


@kernel(lent=True)
def footprint(chains: TextureChains, texture: int, level: int, u: Any, v: Any) -> tuple[int, int, Any, Any]:
    """Lower left texel of the 2x2 texels around (u, v), and the weights of the right and upper ones."""
    s = u * np.float32(chains.levels[texture, level, 1]) - _HALF
    t = v * np.float32(chains.levels[texture, level, 2]) - _HALF
    x = np.floor(s)
    y = np.floor(t)
    return int(x), int(y), s - x, t - y


@kernel(lent=True)
def add_bilinear(chains: TextureChains, texture: int, level: int, u: Any, v: Any, weight: Any, out: Any) -> None:
    """Add ``weight`` times the bilinear value at (u, v) of one level to ``out``."""
    x, y, fx, fy = footprint(chains, texture, level, u, v)
    for dy in range(2):
        wy = (fy if dy else _ONE - fy) * weight
        for dx in range(2):
            w = (fx if dx else _ONE - fx) * wy
            i = texel_index(chains, texture, level, x + dx, y + dy)
            for c in range(4):
                out[c] += w * chains.texels[i, c]


@kernel(lent=True)
def texel_step(chains: TextureChains, texture: int, dudx: Any, dvdx: Any, dudy: Any, dvdy: Any) -> Any:
    """Square of the longer of the two derivatives, in texels of the first level."""
    width = np.float32(chains.levels[texture, 0, 1])
    height = np.float32(chains.levels[texture, 0, 2])
    along_x = dudx * width * dudx * width + dvdx * height * dvdx * height
    along_y = dudy * width * dudy * width + dvdy * height * dvdy * height
    return max(along_x, along_y)


@kernel(lent=True)
def level_of_detail(chains: TextureChains, texture: int, step: Any) -> Any:
    """Automatic level of a squared ``texel_step``: its log2 / 2, in [0, last level]."""
    if not step > _ONE:
        return np.float32(0.0)
    return min(_HALF * np.log2(step), np.float32(chains.counts[texture] - 1))


@kernel(lent=True)
def add_trilinear(chains: TextureChains, texture: int, lod: Any, u: Any, v: Any, out: Any) -> None:
    """Add the trilinear value at (u, v): two levels around ``lod``, blended by its fraction."""
    low = int(lod)
    high = min(low + 1, chains.counts[texture] - 1)
    blend = lod - np.float32(low)
    add_bilinear(chains, texture, low, u, v, _ONE - blend, out)
    add_bilinear(chains, texture, high, u, v, blend, out)
