"""What every time keeps, over machines and launches: monotone, continuous, of the first degree, with known answers."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.pricing import bounds, microseconds, schedule
from tests.test_known_times import AT_ONCE, DRAM, H200, NOTHING, OVERHEAD, START, launch_of
from tilestamp.models.errors import TilestampError
from tilestamp.models.events import EVENTS, MachineEvent
from tilestamp.models.launch import Launch, Stream
from tilestamp.models.machine import altered, load_machine
from tilestamp.models.traffic import traffic

MACHINES = [load_machine(name) for name in ("gtx280", "gtx480", "gtx680", "h200")]
ROUNDING = 1 + 1e-9
COUNTED = ("sm.warp_size", "memory.bank", "memory.l2_line_bytes", "fixed_function", "identity")  # they change counts
HASHED = ("atomics.unit_bytes", "atomics.units")  # they change which counters meet, for better or worse
UNPRICED = ("latency.l2_far_cycles", "launch.stream_us", "launch.graph_us", "launch.sync_us")
COSTS = (
    "atomics.unit_ns",
    "atomics.spread_ns",
    "atomics.conflict_ns",
    "memory.l1_line_cycles",
    "memory.loaded_latency",
    "launch.kernel_us",
)
LESS = ("issue.", "pipe.", "latency.", "sm.reserved", *COSTS)
GRANTED = ("sm.register_unit", "sm.warp_granularity", "sm.shared_unit_bytes")  # a smaller unit may waste more
EVENT_NAMES = [event.name for event in MachineEvent if event.name not in ("LANES", "ATOMIC_LANES", "ATOMIC_DEPTH")]


def number(machine, key):
    for step in key.split("."):
        machine = getattr(machine, step)
    return machine


def priced(machine):
    """Numbers of a machine that a time may depend on."""
    skipped = (*COUNTED, *HASHED, *UNPRICED, *GRANTED)
    keys = [key for key in machine.provenance if not key.startswith(skipped)]
    return [key for key in keys if isinstance(number(machine, key), int | float) and number(machine, key) > 0]


@st.composite
def launches(draw):
    """Units alike or unlike, sorted or not, of any mixture of events, in a grid or drawn from a queue."""
    random = np.random.default_rng(draw(st.integers(0, 10**6)))
    units = draw(st.sampled_from([1, 2, 7, 40, 131, 133, 500, 2000]))
    spread = draw(st.sampled_from([0.0, 0.2, 1.0, 2.5]))
    events = np.zeros((units, EVENTS))
    for name in draw(st.lists(st.sampled_from(EVENT_NAMES), min_size=1, max_size=8, unique=True)):
        events[:, MachineEvent[name]] = 10 ** random.uniform(0, 4) * random.lognormal(0, spread, units)
    dispatch = draw(st.sampled_from(["blocks", "block_queue", "warp_queue"]))
    return Launch(
        stage="stage",
        kernel="kernel",
        grid=units if dispatch == "blocks" else draw(st.sampled_from([1, 30, 132, 300])),
        block=draw(st.sampled_from([32, 96, 256, 512])),
        registers=draw(st.sampled_from([10, 20, 32])),
        shared_bytes=draw(st.sampled_from([0, 3000, 12000])),
        events=events[np.argsort(events[:, 0])] if draw(st.booleans()) else events,
        dispatch=dispatch,
        atomic_requests=draw(st.sampled_from([None, np.array([70000, 30]), np.full(300, 50)])),
    )


def better(machine, key):
    """The machine with one number better, or None where that contradicts its others."""
    value = number(machine, key)
    ratio = 0.8 if key.startswith(LESS) else 1.3
    step = max(1, int(value * ratio)) if isinstance(value, int) else value * ratio
    changed = {key: value + 1 if key == "sm.count" else step}
    if key in ("sm.max_warps", "sm.max_threads_per_block"):
        changed["sm.max_threads"] = 2 * machine.sm.max_threads
    try:
        return altered(machine, changed)
    except TilestampError:
        return None


@settings(deadline=None, max_examples=60)
@given(launch=launches(), machine=st.sampled_from(MACHINES))
def test_a_better_number_never_makes_a_launch_slower(launch, machine):
    try:
        before = microseconds(launch, machine)
    except TilestampError:
        return
    for key in priced(machine):
        other = better(machine, key)
        if other is not None:
            assert microseconds(launch, other) <= before * ROUNDING, key


@settings(deadline=None, max_examples=60)
@given(launch=launches(), machine=st.sampled_from(MACHINES), percent=st.sampled_from([-1.0, -0.01, 0.01, 1.0]))
def test_a_number_that_changes_a_little_changes_the_time_by_no_more(launch, machine, percent):
    try:
        before = microseconds(launch, machine)
    except TilestampError:
        return
    for key in priced(machine):
        value = number(machine, key)
        if isinstance(value, int) or (key == "memory.dram_efficiency" and percent > 0):
            continue
        other = altered(machine, {key: value * (1 + percent / 100)})
        assert abs(microseconds(launch, other) / before - 1) <= abs(percent) / 99, key


@settings(deadline=None, max_examples=60)
@given(launch=launches(), machine=st.sampled_from(MACHINES), seed=st.integers(0, 10**6))
def test_events_that_change_a_little_change_the_time_by_no_more(launch, machine, seed):
    noise = 1 + 1e-4 * np.random.default_rng(seed).uniform(-1, 1, launch.events.shape)
    try:
        before = microseconds(launch, machine)
    except TilestampError:
        return
    after = microseconds(replace(launch, events=launch.events * noise), machine)
    assert (
        abs(after / before - 1) <= 3e-4
    )  # shares of what the chip moves: of each unit by its own and by the sum's change


@settings(deadline=None, max_examples=60)
@given(launch=launches(), machine=st.sampled_from(MACHINES))
def test_a_machine_at_half_of_every_pace_takes_twice_the_time(launch, machine):
    half = {"sm.clock_mhz": 0.5, "memory.dram_gb_per_s": 0.5, "launch.blocks_per_us": 0.5, "launch.kernel_us": 2.0}
    half |= {"atomics.unit_ns_per_request": 2.0, "atomics.conflict_ns": 2.0}
    slow = altered(machine, {key: number(machine, key) * ratio for key, ratio in half.items()})
    try:
        before = microseconds(launch, machine)
    except TilestampError:
        return
    assert microseconds(launch, slow) == pytest.approx(2 * before, rel=1e-9)


@settings(deadline=None, max_examples=100)
@given(launch=launches(), machine=st.sampled_from(MACHINES))
def test_a_time_is_not_below_its_bounds_and_within_its_spread(launch, machine):
    moved = traffic([launch], machine)[0]
    try:
        got = schedule(launch, machine, moved)
    except TilestampError:
        return
    least = bounds(launch, machine, moved).milliseconds
    assert least <= got.low * ROUNDING
    assert got.low <= got.milliseconds * ROUNDING
    assert got.milliseconds <= got.high * ROUNDING


@settings(deadline=None, max_examples=60)
@given(launch=launches(), machine=st.sampled_from(MACHINES), seed=st.integers(0, 10**6))
def test_events_that_change_a_little_change_the_spread_by_no_more(launch, machine, seed):
    """Another unit may be the last one to end: what it waits for does not jump into the spread."""
    noise = 1 + 1e-4 * np.random.default_rng(seed).uniform(-1, 1, launch.events.shape)
    other = replace(launch, events=launch.events * noise)
    try:
        before, after = (schedule(what, machine, traffic([what], machine)[0]) for what in (launch, other))
    except TilestampError:
        return
    assert after.low / before.low == pytest.approx(1.0, rel=5e-4)
    assert after.high / before.high == pytest.approx(1.0, rel=5e-4)


def test_the_spread_stays_where_another_unit_ends_last():
    """The first block waits for nothing and ends with the others, 0.01 % before or after them."""
    work, chains = np.full(264, 4.0e4), np.zeros(264)
    work[0], spreads = 0.0, []
    end = schedule(launch_of(264, 32, LOAD=work), AT_ONCE, NOTHING).cycles - OVERHEAD
    for ratio in (0.9999, 1.0001):
        chains[0] = (ratio * end - START) / DRAM
        got = schedule(launch_of(264, 32, LOAD=work, CHAIN_LOAD=chains), AT_ONCE, NOTHING)
        spreads.append((got.low, got.high))
    assert spreads[0] == pytest.approx(spreads[1], rel=1e-3)
    assert got.low < 0.95 * got.milliseconds < 0.95 / 1.05 * got.high


sizes = st.integers(1, 10**5)
streams = st.lists(st.tuples(st.sampled_from("abcd"), st.sampled_from(["load", "store", "atomic"]), sizes), min_size=1)


@settings(deadline=None, max_examples=200)
@given(frame=st.lists(streams, min_size=1, max_size=6), share=st.floats(0.01, 1.0), cache=sizes, more=sizes)
def test_a_larger_cache_moves_no_more_bytes_in_all(frame, share, cache, more):
    """Of a frame; which launch pays for what is written back may change."""
    frame = [
        replace(launch_of(1), streams=tuple(Stream(name, op, size, int(share * size)) for name, op, size in launch))
        for launch in frame
    ]
    caches = (altered(H200, {"memory.l2_bytes": size}) for size in (cache, cache + more))
    less, much = (sum(moved.dram_bytes for moved in traffic(frame, machine)) for machine in caches)
    assert much <= less * ROUNDING + 1e-6


@settings(deadline=None, max_examples=60)
@given(launch=launches(), sizes=st.tuples(st.integers(1, 10**7), st.integers(1, 10**9)), more=st.integers(1, 132))
def test_more_sms_that_share_an_l2_cost_no_more_than_their_share(launch, sizes, more):
    """Each fetches from L2 what it keeps in its L1: the bytes grow by no more than the SMs, and so does the time."""
    what = replace(launch, streams=(Stream("table", "load", sizes[0], sizes[0], requested_bytes=sizes[1]),))
    larger = altered(H200, {"sm.count": H200.sm.count + more})
    try:
        before = microseconds(what, H200)
    except TilestampError:
        return
    bytes_ = [traffic([what], machine)[0].l2_bytes for machine in (H200, larger)]
    assert bytes_[1] <= bytes_[0] * larger.sm.count / H200.sm.count + 1
    assert microseconds(what, larger) <= before * max(1.0, bytes_[1] / bytes_[0]) * ROUNDING
