"""Textured triangles here and there: a scene for the textured pipelines."""

import numpy as np

from tilestamp.simulator.scenes.scene import Mesh, Scene


def soup(seed=3, count=40):
    """Triangles of all sizes, turned and crossing, with texture coordinates outside of [0, 1] too."""
    rng = np.random.default_rng(seed)
    centers = rng.uniform(-1.2, 1.2, (count, 1, 3))
    points = centers + rng.uniform(-0.6, 0.6, (count, 3, 3))
    positions = np.concatenate([points.reshape(-1, 3), np.ones((3 * count, 1))], axis=1).astype(np.float32)
    triangles = np.arange(3 * count, dtype=np.int32).reshape(-1, 3)
    texture = rng.integers(0, 256, (8, 8, 4), dtype=np.uint8)
    uvs = rng.uniform(-1, 2, (3 * count, 2)).astype(np.float32)
    ids = np.zeros(count, np.int32)
    return Scene("soup", mesh=Mesh(positions, triangles, uvs=uvs, texture_ids=ids, textures=(texture,)))
