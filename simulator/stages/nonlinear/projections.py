"""Fisheye, paraboloid and cylinder: the line of sight of a sample, its inverse, and how far sight turns a pixel.

Eye space: x to the right, y up, z ahead. All of them see more than a half space; ``fov`` is the angle across the width
of the picture.

fisheye      equidistant: the angle from the axis is the distance from the middle, over f; 360 degrees are a disc
paraboloid   (x, y) / (1 + z) of the unit direction: a stereographic image, up to less than 360 degrees
cylindrical  the angle about the upright axis across, its tangent of height up; 360 degrees
"""

from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tilestamp.models.errors import TilestampError

Kind = Literal["fisheye", "paraboloid", "cylindrical"]
KINDS: tuple[Kind, ...] = get_args(Kind)


class Projection(NamedTuple):
    """A projection onto a screen.

    Parameters
    ----------
    kind : {"fisheye", "paraboloid", "cylindrical"}
    width, height : int
        Pixels.
    focal : float
        Pixels: of a radian (fisheye, cylindrical), or of a unit (paraboloid), in the middle.
    """

    kind: Kind
    width: int
    height: int
    focal: float


def projection(kind: Kind, fov: float, width: int, height: int) -> Projection:
    """Make a projection of ``fov`` degrees across the width."""
    if kind == "paraboloid" and fov >= 360:
        raise TilestampError(f"a paraboloid sees less than 360 degrees, not {fov:g}")
    angle = np.radians(fov)
    across = 2.0 * np.tan(angle / 4.0) if kind == "paraboloid" else angle
    return Projection(kind, width, height, float(width / across))


def rays(to: Projection, x: ArrayLike, y: ArrayLike) -> NDArray[np.float64]:
    """Unit directions (..., 3) of places on screen in pixels, y down; not a number where nothing is seen."""
    p, q = (np.asarray(x, float) - to.width / 2) / to.focal, (to.height / 2 - np.asarray(y, float)) / to.focal
    p, q = np.broadcast_arrays(p, q)
    if to.kind == "cylindrical":
        length = np.hypot(1.0, q)
        return np.stack([np.sin(p) / length, q / length, np.cos(p) / length], axis=-1)
    radius = np.hypot(p, q)
    if to.kind == "paraboloid":
        square = radius**2
        return np.asarray(np.stack([2 * p, 2 * q, 1 - square], axis=-1) / (1 + square)[..., None], np.float64)
    aside = np.sinc(radius / np.pi)
    directions = np.stack([p * aside, q * aside, np.cos(radius)], axis=-1)
    return np.where(radius[..., None] <= np.pi, directions, np.nan)


def project(to: Projection, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Places on screen (..., 2) of points in eye space (..., 3): the inverse of ``rays``."""
    x, y, z = np.moveaxis(points, -1, 0)
    side = np.hypot(x, y)
    if to.kind == "cylindrical":
        p, q = np.arctan2(x, z), y / np.maximum(np.hypot(x, z), 1e-300)
    elif to.kind == "paraboloid":
        scale = 1.0 / np.maximum(np.sqrt(x * x + y * y + z * z) + z, 1e-300)
        p, q = x * scale, y * scale
    else:
        scale = np.arctan2(side, z) / np.maximum(side, 1e-300)
        p, q = x * scale, y * scale
    return np.asarray(np.stack([to.width / 2 + p * to.focal, to.height / 2 - q * to.focal], axis=-1), np.float64)


def cones(to: Projection, size: int) -> NDArray[np.float64]:
    """Cones that hold the lines of sight of squares of ``size`` pixels, row by row, (squares, 4): axis and half angle.

    A direction turns by at most 1 / focal a pixel: the equidistant map does not stretch (the sphere is curved), nor
    does the cylinder; a stereographic one turns by 2 / (1 + r^2) a unit, most where a square is nearest to the middle.
    """
    rows, columns = -(-to.height // size), -(-to.width // size)
    y, x = (np.stack(np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")) + 0.5) * size
    half = size / np.sqrt(2.0)
    turn = np.full(x.shape, 1.0 / to.focal)
    axis = rays(to, x, y)
    if to.kind == "paraboloid":
        aside, above = (np.maximum(np.abs(at - all_ / 2) - size / 2, 0) for at, all_ in ((x, to.width), (y, to.height)))
        nearest = np.hypot(aside, above)
        turn *= 2.0 / (1.0 + (nearest / to.focal) ** 2)
    elif to.kind == "fisheye":  # a square whose middle sees nothing may have a corner that does
        away = np.isnan(axis[..., 0])
        p, q = (x - to.width / 2) / to.focal, (to.height / 2 - y) / to.focal
        radius = np.maximum(np.hypot(p, q), 1e-300)
        axis[away] = np.stack([p / radius * np.sin(radius), q / radius * np.sin(radius), np.cos(radius)], axis=-1)[away]
    return np.concatenate([axis, (turn * half)[..., None]], axis=-1).reshape(-1, 4)
