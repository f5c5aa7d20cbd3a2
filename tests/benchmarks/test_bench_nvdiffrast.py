"""Speed of nvdiffrast's rasterize with derivatives at 1024x1024 (aims: 25, 60, 150 ms), and of a batch of 16."""

import numpy as np
import pytest

from tilestamp.simulator.nvdiffrast import rasterize

SIZE = 1024


def grid(triangles):
    """Clip positions (V, 4) and indices of a jittered grid that fills the screen."""
    n = round((triangles / 2) ** 0.5)
    y, x = np.mgrid[: n + 1, : n + 1] * (2 / n) - 1
    rng = np.random.default_rng(0)
    xy = np.stack([x.ravel(), y.ravel()], 1) + rng.uniform(-0.3, 0.3, (x.size, 2)) / n
    pos = np.column_stack([xy, rng.uniform(-0.9, 0.9, x.size), np.ones(x.size)]).astype(np.float32)
    j, i = (k.ravel() for k in np.mgrid[:n, :n])
    a = j * (n + 1) + i
    tri = np.concatenate([np.stack([a, a + 1, a + n + 1], 1), np.stack([a + 1, a + n + 2, a + n + 1], 1)])
    return pos, tri.astype(np.int32)


@pytest.mark.parametrize("triangles", [10_000, 100_000, 1_000_000])
def test_rasterize_1024x1024(benchmark, triangles):
    pos, tri = grid(triangles)
    benchmark(rasterize, pos[None], tri, (SIZE, SIZE))


def test_rasterize_a_batch_of_16(benchmark):
    pos, tri = grid(10_000)
    benchmark(rasterize, np.repeat(pos[None], 16, axis=0), tri, (SIZE // 2, SIZE // 2))
