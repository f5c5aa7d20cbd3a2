"""Speed of splats with counting; the aims are for two idle cores and a warm compile cache."""

import pytest

from tilestamp.models.machine import load_machine
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.pipelines.splat import SplatOptions, splat
from tilestamp.simulator.scenes.library import load_scene
from tilestamp.simulator.scenes.pinhole import pinhole_camera

pytestmark = pytest.mark.benchmark(group="splat")
SIZE = 1920, 1080


def timed(benchmark, name, rounds=5):
    scene, simt = load_scene(name), load_machine("h200").simt
    view = scene, pinhole_camera(scene.views["default"], *SIZE), *SIZE
    run = benchmark.pedantic(
        lambda: splat(*view, simt, SplatOptions(), Executor()), rounds=rounds, warmup_rounds=int(rounds > 1)
    )
    assert run.facts["visible Gaussians"] > 0


def test_112_thousand(benchmark, shared):
    """Aim: 0.4 s."""
    timed(benchmark, "garden1")


def test_2_8_million(benchmark, shared):
    """Aim: 2 s."""
    timed(benchmark, "garden5")


def test_49_million(benchmark, shared):
    """Aim: 30 s in under 12 GB."""
    timed(benchmark, "garden21", rounds=1)
