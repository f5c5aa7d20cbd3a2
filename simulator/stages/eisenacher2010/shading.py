"""Phong shading of diced grids: ambient, diffuse and specular light of one lamp, on a texture or a checker.

The lamp hangs above the viewer's left shoulder and is infinitely far away; surfaces are two-sided. The paper says
"Phong shaded" and "textured" and no more: reflectances and lamp are ours.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.eisenacher2010.bezier import LANES

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


# Rows of 16 vertices of all lanes in one buffer: by one base and constant distances LLVM sees that they do not overlap.
VERTICES = 16 * LANES  # vertex k of lane n is k * LANES + n
SCREEN, POINT, ALONG_U, ALONG_V, NORMAL = (4 * VERTICES * row for row in range(5))  # 4 coordinates each, 3 of NORMAL
MATT, GLOSS = 19 * VERTICES, 20 * VERTICES  # ambient and diffuse, and specular light
COLOR = 21 * VERTICES  # red, green, blue reflectance; then the packed colour's bits in the first
ROWS = 24 * VERTICES


class Grid(NamedTuple):
    """Scratch of the grids of all lanes: tables of their parameters, and rows of their vertices with views of some."""

    by_u: NDArray[np.float32]  # (4, 4, LANES)
    by_v: NDArray[np.float32]
    slope_u: NDArray[np.float32]  # (3, 4, LANES)
    slope_v: NDArray[np.float32]
    between: NDArray[np.float32]  # (4, 4, LANES)
    rows: NDArray[np.float32]  # (ROWS,)
    words: NDArray[np.uint32]  # (ROWS,) its bits
    box: NDArray[np.float32]  # (4, LANES) x0, y0, x1, y1
    screen: NDArray[np.float32]  # (4, 16, LANES) x w, y w, w, z w
    point: NDArray[np.float32]  # (4, 16, LANES) homogeneous, model space
    along_u: NDArray[np.float32]  # (4, 16, LANES)
    along_v: NDArray[np.float32]  # (4, 16, LANES)


@kernel
def new_grid(side: Any, lanes: Any) -> Any:
    """Scratch for grids; w = 1 until a patch with weights writes it."""
    rows = np.zeros(ROWS, np.float32)
    rows[POINT + 3 * VERTICES : POINT + 4 * VERTICES] = 1
    rows.view(np.uint32)[COLOR : COLOR + VERTICES] = OPAQUE
    return Grid(
        np.zeros(4 * side * lanes, np.float32),
        np.zeros(4 * side * lanes, np.float32),
        np.zeros(3 * side * lanes, np.float32),
        np.zeros(3 * side * lanes, np.float32),
        np.zeros(side * side * lanes, np.float32),
        rows,
        rows.view(np.uint32),
        np.zeros(4 * lanes, np.float32),
        rows[SCREEN : SCREEN + 4 * VERTICES],
        rows[POINT : POINT + 4 * VERTICES],
        rows[ALONG_U : ALONG_U + 4 * VERTICES],
        rows[ALONG_V : ALONG_V + 4 * VERTICES],
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
    extent = float(max(np.ptp(points[..., d] / points[..., 3]) for d in range(3))) or 1.0
    return Lighting(
        (lamp / np.linalg.norm(lamp)).astype(np.float32), eye.astype(np.float32), np.float32(CHECKERS / extent)
    )


@kernel(error_model="numpy", lent=True)
def set_normals(s: Any) -> Any:
    """Cross products of the tangents of x/w, y/w, z/w, up to a positive factor; how many vertices have none."""
    missing = np.int32(0)
    for k in range(VERTICES):
        px, py, pz, w = s[POINT + k], s[POINT + VERTICES + k], s[POINT + 2 * VERTICES + k], s[POINT + 3 * VERTICES + k]
        wu, wv = s[ALONG_U + 3 * VERTICES + k], s[ALONG_V + 3 * VERTICES + k]
        ux, uy, uz = (
            s[ALONG_U + k] * w - px * wu,
            s[ALONG_U + VERTICES + k] * w - py * wu,
            s[ALONG_U + 2 * VERTICES + k] * w - pz * wu,
        )
        vx, vy, vz = (
            s[ALONG_V + k] * w - px * wv,
            s[ALONG_V + VERTICES + k] * w - py * wv,
            s[ALONG_V + 2 * VERTICES + k] * w - pz * wv,
        )
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        most = (ux * ux + uy * uy + uz * uz) * (vx * vx + vy * vy + vz * vz)
        none = nx * nx + ny * ny + nz * nz <= DEGENERATE * most
        missing = np.int32(missing + none)
        s[NORMAL + k], s[NORMAL + VERTICES + k], s[NORMAL + 2 * VERTICES + k] = nx, ny, nz
        s[MATT + k] = _ZERO if none else _ONE  # until the light is set: whether there is a normal
    return missing


@kernel(lent=True)
def tangent(values: Any, along: Any) -> Any:
    """Tangent of x/w, y/w, z/w up to a positive factor, from a point and its derivatives, a coordinate a row."""
    w, dw = values[3, 0], values[3, along]
    return (
        values[0, along] * w - values[0, 0] * dw,
        values[1, along] * w - values[1, 0] * dw,
        values[2, along] * w - values[2, 0] * dw,
    )


@kernel(error_model="numpy", lent=True)
def _set_light(s: Any, lx: Any, ly: Any, lz: Any, ex: Any, ey: Any, ez: Any, ew: Any) -> None:
    """Matt and glossy light by vertex; a normal turned away from the viewer is turned round."""
    tiny = np.float32(1e-30)
    for k in range(VERTICES):
        w = s[POINT + 3 * VERTICES + k]
        vx, vy, vz = (
            ex * w - ew * s[POINT + k],
            ey * w - ew * s[POINT + VERTICES + k],
            ez * w - ew * s[POINT + 2 * VERTICES + k],
        )
        nx, ny, nz = s[NORMAL + k], s[NORMAL + VERTICES + k], s[NORMAL + 2 * VERTICES + k]
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


@kernel(error_model="numpy", lent=True)
def _set_checker(s: Any, squares: Any) -> None:
    """Reflectances of a solid checker."""
    for k in range(VERTICES):
        scale = squares / s[POINT + 3 * VERTICES + k]
        cells = np.floor(s[POINT + k] * scale) + np.floor(s[POINT + VERTICES + k] * scale)
        half = _HALF * (cells + np.floor(s[POINT + 2 * VERTICES + k] * scale))
        odd = half != np.floor(half)
        s[COLOR + k] = LIGHT_SQUARE[0] if odd else DARK_SQUARE[0]
        s[COLOR + VERTICES + k] = LIGHT_SQUARE[1] if odd else DARK_SQUARE[1]
        s[COLOR + 2 * VERTICES + k] = LIGHT_SQUARE[2] if odd else DARK_SQUARE[2]


@kernel(error_model="numpy", lent=True)
def _set_texels(s: Any, texture: Any, squares: Any) -> None:
    """Reflectances from the texels at (u, v) of the patch, v down the rows."""
    for at in range(VERTICES):
        n, k = at % LANES, at // LANES
        u = np.float32(3 * squares.i[n] + (k & 3)) * squares.side[n] / _THREE
        v = np.float32(3 * squares.j[n] + (k >> 2)) * squares.side[n] / _THREE
        row = min(np.int64(v * np.float32(texture.shape[0])), texture.shape[0] - 1)
        column = min(np.int64(u * np.float32(texture.shape[1])), texture.shape[1] - 1)
        for channel in range(3):
            s[COLOR + VERTICES * channel + at] = np.float32(texture[row, column, channel]) / _BYTE


@kernel(lent=True)
def _level(s: Any, channel: int, k: int) -> Any:
    """Light a reflectance: from 0 to 255."""
    level = s[COLOR + channel * VERTICES + k] * s[MATT + k] + s[GLOSS + k]
    return np.uint32(min(level, _ONE) * _BYTE + _HALF)


@kernel(lent=True)
def _set_colors(s: Any, words: Any) -> None:
    """Light the reflectances, and pack them in the place of the first: RGBA8, red lowest."""
    for k in range(VERTICES):
        red, green, blue = _level(s, 0, k), _level(s, 1, k), _level(s, 2, k)
        words[COLOR + k] = red | green << np.uint32(8) | blue << np.uint32(16) | OPAQUE


@kernel(lent=True)
def shade(grid: Grid, light: Lighting, texture: Any, squares: Any) -> None:
    """Set the colours of grids with normals."""
    s, lamp, eye = grid.rows, light.lamp, light.eye
    _set_light(s, lamp[0], lamp[1], lamp[2], eye[0], eye[1], eye[2], eye[3])
    if texture is None:
        _set_checker(s, light.squares)
    else:
        _set_texels(s, texture, squares)
    _set_colors(s, grid.words)
