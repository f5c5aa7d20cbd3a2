"""The description of the H200 against the measurements that it was made from: atomics of whole launches."""

import csv

import numpy as np
import pytest

from tests.pricing import bounds
from tilestamp.models.atomics import add_requests
from tilestamp.models.events import EVENTS, MachineEvent
from tilestamp.models.launch import Launch
from tilestamp.models.machine import load_machine
from tilestamp.models.traffic import Traffic

H200 = load_machine("h200")
WARPS = 2048


def random_words(count, spacing=4):
    return np.random.default_rng(0).integers(0, count, (WARPS, 32)) * spacing


def same_for_all_warps(lanes):
    return np.tile(lanes, (WARPS, 1))


def giga_per_second(addresses):
    """Lane atomics that the model says run in a nanosecond."""
    addresses = addresses.astype(np.int64)
    chunks = np.zeros(addresses.max() // 32 + 1, np.int64)
    for warp in addresses:
        add_requests(warp, 32, H200.simt.atomic_merge, 0, chunks)
    events = np.zeros((1, EVENTS))
    events[0, MachineEvent.ATOMIC_REQUESTS] = chunks.sum()
    events[0, MachineEvent.CHAIN_ATOMIC] = 1  # the value returned is awaited
    launch = Launch(
        stage="stage",
        kernel="kernel",
        grid=1,
        block=32,
        registers=16,
        shared_bytes=0,
        events=events,
        atomic_requests=chunks,
    )
    terms = bounds(launch, H200, Traffic(0.0, 0.0, 1.0)).term_cycles
    return addresses.size / max(terms["atomic"], terms["queue"]) * H200.clock_hz * 1e-9


@pytest.fixture(scope="module")
def measured(shared):
    with (shared / "silicon" / "microbenchmarks.csv").open() as file:
        return {row["case"]: float(row["value"]) for row in csv.DictReader(file) if _is_rate(row)}


def _is_rate(row):
    return row["run"] == "run4" and row["group"].startswith("gatomic") and row["metric"] == "Gops_per_s"


@pytest.mark.parametrize("count", [1, 32, 1000, 10000, 100000, 1000000])
def test_random_counters_run_as_fast_as_measured(measured, count):
    assert giga_per_second(random_words(count)) == pytest.approx(measured[f"atom_add_u32_random_{count}"], rel=0.3)


@pytest.mark.parametrize("spacing", [4, 8, 16, 32])
def test_counters_like_those_of_304_tiles_run_as_fast_as_measured(measured, spacing):
    ours = giga_per_second(random_words(304, spacing))
    assert ours == pytest.approx(measured[f"atom_random304_spacing{spacing}B"], rel=0.3)


@pytest.mark.parametrize("words", [1, 4, 8, 32])
def test_words_shared_by_all_warps_run_as_fast_as_measured(measured, words):
    ours = giga_per_second(same_for_all_warps(np.arange(32) % words * 4))
    assert ours == pytest.approx(measured[f"atom_add_u32_allwarps_stride4_k{words}"], rel=0.3)


@pytest.mark.parametrize("spacing", [4, 32, 64, 128])
def test_addresses_spread_over_lines_run_as_fast_as_measured(measured, spacing):
    ours = giga_per_second(same_for_all_warps(np.arange(32) * spacing))
    assert ours == pytest.approx(measured[f"atom_32addr_allwarps_spacing{spacing}B"], rel=0.3)
