"""What the rows about triangles share: layers of small triangles over the whole screen, one behind the other."""

import numpy as np

from tilestamp.simulator.scenes.camera import LookAt
from tilestamp.simulator.scenes.scene import Mesh, Scene

WARP = 32  # triangles that stay together
VIEW = LookAt((0, 0, 5), (0, 0, 0), (0, 1, 0), 30.0, 1.0, 20.0)
REACH = 1.6  # half a layer's side: beyond the screen, a little more for the layers behind
GAP = 0.02  # between layers


def layered(layers: int, cells: int, seed: int = 0, opacity: float = 1.0) -> Scene:
    """Layers of ``2 cells**2`` triangles, facing the viewer: back to front, or as the seed decides, 32 by 32.

    The order stands for the order in which a machine happens to start its warps: nothing promises another one.
    """
    side = np.linspace(-REACH, REACH, cells + 1)
    x, y = np.meshgrid(side, side)
    corner = np.arange((cells + 1) ** 2).reshape(cells + 1, cells + 1)
    a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, :-1], corner[1:, 1:]
    one = np.stack([a, b, c, b, d, c], axis=-1).reshape(-1, 3)
    heights = -GAP * np.arange(layers)[::-1]
    positions = np.concatenate([np.stack([x, y, np.full_like(x, z)], axis=-1).reshape(-1, 3) for z in heights])
    triangles = np.concatenate([one + k * x.size for k in range(layers)]).astype(np.int32)
    colors = np.random.default_rng(1).uniform(0.2, 1.0, (layers, 4))
    colors[:, 3] = opacity
    mesh = Mesh(
        np.concatenate([positions, np.ones((len(positions), 1))], axis=1).astype(np.float32),
        _shuffled(triangles, seed),
        np.repeat(colors, x.size, axis=0).astype(np.float32),
    )
    return Scene(f"{layers} layers", mesh=mesh, views={"default": VIEW})


def _shuffled(triangles: np.ndarray, seed: int) -> np.ndarray:
    """Warps of triangles in another order; seed 0 leaves them back to front."""
    if seed == 0:
        return triangles
    warps = np.array_split(np.arange(len(triangles)), -(-len(triangles) // WARP))
    order = np.random.default_rng(seed).permutation(len(warps))
    return np.ascontiguousarray(triangles[np.concatenate([warps[w] for w in order])])
