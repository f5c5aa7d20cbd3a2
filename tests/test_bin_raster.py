"""Bin raster: queues, events and the GPU's own figures."""

import csv

import numba
import numpy as np
import pytest

from tests.naive_bins import bin_queues, random_setup, rounds_of
from tilestamp.models.errors import TilestampError
from tilestamp.models.simt import Coalescing, Simt
from tilestamp.simulator.stages.laine2011.bin_raster import batch_size, bin_raster, initial_capacity
from tilestamp.simulator.stages.laine2011.bin_raster_events import BinRasterEvent
from tilestamp.simulator.stages.laine2011.triangle_setup import triangle_setup

E = BinRasterEvent
SCENES = [("bunny", 1024), ("bunny", 512), ("dragon100k", 512), ("teapot16k", 1024), ("soup2k", 512),
          ("nearclip5k", 1024), ("edges_512", 512)]  # fmt: skip


def split(queues):
    return [list(part) for part in np.split(queues.entries, queues.starts[1:-1])]


def small(seed=0, size=40, several=0.0, triangles=1300):
    return random_setup(np.random.default_rng(seed), triangles, 700, 400, size=size, several=several)


def measured(shared, name, width, kernel):
    """Counters of one kernel, by source and metric."""
    with (shared / "silicon/cudaraster.csv").open() as rows:
        return {
            (row["source"], row["metric"]): float(row["value"])
            for row in csv.DictReader(rows)
            if (row["scene"], row["W"], row["kernel"], row["variant"]) == (name, str(width), kernel, "as_published")
        }


def gpu_input(shared, name, width, release, simt=None):
    data = np.load(shared / f"silicon/ids/{name}_input.npz")
    height = width * 3 // 4
    setup = triangle_setup(data["positions"], data["triangles"], width, height, simt or Simt(), release=release)[0]
    return setup, width, height


@pytest.mark.parametrize("size", [8, 90, 500])
def test_queues_hold_what_the_naive_version_holds_in_its_order(size):
    setup = small(size=size)
    queues, _, _ = bin_raster(setup, 700, 400, Simt())
    assert split(queues) == bin_queues(setup, 700, 400)


def test_clipped_triangles_that_overflow_the_ring_are_read_again():
    setup = small(several=0.9)
    queues, (work,), facts = bin_raster(setup, 700, 400, Simt())
    overflows = rounds_of(setup)[1]
    assert overflows > 0
    assert facts["counters"]["BinRaster / Input overflows"] == (overflows, 0)
    assert split(queues) == bin_queues(setup, 700, 400)
    assert work.total(E.READ_LANES) > len(setup.subtriangles)


def test_every_batch_takes_a_round_even_when_nothing_is_visible():
    setup = small()._replace(subtriangles=np.zeros(1300, np.uint8))
    queues, (work,), _ = bin_raster(setup, 700, 400, Simt())
    assert (work.total(E.ROUNDS), work.total(E.BATCHES), len(queues.entries)) == (3, 3, 0)


def test_counting_changes_no_queue():
    setup = small(several=0.1)
    counted, plain = (bin_raster(setup, 700, 400, Simt(), counting=c)[0] for c in (True, False))
    assert np.array_equal(counted.entries, plain.entries)
    assert np.array_equal(counted.starts, plain.starts)


def test_results_do_not_depend_on_the_number_of_threads():
    setup, tables = small(triangles=6000), []
    for threads in (1, numba.get_num_threads()):
        before = numba.get_num_threads()
        numba.set_num_threads(threads)
        tables.append(bin_raster(setup, 700, 400, Simt()).works[0].table)
        numba.set_num_threads(before)
    assert np.array_equal(*tables)


def test_segments_are_closed_at_the_end_of_each_batch():
    setup = small()
    queues, (work,), facts = bin_raster(setup, 700, 400, Simt())
    assert work.total(E.SEGMENTS) == facts["num_bin_segments"] == -(-queues.batch_counts // 512).sum()


def test_each_block_draws_once_past_the_end():
    _, (work,), _ = bin_raster(small(), 700, 400, Simt())
    assert work.total(E.ATOMIC) == work.total(E.BATCHES) + 16 + work.total(E.ALLOC_ROUNDS)


def test_too_few_segments_are_reported_as_overflow():
    setup = small()
    needed = bin_raster(setup, 700, 400, Simt())[2]["num_bin_segments"]
    assert bin_raster(setup, 700, 400, Simt(), capacity=needed - 1)[2]["overflow"]
    assert not bin_raster(setup, 700, 400, Simt(), capacity=needed)[2]["overflow"]


def test_stream_totals_sum_to_the_queues():
    queues, _, _ = bin_raster(small(), 700, 400, Simt())
    assert np.array_equal(queues.stream_totals.sum(axis=1), np.diff(queues.starts))


@pytest.mark.parametrize(("triangles", "batch"), [(1, 512), (16384, 512), (69451, 2048), (5_000_000, 16384)])
def test_batch_size_gives_each_block_two_batches(triangles, batch):
    assert batch_size(triangles) == batch


def test_initial_capacity_is_the_originals():
    assert initial_capacity(1087716, 1024, 768) == 2125 + 256
    assert initial_capacity(100, 1024, 768) == 16 * 48 + 256


@pytest.mark.parametrize("size", [(2049, 10), (10, 0)])
def test_sizes_beyond_the_originals_are_refused(size):
    with pytest.raises(TilestampError, match="2048"):
        bin_raster(small(), *size, Simt())


def test_machines_without_ballots_are_refused():
    with pytest.raises(TilestampError, match=r"2\.0"):
        bin_raster(small(), 64, 64, Simt(coalescing=Coalescing.HALF_WARP_SEGMENTS))


@pytest.mark.parametrize(("name", "width"), SCENES)
def test_bins_hold_as_many_entries_as_on_the_gpu(shared, name, width):
    queues, _, facts = bin_raster(*gpu_input(shared, name, width, "nvdiffrast"), Simt())
    gpu = np.load(shared / f"silicon/ids/{name}_{width}.npz")["bintotal"].sum(axis=1)
    assert np.array_equal(np.diff(queues.starts), gpu)
    assert facts["num_bin_segments"] == measured(shared, name, width, "stats")["stats", "numBinSegs"]


@pytest.mark.parametrize(("name", "width"), SCENES)
def test_global_atomics_are_those_of_the_gpu(shared, name, width):
    _, (work,), _ = bin_raster(*gpu_input(shared, name, width, "nvdiffrast"), Simt())
    counters = measured(shared, name, width, "binRaster")
    assert work.total(E.ATOMIC) == counters["ncu_cold", "l1tex__t_requests_pipe_lsu_mem_global_op_atom.sum"]


@pytest.mark.parametrize("name", ["bunny", "soup2k"])
def test_shared_atomics_are_those_of_the_gpu(shared, name):
    _, (work,), _ = bin_raster(*gpu_input(shared, name, 1024, "nvdiffrast"), Simt())
    counters = measured(shared, name, 1024, "binRaster")
    assert work.total(E.SHARED_ATOMIC) == counters["ncu_sass", "smsp__sass_inst_executed_op_shared_atom.sum"]


TOTALS = (E.TRIANGLES, E.ROUNDS, E.BOX_BINS, E.SINGLE_LANES, E.FAST_LANES, E.SLOW_LANES, E.SEGMENTS, E.EMITS)


@pytest.mark.parametrize(
    ("name", "release", "expected"),
    [
        ("bunny", "1.1", (30587, 80, 32810, 6332, 24255, 0, 737, 32810)),
        ("bunny", "nvdiffrast", (68674, 136, 73279, 16190, 52484, 0, 900, 73279)),
        ("nearclip5k", "nvdiffrast", (331, 10, 854, 2, 41, 288, 369, 767)),
    ],
)
def test_totals_are_those_of_the_specification(shared, name, release, expected):
    _, (work,), _ = bin_raster(*gpu_input(shared, name, 1024, release), Simt())
    assert tuple(work.total(event) for event in TOTALS) == expected
