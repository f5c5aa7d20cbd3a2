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


NOTHING = Fragments(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0), np.zeros(0))


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
    found = in_order(splats, projected, camera, width, height)
    return _picture(found, colours, found.alphas * _left_before(found.pixels, found.alphas), width, height)


def stochastic(
    found: Fragments, colours: NDArray[np.float32], width: int, height: int, samples: int, seed: int = 0
) -> NDArray[np.float64]:
    """Stochastic transparency (Enderton et al. 2010): what sorting is not needed for.

    Each fragment is there in a sample of its pixel by chance, with the probability alpha; the nearest that is there is
    all that the sample shows. The mean is ``composed``; of one layer over black the variance is a (1 - a) / samples.

    Parameters
    ----------
    found : Fragments
        As of ``in_order``.
    colours : ndarray, (N, 3)
    width, height : int
    samples : int
        A pixel.
    seed : int
    """
    chance, picture = np.random.default_rng(seed), np.zeros((height, width, 3))
    for _ in range(samples):
        there = np.flatnonzero(chance.random(len(found.alphas)) < found.alphas)
        _, nearest = np.unique(found.pixels[there], return_index=True)
        kept = taken(found, there[nearest])
        picture += _picture(kept, colours, np.ones(len(nearest)), width, height) / samples
    return picture


def in_order(splats: Splats, projected: Projected, camera: Pinhole, width: int, height: int) -> Fragments:
    """What all Gaussians leave, by pixel and from near to far."""
    rows, centres = ray_rows(splats, camera)
    found = [
        fragments(int(i), projected, rows[i], centres[i], camera, width, height)
        for i in np.flatnonzero(projected.radii)
    ]
    whole = Fragments(*(np.concatenate(parts) for parts in zip(*found, strict=True))) if found else NOTHING
    order = np.lexsort((whole.depths, whole.pixels))
    return taken(whole, order)


def taken(found: Fragments, index: NDArray[np.int64]) -> Fragments:
    """Some of the fragments."""
    return Fragments(found.pixels[index], found.splats[index], found.alphas[index], found.depths[index])


def _picture(
    found: Fragments, colours: NDArray[np.float32], weights: NDArray[np.float64], width: int, height: int
) -> NDArray[np.float64]:
    """Weighted colours, added up at each pixel."""
    seen = colours.astype(np.float64)[found.splats] * weights[:, None]
    planes = [np.bincount(found.pixels, seen[:, k], width * height) for k in range(3)]
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
        return NOTHING
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
