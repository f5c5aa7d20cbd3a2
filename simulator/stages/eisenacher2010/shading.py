"""Phong shading of diced grids: ambient, diffuse and specular light of one lamp, on a texture or a checker.

The lamp hangs above the viewer's left shoulder and is infinitely far away; surfaces are two-sided. The paper says
"Phong shaded" and "textured" and no more: reflectances and lamp are ours.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.eisenacher2010.bezier import POINTS
from tilestamp.simulator.stages.vectors import floor, larger, load, rgba, root, select, size, smaller, store

AMBIENT = np.float32(0.15)
DIFFUSE = np.float32(0.75)
SPECULAR = np.float32(0.35)  # with an exponent of 32: five squarings
LAMP = (-0.5, 0.7, 1.0)  # right, up, towards the viewer
LIGHT_SQUARE = (np.float32(0.92), np.float32(0.86), np.float32(0.74))
DARK_SQUARE = (np.float32(0.72), np.float32(0.47), np.float32(0.33))
CHECKERS = 10.0  # squares along the longest side of the model
DEGENERATE = np.float32(1e-9)  # squared sine of the angle between tangents below which there is no normal
NUDGE = np.float32(1 / 64)  # of the way to the middle of the patch, where a collapsed edge borrows its normal
_ZERO, _ONE, _TWO, _HALF = (np.float32(x) for x in (0, 1, 2, 0.5))
_BYTE = np.float32(255)


class Lighting(NamedTuple):
    """What all vertices of a frame share, in model space."""

    lamp: NDArray[np.float32]  # (3,) unit vector towards the lamp
    eye: NDArray[np.float32]  # (4,) homogeneous; the last is 0 for a parallel projection
    squares: np.float32  # checker squares in a unit of length


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


@kernel(error_model="numpy", lent=True, inline=True)
def cross(x: Any, y: Any, z: Any) -> Any:
    """Normals from a coordinate each and its derivatives along u and v, up to a positive factor; which are missing."""
    nx, ny, nz = y[1] * z[2] - z[1] * y[2], z[1] * x[2] - x[1] * z[2], x[1] * y[2] - y[1] * x[2]
    most = (x[1] * x[1] + y[1] * y[1] + z[1] * z[1]) * (x[2] * x[2] + y[2] * y[2] + z[2] * z[2])
    return nx, ny, nz, nx * nx + ny * ny + nz * nz <= DEGENERATE * most


@kernel(lent=True, inline=True)
def tangents(x: Any, w: Any) -> Any:
    """A coordinate, and the derivatives of x/w along u and v up to a positive factor."""
    return x[0], x[1] * w[0] - x[0] * w[1], x[2] * w[0] - x[0] * w[2]


@kernel(error_model="numpy", lent=True, inline=True)
def lit(point: Any, normal: Any, light: Lighting) -> Any:
    """Matt and glossy light of vertices; a normal turned away from the viewer is turned round."""
    (px, py, pz, w), (nx, ny, nz), tiny = point, normal, np.float32(1e-30)
    lamp, eye = light.lamp, light.eye
    lx, ly, lz, ex, ey, ez, ew = lamp[0], lamp[1], lamp[2], eye[0], eye[1], eye[2], eye[3]
    vx, vy, vz = ex * w - ew * px, ey * w - ew * py, ez * w - ew * pz
    v_scale = _ONE / root(vx * vx + vy * vy + vz * vz + tiny)
    n_scale = _ONE / root(nx * nx + ny * ny + nz * nz + tiny)
    facing = (nx * vx + ny * vy + nz * vz) * (v_scale * n_scale)
    straight = (nx * lx + ny * ly + nz * lz) * n_scale
    straight = select(facing >= _ZERO, straight, -straight)
    along = (lx * vx + ly * vy + lz * vz) * v_scale
    mirrored = _TWO * straight * size(facing) - along  # reflected lamp . viewer
    mirrored = select((mirrored > _ZERO) & (straight > _ZERO), mirrored, _ZERO)
    for _ in range(5):
        mirrored = mirrored * mirrored
    return AMBIENT + DIFFUSE * larger(straight, _ZERO), SPECULAR * mirrored


@kernel(error_model="numpy", lent=True, inline=True)
def checker(point: Any, scale: Any) -> Any:
    """Reflectances of a solid checker: ``scale`` takes a point to squares."""
    cells = floor(point[0] * scale) + floor(point[1] * scale)
    half = _HALF * (cells + floor(point[2] * scale))
    odd = half != floor(half)
    return (
        select(odd, LIGHT_SQUARE[0], DARK_SQUARE[0]),
        select(odd, LIGHT_SQUARE[1], DARK_SQUARE[1]),
        select(odd, LIGHT_SQUARE[2], DARK_SQUARE[2]),
    )


@kernel(error_model="numpy", lent=True)
def texels(texture: Any, u: Any, v: Any, scratch: Any) -> Any:
    """Reflectances from the texels at (u, v) of the patch, v down the rows; ``scratch``, five rows of 16."""
    store(scratch, 0, u)
    store(scratch, POINTS, v)
    for k in range(POINTS):
        row = min(np.int64(scratch[POINTS + k] * np.float32(texture.shape[0])), texture.shape[0] - 1)
        column = min(np.int64(scratch[k] * np.float32(texture.shape[1])), texture.shape[1] - 1)
        for channel in range(3):
            scratch[(2 + channel) * POINTS + k] = np.float32(texture[row, column, channel]) / _BYTE
    return load(scratch, 2 * POINTS), load(scratch, 3 * POINTS), load(scratch, 4 * POINTS)


@kernel(lent=True, inline=True)
def _level(reflectance: Any, matt: Any, gloss: Any) -> Any:
    """Light a reflectance: from 0 to 255."""
    return smaller(reflectance * matt + gloss, _ONE) * _BYTE + _HALF


@kernel(lent=True, inline=True)
def colored(reflectance: Any, light: Any) -> Any:
    """Light reflectances, red, green and blue, and pack them."""
    matt, gloss = light
    red, green, blue = reflectance
    return rgba(_level(red, matt, gloss), _level(green, matt, gloss), _level(blue, matt, gloss))
