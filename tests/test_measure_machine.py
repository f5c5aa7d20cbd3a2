"""Machine files from measurements; what is said where there is no GPU."""

import importlib.util

import numpy as np
import pytest

from tilestamp.experiments.command_line import run_command
from tilestamp.experiments.validation.machine_file import busy, machine_file
from tilestamp.experiments.validation.measuring import CLASSES, Number
from tilestamp.experiments.validation.measuring_l2 import fetch_bytes, gap_lines, kept, lines
from tilestamp.experiments.validation.measuring_sm import SENT, between
from tilestamp.models.machine import load_machine

H200 = load_machine("h200")
NUMBERS = [
    Number("sm.count", 100, 0.0, "driver"),
    Number("latency.alu_cycles", 4.5, 0.01, "chain"),
    Number("memory.dram_gb_per_s", 900.0, 0.3, "reading"),
]
NO_GPU = importlib.util.find_spec("cupy") is None


@pytest.fixture
def machine(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(machine_file(NUMBERS, H200, "mine", "My GPU, measured", "9.0"))
    return load_machine(path)


def test_a_measured_number_says_so_with_its_spread(machine):
    kind, source = machine.provenance["latency.alu_cycles"]
    assert (kind, machine.latency.alu_cycles) == ("measured", 4.5)
    assert source == "tilestamp measure-machine: chain; spread 1.0 %"


def test_what_was_not_measured_is_assumed_and_named(machine):
    kind, source = machine.provenance["launch.kernel_us"]
    assert kind == "assumed"
    assert source == "as h200: not measured"


def test_the_measured_bandwidth_is_the_sustained_one(machine):
    assert machine.dram_bytes_per_cycle * machine.clock_hz == pytest.approx(900e9, rel=1e-3)


def test_numbers_whose_repeats_disagree_tell_of_a_busy_gpu():
    assert busy(NUMBERS) == ["memory.dram_gb_per_s"]


@pytest.mark.skipif(not NO_GPU, reason="CuPy is installed here")
@pytest.mark.parametrize("command", [["measure-machine", "-o", "mine.toml"], ["validate"]])
def test_without_cupy_one_sentence_says_what_to_install(command, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert run_command(command) == 2
    assert "pip install 'tilestamp[gpu]'" in capsys.readouterr().err


def test_a_file_that_is_no_toml_is_refused_before_anything_runs(capsys):
    assert run_command(["measure-machine", "-o", "mine.txt"]) == 2
    assert "should end in .toml" in capsys.readouterr().err


def test_a_block_follows_the_one_before_it_on_its_own_sm():
    rows = np.array([[1, 500, 600, 0], [0, 100, 200, 0], [0, 515, 700, 0], [1, 100, 190, 0], [0, 1000, 1100, 0]])
    assert between(rows).tolist() == [315, 300, 310]


def test_lines_in_part_are_what_single_sectors_take_beyond_their_bytes():
    """Ten clocks for 32 bytes in whole lines; a sector by itself takes fifteen: a line in five clocks."""
    assert lines(np.array([3.2]), np.array([32 / 15])).tolist() == pytest.approx([1 / 5])


def test_l2_keeps_what_is_not_fetched_twice_over():
    """1 us a MiB and 2 to start; 48 MiB take 28 us longer: 14 MiB are missed twice over at 1 MiB a microsecond."""
    times = {size << 20: 2.0 + size for size in (12, 18, 24)} | {48 << 20: 2.0 + 48 + 28}
    found = kept(times, 60 << 20, (1 << 20) / 1e3)
    assert found.value == pytest.approx(34 / 60)
    assert "48 MiB 78.00 us" in found.how


def test_an_l2_that_keeps_all_is_no_larger_than_it_is():
    assert kept({size << 20: 2.0 + size for size in (12, 18, 24, 48)}, 40 << 20, 1000.0).value == 1.0


def test_a_mixture_of_branches_and_uniform_instructions_is_taken_over():
    assert "control" not in CLASSES
    text = machine_file(NUMBERS, H200, "mine", "My GPU, measured", "9.0")
    assert f'control = {{ value = {H200.pipe.control}, provenance = "assumed"' in text


def test_what_one_sm_sends_is_apart_from_what_the_chip_takes():
    for key in SENT:
        section, name = key.split(".")
        assert getattr(getattr(H200, section), name) > 0
        assert H200.provenance[key][0] == "measured"
    assert H200.atomics.sm_requests_per_clock * H200.sm.count > H200.atomics.requests_per_clock


@pytest.mark.parametrize(("other_us", "bytes_"), [(119.0, 64), (62.0, 32)])
def test_a_miss_that_brings_in_two_sectors_takes_as_long_for_every_other_one(other_us, bytes_):
    found = fetch_bytes(120.0, other_us)
    assert (found.value, type(found.value)) == (bytes_, int)


def test_lines_with_gaps_take_what_is_not_the_fetch():
    """1000 lines are left of 640,000 bytes: 50 us, of which each fetches for 0.01: 25 a microsecond of 100 clocks."""
    assert gap_lines(10.0, 60.0, 640_000, 0.01, 100.0).value == pytest.approx(0.25)
    assert gap_lines(10.0, 10.0, 640_000, 0.01, 100.0).value == 0.0
