"""Schedule: times of launches against rooflines and against what must be so."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.pricing import GTX280, H200, NOTHING, bounds, schedule
from tests.pricing import launch_of as launch
from tilestamp.models.events import EVENTS, MachineEvent
from tilestamp.models.launch import Launch
from tilestamp.models.machine import altered, load_machine
from tilestamp.models.traffic import Traffic

COLUMNS = ("FP32", "SHARED", "CHAIN_LOAD", "LOAD_BYTES", "ATOMIC_REQUESTS")


def work_cycles(got):
    return got.cycles - got.term_cycles["launch"]


@pytest.mark.parametrize("machine", [GTX280, H200], ids=lambda machine: machine.name)
@pytest.mark.parametrize(
    "events",
    [{"FP32": 40000}, {"SHARED": 20000}, {"CHAIN_LOAD": 300}, {"LOAD_BYTES": 200000}, {"ATOMIC_REQUESTS": 300}],
    ids=lambda events: next(iter(events)),
)
def test_many_equal_units_take_what_the_roofline_says(machine, events):
    units = 132 * 32 * 5 if machine is H200 else 30 * 8 * 40
    what = launch(units, **events)
    moved = Traffic(events.get("LOAD_BYTES", 0) * units, 0.0, 1.0)
    assert schedule(what, machine, moved).cycles == pytest.approx(bounds(what, machine, moved).cycles, rel=0.03)


@settings(deadline=None, max_examples=60)
@given(
    units=st.integers(1, 400),
    seed=st.integers(0, 10**6),
    dispatch=st.sampled_from(["blocks", "block_queue", "warp_queue"]),
    machine=st.sampled_from([GTX280, H200]),
)
def test_a_schedule_is_never_faster_than_the_roofline(units, seed, dispatch, machine):
    draw = np.random.default_rng(seed)
    what = launch(units, 96, dispatch=dispatch, grid=40, **{name: draw.exponential(2000, units) for name in COLUMNS})
    moved = Traffic(float(draw.exponential(10**7)), 0.0, 1.0)
    assert schedule(what, machine, moved).cycles >= bounds(what, machine, moved).cycles * (1 - 1e-9)


def test_sixteen_blocks_leave_116_of_132_sms_idle():
    got = schedule(launch(16, 512, FP32=10**6), H200, NOTHING)
    assert got.details["busy_sms"] == 16
    assert got.bound == "balance"


def test_sixteen_blocks_take_as_long_as_132():
    few = schedule(launch(16, 512, FP32=10**6), H200, NOTHING)
    many = schedule(launch(132, 512, FP32=10**6), H200, NOTHING)
    assert few.cycles == pytest.approx(many.cycles, rel=0.01)


def test_one_block_more_than_the_sms_hold_at_a_time_takes_twice_as_long():
    """One block of 20 warps and 48 KB an SM: 15 run together on a GTX 480, the 16th after them."""
    machine = load_machine("gtx480")
    events = np.full((15, EVENTS), 1000.0)
    full = Launch(stage="fine", kernel="k", grid=15, block=640, registers=48, shared_bytes=48384, events=events)
    more = replace(full, grid=16, events=np.full((16, EVENTS), 1000.0))
    ratio = work_cycles(schedule(more, machine, NOTHING)) / work_cycles(schedule(full, machine, NOTHING))
    assert ratio == pytest.approx(2, rel=0.02)


def test_one_huge_unit_sets_the_time():
    work = np.full(5000, 100.0)
    work[-1] = 10**6
    got = schedule(launch(5000, FP32=work), GTX280, NOTHING)
    alone = schedule(launch(1, FP32=10**6), GTX280, NOTHING)
    assert got.bound == "tail"
    assert alone.cycles <= got.cycles <= 1.1 * alone.cycles


def test_a_huge_unit_that_starts_first_costs_less_than_one_that_starts_last():
    work = np.full(5000, 1000.0)
    work[0] = 10**6
    first = schedule(launch(5000, FP32=work), GTX280, NOTHING)
    last = schedule(launch(5000, FP32=work[::-1]), GTX280, NOTHING)
    assert first.cycles < last.cycles


def test_doubling_the_clock_halves_an_issue_bound_launch():
    once = altered(GTX280, {"launch.kernel_us": 0.0}, "assumed", "test")
    twice = altered(once, {"sm.clock_mhz": 2592.0}, "assumed", "test")
    what = launch(3000, FP32=np.random.default_rng(1).exponential(50000, 3000))
    ratio = schedule(what, twice, NOTHING).milliseconds / schedule(what, once, NOTHING).milliseconds
    assert ratio == pytest.approx(0.5, rel=0.01)  # blocks still start at the same rate in microseconds


def test_resident_blocks_hide_each_others_latency():
    """Eight blocks that wait and compute half of the time each take little more than their instructions."""
    alone = schedule(launch(30, FP32=1000, CHAIN_LOAD=18), GTX280, NOTHING)
    together = schedule(launch(30 * 8, FP32=1000, CHAIN_LOAD=18), GTX280, NOTHING)
    assert work_cycles(together) < 8 * work_cycles(alone) * 0.55


@pytest.mark.parametrize("column", COLUMNS)
def test_more_work_never_takes_less_time(column):
    draw = np.random.default_rng(3)
    base = launch(700, **{name: draw.exponential(1000, 700) for name in COLUMNS})
    more = base.events.copy()
    more[:, MachineEvent[column]] *= 1.5
    moved = Traffic(10**7, 0.0, 1.0)
    before = schedule(base, GTX280, moved).cycles
    after = schedule(replace(base, events=more), GTX280, moved).cycles
    assert after >= before * 0.995  # longer units pack differently: a fraction of one unit either way


def test_half_as_much_of_everything_takes_at_most_the_time():
    draw = np.random.default_rng(4)
    base = launch(700, **{name: draw.exponential(1000, 700) for name in COLUMNS})
    half = replace(base, events=base.events / 2)
    assert schedule(half, GTX280, NOTHING).cycles < 0.6 * schedule(base, GTX280, NOTHING).cycles


def test_the_same_launch_has_the_same_time():
    draw = np.random.default_rng(5)
    what = launch(2000, FP32=draw.exponential(1000, 2000), CHAIN_LOAD=5)
    assert schedule(what, H200, NOTHING) == schedule(what, H200, NOTHING)


def test_a_queue_balances_what_a_grid_of_the_same_size_cannot():
    """Items drawn by 132 persistent blocks: none waits for a neighbour's long item."""
    work = np.tile([10.0] * 131 + [50000.0], 20)
    queue = schedule(launch(len(work), 640, dispatch="block_queue", grid=132, FP32=work), H200, NOTHING)
    assert work_cycles(queue) < 3 * 50000 / 4 + 5000


def test_each_warp_of_a_persistent_block_draws_its_own_item():
    blocks = schedule(launch(132 * 20, 640, dispatch="block_queue", grid=132, CHAIN_LOAD=100), H200, NOTHING)
    warps = schedule(launch(132 * 20, 640, dispatch="warp_queue", grid=132, CHAIN_LOAD=100), H200, NOTHING)
    assert work_cycles(blocks) > 15 * work_cycles(warps)


def test_blocks_that_end_faster_than_they_start_leave_places_free_on_many_sms():
    work = np.zeros(4096)
    work[::3] = np.random.default_rng(2).exponential(20000, len(work[::3]))
    got = schedule(launch(4096, CHAIN_ALU=work), H200, NOTHING)
    longest = work.max() * H200.latency.alu_cycles
    assert longest < work_cycles(got) < 4 * longest


def test_a_launch_without_work_is_all_overhead():
    assert schedule(launch(0, grid=1), H200, NOTHING).bound == "launch"


@pytest.mark.parametrize(("blocks", "share"), [(33, 1 / 64), (132, 1 / 64), (264, 2 / 64), (132 * 64, 32 / 64)])
def test_few_blocks_fill_no_sm(blocks, share):
    """Blocks of a warp, all alike and long: an SM has places for 32, and holds what it gets."""
    got = schedule(launch(units=blocks, block=32, CHAIN_LOAD=10**4), H200, NOTHING)
    assert got.occupancy == 32 / 64
    assert got.achieved == pytest.approx(share, rel=0.01)


def test_blocks_that_draw_stay_to_the_end():
    units = launch(units=10, block=256, dispatch="block_queue", CHAIN_LOAD=10**4)
    assert schedule(units, H200, NOTHING).achieved == 8 / 64
