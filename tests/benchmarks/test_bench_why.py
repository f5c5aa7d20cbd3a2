"""Speed of explanations, by ``pytest tests/benchmarks --benchmark-only``: reported, never asserted."""

import gzip

import numpy as np
import pytest

from tilestamp import simulate
from tilestamp.reports.chrome_trace import Process, write_trace


@pytest.fixture(scope="module")
def run():
    """Give a teapot frame, priced."""
    found = simulate("teapot", machine="h200", width=1600, height=1200, picture=False)
    assert found.milliseconds > 0
    return found


def test_sensitivity_of_a_teapot_frame(benchmark, run):
    found = benchmark.pedantic(run.sensitivity, rounds=3, warmup_rounds=1)
    benchmark.extra_info["numbers"] = found.numbers["number"].nunique()


def test_a_trace_of_100_000_slices(benchmark, tmp_path):
    units = np.arange(100_000)
    begin = (units // 1000) * 7.3
    process = Process(
        name="a", threads={int(thread): f"SM {thread}" for thread in range(1, 1001)}, thread=1 + units % 1000,
        start=begin, stop=begin + 1 + units % 7 / 1.1, label=units % 3, labels=("issue", "l1", "latency"),
        number=units, amount=units % 211,
    )  # fmt: skip
    benchmark.pedantic(write_trace, ([process], tmp_path / "a.json.gz", 200_000), rounds=3, warmup_rounds=1)
    benchmark.extra_info["bytes"] = (tmp_path / "a.json.gz").stat().st_size
    with gzip.open(tmp_path / "a.json.gz", "rt") as file:
        assert sum('"ph":"X"' in line for line in file) == 100_000
