"""Bounds: each term by hand, and traffic, fixed function and fidelities around it."""

import math

import numpy as np
import pytest

from tests.pricing import GTX280, H200, NOTHING, bounds, launch_of
from tilestamp.models.demand import demand
from tilestamp.models.errors import TilestampError
from tilestamp.models.launch import PipeLaunch, Stream
from tilestamp.models.machine import altered, load_machine
from tilestamp.models.price import price
from tilestamp.models.traffic import Traffic, traffic


def launch(units=3000, block=64, **described):
    """Describe equal units that each have these events."""
    return launch_of(units, block, **described)


def stream(buffer, op, size, footprint=None):
    return Stream(buffer, op, size, size if footprint is None else footprint)


def terms(machine=GTX280, **description):
    what = launch(**description)
    return bounds(what, machine, traffic([what], machine)[0]).term_cycles


def test_a_warp_instruction_issues_over_four_clocks_on_gt200():
    assert terms(units=30, FP32=1000)["issue"] == 4 * 1000


def test_reciprocals_fill_their_own_unit_beside_the_schedulers():
    assert terms(units=30, SFU=1000)["issue"] == 16 * 1000
    assert terms(units=30, SFU=1000, FP32=9000)["issue"] == 4 * 10000


def test_four_schedulers_issue_four_warps_a_clock():
    assert terms(H200, units=132, CONTROL=0, LOAD=4000)["issue"] == 1000


def test_logic_runs_at_half_rate_on_hopper():
    assert terms(H200, units=132, INT32=4000)["issue"] == pytest.approx(2030)


def test_a_shared_access_of_a_warp_takes_two_half_warp_passes_on_gt200():
    assert terms(units=30, SHARED=100)["shared"] == 100 * 2 * 2


def test_each_bank_replay_takes_one_pass():
    assert terms(units=30, SHARED=100, BANK_REPLAYS=50)["shared"] == (200 + 50) * 2


def test_latency_is_hidden_by_resident_blocks():
    """Little's law: 30 SMs x 8 blocks are in flight together."""
    ours = GTX280.latency.block_launch_cycles + 10 * GTX280.latency.dram_cycles
    assert terms(units=2400, CHAIN_LOAD=10)["latency"] == pytest.approx(2400 * ours / 240)


def test_few_blocks_hide_less():
    ours = GTX280.latency.block_launch_cycles + 10 * GTX280.latency.dram_cycles
    assert terms(units=12, CHAIN_LOAD=10)["latency"] == pytest.approx(ours)


def test_words_that_meet_in_l2_within_a_span_that_fits_reach_dram_once():
    size = 100 * H200.memory.l2_bytes
    words = Stream("records", "store", 8 * size, size, span_bytes=H200.memory.l2_bytes // 2)
    scattered = Stream("records", "store", 8 * size, size)
    met, missed = (traffic([launch(streams=[s])], H200)[0] for s in (words, scattered))
    assert met.dram_bytes == pytest.approx(size, rel=0.02)
    assert missed.dram_bytes > 7 * size
    assert met.l2_bytes == missed.l2_bytes == 8 * size


def test_dram_moves_its_bytes_at_the_sustained_bandwidth():
    seconds = terms(streams=[stream("a", "load", 10**9)])["dram"] / GTX280.clock_hz
    assert seconds == pytest.approx(1 / (141.7 * GTX280.memory.dram_efficiency))


def test_conflicting_lanes_cost_time_at_the_locks_of_gt200():
    free = terms(units=1, ATOMIC_REQUESTS=1000)["atomic"]
    crowded = terms(units=1, ATOMIC_REQUESTS=1000, ATOMIC_CONFLICTS=500)["atomic"]
    assert crowded - free == pytest.approx(500 * GTX280.atomics.conflict_ns * 1.296)


def test_requests_behind_a_locked_word_wait_too_on_gt200():
    requests = np.array([5000, 0, 0])
    locked = terms(units=1, ATOMIC_REQUESTS=5000, requests=requests)
    free = terms(units=1, ATOMIC_REQUESTS=5000)
    assert locked["queue"] == pytest.approx(5000 * GTX280.atomics.unit_ns_per_request * 1.296)
    assert locked["atomic"] == pytest.approx(free["atomic"] + locked["queue"])


def test_requests_at_one_word_queue_at_one_unit_on_hopper():
    requests = np.array([135_000, 0, 0, 0])
    cycles = terms(H200, ATOMIC_REQUESTS=45, requests=requests)["queue"]
    assert cycles / H200.clock_hz == pytest.approx(135_000 * 0.743e-9)


def test_neighbouring_words_queue_together_on_hopper():
    requests = np.zeros(64, np.int64)
    requests[:16] = 1000  # 512 bytes
    together = terms(H200, ATOMIC_REQUESTS=1, requests=requests)["queue"]
    requests = np.zeros(16 * 16, np.int64)
    requests[::16] = 1000  # padded to 512 bytes each: of two the same unit owns every other
    apart = terms(H200, ATOMIC_REQUESTS=1, requests=requests)["queue"]
    assert apart < together / 3


def test_empty_blocks_come_at_the_block_launch_rate():
    """Measured on an H200: 1048576 empty blocks in 640 us."""
    got = bounds(launch(units=1048576, block=32), H200, NOTHING)
    assert got.bound == "start"
    assert got.milliseconds == pytest.approx(0.640, rel=0.01)


def test_a_tiny_kernel_is_all_overhead():
    got = bounds(launch(units=1, FP32=1), H200, NOTHING)
    assert got.bound == "launch"


def test_sixteen_blocks_on_132_sms_are_bound_by_balance():
    got = bounds(launch(units=16, FP32=10**6), H200, NOTHING)
    assert got.bound == "balance"
    assert got.term_cycles["balance"] == pytest.approx(got.term_cycles["issue"] * 132 / 16)


def test_time_is_launch_plus_the_largest_term():
    got = bounds(launch(FP32=500, SHARED=100), GTX280, NOTHING)
    others = {name: value for name, value in got.term_cycles.items() if name != "launch"}
    assert got.cycles == got.term_cycles["launch"] + max(others.values())
    assert got.bound == max(others, key=others.get)


def test_terms_are_also_given_in_milliseconds():
    got = bounds(launch(FP32=500), GTX280, NOTHING)
    assert got.terms["issue"] + got.terms["launch"] == pytest.approx(got.milliseconds)
    assert got.terms["shared"] == 0


def test_an_issue_bound_launch_takes_half_the_time_at_twice_the_clock():
    twice = altered(GTX280, {"sm.clock_mhz": 2592.0, "launch.kernel_us": 0.0}, "assumed", "test")
    once = altered(GTX280, {"launch.kernel_us": 0.0}, "assumed", "test")
    heavy = launch(FP32=50000)
    assert bounds(heavy, twice, NOTHING).milliseconds == pytest.approx(bounds(heavy, once, NOTHING).milliseconds / 2)


def test_without_a_cache_every_byte_goes_to_dram():
    reader = launch(streams=[stream("a", "load", 1000, 100)])
    assert traffic([reader, reader], GTX280)[1] == Traffic(1000.0, 0.0, 1.0)


def test_a_buffer_that_was_just_written_is_found_in_l2():
    writer = launch(streams=[stream("a", "store", 10**6)])
    reader = launch(streams=[stream("a", "load", 10**6)])
    assert traffic([writer, reader], H200)[1] == Traffic(0.0, 10**6, 0.0)


def test_a_buffer_that_nobody_touched_comes_from_dram_once():
    reader = launch(streams=[stream("a", "load", 5 * 10**6, 10**6)])
    assert traffic([reader], H200)[0].dram_bytes == 10**6


def test_a_large_buffer_pushes_out_what_was_written_before():
    writer = launch(streams=[stream("a", "store", 10**7)])
    flood = launch(streams=[stream("b", "load", 2 * 10**8)])
    reader = launch(streams=[stream("a", "load", 10**7)])
    moved = traffic([writer, flood, reader], H200)
    assert moved[0].dram_bytes == 0
    assert moved[1].dram_bytes == 2 * 10**8 + 10**7  # the writing back of a
    assert moved[2].dram_bytes == 10**7


def test_reuse_misses_by_the_share_that_does_not_fit():
    size = 2 * H200.memory.l2_bytes * H200.memory.l2_kept_share
    reader = launch(streams=[stream("a", "load", 3 * size, size)])
    assert traffic([reader], H200)[0].dram_bytes == pytest.approx(size + 2 * size * 0.5)


@pytest.mark.parametrize(("mib", "found"), [(30, 1.0), (36, 0.89), (48, 0.42), (64, 0.06), (96, 0.0)])
def test_what_was_just_written_is_found_as_measured_on_the_h200(mib, found):
    """DRAM bytes in experiments/silicon/measured/l2_sweep.csv say 0.96, 0.42 and 0.06 at 36, 48 and 64 MiB."""
    size = mib << 20
    writer, reader = (launch(streams=[stream("a", op, size)]) for op in ("store", "load"))
    assert traffic([writer, reader], H200)[1].load_miss == pytest.approx(1 - found, abs=0.01)


def test_a_load_that_hits_l2_waits_less():
    writer = launch(streams=[stream("a", "store", 10**6)])
    reader = launch(streams=[stream("a", "load", 10**6)], CHAIN_LOAD=10)
    warm = price([writer, reader], H200, "bounds")[1].term_cycles["latency"]
    cold = price([reader], H200, "bounds")[0].term_cycles["latency"]
    assert warm < cold


def test_the_slowest_fixed_function_unit_sets_the_time():
    got = price([PipeLaunch(stage="hardware", kernel="draw", items={"primitives": 602e6, "pixels": 602e6})], GTX280)[0]
    assert got.bound == "primitives"
    assert got.milliseconds == pytest.approx(1000, rel=1e-3)


def test_an_unknown_fixed_function_unit_is_refused():
    with pytest.raises(TilestampError, match="'triangls'"):
        price([PipeLaunch(stage="hardware", kernel="draw", items={"triangls": 1.0})], GTX280)


def test_a_machine_without_fixed_function_refuses_the_pipe():
    with pytest.raises(TilestampError, match="no fixed-function pipe"):
        price([PipeLaunch(stage="hardware", kernel="draw", items={"primitives": 1.0})], load_machine("gt750m"))


def test_counts_have_no_time():
    got = price([launch(FP32=100)], GTX280, "counts")[0]
    assert math.isnan(got.milliseconds)
    assert got.occupancy == 0.5


def test_an_unknown_fidelity_is_refused():
    with pytest.raises(TilestampError, match="no fidelity 'exact'"):
        price([], GTX280, "exact")


def test_a_stream_that_touches_nothing_moves_nothing():
    asked = Stream("records", "load", 64, 0, requested_bytes=64)
    assert traffic([launch(streams=[asked])], H200)[0].l2_bytes == 0


@pytest.mark.parametrize(
    ("lines", "one_sm", "all_sms"),
    [(0, 31.8, 2384), (100, 15.9, 1248), (25, 25.4, 1943)],  # whole lines; a sector in each; four in part
)
def test_stores_run_as_measured_on_the_h200(lines, one_sm, all_sms):
    """Bytes a clock: experiments/cuda/blocks.cu for one SM, l2_sweep.csv for all (2384, 1248, 1846 to 1974)."""
    store = Stream("a", "store", 3200, 3200, partial_lines=lines)
    (moved,) = traffic([launch(units=1, STORE_BYTES=3200, streams=[store])], H200)
    what = launch(units=1, STORE_BYTES=3200, streams=[store])
    assert demand(what, H200, moved).l1 == pytest.approx(3200 / one_sm, rel=0.01)
    assert bounds(what, H200, moved).term_cycles["l2"] == pytest.approx(3200 / all_sms, rel=0.01)


def test_stores_whose_lines_nobody_counted_scatter():
    assert Stream("a", "store", 3200, 3200).lines_in_part == 100
    assert Stream("a", "load", 3200, 3200).lines_in_part == 0
