"""Prices of one run on many machines: each is that of one machine, and what no machine can price is said."""

import re
from contextlib import suppress
from dataclasses import replace
from functools import reduce

import numpy as np
import pandas as pd
import pytest

from tests.drawable import scene_for
from tilestamp import TilestampError, altered, load_machine, simulate, variants
from tilestamp.simulator.pipelines import pipeline_names

SMALL = {"width": 96, "height": 72}
NUMBERS = {"sm.clock_mhz": [900.0, 1500.0, 1500.0], "memory.dram_gb_per_s": [100.0, 100.0, 200.0]}


@pytest.fixture(scope="module")
def run():
    return simulate("teapot", "micropolygon", "h200", **SMALL)


def test_prices_are_those_of_one_machine_at_a_time(run):
    machines = ["h200", "a100", altered(run.machine, {"sm.clock_mhz": 1000.0})]
    got = run.prices(machines)
    for place, machine in enumerate(machines):
        timings = run.on(machine).timings
        for name in ("milliseconds", "low", "high"):
            assert getattr(got, name)[place].tolist() == [getattr(timing, name) for timing in timings]
        assert got.bounds[place].tolist() == [timing.bound for timing in timings]
        assert got.frame[place] == pytest.approx(run.on(machine).milliseconds, rel=1e-14)
    assert got.kernels == tuple(timing.kernel for timing in run.timings)


def test_a_machine_of_another_mix_is_priced_by_that(run):
    """Instructions of the back end are those of 9.0 on an H200, and older ones on an A100."""
    fresh = replace(run, frame=replace(run.frame)).on("a100")
    assert fresh.launches[-1].events.sum() != run.launches[-1].events.sum()
    assert run.prices(["h200", "a100"]).milliseconds[1].tolist() == [timing.milliseconds for timing in fresh.timings]


@pytest.mark.parametrize("numbers", [NUMBERS, pd.DataFrame(NUMBERS)])
def test_numbers_of_many_machines_are_taken_as_columns(run, numbers):
    got = run.prices(numbers)
    assert [machine.sm.clock_mhz for machine in got.machines] == NUMBERS["sm.clock_mhz"]
    assert got.frame.tolist() == run.prices(list(variants(run.machine, NUMBERS))).frame.tolist()


def test_no_machines_of_many_have_no_prices(run):
    got = run.prices(variants(run.machine, NUMBERS)[3:])
    assert got.milliseconds.shape == (0, len(run.timings))
    assert got.table().empty


def test_a_lone_number_is_that_of_all_machines(run):
    machines = variants(run.machine, NUMBERS | {"memory.l2_bytes": 10**6})
    assert [machine.memory.l2_bytes for machine in machines] == [10**6] * 3


def test_columns_of_unequal_length_are_refused(run):
    with pytest.raises(TilestampError, match=r"one length, not sm.clock_mhz \(3,\), sm.count \(2,\)"):
        variants(run.machine, {"sm.clock_mhz": [1.0, 2.0, 3.0], "sm.count": [1, 2]})


def test_a_table_has_a_row_for_each_machine_and_stage(run):
    got = run.prices(["h200", "a100"])
    table = got.table()
    assert len(table) == 2 * len(set(got.stages))
    assert table[table.machine == 0].set_index("stage").milliseconds.tolist() == pytest.approx(
        run.stages["milliseconds"].tolist()
    )


def test_a_machine_without_a_price_is_refused_or_skipped(run):
    machines = [altered(run.machine, {"sm.max_threads_per_block": 32}), load_machine("gtx280"), run.machine]
    with pytest.raises(TilestampError, match="launches at most 32 threads"):
        run.prices(machines)
    got = run.prices(machines, skip=True)
    assert list(got.refusals) == [0, 1]
    assert "simulate again on it" in got.refusals[1]
    assert np.isnan(got.frame[:2]).all()
    assert got.frame[2] == pytest.approx(run.milliseconds)


def test_columns_of_a_machine_without_a_price_say_so_of_each(run):
    got = run.prices(variants(load_machine("gtx280"), NUMBERS), skip=True)
    assert ["sm.clock_mhz=1500.0, memory.dram_gb_per_s=200.0" in got.refusals[place] for place in range(3)] == [
        False,
        False,
        True,
    ]


PIPELINES = [(name, machine) for name in pipeline_names() for machine in ("gtx280", "gtx680", "h200")]


@pytest.fixture(scope="module", params=PIPELINES, ids=" ".join)
def changed(request):
    """A small frame, and its machine with each of its numbers changed by itself, some twice."""
    name, machine = request.param
    try:
        run = simulate(scene_for(name), name, machine, **SMALL)
    except TilestampError as refused:
        pytest.skip(str(refused))
    return run, [other for key in run.machine.provenance for other in _others(run.machine, key)]


def _others(machine, key):
    """The machine with one number larger and one smaller, where a machine can have such."""
    value = reduce(
        lambda part, step: part[step] if isinstance(part, dict) else getattr(part, step), key.split("."), machine
    )
    for ratio in (0.5, 2.0):
        with suppress(TilestampError):
            if isinstance(value, int | float):
                yield altered(machine, {key: type(value)(value * ratio)})


def test_whatever_number_changes_many_machines_are_priced_as_each_alone(changed):
    """Shared work is of no other machine: in this order each machine comes between two that differ from it."""
    run, machines = changed
    got = run.prices([*machines, *reversed(machines)], skip=True)
    for place, machine in enumerate(machines):
        twin = 2 * len(machines) - 1 - place
        if place in got.refusals:
            with pytest.raises(TilestampError, match=re.escape(got.refusals[place])):
                run.on(machine).timings  # noqa: B018 - raises
            continue
        alone = [timing.milliseconds for timing in run.on(machine).timings]
        assert got.milliseconds[place].tolist() == alone == got.milliseconds[twin].tolist(), machine.name
