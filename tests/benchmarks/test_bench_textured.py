"""Speed of the textured pipelines with counting; the aims are for two idle cores and a warm compile cache."""

import pytest

from tilestamp.models.machine import load_machine
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.pipelines.binned import BinnedOptions, binned
from tilestamp.simulator.pipelines.per_primitive import PerPrimitiveOptions, per_primitive
from tilestamp.simulator.pipelines.tiled import TiledOptions, tiled
from tilestamp.simulator.scenes.library import load_scene

pytestmark = pytest.mark.benchmark(group="textured")


def timed(benchmark, pipeline, options, name, size, machine):
    scene = load_scene(name, kind="mesh")
    view = scene, scene.views["default"].matrix(*size), *size
    simt = load_machine(machine).simt
    return benchmark.pedantic(lambda: pipeline(*view, simt, options, Executor()), rounds=5, warmup_rounds=1)


def test_bunny_through_nine_stages(benchmark, shared):
    """Aim: 0.5 s."""
    frame = timed(benchmark, binned, BinnedOptions(), "bunny", (1920, 1080), "ga104")
    assert (frame.triangle_ids >= 0).any()


def test_bunny_without_quads(benchmark, shared):
    """Aim: that of quads."""
    frame = timed(benchmark, binned, BinnedOptions(derivatives="planes"), "bunny", (1920, 1080), "ga104")
    assert (frame.triangle_ids >= 0).any()


def test_engine_by_tiles(benchmark, shared):
    """Aim: 0.7 s."""
    frame = timed(benchmark, tiled, TiledOptions(), "2CylinderEngine", (800, 800), "gt750m")
    assert (frame.triangle_ids >= 0).any()


def test_engine_by_primitives(benchmark, shared):
    """Aim: 0.7 s."""
    frame = timed(benchmark, per_primitive, PerPrimitiveOptions(), "2CylinderEngine", (800, 800), "gt750m")
    assert (frame.triangle_ids >= 0).any()
