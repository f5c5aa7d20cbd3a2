"""Phong shading of one diced grid: ambient, diffuse and specular light of one lamp, on a texture or a checker.

The lamp hangs above the viewer's left shoulder and is infinitely far away; surfaces are two-sided. The paper says
"Phong shaded" and "textured" and no more: reflectances and lamp are ours.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

AMBIENT = np.float32(0.15)
DIFFUSE = np.float32(0.75)
SPECULAR = np.float32(0.35)
SHININESS_LOG2 = 5  # the exponent is 32
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


class Grid(NamedTuple):
    """Scratch of one grid: coordinates by 16 vertices, and the tables of its two parameters."""

    by_u: NDArray[np.float32]  # (4, 4)
    by_v: NDArray[np.float32]
    slope_u: NDArray[np.float32]  # (3, 4)
    slope_v: NDArray[np.float32]
    between: NDArray[np.float32]  # (16,)
    screen: NDArray[np.float32]  # (4, 16) x w, y w, w, z w
    point: NDArray[np.float32]  # (4, 16) homogeneous model space
    along_u: NDArray[np.float32]  # (4, 16)
    along_v: NDArray[np.float32]
    normal: NDArray[np.float32]  # (4, 16) not yet of unit length; the last row is the product of tangent lengths
    light: NDArray[np.float32]  # (2, 16) diffuse with ambient, specular


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
def _set_normals(grid):
    """Cross products of the tangents of x/w, y/w, z/w, up to a positive factor."""
    p, u, v, n = grid.point, grid.along_u, grid.along_v, grid.normal
    for k in range(16):
        w, wu, wv = p[3, k], u[3, k], v[3, k]
        ux, uy, uz = u[0, k] * w - p[0, k] * wu, u[1, k] * w - p[1, k] * wu, u[2, k] * w - p[2, k] * wu
        vx, vy, vz = v[0, k] * w - p[0, k] * wv, v[1, k] * w - p[1, k] * wv, v[2, k] * w - p[2, k] * wv
        n[0, k] = uy * vz - uz * vy
        n[1, k] = uz * vx - ux * vz
        n[2, k] = ux * vy - uy * vx
        n[3, k] = (ux * ux + uy * uy + uz * uz) * (vx * vx + vy * vy + vz * vz)


@njit(cache=True, nogil=True)
def has_normal(grid, k):
    """Whether the tangents of vertex k span a plane."""
    n = grid.normal
    return n[0, k] * n[0, k] + n[1, k] * n[1, k] + n[2, k] * n[2, k] > DEGENERATE * n[3, k]


@njit(cache=True, nogil=True)
def _set_light(grid, lamp, eye):
    """Ambient and diffuse, and specular light by vertex; a normal turned away from the viewer is turned round."""
    p, n, light = grid.point, grid.normal, grid.light
    lx, ly, lz = lamp[0], lamp[1], lamp[2]
    ex, ey, ez, ew = eye[0], eye[1], eye[2], eye[3]
    tiny = np.float32(1e-30)
    for k in range(16):
        w = p[3, k]
        vx, vy, vz = ex * w - ew * p[0, k], ey * w - ew * p[1, k], ez * w - ew * p[2, k]
        nx, ny, nz = n[0, k], n[1, k], n[2, k]
        v_length = np.sqrt(vx * vx + vy * vy + vz * vz + tiny)
        n_length = np.sqrt(nx * nx + ny * ny + nz * nz + tiny)
        facing = (nx * vx + ny * vy + nz * vz) / (v_length * n_length)
        lit = (nx * lx + ny * ly + nz * lz) / n_length
        lit = lit if facing >= _ZERO else -lit
        along = (lx * vx + ly * vy + lz * vz) / v_length
        mirrored = max(_TWO * lit * abs(facing) - along, _ZERO)  # reflected lamp . viewer
        mirrored = mirrored if lit > _ZERO else _ZERO
        for _ in range(SHININESS_LOG2):
            mirrored *= mirrored
        light[0, k] = AMBIENT + DIFFUSE * max(lit, _ZERO)
        light[1, k] = SPECULAR * mirrored


@njit(cache=True, nogil=True)
def _checker(grid, k, squares):
    """Colour of a solid checker at vertex k."""
    scale = squares / grid.point[3, k]
    cells = np.floor(grid.point[0, k] * scale) + np.floor(grid.point[1, k] * scale) + np.floor(grid.point[2, k] * scale)
    return LIGHT_SQUARE if np.int64(cells) & 1 else DARK_SQUARE


@njit(cache=True, nogil=True)
def _texel(texture, u, v):
    """Colour of the texel at (u, v) of the patch, v down the rows."""
    row = min(np.int64(v * np.float32(texture.shape[0])), texture.shape[0] - 1)
    column = min(np.int64(u * np.float32(texture.shape[1])), texture.shape[1] - 1)
    texel = texture[row, column]
    return np.float32(texel[0]) / _BYTE, np.float32(texel[1]) / _BYTE, np.float32(texel[2]) / _BYTE


@njit(cache=True, nogil=True)
def _byte(x):
    return np.uint32(min(x, _ONE) * _BYTE + _HALF)


@njit(cache=True, nogil=True)
def shade(grid, light, texture, first_u, first_v, side, colors):
    """Colours (16,) uint32, RGBA8 with red lowest, of a grid whose ``normal`` is set."""
    _set_light(grid, light.lamp, light.eye)
    for k in range(16):
        if texture is None:
            red, green, blue = _checker(grid, k, light.squares)
        else:
            u = np.float32(3 * first_u + (k & 3)) * side / _THREE
            v = np.float32(3 * first_v + (k >> 2)) * side / _THREE
            red, green, blue = _texel(texture, u, v)
        matt, gloss = grid.light[0, k], grid.light[1, k]
        colors[k] = (
            _byte(red * matt + gloss)
            | _byte(green * matt + gloss) << np.uint32(8)
            | _byte(blue * matt + gloss) << np.uint32(16)
            | OPAQUE
        )
