"""Times of launches whose answer is known by hand, and the list schedule beside one of sorted lists."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.pricing import launch_of, microseconds, schedule
from tilestamp.models.list_schedule import Pace, list_schedule, record_of
from tilestamp.models.machine import altered, load_machine
from tilestamp.models.traffic import Traffic

H200 = load_machine("h200")
NOTHING = Traffic(0.0, 0.0, 1.0)


def each(units):
    """Kinds of units of which each is one."""
    return np.arange(units, dtype=np.uint32)


@settings(deadline=None, max_examples=60)
@given(
    seed=st.integers(0, 10**6),
    units=st.integers(0, 60),
    places=st.integers(1, 17),
    sms=st.integers(1, 9),
    queue=st.booleans(),
    moving=st.booleans(),
    slower=st.floats(1.0, 5.0),
)
def test_the_list_schedule_is_that_of_sorted_lists(seed, units, places, sms, queue, moving, slower):
    """The same by two lists that are sorted after each unit."""
    random = np.random.default_rng(seed)
    sm, alone, draws, moves = (random.exponential(size, units) for size in (2.0, 9.0, 0.5, 0.8))
    free, served, drawn, moved, end, begun = [0.0] * places, [0.0] * sms, 0.0, 0.0, 0.0, -0.3
    for i in range(units):
        begun = max(free[0], begun + 0.3)
        served[0] = max(served[0], begun + 0.7) + sm[i]
        drawn = max(drawn, begun) + draws[i]
        moved = max(moved, begun + 0.7) + moves[i] if moving else 0.0
        begin = drawn if queue else begun
        busy = max(0.0, moves.sum() - begin) if moving and i >= places else 0.0  # a unit gets 1 / slower as far
        own = slower * alone[i] if slower * alone[i] < busy else busy + alone[i] - busy / slower
        free[0] = max(served[0], moved, begin + own)
        end = max(end, free[0])
        free, served = sorted(free), sorted(served)
    nothing = np.empty(0)
    got = list_schedule(
        each(units),
        sm,
        alone,
        draws if queue else nothing,
        moves if moving else nothing,
        places,
        sms,
        Pace(0.3, 0.7, slower),
        record_of(0),
    )
    assert got[0] == pytest.approx(end, rel=1e-12)


def test_what_could_not_start_while_places_were_taken_does_not_start_at_once_later():
    """One place: a block of 10 from 0 on, then empty blocks at 10, 11, 12 and 13."""
    nothing, alone = np.zeros(5), np.array([10.0, 0.0, 0.0, 0.0, 0.0])
    found = list_schedule(each(5), nothing, alone, np.empty(0), np.empty(0), 1, 1, Pace(1.0, 0.0, 1.0), record_of(0))
    assert found[0] == 13.0


@pytest.mark.parametrize(("busy", "end"), [(0.0, 10.0), (6.0, 14.0), (30.0, 30.0), (15.0, 20.0)])
def test_a_block_that_waited_goes_more_slowly_while_memory_is_busy(busy, end):
    """Of 10 cycles 2 pass in 6 that memory serves at a third of the pace: 8 are left. With a place of its own, none."""
    nothing, alone, moves = np.zeros(2), np.array([0.0, 10.0]), np.array([0.0, busy])
    for places, expected in ((1, end), (2, max(10.0, busy))):
        pace = Pace(0.0, 0.0, 3.0)
        found = list_schedule(each(2), nothing, alone, np.empty(0), moves, places, places, pace, record_of(0))
        assert found[0] == pytest.approx(expected)


def test_a_block_holds_its_place_while_memory_serves_it():
    """Two places: blocks that would take 1 cycle each, served for 4 cycles one after another."""
    ones, served = np.ones(2), np.array([4.0, 4.0])
    found = list_schedule(each(2), np.zeros(2), ones, np.empty(0), served, 2, 2, Pace(0.0, 0.0, 1.0), record_of(0))
    assert found[2] == 4.0 + 8.0


AT_ONCE = altered(
    H200,
    {"launch.blocks_per_us": 1e6, "memory.loaded_latency": 1.0},
    "assumed",
    "blocks start together, and go on alike",
)
START, DRAM = AT_ONCE.latency.block_launch_cycles, AT_ONCE.latency.dram_cycles
OVERHEAD = AT_ONCE.launch.kernel_us * AT_ONCE.sm.clock_mhz
ALL_SHARED = 200_000  # bytes: a block leaves no room for another


def test_one_block_takes_its_own_time():
    got = schedule(launch_of(1, CHAIN_LOAD=10), AT_ONCE, NOTHING)
    assert got.cycles == pytest.approx(OVERHEAD + START + 10 * DRAM)


@pytest.mark.parametrize(("blocks", "rounds"), [(1, 1), (132, 1), (133, 2), (264, 2), (265, 3), (1320, 10)])
def test_equal_blocks_take_whole_rounds_of_the_sms(blocks, rounds):
    got = schedule(launch_of(blocks, shared_bytes=ALL_SHARED, CHAIN_LOAD=100), AT_ONCE, NOTHING)
    assert got.cycles == pytest.approx(OVERHEAD + rounds * (START + 100 * DRAM), rel=1e-4)


@pytest.mark.parametrize(("blocks", "rounds"), [(132, 1), (133, 2), (264, 2), (396, 3)])
def test_equal_blocks_of_instructions_share_their_sm(blocks, rounds):
    """Side by side or one after another: four schedulers issue four warps' instructions a clock."""
    got = schedule(launch_of(blocks, 512, CONTROL=0, LOAD=4 * 10**6), AT_ONCE, NOTHING)
    assert got.cycles == pytest.approx(OVERHEAD + START + rounds * 10**6, rel=1e-4)


def test_a_long_block_that_starts_at_once_hides_the_others():
    chains = np.ones(1000)
    chains[0] = 10**4
    got = schedule(launch_of(1000, CHAIN_LOAD=chains), AT_ONCE, NOTHING)
    assert got.cycles == pytest.approx(OVERHEAD + START + 10**4 * DRAM)


def test_a_long_block_that_starts_last_comes_on_top_of_the_others():
    chains = np.full(133, 100.0)
    chains[-1] = 10**4
    got = schedule(launch_of(133, shared_bytes=ALL_SHARED, CHAIN_LOAD=chains), AT_ONCE, NOTHING)
    assert got.cycles == pytest.approx(OVERHEAD + 2 * START + 10100 * DRAM, rel=1e-4)


def test_no_work_is_all_overhead():
    assert schedule(launch_of(0), AT_ONCE, NOTHING).cycles == pytest.approx(OVERHEAD)


def test_many_bytes_take_bytes_over_bandwidth_and_the_way_there():
    what = launch_of(4000, CHAIN_LOAD=1, LOAD_BYTES=10**5)
    got = schedule(what, AT_ONCE, Traffic(4e9, 0.0, 1.0))
    way = START + DRAM
    expected = OVERHEAD + way + 4e9 / AT_ONCE.dram_bytes_per_cycle + way / 2  # its first units are in step
    assert got.cycles == pytest.approx(expected)


def test_all_atomics_at_one_address_queue_there():
    what = launch_of(100, ATOMIC_REQUESTS=1000, CHAIN_ATOMIC=1, requests=np.array([100_000]))
    got = schedule(what, AT_ONCE, NOTHING)
    queue = 100_000 * AT_ONCE.atomics.unit_ns_per_request * 1e-3 * AT_ONCE.sm.clock_mhz
    sent = 1000 / AT_ONCE.atomics.sm_requests_per_clock  # by each SM: half of it is in the way
    assert got.cycles == pytest.approx(OVERHEAD + START + AT_ONCE.latency.atomic_cycles + queue + sent / 2)


def test_draws_at_one_counter_come_one_after_another_and_the_last_item_then_runs():
    items = replace(
        launch_of(1000, ATOMIC_REQUESTS=1, CHAIN_LOAD=10, requests=np.array([1000])),
        grid=132, block=640, dispatch="warp_queue",
    )  # fmt: skip
    queue = 1000 * AT_ONCE.atomics.unit_ns_per_request * 1e-3 * AT_ONCE.sm.clock_mhz
    sent = 1000 / AT_ONCE.atomics.unawaited_per_clock / 2  # by all units together: half of it comes on top
    expected = OVERHEAD + START + queue + sent + 10 * DRAM
    assert schedule(items, AT_ONCE, NOTHING).cycles == pytest.approx(expected, rel=1e-4)


def test_an_sm_sends_its_atomics_at_its_own_rate_however_many_sms_there_are():
    what = launch_of(1, 256, ATOMIC_REQUESTS=10**5)
    times = [microseconds(what, altered(H200, {"sm.count": sms})) for sms in (66, 132, 264, 528)]
    assert times == pytest.approx([times[0]] * 4)
    assert times[0] == pytest.approx(10**5 / 0.987 / 1970.7, rel=0.05)


@pytest.mark.parametrize(("blocks", "shared"), [(140, 8 / 132), (396, 2.0), (1320, 4.0)])
def test_two_that_want_the_sm_together_are_half_of_the_time_in_each_others_way(blocks, shared):
    """Neighbours' work is that of the blocks beyond one an SM; a block's own, of one warp, is that of its scheduler."""
    sm, alone = 10**5 / 4, START + 10**5 * AT_ONCE.latency.alu_cycles
    got = schedule(launch_of(blocks, 32, LOAD=10**5, CHAIN_ALU=10**5), AT_ONCE, NOTHING)
    assert got.cycles == pytest.approx(OVERHEAD + alone + 0.5 * shared * sm, rel=1e-4)


def test_a_block_more_on_an_sm_never_makes_a_long_block_late():
    """Alone on its SM the long block ends by itself; the others then have 131 SMs, and time enough."""
    chains = np.full(264, 10.0)
    chains[0] = 10**4
    what = launch_of(264, 32, CHAIN_LOAD=chains, LOAD=2000)
    one, many = (schedule(what, altered(AT_ONCE, {"sm.max_blocks": n}), NOTHING) for n in (1, 32))
    assert one.cycles == many.cycles == pytest.approx(OVERHEAD + START + 10**4 * DRAM)


def test_equal_blocks_spread_by_what_they_are_in_each_others_way():
    alone = schedule(launch_of(132, 32, LOAD=10**5, CHAIN_ALU=10**5), AT_ONCE, NOTHING)
    together = schedule(launch_of(264, 32, LOAD=10**5, CHAIN_ALU=10**5), AT_ONCE, NOTHING)
    assert alone.low == alone.milliseconds == alone.high
    assert together.low < together.milliseconds < together.high


def test_a_launch_of_one_round_is_in_step_with_itself():
    """Half of what the chip needs comes on top, up to half of a unit's own time."""
    chains = np.full(132, 100.0)
    chains[0] = 0  # nothing but its start: the first request may come then
    what = launch_of(132, CHAIN_LOAD=chains, LOAD_BYTES=10**4)
    alone = START + 100 * DRAM
    for share in (0.1, 0.3):
        got = schedule(what, AT_ONCE, Traffic(share * alone * AT_ONCE.dram_bytes_per_cycle, 0.0, 1.0))
        assert got.cycles == pytest.approx(OVERHEAD + alone * (1 + share / 2), rel=1e-4)


@pytest.mark.parametrize(("blocks", "said"), [(2112, ", 1.00 rounds"), (3168, ", 1.50 rounds")])
def test_where_a_time_may_step_is_said(blocks, said):
    assert schedule(launch_of(blocks, 128), H200, NOTHING).residency == f"16 an SM by warps{said}"


def test_of_two_round_trips_one_comes_on_top_of_what_memory_takes():
    """Memory is idle until the first request and after the last; half of what the SM serves is waited for besides."""
    memory, served = 10**5, 10**5 / AT_ONCE.memory.l1_bytes_per_clock
    what = launch_of(132, CHAIN_LOAD=2, LOAD_BYTES=10**5)
    got = schedule(what, AT_ONCE, Traffic(memory * AT_ONCE.dram_bytes_per_cycle, 0.0, 1.0))
    assert got.cycles == pytest.approx(OVERHEAD + memory + START + DRAM + served / 2, rel=1e-5)
