"""Scenes of transparent triangles: piles of one size in two orders, and confetti to look at."""

import numpy as np
from numpy.typing import NDArray

from tilestamp.simulator.scenes import Scene
from tilestamp.simulator.scenes.scene import Mesh


def scene_of(
    name: str, pixels: NDArray[np.float64], depths: NDArray[np.float64], colors: NDArray[np.float64], side: int
) -> Scene:
    """Triangles in one colour and at one depth each.

    Parameters
    ----------
    pixels : ndarray, (F, 3, 2)
    depths : ndarray, (F,)
        Clip space, -1 to 1.
    colors : ndarray, (F, 4)
        RGBA, 0 to 1.
    side : int
        Pixels of a side of the screen.
    """
    positions = np.ones((len(pixels), 3, 4))
    positions[..., :2] = pixels * 2 / side - 1
    positions[..., 2] = depths[:, None]
    triangles = np.arange(3 * len(pixels), dtype=np.int32).reshape(-1, 3)
    corners = np.repeat(colors, 3, axis=0).astype(np.float32)
    return Scene(name, mesh=Mesh(positions.reshape(-1, 4).astype(np.float32), triangles, corners, clip_space=True))


def random_colors(count: int, seed: int) -> NDArray[np.float64]:
    """RGBA, alpha 0.3 to 0.7."""
    random = np.random.default_rng(seed)
    colors = random.uniform(0.1, 1.0, (count, 4))
    colors[:, 3] = random.uniform(0.3, 0.7, count)
    return colors


def piles(side: int, leg: int, layers: int, *, together: bool) -> Scene:
    """Right triangles over the whole screen, ``layers`` at each place: those of a place one after another, or apart."""
    places = np.stack(np.meshgrid(np.arange(0, side, leg), np.arange(0, side, leg)), axis=-1).reshape(-1, 2)
    order = np.arange(layers * len(places)).reshape(layers, len(places))
    drawn = (order.T if together else order).ravel() % len(places)
    pixels = places[drawn][:, None] + leg * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    depths = np.random.default_rng(2).uniform(-0.9, 0.9, len(drawn))
    name = f"piles of {leg} px, {'together' if together else 'apart'}"
    return scene_of(name, pixels, depths, random_colors(len(drawn), 3), side)


def stack(side: int, layers: int, *, front_first: bool) -> Scene:
    """Triangles that each cover the whole screen: red near, blue far, so transparent that the farthest is seen."""
    depths = np.linspace(-0.8, 0.8, max(layers, 2))[:layers]
    order = slice(None) if front_first else slice(None, None, -1)
    pixels = np.repeat(2.0 * side * np.array([[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]]), layers, axis=0)
    far = np.arange(layers) / max(layers - 1, 1)
    colors = np.stack([1.0 - far, np.zeros(layers), far, np.full(layers, 0.2)], axis=1)
    return scene_of(f"stack of {layers}", pixels, depths[order], colors[order], side)


def confetti(side: int, count: int, reach: float, seed: int = 1) -> Scene:
    """Triangles at random places, depths and turns, as wide as ``reach`` pixels."""
    random = np.random.default_rng(seed)
    turn = random.uniform(0, 2 * np.pi, (count, 1)) + np.array([0.0, 2.1, 4.2])
    middle = random.uniform(0, side, (count, 1, 2))
    pixels = middle + reach / 2 * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    depths = random.uniform(-0.9, 0.9, count)
    return scene_of(f"confetti of {count}", pixels, depths, random_colors(count, seed + 1), side)
