"""A sphere through cudaraster and freepipe, with every counter and without: time by size, setup alone, memory."""

import subprocess
import sys

import numpy as np
import pytest

from tilestamp.models.simt import Simt
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.pipelines.cudaraster import CudarasterOptions, cudaraster
from tilestamp.simulator.pipelines.freepipe import FreepipeOptions, freepipe
from tilestamp.simulator.scenes.scene import Mesh, Scene
from tilestamp.simulator.stages.laine2011.triangle_setup import triangle_setup


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
@pytest.mark.parametrize(
    ("pipeline", "options", "triangles"),
    [
        *((cudaraster, CudarasterOptions(), count) for count in (10_000, 100_000, 1_000_000, 4_800_000)),
        (freepipe, FreepipeOptions(), 1_000_000),
    ],
)
def test_a_sphere_1600x1200(benchmark, scaled, pipeline, options, triangles, counting):
    scene = sphere(scaled(triangles))

    def draw():
        return pipeline(scene, np.eye(4), 1600, 1200, Simt(), options, Executor(counting=counting))

    frame = benchmark.pedantic(draw, rounds=3, warmup_rounds=1)
    assert (frame.triangle_ids >= 0).sum() > 900_000


@pytest.mark.parametrize("counting", [True, False])
def test_triangle_setup_of_a_million(benchmark, scaled, counting):
    mesh = sphere(scaled(1_000_000)).mesh
    given = {"release": "1.1", "counting": counting}
    found = benchmark.pedantic(
        triangle_setup, (mesh.positions, mesh.triangles, 1600, 1200, Simt()), given, rounds=5, warmup_rounds=1
    )
    assert found.outputs.subtriangles.any()


def test_memory_of_five_million_triangles(benchmark, scaled):
    """Peak of a process, in ``extra_info``: of the benchmarks before it nothing is in it."""
    program = (
        "import resource, numpy as np; from tests.benchmarks.test_bench_cudaraster import *; "
        f"scene = sphere({scaled(5_000_000)}); before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss; "
        "cudaraster(scene, np.eye(4), 1600, 1200, Simt(), CudarasterOptions(), Executor()); "
        "print(before, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)"
    )
    command = [sys.executable, "-c", program]
    done = benchmark.pedantic(subprocess.run, (command,), {"capture_output": True, "check": True}, rounds=1)
    with_scene, peak = (int(word) / 1024 for word in done.stdout.split())
    benchmark.extra_info.update(scene_mb=with_scene, peak_mb=peak)
    assert peak >= with_scene
