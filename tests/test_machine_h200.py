"""The description of the H200 against measurements that it was made from: atomics, loads while memory is busy."""

import csv
from pathlib import Path

import numpy as np
import pytest

from tests.pricing import bounds, schedule
from tilestamp.models.atomics import add_requests
from tilestamp.models.events import EVENTS, MachineEvent
from tilestamp.models.launch import Launch
from tilestamp.models.machine import load_machine
from tilestamp.models.traffic import Traffic

H200 = load_machine("h200")
SILICON = Path(__file__).parents[1] / "experiments" / "silicon" / "measured"
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


def waves():
    """Microseconds that grids of blocks took, by what a warp loads, block, dependent loads of each and grid."""
    with (SILICON / "loaded_latency.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if row["group"] == "waves"]
    return {
        (row["pattern"], int(row["case"].split()[0]), int(row["steps"]), int(row["count"])): float(row["value"])
        for row in rows
    }


def wave(pattern, block, steps, grid):
    """Instructions of a step: an address is mixed from the one before."""
    warps, sectors = block // 32, {"sector": 32, "line": 4, "quad": 16}[pattern]
    counts = {
        "INT32": 14 * steps + 8,
        "MUL32": 3 * steps,
        "CONTROL": 2 * steps + 4,
        "LOAD": steps,
        "LOAD_BYTES": 32 * sectors * steps,
    }
    events = np.zeros((grid, EVENTS))
    for name, count in counts.items():
        events[:, MachineEvent[name]] = warps * count
    events[:, MachineEvent.CHAIN_LOAD], events[:, MachineEvent.CHAIN_ALU] = steps, 22 * steps + 10
    moved = Traffic(0.0, float(events[:, MachineEvent.LOAD_BYTES].sum()), 0.0)
    moved = moved._replace(read_lines=moved.l2_bytes / 32 * (pattern == "sector"))
    about = {"stage": "s", "kernel": "k", "registers": 24, "shared_bytes": 56000 * (block == 128)}
    return schedule(Launch(grid=grid, block=block, events=events, **about), H200, moved)


def test_blocks_that_wait_for_memory_follow_each_other_as_slowly_as_measured():
    """Where memory would take twice as long as the places, a block stays 2.2 times as long as a lone one."""
    before = H200.launch.kernel_us + H200.latency.block_launch_cycles / H200.sm.clock_mhz
    ratios = {key: (1e3 * wave(*key).milliseconds - before) / us for key, us in waves().items()}
    several = [ratio for (_, block, _, grid), ratio in ratios.items() if grid > 132 * (8 if block == 256 else 4)]
    assert len(ratios) == 120
    assert np.abs(np.log(several)).mean() < 0.105
    assert np.abs(np.log(list(ratios.values()))).mean() < 0.12
