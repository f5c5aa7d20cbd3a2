"""Every event of bin and coarse raster against Python."""

import numpy as np
import pytest

from tests import naive_coarse, naive_queues
from tests.naive_bins import random_setup
from tests.test_counts_of_warps import nonzero
from tilestamp.models.simt import Coalescing, Simt
from tilestamp.simulator.stages.laine2011.bin_raster import bin_raster
from tilestamp.simulator.stages.laine2011.coarse_raster import coarse_raster

SETUPS = {  # triangles, width, height, size in pixels, share with several sub-triangles
    "small": (900, 300, 200, 3, 0.0),
    "large": (700, 700, 400, 300, 0.1),
    "clipped": (1100, 300, 200, 30, 0.9),
    "many bins": (600, 700, 520, 60, 0.0),
}
LINES, SECTORS = Simt(coalescing=Coalescing.WARP_LINES), Simt(coalescing=Coalescing.WARP_SECTORS)
by_machine = pytest.mark.parametrize("simt", [LINES, SECTORS], ids=["lines", "sectors"])
by_setup = pytest.mark.parametrize("name", SETUPS)


def made(name, seed=4):
    triangles, width, height, size, several = SETUPS[name]
    return (
        random_setup(np.random.default_rng(seed), triangles, width, height, size=size, several=several),
        width,
        height,
    )


@by_machine
@by_setup
def test_bin_raster(name, simt):
    setup, width, height = made(name)
    _, (work,), _ = bin_raster(setup, width, height, simt)
    assert nonzero(work.counts()) == nonzero(naive_queues.bin_counts(setup, width, height, simt))


@by_machine
@by_setup
def test_coarse_raster(name, simt):
    setup, width, height = made(name)
    queues, _, _ = bin_raster(setup, width, height, simt)
    _, (work,), _ = coarse_raster(queues, setup, width, height, simt)
    entries = [part.tolist() for part in np.split(queues.entries, queues.starts[1:-1])]
    expected = naive_coarse.coarse_counts(setup, queues.batch_counts, entries, width, height, simt)
    counts = {event: n for event, n in work.counts().items() if not event.startswith("STORE")}
    assert nonzero(counts) == nonzero(expected)
