"""Transparent layers in cudaraster: programs of the ROP, and lists of fragments."""

import numpy as np
import pytest

from tilestamp.experiments.exploration.transparent_scenes import confetti
from tilestamp.models.simt import Simt
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.pipelines.cudaraster import CudarasterOptions, cudaraster


@pytest.mark.parametrize(
    "chosen",
    [{"blend": name} for name in ("over", "additive", "k-buffer", "stochastic")] + [{"lists": "chunked"}],
    ids=str,
)
def test_transparency_1024x1024(benchmark, chosen):
    scene, options = confetti(1024, 20_000, 40.0), CudarasterOptions(mode="blend", cull_backfaces=False, **chosen)

    def draw():
        return cudaraster(scene, np.eye(4), 1024, 1024, Simt(), options, Executor())

    frame = benchmark.pedantic(draw, rounds=3, warmup_rounds=1)
    assert frame.image.any(axis=-1).mean() > 0.9
