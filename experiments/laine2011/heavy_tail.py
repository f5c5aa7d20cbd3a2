"""Triangles whose areas have a heavy tail, as those of scenes seen in perspective have: most are small, a few huge.

Areas are the quantiles of a Pareto distribution, so that the largest follows from the exponent and the number of
triangles and not from luck. Shapes are equilateral, in random places and directions; no vertex is shared.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.simulator.scenes import Scene

WIDTH, HEIGHT = 1024, 768  # the size that areas in pixels are of
LARGEST = 8.0  # viewports
OUTSIDE = 40.0  # half viewports by which triangles out of view are moved
VISIBLE, FACING_AWAY, OUT_OF_VIEW = 0, 1, 2
Floats = NDArray[np.float64]


class Places(NamedTuple):
    """Where triangles lie, in half viewports from the centre."""

    spread: tuple[float, float]  # across and along: of a normal distribution, or the half axes of an ellipse
    ellipse: bool  # that is filled evenly
    disorder: float  # of places when triangles are ordered


def pareto_areas(count: int, mean: float, exponent: float) -> Floats:
    """Areas in pixels, largest first, whose parts on the screen have a mean.

    Parameters
    ----------
    count : int
    mean : float
        Pixels on the screen, of ``area * screen / (area + screen)``: what is in view of a triangle about its centre.
    exponent : float
        The share of triangles larger than an area falls by this power of it.
    """
    screen = float(WIDTH * HEIGHT)
    shape = ((np.arange(count) + 0.5) / count) ** (-1.0 / exponent)
    area: Floats = shape
    low, high = 1e-9, mean
    for _ in range(50):
        least = np.sqrt(low * high)
        area = np.minimum(least * shape, LARGEST * screen)
        if np.mean(area * screen / (area + screen)) > mean:
            high = least
        else:
            low = least
    return area


def heavy_tail_scene(
    name: str, triangles: int, visible: int, pixels: float, exponent: float, places: Places, seed: int = 1
) -> Scene:
    """Make a clip-space scene; of what is not visible, half faces away and half lies out of view.

    Parameters
    ----------
    name : str
    triangles, visible : int
    pixels : float
        Mean of a visible triangle at 1024x768.
    exponent : float
        Of ``pareto_areas``.
    places : Places
    seed : int
    """
    random = np.random.default_rng(seed)
    away = (triangles - visible) // 2
    counts = (visible, away, triangles - visible - away)
    kind = np.repeat((VISIBLE, FACING_AWAY, OUT_OF_VIEW), counts)
    area = np.concatenate([pareto_areas(n, pixels, exponent) if n else np.empty(0) for n in counts[:2]])
    area = np.concatenate([area, np.ones(counts[2])])  # their size matters to nobody
    mixed = random.permutation(triangles)
    kind, area = kind[mixed], area[mixed]
    center = _ordered(random, _centers(random, triangles, places), places.disorder)
    center[kind == OUT_OF_VIEW, 0] += OUTSIDE
    facing = np.where(kind == FACING_AWAY, -1.0, 1.0)
    return Scene.from_clip_space(
        _corners(random, center, area, facing).reshape(-1, 4),
        np.arange(3 * triangles, dtype=np.int32).reshape(-1, 3),
        name,
    )


def _centers(random: np.random.Generator, count: int, places: Places) -> Floats:
    """Places on the screen; what a normal distribution has beyond a border is folded back."""
    if places.ellipse:
        radius, angle = np.sqrt(random.random(count)), random.uniform(0.0, 2.0 * np.pi, count)
        return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1) * places.spread
    center = random.standard_normal((count, 2)) * places.spread
    folded = np.where(np.abs(center) > 1.0, np.sign(center) * 2.0 - center, center)
    return np.clip(folded, -1.0, 1.0)


def _ordered(random: np.random.Generator, center: Floats, disorder: float) -> Floats:
    """Places in Morton order, out of order by as much as a normal step in each direction makes."""
    near = np.clip(center + disorder * random.standard_normal(center.shape), -1.0, 1.0)
    return center[np.argsort(_morton(near), kind="stable")]


def _morton(points: Floats) -> NDArray[np.int64]:
    """Interleave ten bits of each coordinate in [-1, 1]."""
    cells = ((points + 1.0) * 511.5).astype(np.int64)
    code = np.zeros(len(points), np.int64)
    for bit in range(10):
        code |= (cells[:, 0] >> bit & 1) << (2 * bit) | (cells[:, 1] >> bit & 1) << (2 * bit + 1)
    return code


def _corners(random: np.random.Generator, center: Floats, area: Floats, facing: Floats) -> NDArray[np.float32]:
    """Clip positions (N, 3, 4) of equilateral triangles at random depths."""
    radius = np.sqrt(area * 4.0 / (3.0 * np.sqrt(3.0)))  # of the corners, pixels
    turn = random.uniform(0.0, 2.0 * np.pi, len(area))
    angle = turn[:, None] + facing[:, None] * np.arange(3) * (2.0 * np.pi / 3.0)
    corner = np.ones((len(area), 3, 4), np.float32)
    corner[..., 0] = center[:, None, 0] + radius[:, None] * np.cos(angle) * (2.0 / WIDTH)
    corner[..., 1] = center[:, None, 1] + radius[:, None] * np.sin(angle) * (2.0 / HEIGHT)
    corner[..., 2] = random.uniform(-0.9, 0.9, len(area))[:, None]
    return corner
