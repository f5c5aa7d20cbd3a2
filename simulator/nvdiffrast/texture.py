"""``texture``: filtered lookups in textures, mipmaps and cube maps."""

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.kernel import kernel
from tilestamp.simulator.nvdiffrast.arrays import Array, Faults, are_mended, as_array, need_axis, same_batch
from tilestamp.simulator.nvdiffrast.mipmap import (
    Mipmap,
    as_mipmap,
    as_texture,
    clamped_level,
    cube_steps,
    level_of,
    need_levels,
    smaller_levels,
)
from tilestamp.simulator.nvdiffrast.texels import (
    CUBE,
    FACES,
    cube_place,
    cube_texels,
    floor_to_int32,
    linear_texels,
    nearest_texel,
)
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stages.laine2011.exact import fma

Filter = Literal["auto", "nearest", "linear", "linear-mipmap-nearest", "linear-mipmap-linear"]
Boundary = Literal["wrap", "clamp", "zero", "cube"]
FILTERS = ("nearest", "linear", "linear-mipmap-nearest", "linear-mipmap-linear")
BOUNDARIES = ("wrap", "clamp", "zero", "cube")
NEAREST, LINEAR, MIP_NEAREST, MIP_LINEAR = range(4)
_THIRD = np.float32(0.33333333)
_NONE = np.float32(0)


@kernel(error_model="numpy", lent=True)
def _lerp(a: Any, b: Any, t: Any) -> Any:
    return fma(t, b - a, a)


@kernel(error_model="numpy", lent=True)
def _value(texels: Any, first: int, texel: int, channels: int, c: int) -> Any:
    return texels[first + texel * channels + c] if texel >= 0 else _NONE


@kernel(lent=True)
def _after(texel: int, size: int) -> Any:
    """Index of a texel as counted from ``size`` texels before; 0 where there is none."""
    return texel + size if texel >= 0 else 0


@kernel(error_model="numpy", lent=True)
def _sample(mip: Mipmap, level: int, image: int, place: Any, boundary: int, mended: bool, out: Any) -> None:
    """Write the bilinear value of one level; a cube map's missing corner is the mean of the three around it."""
    face, u, v = place
    height, width, channels = mip.sizes[level, 0], mip.sizes[level, 1], mip.channels
    first = mip.firsts[level] + image * (FACES if boundary == CUBE else 1) * height * width * channels
    if boundary == CUBE:
        a, b, c, d, s, t = cube_texels(face, u, v, width)
    else:
        a, b, c, d, s, t = linear_texels(u, v, width, height, boundary)
    corner = boundary == CUBE and min(a, b, c, d) < 0
    if corner and image > 0 and not mended:  # the original takes the first texel of the face before this image's first
        size = height * width
        first, corner = first - size * channels, False
        a, b, c, d = _after(a, size), _after(b, size), _after(c, size), _after(d, size)
    for k in range(channels):
        p, q = _value(mip.texels, first, a, channels, k), _value(mip.texels, first, b, channels, k)
        r, w = _value(mip.texels, first, c, channels, k), _value(mip.texels, first, d, channels, k)
        if corner:
            mean = (((p + q) + r) + w) * _THIRD
            p, q, r, w = mean if a < 0 else p, mean if b < 0 else q, mean if c < 0 else r, mean if d < 0 else w
        out[k] = _lerp(_lerp(p, q, s), _lerp(r, w, s), t)


@kernel(error_model="numpy", lent=True)
def _nearest(mip: Mipmap, image: int, place: Any, boundary: int, out: Any) -> None:
    face, u, v = place
    height, width, channels = mip.sizes[0, 0], mip.sizes[0, 1], mip.channels
    texel = nearest_texel(u, v, width, height, boundary)
    faces = FACES if boundary == CUBE else 1
    first = mip.firsts[0] + (image * faces + face) * height * width * channels
    for k in range(channels):
        out[k] = _value(mip.texels, first, texel, channels, k)


@kernel(error_model="numpy", lent=True)
def _level(mip: Mipmap, uv: Any, uv_da: Any, bias: Any, boundary: int) -> Any:
    level = _NONE
    if uv_da is not None:
        height, width = np.float32(mip.sizes[0, 0]), np.float32(mip.sizes[0, 1])
        if boundary == CUBE:
            level = level_of(cube_steps(uv[0], uv[1], uv[2], uv_da, width))
        else:
            level = level_of((uv_da[0] * width, uv_da[1] * width, uv_da[2] * height, uv_da[3] * height))
    if bias is not None:
        level = level + bias
    return clamped_level(level, len(mip.sizes))


@kernel(error_model="numpy")
def _rows_part(
    part: int,
    parts: int,
    mip: Mipmap,
    image: int,
    uv: Any,
    uv_da: Any,
    bias: Any,
    mode: int,
    boundary: int,
    mended: bool,
    out: Any,
) -> None:
    second = np.empty(mip.channels, np.float32)
    for y in range(len(uv) * part // parts, len(uv) * (part + 1) // parts):
        for x in range(uv.shape[1]):
            at, to = uv[y, x], out[y, x]
            place = cube_place(at[0], at[1], at[2]) if boundary == CUBE else (0, at[0], at[1])
            if place[0] < 0:
                continue  # a direction of no length or no number
            if mode == NEAREST:
                _nearest(mip, image, place, boundary, to)
                continue
            level = _NONE
            if mode >= MIP_NEAREST:
                steps = None if uv_da is None else uv_da[y, x]
                level = _level(mip, at, steps, None if bias is None else bias[y, x], boundary)
            whole = floor_to_int32(level)
            _sample(mip, whole, image, place, boundary, mended, to)
            between = level - np.float32(whole)
            if mode == MIP_LINEAR and between > _NONE:
                _sample(mip, whole + 1, image, place, boundary, mended, second)
                for k in range(mip.channels):
                    to[k] = _lerp(to[k], second[k], between)


def texture(
    tex: Array,
    uv: Array,
    uv_da: Array | None = None,
    mip_level_bias: Array | None = None,
    mip: Sequence[Array] | None = None,
    filter_mode: Filter = "auto",
    boundary_mode: Boundary = "wrap",
    max_mip_level: int | None = None,
    *,
    faults: Faults = "kept",
) -> NDArray[np.float32]:
    """Look textures up as ``nvdiffrast.torch.texture`` does.

    Parameters
    ----------
    tex : array, (B, H, W, C) or, cube maps, (B, 6, H, H, C), float32
        A texture for each image, or one for all.
    uv : array, (B, H, W, 2) or, cube maps, (B, H, W, 3), float32
    uv_da : array, (B, H, W, 4) or, cube maps, (B, H, W, 6), float32, optional
        Derivatives of uv by X and Y, as ``interpolate`` returns them.
    mip_level_bias : array, (B, H, W), float32, optional
    mip : sequence of arrays, optional
        Levels 1 and on, from ``texture_construct_mip`` or one's own.
    filter_mode : {"auto", "nearest", "linear", "linear-mipmap-nearest", "linear-mipmap-linear"}
        auto: linear-mipmap-linear with ``uv_da`` or ``mip_level_bias``, else linear.
    boundary_mode : {"wrap", "clamp", "zero", "cube"}
    max_mip_level : int, optional
        Levels beyond the texture itself.
    faults : {"kept", "mended"}
        The original takes a wrong texel at the corners of a cube map from the second image of a batch on.

    Returns
    -------
    ndarray, (B, H, W, C), float32
        To the bit; with linear-mipmap-linear within 4e-7 for texels of -1 to 1, since the GPU's logarithm is an
        approximation.

    Raises
    ------
    TilestampError
        For other shapes, types and modes.
    """
    mended = are_mended(faults)
    if filter_mode == "auto":
        filter_mode = "linear" if uv_da is None and mip_level_bias is None else "linear-mipmap-linear"
    mode, boundary = _index("filter_mode", filter_mode, FILTERS), _index("boundary_mode", boundary_mode, BOUNDARIES)
    tex, uv = _check(tex, uv, cube=boundary == CUBE)
    levels = [tex]
    if mode >= MIP_NEAREST:
        if uv_da is None and mip_level_bias is None:
            raise TilestampError(f"filter_mode {filter_mode!r} needs uv_da or mip_level_bias")
        uv_da = _per_pixel("uv_da", uv_da, uv.shape, 2 * uv.shape[3])
        mip_level_bias = _per_pixel("mip_level_bias", mip_level_bias, uv.shape, 0)
        levels += smaller_levels(tex, max_mip_level) if mip is None else _given_levels(tex, mip, max_mip_level)
    else:
        uv_da = mip_level_bias = None
    out = np.zeros((*uv.shape[:3], tex.shape[-1]), np.float32)
    packed = as_mipmap(levels)
    with np.errstate(all="ignore"):
        for b in range(len(uv)):
            steps, bias = None if uv_da is None else uv_da[b], None if mip_level_bias is None else mip_level_bias[b]
            for_parts(
                _rows_part, parts_of(uv.shape[1], 4), packed, b % len(tex), uv[b], steps, bias, mode, boundary,
                mended, out[b],
            )  # fmt: skip
    return out


def _index(name: str, value: str, known: tuple[str, ...]) -> int:
    if value not in known:
        raise TilestampError(f"{name} must be one of {', '.join(known)}, not {value!r}")
    return known.index(value)


def _check(tex: Array, uv: Array, *, cube: bool) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    tex = as_texture(tex, cube=cube)
    uv_shape = "[B, H, W, 3]" if cube else "[B, H, W, 2]"
    uv = as_array("uv", uv, np.float32, uv_shape, 4)
    need_axis("uv", uv, 3, 3 if cube else 2, uv_shape)
    if len(tex) > 1:
        same_batch(len(tex), len(uv), "tex and uv")
    return tex, uv


def _per_pixel(name: str, value: Array | None, shape: tuple[int, ...], components: int) -> NDArray[np.float32] | None:
    """Take an array of the pixels of ``shape``, with so many components each (0: no axis of them)."""
    if value is None:
        return None
    wanted = [*shape[:3], components][: 4 if components else 3]
    array = as_array(name, value, np.float32, str(wanted), len(wanted))
    if list(array.shape) != wanted:
        raise TilestampError(f"{name} must be float32 {wanted}, not {list(array.shape)}")
    return array


def _given_levels(tex: NDArray[np.float32], mip: Sequence[Array], most: int | None) -> list[NDArray[np.float32]]:
    """Levels that the caller made: each half as large as the one before, down to 1."""
    need_levels(most)
    levels, height, width = [], *tex.shape[-3:-1]
    for i, level in enumerate(mip if most is None else mip[:most], 1):
        height, width = max(height // 2, 1), max(width // 2, 1)
        wanted = (*tex.shape[:-3], height, width, tex.shape[-1])
        array = as_array(f"mip level {i}", level, np.float32, str(list(wanted)), tex.ndim)
        if array.shape != wanted:
            raise TilestampError(f"mip level {i} must be float32 {list(wanted)}, not {list(array.shape)}")
        levels.append(array)
    return levels
