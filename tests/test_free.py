"""Free: the time with one thing free is that of a launch that never had it, or of units that are cut or level."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.pricing import NOTHING, bounds, schedule
from tests.pricing import launch_of as launch
from tests.test_schedule import work_cycles
from tests.test_time_properties import MACHINES, launches
from tilestamp.models.errors import TilestampError
from tilestamp.models.events import MachineEvent
from tilestamp.models.free import MACHINE_TERMS, SCHEDULE_TERMS, free_of, free_terms, without
from tilestamp.models.launch import PipeLaunch
from tilestamp.models.machine import altered, load_machine
from tilestamp.models.price import price
from tilestamp.models.traffic import Traffic, traffic

GTX480, H200 = load_machine("gtx480"), load_machine("h200")
ROUNDING = 1 + 1e-9
CAUSES = {  # of a term: the events that it is made of
    "issue": ("FP32", "CONTROL"),
    "shared": ("BANK_REPLAYS",),
    "l1": ("LOAD_BYTES",),
    "latency": ("CHAIN_LOAD", "CHAIN_ALU"),
    "atomics": ("ATOMIC_REQUESTS", "ATOMIC_CONFLICTS"),
}
EVENTS = {"FP32": 3000, "CONTROL": 200, "BANK_REPLAYS": 900, "LOAD_BYTES": 90000, "CHAIN_LOAD": 4, "CHAIN_ALU": 40}
EVENTS |= {"ATOMIC_REQUESTS": 20, "ATOMIC_CONFLICTS": 9}
MOVED = Traffic(4e7, 5e7, 0.5, 1e7)


def freed(what, machine, term, moved=NOTHING):
    """A launch with a term free."""
    if term in SCHEDULE_TERMS:
        return without([what], machine, [schedule(what, machine, moved)], term)[0]
    return schedule(what, free_of(machine, term), moved)


@pytest.mark.parametrize("term", CAUSES)
@pytest.mark.parametrize("dispatch", ["blocks", "warp_queue"])
def test_free_of_a_term_a_launch_takes_as_long_as_without_its_events(term, dispatch):
    machine = altered(GTX480, {"latency.block_launch_cycles": 0.0})
    rng = np.random.default_rng(1)
    what = launch(700, dispatch=dispatch, grid=60, **{name: n * rng.random(700) for name, n in EVENTS.items()})
    what = replace(what, atomic_requests=np.full(40, 30000))
    events = what.events.copy()
    events[:, [MachineEvent[name] for name in CAUSES[term]]] = 0.0
    never = replace(what, events=events, atomic_requests=None if term == "atomics" else what.atomic_requests)
    if term == "l1":  # what memory moves is shared among units by these bytes
        assert freed(what, machine, term).cycles == pytest.approx(schedule(never, machine, NOTHING).cycles)
    else:
        never_moved = replace(never, events=events)
        assert freed(what, machine, term, MOVED).cycles == pytest.approx(schedule(never_moved, machine, MOVED).cycles)


@pytest.mark.parametrize(("term", "left"), [("dram", Traffic(0.0, 5e8, 0.5, 1e8)), ("l2", Traffic(4e8, 0.0, 0.5))])
def test_free_of_a_bandwidth_a_launch_takes_as_long_as_without_its_bytes(term, left):
    what = launch(700, FP32=300, LOAD_BYTES=9000)
    assert freed(what, H200, term, Traffic(4e8, 5e8, 0.5, 1e8)).cycles == schedule(what, H200, left).cycles


def test_free_of_launch_and_of_start_only_those_are_gone():
    what, slow = launch(6000, FP32=10), altered(H200, {"launch.blocks_per_us": 1.0})
    now = schedule(what, slow, NOTHING)
    assert freed(what, slow, "launch").cycles == pytest.approx(now.cycles - now.term_cycles["launch"])
    fast = altered(H200, {"launch.blocks_per_us": 1e6})
    assert freed(what, slow, "start").cycles == pytest.approx(schedule(what, fast, NOTHING).cycles, rel=1e-2)


def test_free_of_balance_sixteen_blocks_take_as_long_as_132_of_a_share_each():
    few, many = launch(16, 512, FP32=10**6), launch(132, 512, FP32=10**6 * 16 / 132)
    assert work_cycles(freed(few, H200, "balance")) == pytest.approx(
        work_cycles(schedule(many, H200, NOTHING)), rel=0.01
    )


def test_free_of_balance_a_chain_is_shared_out_too_in_a_roofline():
    what = launch(16, 512, CHAIN_ALU=300000)
    now = bounds(what, H200, NOTHING)
    freed_ = without([what], H200, [now], "balance")[0]
    assert work_cycles(freed_) == pytest.approx(work_cycles(now) * 16 / 132)


def test_free_of_the_tail_units_that_all_begin_at_once_take_their_mean():
    chain = np.linspace(10000, 90000, 264)
    what = launch(264, CHAIN_ALU=chain)
    mean = launch(264, CHAIN_ALU=chain.mean())
    assert work_cycles(freed(what, H200, "tail")) == pytest.approx(work_cycles(schedule(mean, H200, NOTHING)), rel=0.01)


def test_free_of_the_tail_draws_still_pass_one_after_another():
    what = replace(launch(700, dispatch="block_queue", grid=60, ATOMIC_REQUESTS=1), atomic_requests=np.array([700000]))
    assert freed(what, H200, "tail").cycles == pytest.approx(schedule(what, H200, NOTHING).cycles, rel=0.01)


def test_balance_costs_nothing_where_every_sm_has_a_unit():
    what = launch(133, 512, FP32=10**6)
    assert freed(what, H200, "balance").cycles == schedule(what, H200, NOTHING).cycles


def test_free_of_the_tail_units_take_as_long_as_equal_ones():
    unlike = np.full(5280, 1000.0)
    unlike[-1] = 10**6
    alike = launch(5280, FP32=unlike.mean())
    assert schedule(launch(5280, FP32=unlike), H200, NOTHING).bound == "tail"
    assert work_cycles(freed(launch(5280, FP32=unlike), H200, "tail")) == pytest.approx(
        work_cycles(schedule(alike, H200, NOTHING)), rel=0.02
    )


def test_a_unit_of_the_fixed_function_pipe_can_be_free():
    pipe = PipeLaunch(stage="hardware", kernel="draw", items={"primitives": 1e6, "pixels": 1e5})
    alone = price([replace(pipe, items={"pixels": 1e5})], GTX480)[0]
    assert "primitives" in free_terms(GTX480)
    assert price([pipe], free_of(GTX480, "primitives"))[0].cycles == alone.cycles


@settings(deadline=None, max_examples=40)
@given(what=launches(), machine=st.sampled_from(MACHINES), term=st.sampled_from([*MACHINE_TERMS, *SCHEDULE_TERMS]))
def test_nothing_that_is_free_makes_a_launch_slower(what, machine, term):
    moved = traffic([what], machine)[0]
    try:
        now = schedule(what, machine, moved).cycles
    except TilestampError:
        return
    assert freed(what, machine, term, moved).cycles <= now * ROUNDING
