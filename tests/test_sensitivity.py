"""Sensitivity: each figure against a run priced by hand, and against what a time of the first degree must keep."""

import numpy as np
import pytest

from tilestamp import TilestampError, altered, load_machine, simulate
from tilestamp.simulator.sensitivity import FRAME, NEAR
from tilestamp.simulator.why import movers, sentences

COSTS = ("issue", "pipe", "latency", "memory.bank_pass", "atomics.unit_ns", "atomics.conflict", "launch.kernel")
RATES = ("sm.clock_mhz", "memory.dram_gb_per_s", "launch.blocks_per_us", "fixed_function.clock_mhz")
NOT_RATES = ("sm.clock_mhz", "fixed_function.clock_mhz", "memory.dram_efficiency", "memory.loaded_latency")  # or ratios


@pytest.fixture(scope="module", params=["gtx280", "h200"])
def run(request):
    return simulate("teapot", machine=request.param, width=160, height=120, picture=False)


@pytest.fixture(scope="module")
def found(run):
    return run.sensitivity()


def by_hand(run, key, value):
    """Milliseconds by stage on a machine with another number."""
    other = run.on(altered(run.machine, {key: value}))
    return other.stages["milliseconds"].to_dict() | {FRAME: other.milliseconds}


def rows_of(found, key):
    return found.numbers[found.numbers["number"] == key].set_index("stage")


@pytest.mark.parametrize("key", ["sm.clock_mhz", "latency.dram_cycles", "launch.kernel_us"])
def test_an_elasticity_is_the_slope_between_two_runs_priced_by_hand(run, found, key):
    low, high = (by_hand(run, key, run.machine.number(key) * (1 + change)) for change in (-NEAR, NEAR))
    for stage, row in rows_of(found, key).iterrows():
        slope = np.log(high[stage] / low[stage]) / np.log((1 + NEAR) / (1 - NEAR))
        assert row["elasticity"] == pytest.approx(slope, abs=1e-9)


@pytest.mark.parametrize(("key", "step"), [("sm.count", None), ("sm.schedulers", 1)])
def test_a_whole_number_steps_and_has_no_elasticity(run, found, key, step):
    value = run.machine.number(key)
    after = by_hand(run, key, value + (step or round(value / 10)))
    for stage, row in rows_of(found, key).iterrows():
        assert np.isnan(row["elasticity"])
        assert row["more"] == pytest.approx(after[stage] / found.free["now"][stage])


@pytest.mark.parametrize("key", ["sm.register_unit", "memory.dram_fetch_bytes"])
def test_what_hardware_has_in_powers_of_two_is_halved_and_doubled(run, found, key):
    if key.startswith("memory") and not run.machine.memory.l2_bytes:
        pytest.skip(f"{run.machine.name} has no L2")
    row, value = rows_of(found, key).loc[FRAME], run.machine.number(key)
    assert [row["lower"], row["higher"]] == [value // 2, value * 2]


def test_costs_and_rates_add_up_to_one(found):
    """A time is of the first degree in all its costs, so 1 % of all of them is 1 % of it."""
    table = found.numbers.dropna(subset="elasticity")
    costs = table[~table["number"].isin(NOT_RATES)]
    sign = np.where(costs["number"].str.startswith(COSTS), 1.0, -1.0)
    sums = (costs["elasticity"] * sign).groupby(costs["stage"]).sum()
    assert sums.to_numpy() == pytest.approx(1.0, abs=0.03)


def test_the_rates_of_clock_memory_and_launches_add_up_to_minus_one(found):
    """All that is not counted in cycles, and the clock: half of every pace is twice the time."""
    table = found.numbers[
        found.numbers["number"].isin((*RATES, "launch.kernel_us", "atomics.unit_ns_per_request", "atomics.conflict_ns"))
    ]
    sign = np.where(table["number"].str.startswith(COSTS), -1.0, 1.0)
    sums = (table["elasticity"] * sign).groupby(table["stage"]).sum()
    assert sums.to_numpy() == pytest.approx(-1.0, abs=0.03)


def test_every_number_of_the_machine_is_changed_fixed_or_zero(run, found):
    known = {*found.numbers["number"], *found.fixed, *found.zero}
    numbers = {key for key in run.machine.provenance if not isinstance(run.machine.number(key), str)}
    assert known == numbers
    assert "sm.warp_size" in found.fixed


def test_a_number_at_its_limit_is_changed_on_one_side():
    whole = altered(load_machine("gtx280"), {"memory.dram_efficiency": 1.0})
    run = simulate("teapot", machine=whole, width=64, height=48, picture=False)
    rows = rows_of(run.sensitivity(), "memory.dram_efficiency")
    assert rows["more"].isna().all()
    assert rows.loc[FRAME, "less"] > 1.0
    assert rows.loc[FRAME, "elasticity"] < 0.0


def test_the_sms_of_persistent_kernels_are_fixed():
    run = simulate("teapot", pipeline="cudaraster", machine="gtx480", width=64, height=48, picture=False)
    assert "sm.count" in run.sensitivity().fixed


def test_what_holds_is_what_takes_most_off_if_it_is_free(found):
    for stage, row in found.limits.iterrows():
        assert row["without"] == found.free.loc[stage].min()
        assert row["holds"] == found.free.loc[stage].idxmin()


def test_a_sentence_names_what_holds_and_the_number_that_moves_it_most(found):
    for stage, sentence in sentences(found).items():
        assert f"held by {found.limits.loc[stage, 'holds']} (" in sentence
        best = movers(found.numbers[found.numbers["stage"] == stage])
        assert f"moved most by {best.iloc[0]['number']} " in sentence


def test_movers_compare_a_doubled_number_with_one_a_tenth_higher(found):
    """A scheduler more doubles them: that counts for its own size, not for 10 %."""
    table = found.numbers.iloc[:2].assign(
        value=[1.0, 10.0], lower=[0.0, 9.0], higher=[2.0, 11.0], less=np.nan, more=[0.8, 0.91], number=["a", "b"]
    )
    assert list(movers(table)["number"]) == ["b", "a"]


def test_counts_alone_have_no_sensitivity():
    run = simulate("teapot", width=64, height=48, fidelity="counts", picture=False)
    with pytest.raises(TilestampError, match="no time"):
        run.sensitivity()
