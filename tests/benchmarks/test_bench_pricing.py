"""Speed of pricing what was executed: one frame (aim: 3 ms), and many machines (10,000 in 2 s; 200 large in 0.2 s)."""

import numpy as np
import pytest

from tilestamp import altered, simulate, variants

SMALL, LARGE = (640, 480), (1600, 1200)


@pytest.fixture(scope="module", params=[SMALL, LARGE], ids=["640x480", "1600x1200"])
def run(request):
    """A teapot through the micropolygon pipeline."""
    width, height = request.param
    run = simulate("teapot", "micropolygon", "gtx280", width=width, height=height, picture=False)
    assert run.milliseconds > 0  # compiled, and works priced in machine events
    return run


def machines(run, count):
    """Machines of three random numbers."""
    random = np.random.default_rng(1)
    ends = {"sm.clock_mhz": (800, 2000), "memory.dram_gb_per_s": (80, 500), "latency.dram_cycles": (300, 800)}
    return variants(run.machine, {key: random.uniform(low, high, count) for key, (low, high) in ends.items()})


def test_price_a_frame(benchmark, run):
    benchmark(lambda: run.on(run.machine).milliseconds)


def test_price_200_machines(benchmark, run, scaled):
    got = benchmark.pedantic(lambda: run.prices(machines(run, scaled(200))), rounds=3)
    assert np.isfinite(got.frame).all()


def test_price_10000_machines(benchmark, run, scaled):
    if run.width != SMALL[0]:
        pytest.skip("of the small frame")
    got = benchmark.pedantic(lambda: run.prices(machines(run, scaled(10_000))), rounds=1)
    assert got.milliseconds.shape == (scaled(10_000), len(run.launches))


def test_price_works_in_machine_events(benchmark, run):
    benchmark(lambda: [run._launch(work) for work in run.frame.works])


def test_alter_a_machine(benchmark, run):
    benchmark(altered, run.machine, {"sm.clock_mhz": 1500.0, "memory.dram_gb_per_s": 200.0})
