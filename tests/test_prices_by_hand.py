"""Each pricing rule on a launch small enough for paper, on a machine of round numbers."""

from dataclasses import replace

import numpy as np
import pytest

from tests.pricing import bounds, schedule
from tests.test_bounds import launch, stream
from tilestamp.models.bounds import Term
from tilestamp.models.demand import demand
from tilestamp.models.events import MachineEvent as E
from tilestamp.models.fixed_function import pipe_time
from tilestamp.models.launch import PipeLaunch
from tilestamp.models.machine import altered, load_machine
from tilestamp.models.price import opened
from tilestamp.models.schedule import play
from tilestamp.models.traffic import Traffic, traffic

ROUND = {  # 2 SMs at 1 GHz: a cycle is a nanosecond
    "sm.count": 2,
    "sm.clock_mhz": 1000.0,
    "issue.fp32": 1.0,
    "issue.int32": 1.0,
    "issue.control": 1.0,
    "issue.load": 1.0,
    "pipe.fp32": 1.0,
    "pipe.int32": 3.0,
    "pipe.control": 2.0,
    "pipe.mul32": 5.0,
    "pipe.sfu": 8.0,
    "memory.bank_pass_cycles": 1.0,
    "memory.dram_gb_per_s": 100.0,
    "memory.dram_efficiency": 0.5,
    "memory.l2_kept_share": 1.0,
    "memory.l2_dirty_share": 1.0,
    "memory.loaded_latency": 1.0,
    "memory.l2_bytes_per_clock": 64.0,
    "memory.l2_write_bytes_per_clock": 16.0,
    "memory.l1_bytes_per_clock": 32.0,
    "memory.l1_write_bytes_per_clock": 8.0,
    "memory.l1_line_cycles": 5.0,
    "memory.l2_read_lines_per_clock": 2.0,
    "memory.l2_write_lines_per_clock": 0.5,
    "latency.alu_cycles": 10.0,
    "latency.shared_cycles": 20.0,
    "latency.l2_cycles": 100.0,
    "latency.dram_cycles": 500.0,
    "latency.atomic_cycles": 300.0,
    "latency.barrier_cycles": 7.0,
    "latency.block_launch_cycles": 40.0,
    "atomics.requests_per_clock": 2.0,
    "atomics.unawaited_per_clock": 4.0,
    "atomics.sm_requests_per_clock": 0.5,
    "atomics.sm_unawaited_per_clock": 0.8,
    "atomics.unit_ns_per_request": 3.0,
    "launch.kernel_us": 2.0,
    "launch.blocks_per_us": 100.0,
}
MACHINE = altered(load_machine("h200"), ROUND)
NOTHING = Traffic(0.0, 0.0, 0.0)


def asked(moved=NOTHING, machine=MACHINE, **description):
    """Demand of each unit."""
    return demand(launch(**{"units": 1, "block": 128, **description}), machine, moved)


def terms(moved=NOTHING, machine=MACHINE, **description):
    """Cycles of each term of one unit."""
    return bounds(launch(**{"units": 1, "block": 128, **description}), machine, moved).term_cycles


def test_four_schedulers_share_the_instructions_of_four_warps():
    assert asked(FP32=800, LOAD=400).issue == 300


@pytest.mark.parametrize(
    ("events", "cycles"),
    [
        ({"INT32": 100}, 3 * 100),
        ({"INT32": 100, "CONTROL": 50}, 3 * 100 + 2 * 50),  # one unit for both
        ({"CONTROL": 100}, 2 * 100),
        ({"MUL32": 100, "INT32": 100}, 5 * 100),  # units side by side
        ({"SFU": 10, "FP32": 10}, 8 * 10),
        ({"FP32": 100}, 100),
    ],
)
def test_the_fullest_execution_unit_holds_the_schedulers_up(events, cycles):
    assert asked(**events).issue == pytest.approx(cycles / 4)


@pytest.mark.parametrize(("block", "schedulers"), [(32, 1), (64, 2), (96, 3), (128, 4), (256, 4)])
def test_a_block_uses_no_more_schedulers_than_it_has_warps(block, schedulers):
    assert asked(block=block, FP32=1200).alone == pytest.approx(1200 / schedulers)


def test_an_item_of_a_queue_by_warps_has_one_warp():
    assert asked(block=128, dispatch="warp_queue", FP32=1200).alone == 1200
    assert asked(block=128, dispatch="block_queue", FP32=1200).alone == 300


def test_atomics_in_shared_memory_are_accesses():
    assert asked(SHARED=10).shared == 10
    assert asked(SHARED=10, SHARED_ATOMIC=5, BANK_REPLAYS=2).shared == 17


def test_stores_take_the_load_path_at_their_own_rate():
    assert asked(LOAD_BYTES=320).l1 == 320 / 32
    assert asked(STORE_BYTES=320).l1 == 320 / 8


def test_lines_that_are_moved_in_part_take_the_sm_their_own_cycles():
    """Loads by what each unit loads, stores by what it stores."""
    what = launch(units=2, LOAD_BYTES=100)
    what.events[1, E.LOAD_BYTES] = 300
    assert demand(what, MACHINE, Traffic(0, 400, 0, read_lines=8)).l1.tolist() == [100 / 32 + 2 * 5, 300 / 32 + 6 * 5]
    stored = Traffic(0, 64, 0, written_bytes=64, written_lines=4)
    assert asked(stored, STORE_BYTES=32).l1 == 32 / 8 + 4 * 5


def test_lines_that_are_moved_in_part_take_l2_more_than_their_bytes():
    moved = Traffic(0.0, 640.0, 0.0, 160.0, read_lines=10.0, written_lines=3.0)
    assert terms(moved)["l2"] == 480 / 64 + 160 / 16 + 10 / 2 + 3 / 0.5


def test_a_warp_waits_for_others_of_its_block_on_its_scheduler():
    """Half of what both want: 8 warps are two a scheduler, 16 are four."""
    assert asked(block=128, FP32=80, CHAIN_ALU=100).alone == 1040
    assert asked(block=256, FP32=80, CHAIN_ALU=100).alone == 1040 + 20 / 2 / 2
    assert asked(block=512, FP32=80, CHAIN_ALU=100).alone == 1040 + 20 / 4 / 2


def test_loads_that_l1_holds_are_its_round_trips():
    near = altered(MACHINE, {"latency.l1_cycles": 30.0})
    moved = Traffic(0, 0, 0.5, from_l1=0.75)
    assert asked(moved, near, CHAIN_LOAD=1, dispatch="block_queue").chain == 0.75 * 30 + 0.25 * (100 + 500) / 2


def test_l2_takes_stores_at_their_own_rate():
    moved = Traffic(0.0, 640.0, 0.0, written_bytes=160.0)
    assert terms(moved, LOAD_BYTES=480, STORE_BYTES=160)["l2"] == (640 - 160) / 64 + 160 / 16


def test_an_sm_sends_atomics_at_its_own_rate():
    assert asked(ATOMIC_REQUESTS=40, CHAIN_ATOMIC=1).l1 == 40 / 0.5
    assert asked(ATOMIC_REQUESTS=40).l1 == 40 / 0.8  # nobody waits for an answer


def test_the_chip_serves_atomics_at_its_own_rate():
    assert terms(ATOMIC_REQUESTS=40, CHAIN_ATOMIC=1)["atomic"] == 40 / 2
    assert terms(ATOMIC_REQUESTS=40)["atomic"] == 40 / 4


def test_where_blind_atomics_are_no_faster_all_go_at_one_rate():
    alike = altered(MACHINE, {"atomics.unawaited_per_clock": 0.0})
    assert terms(machine=alike, ATOMIC_REQUESTS=40)["atomic"] == 40 / 2


def test_dram_moves_its_bytes_at_what_it_sustains():
    assert terms(Traffic(800.0, 640.0, 0.0))["dram"] == 800 / 50  # 100 GB/s, of which half: 50 bytes a cycle


def test_the_fullest_atomic_unit_serves_its_requests():
    """Chunks of 32 bytes; the unit of the first ten chunks is one."""
    assert terms(ATOMIC_REQUESTS=10, requests=np.array([12, 8]))["queue"] == pytest.approx(20 * 3)


@pytest.mark.parametrize(("sent", "begun"), [((10, 30), 15), ((30, 10), 45)])
def test_draws_are_shared_by_requests(sent, begun):
    """The first of two items takes 300 cycles from when its part of 20 requests of 3 cycles each has passed.

    All units together serve 4 requests a cycle: half of those 10 cycles are in the way.
    """
    what = launch(units=2, block=32, dispatch="block_queue", FP32=100, requests=np.array([12, 8]))
    what.events[:, E.ATOMIC_REQUESTS] = sent
    what.events[0, E.FP32] = 300
    assert schedule(what, MACHINE, NOTHING).cycles == pytest.approx(2000 + 40 + begun + 300 + 10 / 2)


@pytest.mark.parametrize(
    ("events", "cycles"),
    [
        ({"CHAIN_ALU": 3}, 30),
        ({"CHAIN_SHARED": 3}, 60),
        ({"CHAIN_ATOMIC": 2}, 600),
        ({"CHAIN_BARRIER": 2}, 14),
        ({"CHAIN_LOAD": 2}, 200),
        ({"CHAIN_LOAD": 2, "CHAIN_ALU": 1}, 210),
    ],
)
def test_dependent_steps_wait_one_after_another(events, cycles):
    assert asked(**events).chain == cycles + 40  # a block waits for its start
    assert asked(dispatch="block_queue", **events).chain == cycles  # an item of a queue does not
    assert asked(dispatch="warp_queue", **events).chain == cycles


def test_warps_in_step_wait_for_their_own_way_through_l1_too():
    """80 bytes stored at 8 a clock, after a chain of 2 loads and a block's start."""
    what = launch(units=1, block=128, CHAIN_LOAD=2, STORE_BYTES=80, STORE_TRANSACTIONS=3)
    assert demand(what, MACHINE, NOTHING).alone == 240
    assert demand(replace(what, in_step=True), MACHINE, NOTHING).alone == 250


def test_a_load_waits_for_dram_by_the_share_that_misses():
    assert asked(Traffic(0.0, 0.0, 0.25), CHAIN_LOAD=1).chain == 40 + 100 + 400 / 4


def test_a_kernel_without_work_takes_its_launch():
    assert bounds(launch(units=0), MACHINE, NOTHING).cycles == 2000


def test_blocks_start_one_after_another():
    terms = bounds(launch(units=50, FP32=1), MACHINE, NOTHING).term_cycles
    assert terms["start"] == 50 * 10
    queued = bounds(launch(units=50, dispatch="block_queue", FP32=1), MACHINE, NOTHING).term_cycles
    assert queued["start"] == 0


def test_a_schedule_of_one_block_by_hand():
    """2000 cycles of launch, 40 of the block's start, 400 instructions on four schedulers."""
    assert schedule(launch(units=1, block=128, FP32=400), MACHINE, NOTHING).cycles == pytest.approx(2000 + 40 + 100)


def test_persistent_blocks_start_once():
    """Two blocks draw two items each: the start of 40 cycles is waited for once, not with each item."""
    what = launch(units=4, block=32, dispatch="block_queue", FP32=400)
    what = type(what)(**{**vars(what), "grid": 2})
    assert schedule(what, MACHINE, NOTHING).cycles == pytest.approx(2000 + 40 + 2 * 400)


def test_draws_from_a_queue_pass_its_atomic_unit_one_by_one():
    """Of two SMs with two items of 100 cycles each, the last is drawn when four requests of 300 cycles have passed."""
    slow = altered(MACHINE, {"atomics.unit_ns_per_request": 300.0})
    what = launch(units=4, block=32, dispatch="block_queue", FP32=100, ATOMIC_REQUESTS=1, requests=np.array([4]))
    what = type(what)(**{**vars(what), "grid": 2})
    assert schedule(what, slow, NOTHING).cycles == pytest.approx(2000 + 40 + 4 * 300 + 100, abs=1)


def test_what_a_price_is_made_of_makes_the_price():
    """Three blocks on two SMs, an SM holds one: the third starts as the first ends."""
    what = launch(units=3, block=128, FP32=400, CHAIN_LOAD=10)
    parts = opened(what, altered(MACHINE, {"sm.max_blocks": 1}), NOTHING)
    assert parts.units.chain.tolist() == [40 + 10 * 100] * 3
    assert play(parts.loads).end == 2 * (40 + 10 * 100)
    assert parts.terms[Term.LATENCY] == 3 * (40 + 10 * 100) / 2


# traffic


def test_loads_fetch_what_no_earlier_launch_left():
    writes = launch(streams=[stream("a", "store", 1000)])
    reads = launch(streams=[stream("a", "load", 3000, 1500), stream("b", "load", 500)])
    first, second = traffic([writes, reads], MACHINE)
    assert (first.dram_bytes, first.l2_bytes, first.written_bytes) == (0, 1000, 1000)
    assert (second.dram_bytes, second.l2_bytes, second.written_bytes) == (500 + 500, 3500, 0)
    assert second.load_miss == 1000 / 3500


def test_a_small_cache_writes_back_what_it_drops():
    small = altered(MACHINE, {"memory.l2_bytes": 1000})
    writes, reads = launch(streams=[stream("a", "store", 800)]), launch(streams=[stream("b", "load", 600)])
    first, second, third = traffic([writes, reads, reads], small)
    assert first.dram_bytes == 0
    assert second.dram_bytes == 600 + 400  # b, and of a what must go: 800 + 600 - 1000
    assert third.dram_bytes == 0


def test_a_store_larger_than_the_cache_goes_through():
    small = altered(MACHINE, {"memory.l2_bytes": 1000})
    assert traffic([launch(streams=[stream("a", "store", 1500)])], small)[0].dram_bytes == 500


def test_an_l1_that_holds_loads_asks_once_an_sm():
    """Two SMs; a footprint asked for three times over comes 2 (1 - 1/8) times."""
    shared = type(stream("a", "load", 1))("a", "load", 3000, 1000, requested_bytes=3000)
    (moved,) = traffic([launch(streams=[shared])], MACHINE)
    assert (moved.l2_bytes, moved.dram_bytes) == (1750, 1000)


# fixed function


def test_the_slowest_unit_of_a_pipe_by_hand():
    pipe = {"fixed_function.clock_mhz": 500.0, "fixed_function.per_clock.primitives": 2.0}
    pipe |= {"fixed_function.per_clock.pixels": 10.0}
    machine = altered(MACHINE, pipe)
    passed = PipeLaunch(stage="s", kernel="k", items={"primitives": 300, "pixels": 2000})
    timing = pipe_time(passed, machine, Traffic(5000.0, 0.0, 0.0))
    assert timing.term_cycles["primitives"] == 300 / 2 * 2  # two cycles of the SMs a clock of the pipe
    assert timing.term_cycles["pixels"] == 2000 / 10 * 2
    assert timing.term_cycles["dram"] == 100
    assert (timing.cycles, timing.milliseconds) == (2000 + 400, pytest.approx(0.0024))
