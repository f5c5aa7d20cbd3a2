"""Machine files: every number has a provenance, and a bad file is refused in a sentence."""

import re

import numpy as np
import pytest

from tests.drawable import scene_for
from tilestamp import simulate
from tilestamp.models.errors import TilestampError
from tilestamp.models.machine import FOLDER, altered, list_machines, load_machine
from tilestamp.models.simt import AtomicMerge, Coalescing
from tilestamp.simulator.launchable import able_machines
from tilestamp.simulator.mix import load_mix
from tilestamp.simulator.pipelines import pipeline_names, pipeline_options


@pytest.fixture
def edited(tmp_path):
    """Write gtx280.toml with some text replaced; give the path."""

    def edit(old, new):
        text = (FOLDER / "gtx280.toml").read_text("utf-8")
        assert old in text
        path = tmp_path / "mine.toml"
        path.write_text(text.replace(old, new, 1), "utf-8")
        return path

    return edit


@pytest.mark.parametrize("name", list(list_machines()))
def test_every_number_has_a_source(name):
    machine = load_machine(name)
    assert all(source for _, source in machine.provenance.values())


@pytest.mark.parametrize("name", list(list_machines()))
def test_a_machine_bears_the_name_of_its_file(name):
    assert load_machine(name).name == name


CARDS = {
    "gtx980": "5.2",
    "gtx1080": "6.1",
    "rtx2080ti": "7.5",
    "a100": "8.0",
    "rtx3080": "8.6",
    "rtx4090": "8.9",
    "b200": "10.0",
    "rtx5090": "12.0",
}


@pytest.mark.parametrize(("name", "capability"), CARDS.items())
def test_there_is_a_card_of_each_generation(name, capability):
    assert load_machine(name).compute_capability == capability


@pytest.mark.parametrize("name", CARDS)
@pytest.mark.parametrize("pipeline", pipeline_names())
def test_a_card_prices_every_pipeline(name, pipeline):
    run = simulate(scene_for(pipeline), pipeline, name, width=48, height=36, picture=False)
    assert 0.0 < run.milliseconds < 10.0


def test_a_newer_card_draws_a_frame_sooner():
    order = ["gtx980", "gtx1080", "rtx3080", "rtx4090"]
    times = [simulate("teapot", "micropolygon", name, width=320, height=240).milliseconds for name in order]
    assert times == sorted(times, reverse=True)


def test_a_number_keeps_its_provenance():
    machine = load_machine("gtx280")
    assert machine.sm.count == 30
    assert machine.provenance["sm.count"][0] == "published"


def test_gt200_counts_by_half_warps():
    simt = load_machine("gtx280").simt
    assert (simt.coalescing, simt.bank_lanes, simt.atomic_merge) == (
        Coalescing.HALF_WARP_SEGMENTS,
        16,
        AtomicMerge.NONE,
    )


def test_h200_numbers_are_those_of_the_measurements(shared):
    """The file says 'microbenchmarks.csv run4: GROUP CASE [METRIC]': look a plain one up."""
    rows = [line.split(",") for line in (shared / "silicon" / "microbenchmarks.csv").read_text().splitlines()]
    value = {row[2]: float(row[4]) for row in rows if row[5] == "run4" and row[1] == "latency"}
    machine = load_machine("h200")
    assert machine.latency.shared_cycles == pytest.approx(value["ld_shared"], rel=0.01)
    assert machine.latency.dram_cycles == pytest.approx(value["ld_cg_1.04858e+06KiB"], rel=0.01)
    assert machine.latency.atomic_cycles == pytest.approx(value["atom_global_add"], rel=0.01)


def test_a_file_of_the_user_is_read_by_its_path(edited):
    path = edited('name = "gtx280"', 'name = "mine"')
    assert load_machine(path).name == "mine"


def test_an_unknown_machine_is_refused_with_the_nearest_name():
    with pytest.raises(TilestampError, match="did you mean 'gtx280'"):
        load_machine("gtx290")


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(TilestampError, match=re.escape("none.toml")):
        load_machine(tmp_path / "none.toml")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("max_warps", "max_warp", r"unknown key of \[sm\] 'max_warp' \(did you mean 'max_warps'"),
        ("[memory]", "[memry]", r"unknown section 'memry' \(did you mean 'memory'"),
        ("max_blocks = {", "# max_blocks = {", r"missing key of \[sm\] 'max_blocks'"),
        ("count = {", "count = 30 #", "sm.count must be written"),  # a number without provenance
        ("count = { value = 30,", 'count = { value = "many",', "sm.count"),
        ("dram_efficiency = { value = 0.8", "dram_efficiency = { value = 1.8", "dram_efficiency"),
        ("max_warps = { value = 32", "max_warps = { value = 48", "contradicts itself: 48 warps of 32"),
        (
            "banks = {",
            'bank_mode_bytes = { value = 8, provenance = "assumed", source = "test" }\nbanks = {',
            "words of 8 bytes do not fit banks of 4",
        ),
    ],
)
def test_what_is_wrong_with_a_machine_file_is_a_sentence(edited, old, new, said):
    with pytest.raises(TilestampError, match=said):
        load_machine(edited(old, new))


def test_a_broken_file_is_refused(tmp_path):
    path = tmp_path / "broken.toml"
    path.write_text("[sm\n")
    with pytest.raises(TilestampError, match="not a TOML file"):
        load_machine(path)


def test_a_what_if_says_what_it_is():
    machine = altered(load_machine("gtx280"), {"sm.clock_mhz": 2592.0}, "assumed", "twice the clock")
    assert machine.sm.clock_mhz == 2592.0
    assert machine.provenance["sm.clock_mhz"] == ("assumed", "twice the clock")


def test_a_what_if_has_another_digest():
    machine = load_machine("gtx280")
    assert altered(machine, {"atomics.conflict_ns": 1.0}, "fitted", "test").digest != machine.digest


def test_a_what_if_of_an_unknown_number_is_refused():
    with pytest.raises(TilestampError, match=r"did you mean 'sm\.clock_mhz'"):
        altered(load_machine("gtx280"), {"sm.clok_mhz": 1.0}, "assumed", "test")


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("sm.count", 10**9, "sm.count is 1000000000, and no machine has that: it is a whole number from 1 to 65,536"),
        ("memory.dram_gb_per_s", float("inf"), "memory.dram_gb_per_s is inf, .* a number from 0.001 to 1,000,000"),
        ("sm.clock_mhz", float("nan"), "sm.clock_mhz is nan"),
        ("issue.fp32", 0, "issue.fp32 is 0, .* from 0.015625 to 10,000"),
        ("sm.schedulers", 1.5, "sm.schedulers is 1.5, .* a whole number"),
        ("sm.count", "many", "sm.count is 'many', .* a whole number from 1 to 65,536"),
        ("sm.count", True, "sm.count is True"),
        ("sm.clock_mhz", 10**400, r"sm.clock_mhz is 10+\.\.\.0+, and no machine has that"),
        ("memory.dram_efficiency", 0, "memory.dram_efficiency is 0, .* a number above 0 to 1"),
        ("fixed_function.per_clock.primitives", 0, "per_clock.primitives is 0, .* a number from 0.001 to 1,000,000"),
    ],
)
def test_a_number_that_no_machine_has_is_refused_with_its_range(key, value, said):
    with pytest.raises(TilestampError, match=said):
        altered(load_machine("gtx280"), {key: value}, "assumed", "test")


@pytest.mark.parametrize("key", ["sm", "sm.count.x", "", "digest", "provenance.sm", "fixed_function.per_clock", 3])
def test_what_is_no_number_of_a_machine_cannot_be_altered(key):
    with pytest.raises(TilestampError, match="is no number of a machine"):
        altered(load_machine("gtx280"), {key: 3}, "assumed", "test")


def test_a_choice_of_whole_numbers_takes_whole_floats():
    assert altered(load_machine("gtx680"), {"memory.bank_mode_bytes": 4.0}, "assumed", "").memory.bank_mode_bytes == 4


def test_numbers_of_numpy_and_whole_floats_are_numbers():
    values = {"sm.count": np.array(31), "sm.clock_mhz": np.float32(1300), "sm.max_warps": 32.0}
    machine = altered(load_machine("gtx280"), values, "assumed", "test")
    assert (machine.sm.count, machine.sm.clock_mhz, machine.sm.max_warps) == (31, 1300.0, 32)
    assert (
        machine.digest
        == altered(load_machine("gtx280"), {"sm.count": 31, "sm.clock_mhz": 1300.0}, "assumed", "test").digest
    )


def test_a_warp_of_another_size_issues_as_many_lanes_a_clock():
    """Eight lanes a clock on a GTX 280; on an H200 no warp instruction issues in less than a clock."""
    shape = {"sm.warp_size": 16, "memory.bank_lanes": 16}
    old, new = (altered(load_machine(name), shape, "assumed", "test") for name in ("gtx280", "h200"))
    assert (old.issue.fp32, old.pipe.sfu) == (2.0, 8.0)
    assert (new.issue.fp32, new.pipe.sfu) == (1.0, 8.013 / 2)
    given = altered(load_machine("gtx280"), {"sm.warp_size": 16, "issue.fp32": 3.0}, "assumed", "test")
    assert (given.issue.fp32, given.issue.int32) == (3.0, 2.0)


@pytest.mark.parametrize("capability", ["abc", "9", "9.0a", ""])
def test_a_compute_capability_is_two_numbers(capability, edited):
    with pytest.raises(TilestampError, match=r"identity\.compute_capability is .*, not a text of two numbers"):
        load_machine(edited('compute_capability = "1.3"', f'compute_capability = "{capability}"'))


def test_a_machine_may_have_a_name_that_no_file_can_have(edited):
    assert load_machine(edited('name = "gtx280"', f'name = "{"x" * 300}"')).name == "x" * 300


@pytest.mark.parametrize("name", list_machines())
def test_shared_memory_has_the_banks_of_its_generation(name):
    machine = load_machine(name)
    first = machine.compute_capability.startswith("1.")
    assert (machine.memory.banks, machine.memory.bank_lanes) == ((16, 16) if first else (32, 32))


@pytest.mark.parametrize("name", [name for name in pipeline_names() if name != "hardware"])
def test_a_machine_that_may_run_a_pipeline_has_the_registers_of_all_its_kernels(name):
    """Else a frame is executed, and refused only when it is priced."""
    for machine in map(load_machine, able_machines(name, pipeline_options(name, {}))):
        kernels = load_mix(name, machine.compute_capability).kernels.values()
        assert max(kernel.registers for kernel in kernels) <= machine.sm.max_registers_per_thread, machine.name
