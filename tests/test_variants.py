"""Machines of columns: made when they are looked at, and the same as those that ``altered`` makes one by one."""

import numpy as np
import pytest

from tilestamp import TilestampError, altered, load_machine, variants
from tilestamp.models.numbers import numbers_of
from tilestamp.models.used import collect
from tilestamp.models.variants import Variants

MACHINE = load_machine("h200")
NUMBERS = {"sm.clock_mhz": np.array([900, 1500, 1200]), "memory.dram_gb_per_s": np.array([100.5, 100.0, 200.0])}
EACH = [altered(MACHINE, {key: column[place] for key, column in NUMBERS.items()}) for place in range(3)]


def test_machines_are_made_when_they_are_looked_at():
    got = variants(MACHINE, NUMBERS)
    assert isinstance(got, Variants)
    assert list(got) == EACH
    assert [machine.name for machine in got[1:]] == [machine.name for machine in EACH[1:]]


def test_priced_numbers_are_those_of_the_machines():
    got = variants(MACHINE, NUMBERS)[np.array([2, 0])]
    assert got.numbers.tolist() == numbers_of([EACH[2], EACH[0]]).tolist()


@pytest.mark.parametrize("key", NUMBERS)
def test_a_number_that_no_machine_has_is_refused_at_once(key):
    for wrong in (-1.0, np.nan, 1e300):
        with pytest.raises(TilestampError, match=f"{key} is"):
            variants(MACHINE, NUMBERS | {key: [1.0, wrong, 2.0]})


@pytest.mark.parametrize("key", ["latency.l2_cycles", "memory.l2_bytes_per_clock"])
def test_an_l2_without_a_rate_is_refused_at_once(key):
    with pytest.raises(TilestampError, match="contradicts itself"):
        variants(MACHINE, {key: [1.0, 0.0]})


@pytest.mark.parametrize("key", ["sm.count", "memory.l2_kept_share", "atomics.unit_ns_per_request"])
def test_machines_are_made_at_once_where_more_than_prices_depends_on_a_number(key):
    value = MACHINE.number(key)
    assert variants(MACHINE, {key: [value, value]}) == [altered(MACHINE, {key: value})] * 2


def test_whoever_collects_learns_of_each_machine():
    with collect() as found:
        variants(MACHINE, NUMBERS)
    assert set(found["machines"]) == {machine.name for machine in EACH}


def test_a_column_that_is_changed_later_changes_no_machine():
    clocks = np.array([900.0, 1500.0])
    got = variants(MACHINE, {"sm.clock_mhz": clocks})
    clocks[:] = -1.0
    assert [machine.sm.clock_mhz for machine in got] == [900.0, 1500.0]


def test_they_say_in_a_line_what_they_are():
    got = repr(variants(MACHINE, NUMBERS))
    assert got == "3 machines: h200 with other sm.clock_mhz, memory.dram_gb_per_s"


def test_no_columns_are_no_machines():
    assert list(variants(MACHINE, {})) == list(variants(MACHINE, {"sm.clock_mhz": []})) == []
