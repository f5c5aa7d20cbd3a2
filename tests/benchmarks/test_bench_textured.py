"""Speed of the textured pipelines with counting; the aims are for two idle cores and a warm compile cache."""

import pytest

from tilestamp.models.machine import load_machine
from tilestamp.simulator.pipelines.binned import binned
from tilestamp.simulator.pipelines.per_primitive import per_primitive
from tilestamp.simulator.pipelines.tiled import tiled
from tilestamp.simulator.scenes.library import load_scene

pytestmark = pytest.mark.benchmark(group="textured")


def timed(benchmark, pipeline, name, size, machine):
    scene = load_scene(name, kind="mesh")
    matrix = scene.views["default"].matrix(*size)
    simt = load_machine(machine).simt
    return benchmark.pedantic(pipeline, (scene, matrix, *size, simt), rounds=5, warmup_rounds=1)


def test_bunny_through_nine_stages(benchmark, shared):
    """Aim: 0.5 s."""
    frame = timed(benchmark, binned, "bunny", (1920, 1080), "ga104")
    assert (frame.triangle_ids >= 0).any()


def test_engine_by_tiles(benchmark, shared):
    """Aim: 0.7 s."""
    frame = timed(benchmark, tiled, "2CylinderEngine", (800, 800), "gt750m")
    assert (frame.triangle_ids >= 0).any()


def test_engine_by_primitives(benchmark, shared):
    """Aim: 0.7 s."""
    frame = timed(benchmark, per_primitive, "2CylinderEngine", (800, 800), "gt750m")
    assert (frame.triangle_ids >= 0).any()
