"""Cudaraster on a sphere: four stages with every counter, and the growth from ten thousand to a million triangles."""

import numpy as np
import pytest

from tilestamp.models.simt import Simt
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.pipelines.cudaraster import CudarasterOptions, cudaraster
from tilestamp.simulator.scenes.scene import Mesh, Scene


def sphere(triangles):
    """Make a sphere of about so many triangles, half of them turned away, in clip space."""
    n = int(np.sqrt(triangles / 2))
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, n + 1), np.linspace(0.001, np.pi - 0.001, n + 1))
    return _surface("sphere", n, [0.7 * np.cos(u) * np.sin(v), 0.95 * np.cos(v), 0.9 * np.sin(u) * np.sin(v)])


def waves(triangles):
    """Make waves over the whole screen of about so many triangles, none turned away, in clip space."""
    n = int(np.sqrt(triangles / 2))
    u, v = np.meshgrid(np.linspace(-1, 1, n + 1), np.linspace(-1, 1, n + 1))
    return _surface("waves", n, [u, v, 0.5 * np.sin(9 * u) * np.cos(7 * v)])


def _surface(name, n, axes):
    i = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    faces = np.stack([i, i + 1, i + n + 1, i + 1, i + n + 2, i + n + 1], -1).reshape(-1, 3)
    positions = np.stack([*axes, np.ones_like(axes[0])], -1).reshape(-1, 4).astype(np.float32)
    colors = np.ones((len(positions), 4), np.float32)
    return Scene(name, mesh=Mesh(positions, faces.astype(np.int32), colors=colors, clip_space=True))


@pytest.mark.parametrize("counting", [True, False])
@pytest.mark.parametrize("triangles", [10_000, 100_000, 1_000_000])
def test_cudaraster_1600x1200(benchmark, triangles, counting):
    scene = sphere(triangles)

    def draw():
        return cudaraster(scene, np.eye(4), 1600, 1200, Simt(), CudarasterOptions(), Executor(counting=counting))

    frame = benchmark.pedantic(draw, rounds=3, warmup_rounds=1)
    assert (frame.triangle_ids >= 0).sum() > 900_000
