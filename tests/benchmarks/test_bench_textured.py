"""Speed of the textured pipelines with counting; the aims are for two idle cores and a warm compile cache."""

import pytest

from tilestamp.models.machine import load_machine
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.pipelines.binned import BinnedOptions, binned
from tilestamp.simulator.pipelines.per_primitive import PerPrimitiveOptions, per_primitive
from tilestamp.simulator.pipelines.tiled import TiledOptions, tiled
from tilestamp.simulator.scenes.library import load_scene

pytestmark = pytest.mark.benchmark(group="textured")


BUNNY, ENGINE = ("bunny", (1920, 1080), "ga104"), ("2CylinderEngine", (800, 800), "gt750m")
FRAMES = {  # aims: 0.5 s, that of quads, 0.7 s, 0.7 s
    "bunny through nine stages": (binned, BinnedOptions(), *BUNNY),
    "bunny without quads": (binned, BinnedOptions(derivatives="planes"), *BUNNY),
    "engine by tiles": (tiled, TiledOptions(), *ENGINE),
    "engine by primitives": (per_primitive, PerPrimitiveOptions(), *ENGINE),
}


@pytest.mark.parametrize("name", FRAMES)
def test_a_textured_frame(benchmark, shared, name):
    pipeline, options, model, size, machine = FRAMES[name]
    scene = load_scene(model, kind="mesh")
    view = scene, scene.views["default"].matrix(*size), *size
    simt = load_machine(machine).simt
    frame = benchmark.pedantic(lambda: pipeline(*view, simt, options, Executor()), rounds=5, warmup_rounds=1)
    assert (frame.triangle_ids >= 0).any()
