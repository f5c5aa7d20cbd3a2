"""One sub-triangle: snapping, culls, and the header and data record that later stages read (cudaraster 1.1, setup)."""

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numba import njit

from simulator.stages.exact import fma, round_to_int32, round_to_uint32, wrap_int32
from simulator.stages.plane_equation import plane_equation, reciprocal_area

SUBPIXELS = 16  # snapped positions are multiples of 1/16 pixel
DEPTH_ERROR = 2200  # largest error of an evaluated depth plane, in depth units, at one sample a pixel
DEPTH_MIN = DEPTH_ERROR * 8
DEPTH_MAX = 2**32 - 1 - DEPTH_MIN  # the cleared depth
BARYCENTRIC_SCALE = np.float32(2**26)
_DEPTH_SCALE = np.float32(2147465984.0)  # half the depth range
_DEPTH_BASE = np.float32(2147483648.0)
_LOW = 0xFFFFFFFF


class Outcome(IntEnum):
    """What became of a triangle before it is stored."""

    KEPT = 0
    BACKFACE = 1  # or without area
    BETWEEN = 2  # its box holds no sample, or it misses the one or two that the box holds


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


class Corners(NamedTuple):
    """Scratch of one sub-triangle: a row a vertex."""

    clip: np.ndarray  # (3, 4) float32
    barycentric: np.ndarray  # (3, 2) float32, towards vertices 1 and 2 of the input triangle
    snapped: np.ndarray  # (3, 2) int64, 1/16 pixel from the viewport's centre
    inverse_w: np.ndarray  # (3,) float32


@njit(cache=True, nogil=True, error_model="numpy")
def snap(corners, view):
    """Project to the screen and round to 1/16 pixel."""
    for k in range(3):
        inverse = np.float32(1) / corners.clip[k, 3]
        corners.inverse_w[k] = inverse
        corners.snapped[k, 0] = round_to_int32((corners.clip[k, 0] * inverse) * view.scale_x)
        corners.snapped[k, 1] = round_to_int32((corners.clip[k, 1] * inverse) * view.scale_y)


@njit(cache=True, nogil=True)
def snapped_area(snapped):
    """Twice the area in 1/256 square pixels, counter-clockwise positive, as int32 arithmetic has it."""
    e1x, e1y = snapped[1, 0] - snapped[0, 0], snapped[1, 1] - snapped[0, 1]
    e2x, e2y = snapped[2, 0] - snapped[0, 0], snapped[2, 1] - snapped[0, 1]
    return wrap_int32(e1x * e2y - e1y * e2x)


@njit(cache=True, nogil=True)
def _holds_site(snapped, site_x, site_y, sign):
    for a in range(3):
        b = (a + 1) % 3
        ax, ay = snapped[a, 0] - site_x, snapped[a, 1] - site_y
        bx, by = snapped[b, 0] - site_x, snapped[b, 1] - site_y
        if sign * (ax * by - ay * bx) < 0:
            return False
    return True


@njit(cache=True, nogil=True)
def _between_samples(snapped, view, sign):
    """Whether the triangle surely holds no site of the sample grid."""
    q = SUBPIXELS >> view.log_samples
    bx, by = view.half_width - q // 2, view.half_height - q // 2
    x0, x1, x2 = snapped[0, 0], snapped[1, 0], snapped[2, 0]
    y0, y1, y2 = snapped[0, 1], snapped[1, 1], snapped[2, 1]
    lox = wrap_int32(min(x0, x1, x2) + q - 1 + bx) & -q
    hix = wrap_int32(max(x0, x1, x2) + bx) & -q
    loy = wrap_int32(min(y0, y1, y2) + q - 1 + by) & -q
    hiy = wrap_int32(max(y0, y1, y2) + by) & -q
    if lox > hix or loy > hiy:
        return True
    spread = (hix - lox) + (hiy - loy)
    if spread > q or _holds_site(snapped, lox - bx, loy - by, sign):
        return False
    return spread == 0 or not _holds_site(snapped, hix - bx, hiy - by, sign)


@njit(cache=True, nogil=True)
def cull(snapped, view):
    """Outcome of the culls that follow snapping, and the signed area."""
    area = snapped_area(snapped)
    if area == 0 or (area < 0 and view.cull_backfaces):
        return 1, area
    if _between_samples(snapped, view, 1 if area > 0 else -1):
        return 2, area
    return 0, area


@njit(cache=True, nogil=True)
def _flips(dx, dy):
    """How the coverage table is turned for one edge (bits: flip y, flip x, swap, complement)."""
    flips = 0
    if dy > 0 or (dy == 0 and dx <= 0):
        flips ^= 0b1011
    if dx > 0:
        flips ^= 0b0011
    if abs(dx) < abs(dy):
        flips ^= 0b0101
    return flips


@njit(cache=True, nogil=True)
def make_counter_clockwise(corners):
    """Swap vertices 1 and 2 of a clockwise triangle."""
    for c in range(2):
        corners.snapped[1, c], corners.snapped[2, c] = corners.snapped[2, c], corners.snapped[1, c]
        corners.barycentric[1, c], corners.barycentric[2, c] = corners.barycentric[2, c], corners.barycentric[1, c]
    for c in range(4):
        corners.clip[1, c], corners.clip[2, c] = corners.clip[2, c], corners.clip[1, c]
    corners.inverse_w[1], corners.inverse_w[2] = corners.inverse_w[2], corners.inverse_w[1]


@njit(cache=True, nogil=True, error_model="numpy")
def _least(a, b, c):
    """Minimum that ignores NaN, as CUDA's does."""
    low = b if not a <= b else a
    low = a if not low == low else low  # noqa: PLR0124, SIM201 - b was NaN
    last = c if not low <= c else low
    return low if not last == last else last  # noqa: PLR0124, SIM201


@njit(cache=True, nogil=True, error_model="numpy")
def _depth_at(corners, k):
    return fma(corners.clip[k, 2] * _DEPTH_SCALE, corners.inverse_w[k], _DEPTH_BASE)


@njit(cache=True, nogil=True, error_model="numpy")
def store_header(corners, view, header):
    """Write the snapped vertices; returns the word beside them: least depth and the flips of the three edges."""
    p = corners.snapped
    for k in range(3):
        header[2 * k] = np.int16(((p[k, 0] + 32768) & 0xFFFF) - 32768)
        header[2 * k + 1] = np.int16(((p[k, 1] + 32768) & 0xFFFF) - 32768)
    misc = np.int64(0)
    for k in range(3):
        m = (k + 1) % 3
        misc = (misc << 4) | _flips(p[m, 0] - p[k, 0], p[m, 1] - p[k, 1])
    if view.depth:
        nearest = _least(_depth_at(corners, 0), _depth_at(corners, 1), _depth_at(corners, 2))
        misc |= round_to_uint32(nearest - np.float32(DEPTH_ERROR << view.log_samples)) & 0xFFFFF000
    return np.uint32(misc)


@njit(cache=True, nogil=True, error_model="numpy")
def store_depth_plane(corners, area, view, record):
    """Write x, y, base of the depth plane, and how far depth can vary inside a pixel (with several samples)."""
    p, s = corners.snapped, view.log_samples
    mantissa, shift = reciprocal_area(area)
    half = 1 << (3 - s)
    zx, zy, zb = plane_equation(
        _depth_at(corners, 0), _depth_at(corners, 1), _depth_at(corners, 2),
        p[0, 0] + view.half_width - half, p[0, 1] + view.half_height - half,
        p[1, 0] - p[0, 0], p[1, 1] - p[0, 1], p[2, 0] - p[0, 0], p[2, 1] - p[0, 1], mantissa, shift, s,
    )  # fmt: skip
    record[0], record[1], record[2] = np.uint32(zx), np.uint32(zy), np.uint32(zb)
    if s > 0:
        slope = abs(wrap_int32(zx)) + abs(max(wrap_int32(zy), -2147483647))
        record[3] = np.uint32(min(slope << (s - 1), _LOW))


@njit(cache=True, nogil=True, error_model="numpy")
def store_attribute_planes(corners, area, view, record):
    """Write the planes of 1/w, u/w and v/w."""
    p, w = corners.snapped, corners.clip[:, 3]
    mantissa, shift = reciprocal_area(area)
    scale = min(w[0], w[1], w[2]) * BARYCENTRIC_SCALE
    w0, w1, w2 = scale * corners.inverse_w[0], scale * corners.inverse_w[1], scale * corners.inverse_w[2]
    b = corners.barycentric
    for plane in range(3):
        u0, u1, u2 = w0, w1, w2
        if plane > 0:
            u0, u1, u2 = b[0, plane - 1] * w0, b[1, plane - 1] * w1, b[2, plane - 1] * w2
        x, y, base = plane_equation(
            u0, u1, u2, p[0, 0] + view.half_width, p[0, 1] + view.half_height,
            p[1, 0] - p[0, 0], p[1, 1] - p[0, 1], p[2, 0] - p[0, 0], p[2, 1] - p[0, 1],
            mantissa, shift, view.log_samples + 1,
        )  # fmt: skip
        at = 4 + 3 * plane
        record[at], record[at + 1], record[at + 2] = np.uint32(x), np.uint32(y), np.uint32(base)
