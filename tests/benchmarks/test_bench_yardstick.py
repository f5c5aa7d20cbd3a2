"""The yardstick: a fixed piece of NumPy work, by which benchmarks of different days and computers are compared."""

import numpy as np


def test_yardstick(benchmark):
    numbers = np.random.default_rng(0).random(1_000_000)
    assert benchmark.pedantic(np.sort, (numbers,), rounds=15, warmup_rounds=2).shape == numbers.shape
