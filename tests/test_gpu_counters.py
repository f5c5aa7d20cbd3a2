"""What is read from the profiler and derived from micro-benchmarks, without a GPU."""

import pytest

from tilestamp.experiments.validation.measuring_memory import unit_bytes
from tilestamp.experiments.validation.profiler import EFFICIENCY, INSTRUCTIONS, LANES, counters, read_counters

CSV = f"""==PROF== Connected to process 7
"ID","Kernel Name","{LANES}","{INSTRUCTIONS}"
"","","inst","inst"
"0","tile_raster","1,600","100"
"1","tile_raster","3,200","100"
==PROF== Disconnected
"""


def test_each_launch_is_a_row_and_units_are_none():
    assert [row[INSTRUCTIONS] for row in read_counters(CSV)] == [100.0, 100.0]


def test_efficiency_is_lanes_over_instructions_and_lanes_a_warp():
    assert [row[EFFICIENCY] for row in read_counters(CSV)] == [0.5, 1.0]


def test_without_the_profiler_a_sentence_says_so(monkeypatch):
    monkeypatch.setenv("PATH", "")
    rows, why = counters()
    assert rows == []
    assert "ncu is not installed" in why


@pytest.mark.parametrize("size", [128, 512, 2048])
def test_padding_finds_the_bytes_of_a_unit(size):
    rates = {s: max(1.0, min(8.0, 8.0 * s / size)) for s in (32, 64, 128, 256, 512, 1024, 2048, 4096)}
    assert unit_bytes(rates, 1.0).value == size
