"""Which four texels a coordinate lies between, and how far: 2D textures and cube maps."""

from typing import Any

import numpy as np

from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.laine2011.exact import fma

WRAP, CLAMP, ZERO, CUBE = range(4)
FACES = 6
NO_TEXEL = -1
_HALF, _ONE, _NONE = np.float32(0.5), np.float32(1), np.float32(0)
_LARGEST, _LEAST = 2147483647.0, -2147483648.0


@kernel(error_model="numpy", lent=True)
def floor_to_int32(value: Any) -> Any:
    """Float to int32 downward, saturating, NaN to 0, as the GPU converts; returned as int64."""
    if value != value:  # noqa: PLR0124 - NaN
        return np.int64(0)
    return np.int64(min(max(np.floor(np.float64(value)), _LEAST), _LARGEST))


@kernel(error_model="numpy", lent=True)
def _between(value: Any, low: Any, high: Any) -> Any:
    """Clamp; NaN to the lower end, as CUDA's fmax has it."""
    value = max(low, value)
    return min(value, high)


@kernel(error_model="numpy", lent=True)
def _reciprocal_toward_zero(value: Any) -> Any:
    """1 / value as a float32 that is not larger, of a positive value."""
    exact = 1.0 / np.float64(value)
    rounded = np.float32(exact)
    return np.nextafter(rounded, _NONE) if np.float64(rounded) > exact else rounded


@kernel(error_model="numpy", lent=True)
def cube_axes(x: Any, y: Any, z: Any) -> Any:
    """Face of a direction (+x, -x, +y, -y, +z, -z), its component there, and those along s and t with their signs.

    The tables are those of OpenGL: s runs along -z, z, x, x, x, -x and t along -y, -y, z, -z, -y, -y.
    """
    ax, ay, az = abs(x), abs(y), abs(z)
    if az > max(ax, ay):
        return (5, z, -x, -y) if z < _NONE else (4, z, x, -y)
    if ay > ax:
        return (3, y, x, -z) if y < _NONE else (2, y, x, z)
    return (1, x, z, -y) if x < _NONE else (0, x, -z, -y)


@kernel(error_model="numpy", lent=True)
def cube_place(x: Any, y: Any, z: Any) -> Any:
    """Face of a direction, and s and t there in 0..1; face -1 where they are not finite."""
    face, major, s, t = cube_axes(x, y, z)
    m = _reciprocal_toward_zero(abs(major)) * _HALF
    s, t = fma(s, m, _HALF), fma(t, m, _HALF)
    if not (np.isfinite(s) and np.isfinite(t)):
        return NO_TEXEL, _NONE, _NONE
    return face, _between(s, _NONE, _ONE), _between(t, _NONE, _ONE)


@kernel(error_model="numpy", lent=True)
def nearest_texel(u: Any, v: Any, width: int, height: int, mode: int) -> Any:
    """Index of the texel that holds a coordinate, row by row; -1 for none."""
    if mode == WRAP:
        u, v = u - np.floor(u), v - np.floor(v)
    x, y = floor_to_int32(u * np.float32(width)), floor_to_int32(v * np.float32(height))
    if mode == ZERO and not (0 <= x < width and 0 <= y < height):
        return NO_TEXEL
    return min(max(x, 0), width - 1) + width * min(max(y, 0), height - 1)


@kernel(error_model="numpy", lent=True)
def _along(u: Any, size: int, mode: int) -> Any:
    """Two neighbouring texels along an axis, which may lie outside in modes zero and cube, and the place between."""
    if mode == WRAP:
        u = u - np.floor(u)
    u = fma(u, np.float32(size), -_HALF)
    if mode == CLAMP:
        u = _between(u, _NONE, np.float32(size - 1))
    first = floor_to_int32(u)
    between = u - np.float32(first)
    second = first + 1
    if mode == CLAMP:
        second = min(second, size - 1)
    if mode == WRAP:
        first, second = first + size if first < 0 else first, second - size if second >= size else second
    return first, second, between


@kernel(error_model="numpy", lent=True)
def _texel(x: int, y: int, width: int, height: int) -> Any:
    return x + width * y if 0 <= x < width and 0 <= y < height else NO_TEXEL


@kernel(error_model="numpy", lent=True)
def linear_texels(u: Any, v: Any, width: int, height: int, mode: int) -> Any:
    """Indices of the four texels around a coordinate, -1 for none, and the place between them along x and y."""
    left, right, s = _along(u, width, mode)
    low, high, t = _along(v, height, mode)
    return (
        _texel(left, low, width, height),
        _texel(right, low, width, height),
        _texel(left, high, width, height),
        _texel(right, high, width, height),
        s,
        t,
    )


@kernel(error_model="numpy", lent=True)
def cube_texel(face: int, x: int, y: int, size: int) -> Any:
    """Index of a texel of a cube map that may lie one beyond an edge of its face; -1 beyond a corner.

    In units of half a texel from the cube's centre a face lies at +-size, and its texels at odd places. One beyond the
    edge is the first of the face across it.
    """
    beyond_x, beyond_y = not 0 <= x < size, not 0 <= y < size
    if beyond_x and beyond_y:
        return NO_TEXEL
    if beyond_x or beyond_y:
        s, t, major = 2 * x + 1 - size, 2 * y + 1 - size, size - 1
        s, t = min(max(s, -size), size), min(max(t, -size), size)
        if face < 2:
            px, py, pz = (major, -t, -s) if face == 0 else (-major, -t, s)
        elif face < 4:
            px, py, pz = (s, major, t) if face == 2 else (s, -major, -t)
        else:
            px, py, pz = (s, -t, major) if face == 4 else (-s, -t, -major)
        if abs(px) == size:
            face, s, t = (0, -pz, -py) if px > 0 else (1, pz, -py)
        elif abs(py) == size:
            face, s, t = (2, px, pz) if py > 0 else (3, px, -pz)
        else:
            face, s, t = (4, px, -py) if pz > 0 else (5, -px, -py)
        x, y = (s + size - 1) // 2, (t + size - 1) // 2
    return x + size * (y + size * face)


@kernel(error_model="numpy", lent=True)
def cube_texels(face: int, u: Any, v: Any, size: int) -> Any:
    """As ``linear_texels``, of a cube map: an edge is crossed to the next face."""
    left, right, s = _along(u, size, CUBE)
    low, high, t = _along(v, size, CUBE)
    return (
        cube_texel(face, left, low, size),
        cube_texel(face, right, low, size),
        cube_texel(face, left, high, size),
        cube_texel(face, right, high, size),
        s,
        t,
    )
