"""Coarse raster: queues, events and the GPU's own figures."""

import numpy as np
import pytest

from tests.naive_bins import random_setup, tile_queues
from tests.test_bin_raster import SCENES, gpu_input, measured
from tilestamp.models.simt import Simt
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.stages.laine2011.bin_raster import bin_raster
from tilestamp.simulator.stages.laine2011.coarse_raster import bin_order, coarse_raster, initial_capacity
from tilestamp.simulator.stages.laine2011.coarse_raster_events import CoarseRasterEvent
from tilestamp.simulator.stages.laine2011.triangle_setup import triangle_setup

E = CoarseRasterEvent


def coarse(setup, width, height, **options):
    queues = bin_raster(setup, width, height, Simt(), counting=False)[0]
    return coarse_raster(queues, setup, width, height, Simt(), **options)


def small(size=40, several=0.0):
    return random_setup(np.random.default_rng(1), 900, 300, 200, size=size, several=several)


@pytest.mark.parametrize(("size", "several"), [(3, 0.0), (30, 0.2), (150, 0.0)])
def test_queues_hold_what_the_naive_version_holds_in_its_order(size, several):
    setup = small(size, several)
    queues, _, _ = coarse(setup, 300, 200)
    assert [list(part) for part in np.split(queues.entries, queues.starts[1:-1])] == tile_queues(setup, 300, 200)


def test_counting_changes_no_queue():
    counted, plain = (coarse(small(), 300, 200, counting=c)[0] for c in (True, False))
    assert np.array_equal(counted.entries, plain.entries)
    assert np.array_equal(counted.active, plain.active)


def test_a_pending_clear_hands_on_every_tile_once():
    queues, (work,), _ = coarse(small(), 300, 200)
    assert sorted(queues.active) == list(range(38 * 25))
    assert work.total(E.ACTIVE_TILES) == 38 * 25


def test_without_a_clear_only_tiles_with_entries_are_handed_on():
    setup = small(3)._replace(subtriangles=np.repeat([1, 0], [20, 880]).astype(np.uint8))
    queues, (work,), _ = coarse(setup, 300, 200, deferred_clear=False)
    assert sorted(queues.active) == list(np.flatnonzero(np.diff(queues.starts)))
    assert work.total(E.BINS) <= 6


def test_the_fullest_bin_is_drawn_first():
    assert list(bin_order(np.array([3, 0, 9, 3]), deferred_clear=True)) == [2, 0, 3, 1]
    assert list(bin_order(np.array([3, 0, 9, 3]), deferred_clear=False)) == [2, 0, 3]


def test_too_few_segments_are_reported_as_overflow():
    needed = coarse(small(), 300, 200)[2]["num_tile_segments"]
    assert coarse(small(), 300, 200, capacity=needed - 1)[2]["overflow"]
    assert not coarse(small(), 300, 200, capacity=needed)[2]["overflow"]


def test_initial_capacity_is_the_originals():
    assert initial_capacity(1087716, 1024, 768) == 33992 + 4096
    assert initial_capacity(100, 1024, 768) == 12288 + 4096


@pytest.mark.parametrize(("name", "width"), SCENES)
def test_tiles_hold_as_many_entries_as_on_the_gpu(shared, name, width):
    queues, (work,), facts = coarse(*gpu_input(shared, name, width, "nvdiffrast"))
    gpu = np.load(shared / f"silicon/ids/{name}_{width}.npz")["tilecount"].ravel()
    counters = measured(shared, name, width, "coarseRaster")
    assert np.array_equal(np.diff(queues.starts), gpu)
    assert facts["num_tile_segments"] == measured(shared, name, width, "stats")["stats", "numTileSegs"]
    assert work.total(E.ATOMIC) == counters["ncu_cold", "l1tex__t_requests_pipe_lsu_mem_global_op_atom.sum"]


@pytest.mark.parametrize("name", ["bunny", "soup2k"])
def test_shared_atomics_are_those_of_the_gpu(shared, name):
    _, (work,), _ = coarse(*gpu_input(shared, name, 1024, "nvdiffrast"))
    counters = measured(shared, name, 1024, "coarseRaster")
    assert work.total(E.SHARED_ATOMIC) == counters["ncu_sass", "smsp__sass_inst_executed_op_shared_atom.sum"]


TOTALS = (E.ROUNDS, E.MERGES, E.TRIANGLES, E.TILES_TOUCHED, E.EMITS, E.SEGMENTS, E.CASE_A_WARPS, E.CASE_B_WARPS,
          E.CASE_C_WARPS)  # fmt: skip


@pytest.mark.parametrize(
    ("name", "release", "expected"),
    [
        ("bunny", "1.1", (78, 765, 32810, 8560, 76109, 4515, 983, 0, 56)),
        ("bunny", "nvdiffrast", (157, 928, 73279, 18947, 161669, 7090, 2167, 0, 137)),
        ("nearclip5k", "nvdiffrast", (48, 417, 767, 9907, 20946, 9907, 0, 43, 5)),
    ],
)
def test_totals_are_those_of_the_specification(shared, name, release, expected):
    _, (work,), _ = coarse(*gpu_input(shared, name, 1024, release))
    assert tuple(work.total(event) for event in TOTALS) == expected


def test_the_sweep_has_the_published_counters():
    """Section 9.1 at 16 pixels: the figures that the specification prints, to their last digit but one."""
    mesh = Scene.sweep(16.0, width=1024, height=768, seed=123).mesh
    setup, _, _ = triangle_setup(
        mesh.positions, mesh.triangles, 1024, 768, Simt(), release="1.1", depth=False, interpolate=False, counting=False
    )
    queues, _, binned = bin_raster(setup, 1024, 768, Simt())
    _, _, tiles = coarse_raster(queues, setup, 1024, 768, Simt())
    ratio = {name: n / max(d, 1) for name, (n, d) in (binned["counters"] | tiles["counters"]).items()}
    expected = {
        "BinRaster / Avg. triangles/round": 511.8,
        "BinRaster / Coverage single path": 52.8,
        "BinRaster / Coverage fast path": 47.2,
        "BinRaster / Segment allocs/round": 1.56,
        "CoarseRaster / Rounds / Bin": 47.4,
        "CoarseRaster / Tiles / Round": 137.3,
        "CoarseRaster / Emits / Round": 1391,
        "CoarseRaster / Allocs / Round": 46.3,
        "CoarseRaster / Emits / Triangle": 2.75,
        "CoarseRaster / Case A": 100,
    }
    assert {name: ratio[name] for name in expected} == pytest.approx(expected, rel=0.004)
