"""Splats as they are meant: at each pixel in the order of that pixel, in double precision; the truth for error.

A Gaussian is seen where its alpha is 1/255 or more, and never more than 0.99, as in the published rasterizer; that is
part of what the picture shows. There are no tiles and no squares, nothing stops at an opaque pixel, and what is nearer
is where the Gaussian is densest along the ray of the pixel (StopThePop, Radl et al. 2024), not where its centre is.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.simulator.scenes.pinhole import Pinhole
from tilestamp.simulator.scenes.splats import Splats
from tilestamp.simulator.stages.kerbl2023.project import Projected
from tilestamp.simulator.stages.kerbl2023.rays import ray_rows

LEAST_ALPHA, MOST_ALPHA = 1 / 255, 0.99


class Fragments(NamedTuple):
    """What all Gaussians leave at all pixels, in no order."""

    pixels: NDArray[np.int64]
    splats: NDArray[np.int64]
    alphas: NDArray[np.float64]
    depths: NDArray[np.float64]


def composed(
    splats: Splats, colours: NDArray[np.float32], projected: Projected, camera: Pinhole, width: int, height: int
) -> NDArray[np.float64]:
    """Picture over black.

    Parameters
    ----------
    splats : Splats
    colours : ndarray, (N, 3)
    projected : Projected
        Positions and conics, in float32, are those of the rasterizer.
    camera : Pinhole
    width, height : int

    Returns
    -------
    ndarray, (height, width, 3), float64
    """
    rows, centres = ray_rows(splats, camera)
    found = [
        fragments(int(i), projected, rows[i], centres[i], camera, width, height)
        for i in np.flatnonzero(projected.radii)
    ]
    if not found:
        return np.zeros((height, width, 3))
    all_of = Fragments(*(np.concatenate(parts) for parts in zip(*found, strict=True)))
    order = np.lexsort((all_of.depths, all_of.pixels))
    pixels, alphas = all_of.pixels[order], all_of.alphas[order]
    seen = colours.astype(np.float64)[all_of.splats[order]] * (alphas * _left_before(pixels, alphas))[:, None]
    planes = [np.bincount(pixels, seen[:, k], width * height) for k in range(3)]
    return np.stack(planes, axis=1).astype(np.float64).reshape(height, width, 3)


def fragments(
    i: int,
    projected: Projected,
    rows: NDArray[np.float64],
    centre: NDArray[np.float64],
    camera: Pinhole,
    width: int,
    height: int,
) -> Fragments:
    """What one Gaussian leaves."""
    a, b, c, opacity = projected.conics[i].astype(np.float64)
    place = projected.positions[i].astype(np.float64)
    det, power = a * c - b * b, 2 * np.log(max(opacity / LEAST_ALPHA, 1e-300))
    if det <= 0 or a <= 0 or power < 0:
        return Fragments(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0), np.zeros(0))
    reach = np.sqrt(power * np.array([c, a]) / det)
    (x0, y0), (x1, y1) = np.floor(place - reach), np.ceil(place + reach)
    x, y = np.arange(max(0, x0), min(width, x1 + 1)), np.arange(max(0, y0), min(height, y1 + 1))
    x, y = (part.ravel() for part in np.meshgrid(x, y))
    dx, dy = place[0] - x, place[1] - y
    alphas = np.minimum(opacity * np.exp(-0.5 * (a * dx * dx + c * dy * dy) - b * dx * dy), MOST_ALPHA)
    x, y, alphas = (part[alphas >= LEAST_ALPHA] for part in (x, y, alphas))
    slope_x, slope_y = ((2 * x + 1) / width - 1) * camera.tan_x, ((2 * y + 1) / height - 1) * camera.tan_y
    rays = np.stack([slope_x, slope_y, np.ones_like(x)], axis=1) @ rows.T
    depths = rays @ centre / (rays * rays).sum(axis=1)
    return Fragments((y * width + x).astype(np.int64), np.full(len(x), i), alphas, depths)


def _left_before(pixels: NDArray[np.int64], alphas: NDArray[np.float64]) -> NDArray[np.float64]:
    """Transmittance in front of each fragment, of fragments that are sorted by pixel and depth."""
    logs = np.cumsum(np.log1p(-alphas)) - np.log1p(-alphas)
    first = np.flatnonzero(np.diff(pixels, prepend=-1))
    starts = np.repeat(logs[first], np.diff([*first, len(pixels)]))
    left: NDArray[np.float64] = np.exp(logs - starts)
    return left
