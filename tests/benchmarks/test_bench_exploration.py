"""Speed of the roads not taken, by ``pytest tests/benchmarks --benchmark-only``: reported, never asserted."""

import numpy as np
import pytest

from tilestamp.simulator.simulation import simulate

pytestmark = pytest.mark.benchmark(group="exploration")
ROADS = [
    {},
    {"grid": 5, "bound": 16 / 3},
    {"grid": 13, "bound": 16.0},
    {"shading": "shared"},
    {"shading": "visible"},
    {"coarse": 16, "tile": 4},
    {"cull": "sorted"},
    {"edges": "fixed"},
    {"bound": 8.0, "relief": np.eye(16, dtype=np.uint8) * np.uint8(255), "relief_height": 0.01},
    {"coarse": 32, "tile": 8, "second_level": "buckets"},
]


@pytest.mark.parametrize(
    "options", ROADS, ids=lambda options: ",".join(f"{k}={v}" for k, v in options.items()) or "published"
)
def test_micropolygons_another_way(benchmark, options):
    frame = {"machine": "h200", "width": 800, "height": 600, **options}
    run = benchmark.pedantic(lambda: simulate("teapot", "micropolygon", **frame), rounds=5, warmup_rounds=1)
    benchmark.extra_info["milliseconds modelled"] = run.milliseconds
