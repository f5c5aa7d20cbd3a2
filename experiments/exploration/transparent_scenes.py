"""Scenes of transparent triangles: piles of one size in two orders, and confetti to look at."""

import numpy as np
from numpy.typing import NDArray

from tilestamp.simulator.scenes import Scene
from tilestamp.simulator.scenes.scene import Mesh


def transparent(
    name: str,
    pixels: NDArray[np.float64],
    depths: NDArray[np.float64],
    side: int,
    seed: int,
    alpha: tuple[float, float] = (0.3, 0.7),
) -> Scene:
    """Triangles of random colours, and alphas in a range.

    Parameters
    ----------
    pixels : ndarray, (F, 3, 2)
    depths : ndarray, (F,)
        Clip space, -1 to 1.
    side : int
        Pixels of a side of the screen.
    """
    random = np.random.default_rng(seed)
    positions = np.ones((len(pixels), 3, 4))
    positions[..., :2] = pixels * 2 / side - 1
    positions[..., 2] = depths[:, None]
    colors = random.uniform(0.1, 1.0, (len(pixels), 4))
    colors[:, 3] = random.uniform(*alpha, len(pixels))
    triangles = np.arange(3 * len(pixels), dtype=np.int32).reshape(-1, 3)
    corners = np.repeat(colors, 3, axis=0).astype(np.float32)
    return Scene(name, mesh=Mesh(positions.reshape(-1, 4).astype(np.float32), triangles, corners, clip_space=True))


def piles(side: int, leg: int, layers: int, *, together: bool) -> Scene:
    """Right triangles over the whole screen, ``layers`` at each place: those of a place one after another, or apart."""
    places = np.stack(np.meshgrid(np.arange(0, side, leg), np.arange(0, side, leg)), axis=-1).reshape(-1, 2)
    order = np.arange(layers * len(places)).reshape(layers, len(places))
    drawn = (order.T if together else order).ravel() % len(places)
    pixels = places[drawn][:, None] + leg * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    depths = np.random.default_rng(2).uniform(-0.9, 0.9, len(drawn))
    return transparent(f"piles of {leg} px, {'together' if together else 'apart'}", pixels, depths, side, 3)


def stack(side: int, layers: int, *, front_first: bool) -> Scene:
    """Triangles that each cover the whole screen, by depth, so transparent that the farthest is seen."""
    depths = np.linspace(-0.8, 0.8, max(layers, 2))[:layers]
    corners = 2.0 * side * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    pixels = np.repeat(corners[None], layers, axis=0)
    return transparent(f"stack of {layers}", pixels, depths if front_first else depths[::-1], side, 4, (0.1, 0.25))


def confetti(side: int, count: int, reach: float, seed: int = 1) -> Scene:
    """Triangles at random places, depths and turns, as wide as ``reach`` pixels."""
    random = np.random.default_rng(seed)
    turn = random.uniform(0, 2 * np.pi, (count, 1)) + np.array([0.0, 2.1, 4.2])
    middle = random.uniform(0, side, (count, 1, 2))
    pixels = middle + reach / 2 * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    return transparent(f"confetti of {count}", pixels, random.uniform(-0.9, 0.9, count), side, seed + 1)
