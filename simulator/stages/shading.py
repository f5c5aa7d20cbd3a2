"""Phong shading of one diced grid: ambient, diffuse and specular light of one lamp, on a texture or a checker.

The lamp hangs above the viewer's left shoulder and is infinitely far away; surfaces are two-sided. The paper says
"Phong shaded" and "textured" and no more: reflectances and lamp are ours.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

AMBIENT = np.float32(0.15)
DIFFUSE = np.float32(0.75)
SPECULAR = np.float32(0.35)  # with an exponent of 32: five squarings
LAMP = (-0.5, 0.7, 1.0)  # right, up, towards the viewer
LIGHT_SQUARE = (np.float32(0.92), np.float32(0.86), np.float32(0.74))
DARK_SQUARE = (np.float32(0.72), np.float32(0.47), np.float32(0.33))
CHECKERS = 10.0  # squares along the longest side of the model
OPAQUE = np.uint32(0xFF000000)
DEGENERATE = np.float32(1e-9)  # squared sine of the angle between tangents below which there is no normal
NUDGE = np.float32(1 / 64)  # of the way to the middle of the patch, where a collapsed edge borrows its normal
_ZERO, _ONE, _TWO, _HALF, _THREE = (np.float32(x) for x in (0, 1, 2, 0.5, 3))
_BYTE = np.float32(255)


class Lighting(NamedTuple):
    """What all vertices of a frame share, in model space."""

    lamp: NDArray[np.float32]  # (3,) unit vector towards the lamp
    eye: NDArray[np.float32]  # (4,) homogeneous; the last is 0 for a parallel projection
    squares: np.float32  # checker squares in a unit of length


# Rows of 16 vertices in one buffer: with one base and constant distances LLVM sees that they do not overlap.
SCREEN, POINT, ALONG_U, ALONG_V, NORMAL = 0, 64, 128, 192, 256  # 4 coordinates each, but 3 of NORMAL
MATT, GLOSS = 304, 320  # ambient and diffuse, and specular light
COLOR = 336  # red, green, blue
ROWS = 384


class Grid(NamedTuple):
    """Scratch of one grid: tables of its parameters, and rows of its vertices with views of some."""

    by_u: NDArray[np.float32]  # (4, 4)
    by_v: NDArray[np.float32]
    slope_u: NDArray[np.float32]  # (3, 4)
    slope_v: NDArray[np.float32]
    between: NDArray[np.float32]  # (16,)
    rows: NDArray[np.float32]  # (ROWS,)
    screen: NDArray[np.float32]  # (4, 16) x w, y w, w, z w
    point: NDArray[np.float32]  # (4, 16) homogeneous, model space
    along_u: NDArray[np.float32]  # (4, 16)
    along_v: NDArray[np.float32]  # (4, 16)


@njit(cache=True, nogil=True)
def new_grid() -> Any:
    """Scratch for grids; w = 1 until a patch with weights writes it."""
    rows = np.zeros(ROWS, np.float32)
    rows[POINT + 48 : POINT + 64] = 1
    return Grid(
        np.empty((4, 4), np.float32),
        np.empty((4, 4), np.float32),
        np.empty((3, 4), np.float32),
        np.empty((3, 4), np.float32),
        np.empty(16, np.float32),
        rows,
        rows[SCREEN : SCREEN + 64].reshape(4, 16),
        rows[POINT : POINT + 64].reshape(4, 16),
        rows[ALONG_U : ALONG_U + 64].reshape(4, 16),
        rows[ALONG_V : ALONG_V + 64].reshape(4, 16),
    )


def lighting(points: NDArray[np.float32], matrix: ArrayLike) -> Lighting:
    """Place the lamp by a camera, and size the checker by the model.

    Parameters
    ----------
    points : ndarray, (P, 16, 4), float32
        Homogeneous, model space.
    matrix : array-like, (4, 4)
        Model to clip space, for column vectors.
    """
    x, y, z, w = np.asarray(matrix, np.float64)
    # the eye is where x = y = w = 0: the one homogeneous point that the three rows do not see
    eye = np.linalg.svd(np.stack([x, y, w]))[2][3]
    if z @ eye > 0:  # nearer is a smaller z/w: a step towards the eye lowers z
        eye = -eye
    if eye[3] != 0 and abs(eye[3]) > 1e-9 * np.abs(eye).max():
        eye = eye / eye[3]
    towards = -w[:3] if np.any(w[:3]) else eye[:3]
    axes = [axis / np.linalg.norm(axis) for axis in (x[:3], y[:3], towards)]
    lamp = sum(part * axis for part, axis in zip(LAMP, axes, strict=True))
    corners = points[..., :3] / points[..., 3:]
    extent = float(np.ptp(corners.reshape(-1, 3), axis=0).max()) or 1.0
    return Lighting(
        (lamp / np.linalg.norm(lamp)).astype(np.float32), eye.astype(np.float32), np.float32(CHECKERS / extent)
    )


@njit(cache=True, nogil=True)
def set_normals(s: Any) -> Any:
    """Cross products of the tangents of x/w, y/w, z/w, up to a positive factor; how many vertices have none."""
    missing = 0
    for k in range(16):
        px, py, pz, w = s[POINT + k], s[POINT + 16 + k], s[POINT + 32 + k], s[POINT + 48 + k]
        wu, wv = s[ALONG_U + 48 + k], s[ALONG_V + 48 + k]
        ux, uy, uz = s[ALONG_U + k] * w - px * wu, s[ALONG_U + 16 + k] * w - py * wu, s[ALONG_U + 32 + k] * w - pz * wu
        vx, vy, vz = s[ALONG_V + k] * w - px * wv, s[ALONG_V + 16 + k] * w - py * wv, s[ALONG_V + 32 + k] * w - pz * wv
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        most = (ux * ux + uy * uy + uz * uz) * (vx * vx + vy * vy + vz * vz)
        none = nx * nx + ny * ny + nz * nz <= DEGENERATE * most
        missing += none
        s[NORMAL + k], s[NORMAL + 16 + k], s[NORMAL + 32 + k] = nx, ny, nz
        s[MATT + k] = _ZERO if none else _ONE  # until the light is set: whether there is a normal
    return missing


@njit(cache=True, nogil=True)
def _set_light(s: Any, lx: Any, ly: Any, lz: Any, ex: Any, ey: Any, ez: Any, ew: Any) -> Any:
    """Matt and glossy light by vertex; a normal turned away from the viewer is turned round."""
    tiny = np.float32(1e-30)
    for k in range(16):
        w = s[POINT + 48 + k]
        vx, vy, vz = ex * w - ew * s[POINT + k], ey * w - ew * s[POINT + 16 + k], ez * w - ew * s[POINT + 32 + k]
        nx, ny, nz = s[NORMAL + k], s[NORMAL + 16 + k], s[NORMAL + 32 + k]
        v_scale = _ONE / np.sqrt(vx * vx + vy * vy + vz * vz + tiny)
        n_scale = _ONE / np.sqrt(nx * nx + ny * ny + nz * nz + tiny)
        facing = (nx * vx + ny * vy + nz * vz) * (v_scale * n_scale)
        lit = (nx * lx + ny * ly + nz * lz) * n_scale
        lit = lit if facing >= _ZERO else -lit
        along = (lx * vx + ly * vy + lz * vz) * v_scale
        mirrored = _TWO * lit * abs(facing) - along  # reflected lamp . viewer
        mirrored = mirrored if mirrored > _ZERO and lit > _ZERO else _ZERO
        mirrored *= mirrored
        mirrored *= mirrored
        mirrored *= mirrored
        mirrored *= mirrored
        mirrored *= mirrored
        s[MATT + k] = AMBIENT + DIFFUSE * max(lit, _ZERO)
        s[GLOSS + k] = SPECULAR * mirrored


@njit(cache=True, nogil=True)
def _set_checker(s: Any, squares: Any) -> Any:
    """Reflectances of a solid checker."""
    for k in range(16):
        scale = squares / s[POINT + 48 + k]
        cells = np.floor(s[POINT + k] * scale) + np.floor(s[POINT + 16 + k] * scale)
        half = _HALF * (cells + np.floor(s[POINT + 32 + k] * scale))
        odd = half != np.floor(half)
        s[COLOR + k] = LIGHT_SQUARE[0] if odd else DARK_SQUARE[0]
        s[COLOR + 16 + k] = LIGHT_SQUARE[1] if odd else DARK_SQUARE[1]
        s[COLOR + 32 + k] = LIGHT_SQUARE[2] if odd else DARK_SQUARE[2]


@njit(cache=True, nogil=True)
def _set_texels(s: Any, texture: Any, first_u: Any, first_v: Any, side: Any) -> Any:
    """Reflectances from the texels at (u, v) of the patch, v down the rows."""
    for k in range(16):
        u = np.float32(3 * first_u + (k & 3)) * side / _THREE
        v = np.float32(3 * first_v + (k >> 2)) * side / _THREE
        row = min(np.int64(v * np.float32(texture.shape[0])), texture.shape[0] - 1)
        column = min(np.int64(u * np.float32(texture.shape[1])), texture.shape[1] - 1)
        for channel in range(3):
            s[COLOR + 16 * channel + k] = np.float32(texture[row, column, channel]) / _BYTE


@njit(cache=True, nogil=True)
def _set_colors(s: Any) -> Any:
    """Light the reflectances: levels from 0 to 255."""
    for k in range(48):
        level = s[COLOR + k] * s[MATT + (k & 15)] + s[GLOSS + (k & 15)]
        s[COLOR + k] = min(level, _ONE) * _BYTE + _HALF


@njit(cache=True, nogil=True)
def shade(grid: Any, light: Any, texture: Any, first_u: Any, first_v: Any, side: Any, vertices: Any) -> Any:
    """Write the colours of a grid with normals, RGBA8 with red lowest, to the fourth word of ``vertices`` (16, 4)."""
    s, lamp, eye = grid.rows, light.lamp, light.eye
    _set_light(s, lamp[0], lamp[1], lamp[2], eye[0], eye[1], eye[2], eye[3])
    if texture is None:
        _set_checker(s, light.squares)
    else:
        _set_texels(s, texture, first_u, first_v, side)
    _set_colors(s)
    for k in range(16):
        red, green, blue = np.uint32(s[COLOR + k]), np.uint32(s[COLOR + 16 + k]), np.uint32(s[COLOR + 32 + k])
        vertices[k, 3] = red | green << np.uint32(8) | blue << np.uint32(16) | OPAQUE
