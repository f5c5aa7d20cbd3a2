"""Mipmaps: their levels, each half as large as the one before, and which of them a pixel takes."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.kernel import kernel
from tilestamp.simulator.nvdiffrast.arrays import Array, as_array
from tilestamp.simulator.nvdiffrast.texels import FACES, cube_axes
from tilestamp.simulator.stages.laine2011.exact import fma

_QUARTER, _HALF, _ONE, _NONE = np.float32(0.25), np.float32(0.5), np.float32(1), np.float32(0)


class Mipmap(NamedTuple):
    """A texture and its smaller levels, as kernels take them."""

    texels: NDArray[np.float32]  # (n,) all levels, each (images, [faces,] height, width, channels)
    firsts: NDArray[np.int64]  # (levels,) where each begins
    sizes: NDArray[np.int64]  # (levels, 2) height and width
    channels: int


def half_size(level: NDArray[np.float32]) -> NDArray[np.float32]:
    """Average blocks of 2x2 texels, or pairs where an axis has one texel; axes -3 and -2 are height and width."""
    height, width = level.shape[-3:-1]
    if (height > 1 and height % 2) or (width > 1 and width % 2):
        raise TilestampError(
            f"a level of {height}x{width} texels has no half: make both powers of two, or limit max_mip_level"
        )
    if height > 1 and width > 1:
        a, b = level[..., ::2, ::2, :], level[..., ::2, 1::2, :]
        c, d = level[..., 1::2, ::2, :], level[..., 1::2, 1::2, :]
        return _QUARTER * (((a + b) + c) + d)
    if height > 1:
        return _HALF * (level[..., ::2, :, :] + level[..., 1::2, :, :])
    return _HALF * (level[..., ::2, :] + level[..., 1::2, :])


def smaller_levels(tex: NDArray[np.float32], most: int | None) -> list[NDArray[np.float32]]:
    """Levels 1 and on, down to 1x1 or at most ``most`` of them."""
    need_levels(most)
    levels = [tex]
    while max(levels[-1].shape[-3:-1]) > 1 and (most is None or len(levels) <= most):
        levels.append(half_size(levels[-1]))
    return levels[1:]


def need_levels(most: int | None) -> None:
    """Refuse a negative number of levels."""
    if most is not None and most < 0:
        raise TilestampError(f"max_mip_level must be at least 0, not {most}")


def as_texture(tex: Array, *, cube: bool) -> NDArray[np.float32]:
    """Take a batch of textures or of cube maps."""
    shape = "[B, 6, H, H, C]" if cube else "[B, H, W, C]"
    tex = as_array("tex", tex, np.float32, shape, 5 if cube else 4)
    if cube and (tex.shape[1] != FACES or tex.shape[2] != tex.shape[3]):
        raise TilestampError(f"tex must be float32 {shape}, not {list(tex.shape)}")
    return tex


def texture_construct_mip(
    tex: Array, max_mip_level: int | None = None, cube_mode: bool = False
) -> list[NDArray[np.float32]]:
    """Build the smaller levels of a texture once, for several calls of ``texture``.

    Parameters
    ----------
    tex : array, (B, H, W, C) or with ``cube_mode`` (B, 6, H, H, C), float32
    max_mip_level : int, optional
        Levels to make; without it down to one texel.
    cube_mode : bool

    Returns
    -------
    list of ndarray
        Levels 1 and on, each half as large: the average of 2x2 texels.

    Raises
    ------
    TilestampError
        For other shapes and types, and where a level has an odd size larger than 1.
    """
    return smaller_levels(as_texture(tex, cube=cube_mode), max_mip_level)


def as_mipmap(levels: Sequence[NDArray[np.float32]]) -> Mipmap:
    """Lay all levels out in one array."""
    firsts = np.cumsum([0, *(level.size for level in levels)], dtype=np.int64)[:-1]
    sizes = np.array([level.shape[-3:-1] for level in levels], np.int64)
    texels = levels[0].reshape(-1) if len(levels) == 1 else np.concatenate([level.reshape(-1) for level in levels])
    return Mipmap(texels, firsts, sizes, int(levels[0].shape[-1]))


@kernel(error_model="numpy", lent=True)
def level_of(steps: Any) -> Any:
    """Level of detail by the longer axis of a pixel's footprint; steps are ds/dX, ds/dY, dt/dX, dt/dY in texels.

    The logarithm is the correctly rounded one; the GPU's is an approximation of it.
    """
    sx, sy, tx, ty = steps
    a, b, c = fma(sx, sx, tx * tx), fma(sy, sy, ty * ty), fma(sx, sy, tx * ty)
    difference = a - b
    root = np.sqrt(fma(_QUARTER * difference, difference, c * c))
    return _HALF * np.float32(np.log2(np.float64(fma(_HALF, a + b, root))))


@kernel(error_model="numpy", lent=True)
def cube_steps(x: Any, y: Any, z: Any, d: Any, size: Any) -> Any:
    """Derivatives of s and t of a cube map, in texels, from those of the direction (x, y, z by X, Y)."""
    face, major, s, t = cube_axes(x, y, z)
    m = _ONE / abs(major)
    _, mx, sx, tx = _same_axes(face, d[0], d[2], d[4])
    _, my, sy, ty = _same_axes(face, d[1], d[3], d[5])
    half = _HALF * m * size
    s, t = s / major, t / major
    return half * (sx - s * mx), half * (sy - s * my), half * (tx - t * mx), half * (ty - t * my)


@kernel(error_model="numpy", lent=True)
def _same_axes(face: int, x: Any, y: Any, z: Any) -> Any:
    """Components of a vector along the axes of a face: major, s, t."""
    if face == 0:
        return face, x, -z, -y
    if face == 1:
        return face, x, z, -y
    if face == 2:
        return face, y, x, z
    if face == 3:
        return face, y, x, -z
    return (face, z, x, -y) if face == 4 else (face, z, -x, -y)


@kernel(error_model="numpy", lent=True)
def clamped_level(level: Any, levels: int) -> Any:
    """Level within those that there are; NaN to 0."""
    level = max(_NONE, level)
    return min(level, np.float32(levels - 1))
