"""One sub-triangle: snapping, culls, and the header and data record that later stages read (cudaraster 1.1, setup)."""

from typing import Any, NamedTuple

import numpy as np

from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.laine2011.exact import fma, lesser, round_to_int32, round_to_uint32, wrap_int32
from tilestamp.simulator.stages.laine2011.plane_equation import plane_equation

SUBPIXELS = 16  # snapped positions are multiples of 1/16 pixel
DEPTH_ERROR = 2200  # largest error of an evaluated depth plane, in depth units, at one sample a pixel
DEPTH_MIN = DEPTH_ERROR * 8
DEPTH_MAX = 2**32 - 1 - DEPTH_MIN  # the cleared depth
BARYCENTRIC_SCALE = np.float32(2**26)
_DEPTH_SCALE = np.float32(2147465984.0)  # half the depth range
_DEPTH_BASE = np.float32(2147483648.0)
_LOW = 0xFFFFFFFF

KEPT, BACKFACE, BETWEEN, CLIPPED, OUTSIDE, ABSENT = range(6)
"""What became of a triangle: drawn whole, turned away or without area, its box holds no sample or it misses the one or
two that the box holds, clipped, outside one view plane, an index out of range."""


class View(NamedTuple):
    """Viewport and switches of one draw, as kernels take them."""

    half_width: int  # 1/16 pixel
    half_height: int
    scale_x: np.float32
    scale_y: np.float32
    log_samples: int
    guard_band: bool  # release 1.1; nvdiffrast clips whatever leaves the frustum
    cull_backfaces: bool
    depth: bool
    interpolate: bool


class Corner(NamedTuple):
    """A vertex of a sub-triangle: scalars only, so that compiled code keeps it in registers."""

    sx: Any  # snapped, 1/16 pixel from the viewport's centre
    sy: Any
    inverse_w: np.float32
    depth: np.float32
    w: np.float32  # clip space
    u: np.float32  # barycentrics towards vertices 1 and 2 of the input triangle
    v: np.float32


@kernel(error_model="numpy", lent=True)
def snapped(x: Any, y: Any, inverse_w: Any, view: View) -> Any:
    """Project a clip position to the screen and round it to 1/16 pixel."""
    return round_to_int32((x * inverse_w) * view.scale_x), round_to_int32((y * inverse_w) * view.scale_y)


@kernel(error_model="numpy", lent=True)
def depth_at(z: Any, inverse_w: Any) -> Any:
    """Depth of a clip position, float32 in depth units."""
    return fma(z * _DEPTH_SCALE, inverse_w, _DEPTH_BASE)


@kernel(error_model="numpy", lent=True)
def snap(x: Any, y: Any, z: Any, w: Any, u: Any, v: Any, view: View) -> Any:
    """Make a corner of a clip position."""
    inverse = np.float32(1) / w
    sx, sy = snapped(x, y, inverse, view)
    return Corner(sx, sy, inverse, depth_at(z, inverse), w, u, v)


@kernel(lent=True, inline=True)
def _cross(ax: Any, ay: Any, bx: Any, by: Any) -> Any:
    """Cross product of two vectors, as int32 arithmetic has it."""
    return np.int32(ax * by - ay * bx)


@kernel(lent=True, inline=True)
def _holds(ax: Any, ay: Any, bx: Any, by: Any, cx: Any, cy: Any, sign: Any) -> Any:
    """Whether the origin is inside a triangle close to it; ``sign`` -1 where that is clockwise, else 0."""
    ab, bc, ca = _cross(ax, ay, bx, by), _cross(bx, by, cx, cy), _cross(cx, cy, ax, ay)
    return (np.int32((ab ^ sign) - sign) | np.int32((bc ^ sign) - sign) | np.int32((ca ^ sign) - sign)) >= 0


@kernel(lent=True, inline=True)
def cull(ax: Any, ay: Any, bx: Any, by: Any, cx: Any, cy: Any, view: View) -> Any:
    """Cull a snapped triangle, without a branch, so that compiled code takes eight of them at a time.

    Parameters
    ----------
    ax, ay, bx, by, cx, cy : int32
    view : View

    Returns
    -------
    area : int32
        Twice the area in 1/256 square pixels, counter-clockwise positive.
    backface, between, one, two : bool
        No area or turned away; else whether it surely holds no site of the sample grid, and whether one site, and the
        second of two, are looked at for that.
    """
    i32 = np.int32
    q = SUBPIXELS >> view.log_samples
    x, y = i32(view.half_width - q // 2), i32(view.half_height - q // 2)
    area = _cross(i32(bx - ax), i32(by - ay), i32(cx - ax), i32(cy - ay))
    backface = (area == 0) | ((area < 0) & view.cull_backfaces)
    low_x, high_x = i32(min(ax, bx, cx) + x + (q - 1)) & -q, i32(max(ax, bx, cx) + x) & -q
    low_y, high_y = i32(min(ay, by, cy) + y + (q - 1)) & -q, i32(max(ay, by, cy) + y) & -q
    empty = (low_x > high_x) | (low_y > high_y)
    wide, high = np.uint32(high_x - low_x), np.uint32(high_y - low_y)
    one = ((wide | high) <= q) & ((wide & high) == 0) & (not empty) & (not backface)
    x0, y0, x1, y1 = i32(low_x - x), i32(low_y - y), i32(high_x - x), i32(high_y - y)
    sign = area >> 31
    first = _holds(i32(ax - x0), i32(ay - y0), i32(bx - x0), i32(by - y0), i32(cx - x0), i32(cy - y0), sign)
    second = _holds(i32(ax - x1), i32(ay - y1), i32(bx - x1), i32(by - y1), i32(cx - x1), i32(cy - y1), sign)
    missed = one & (not first)
    between = ((not backface) & empty) | (missed & (not second))
    return area, backface, between, one, missed & ((wide | high) != 0)


@kernel(lent=True, inline=True)
def area_of(a: Corner, b: Corner, c: Corner) -> Any:
    """Twice the area of a triangle of three corners, as of ``cull``."""
    i32 = np.int32
    return _cross(i32(b.sx - a.sx), i32(b.sy - a.sy), i32(c.sx - a.sx), i32(c.sy - a.sy))


@kernel(lent=True)
def survives(a: Corner, b: Corner, c: Corner, view: View) -> Any:
    """Whether a triangle of three corners is neither turned away nor between samples."""
    i32 = np.int32
    _, backface, between, _, _ = cull(i32(a.sx), i32(a.sy), i32(b.sx), i32(b.sy), i32(c.sx), i32(c.sy), view)
    return not (backface or between)


@kernel(lent=True)
def _flips(a: Corner, b: Corner) -> Any:
    """How the coverage table is turned for the edge a -> b (bits: flip y, flip x, swap, complement)."""
    dx, dy = b.sx - a.sx, b.sy - a.sy
    flips = 0
    if dy > 0 or (dy == 0 and dx <= 0):
        flips ^= 0b1011
    if dx > 0:
        flips ^= 0b0011
    if abs(dx) < abs(dy):
        flips ^= 0b0101
    return flips


@kernel(error_model="numpy", lent=True, inline=True)
def store_header(a: Corner, b: Corner, c: Corner, view: View, headers: Any, misc: Any, slot: int) -> None:
    """Write the snapped vertices and the word beside them: least depth and the flips of the three edges."""
    headers[slot, 0], headers[slot, 1] = np.int16(a.sx & 0xFFFF), np.int16(a.sy & 0xFFFF)
    headers[slot, 2], headers[slot, 3] = np.int16(b.sx & 0xFFFF), np.int16(b.sy & 0xFFFF)
    headers[slot, 4], headers[slot, 5] = np.int16(c.sx & 0xFFFF), np.int16(c.sy & 0xFFFF)
    word = np.int64(_flips(a, b) << 8 | _flips(b, c) << 4 | _flips(c, a))
    if view.depth:
        nearest = lesser(lesser(a.depth, b.depth), c.depth)
        word |= round_to_uint32(nearest - np.float32(DEPTH_ERROR << view.log_samples)) & 0xFFFFF000
    misc[slot] = np.uint32(word)


@kernel(error_model="numpy", lent=True)
def store_depth_plane(
    a: Corner, b: Corner, c: Corner, mantissa: int, shift: int, view: View, planes: Any, slot: int
) -> None:
    """Write x, y, base of the depth plane, and how far depth can vary inside a pixel (with several samples)."""
    s = view.log_samples
    half = 1 << (3 - s)
    zx, zy, zb = plane_equation(
        a.depth, b.depth, c.depth, a.sx + view.half_width - half, a.sy + view.half_height - half,
        b.sx - a.sx, b.sy - a.sy, c.sx - a.sx, c.sy - a.sy, mantissa, shift, s,
    )  # fmt: skip
    planes[slot, 0], planes[slot, 1], planes[slot, 2] = np.uint32(zx), np.uint32(zy), np.uint32(zb)
    if s > 0:
        slope = abs(wrap_int32(zx)) + abs(max(wrap_int32(zy), -2147483647))
        planes[slot, 3] = np.uint32(min(slope << (s - 1), _LOW))


@kernel(error_model="numpy", lent=True)
def _store_plane(
    u0: Any,
    u1: Any,
    u2: Any,
    a: Corner,
    b: Corner,
    c: Corner,
    mantissa: int,
    shift: int,
    view: View,
    planes: Any,
    slot: int,
    at: int,
) -> None:
    x, y, base = plane_equation(
        u0, u1, u2, a.sx + view.half_width, a.sy + view.half_height,
        b.sx - a.sx, b.sy - a.sy, c.sx - a.sx, c.sy - a.sy, mantissa, shift, view.log_samples + 1,
    )  # fmt: skip
    planes[slot, at], planes[slot, at + 1], planes[slot, at + 2] = np.uint32(x), np.uint32(y), np.uint32(base)


@kernel(error_model="numpy", lent=True)
def store_attribute_planes(
    a: Corner,
    b: Corner,
    c: Corner,
    whole: bool,
    turned: bool,
    mantissa: int,
    shift: int,
    view: View,
    planes: Any,
    slot: int,
) -> None:
    """Write the planes of 1/w, u/w and v/w.

    Of a triangle that is ``whole``, u and v are 1 at one corner and 0 at the others; ``turned``: that of u is c.
    """
    scale = min(a.w, b.w, c.w) * BARYCENTRIC_SCALE
    w0, w1, w2 = scale * a.inverse_w, scale * b.inverse_w, scale * c.inverse_w
    u, v, zero = np.int64(7), np.int64(10), np.float32(0)
    _store_plane(w0, w1, w2, a, b, c, mantissa, shift, view, planes, slot, np.int64(4))
    if whole:
        _store_plane(zero, w1, zero, a, b, c, mantissa, shift, view, planes, slot, v if turned else u)
        _store_plane(zero, zero, w2, a, b, c, mantissa, shift, view, planes, slot, u if turned else v)
        return
    _store_plane(a.u * w0, b.u * w1, c.u * w2, a, b, c, mantissa, shift, view, planes, slot, u)
    _store_plane(a.v * w0, b.v * w1, c.v * w2, a, b, c, mantissa, shift, view, planes, slot, v)
