"""Spans: units in time as the schedule has them, against a list scheduler with plain lists."""

import heapq
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.pricing import GTX280, H200, NOTHING, schedule
from tests.pricing import launch_of as launch
from tests.test_time_properties import MACHINES, launches
from tilestamp.models.errors import TilestampError
from tilestamp.models.launch import Stream
from tilestamp.models.price import opened
from tilestamp.models.schedule import crowd, play
from tilestamp.models.spans import OWN, spans
from tilestamp.models.traffic import traffic

ROUNDING = 1e-6


def naive(units, alone, places):
    """Start and end of each unit: heaps of places and SMs, the soonest taken each time."""
    free, served, drawn, moved, found, begun = [0.0] * places, [0.0] * units.sms, 0.0, 0.0, [], -units.pace.interval
    slower, busy = units.pace.slower, sum(units.moves)
    for i, sm in enumerate(units.sm):
        begun = max(free[0], begun + units.pace.interval)
        done = max(served[0], begun + units.pace.start) + sm
        begin = begun
        if len(units.draws):
            drawn = begin = max(drawn, begun) + units.draws[i]
        progress = max(0.0, min(busy - begin, slower * alone[i])) / slower * (i >= places)  # while memory is busy
        end = max(done, begin + slower * progress + alone[i] - progress)
        if len(units.moves):
            moved = max(moved, begun + units.pace.start) + units.moves[i]
            end = max(end, moved)
        heapq.heapreplace(free, end)
        heapq.heapreplace(served, done)
        found.append((begun, end))
    return found


@settings(deadline=None, max_examples=30)
@given(what=launches(), machine=st.sampled_from(MACHINES))
def test_starts_and_ends_are_those_of_a_plain_list_scheduler(what, machine):
    moved = traffic([what], machine)[0]
    try:
        got, units = spans(what, machine, moved), opened(what, machine, moved).loads
    except TilestampError:
        return
    choices = [naive(units, crowd(units)[0], units.places), naive(units, units.alone, units.sms)]
    expected = min(choices, key=lambda choice: max(end for _, end in choice))
    begun = got.units_begin
    assert np.allclose(np.transpose([got.start, got.end]) - begun, expected, rtol=1e-9, atol=1e-3)


@settings(deadline=None, max_examples=60)
@given(what=launches(), machine=st.sampled_from(MACHINES))
def test_the_last_unit_ends_when_the_schedule_says_and_never_after_the_launch(what, machine):
    moved = traffic([what], machine)[0]
    try:
        got = spans(what, machine, moved)
    except TilestampError:
        return
    expected = play(opened(what, machine, moved).loads).end
    assert got.units_end - got.units_begin == pytest.approx(expected)
    assert got.end.max() == pytest.approx(got.units_end)
    assert got.total == schedule(what, machine, moved).cycles
    assert got.units_end <= got.total * (1 + ROUNDING)


@settings(deadline=None, max_examples=60)
@given(what=launches(), machine=st.sampled_from(MACHINES))
def test_no_place_has_two_units_at_a_time(what, machine):
    try:
        got = spans(what, machine, traffic([what], machine)[0])
    except TilestampError:
        return
    order = np.lexsort((got.start, got.place))
    same = np.diff(got.place[order]) == 0
    assert (got.start[order][1:][same] >= got.end[order][:-1][same] - ROUNDING).all()
    assert got.place.max() < got.places


@pytest.mark.parametrize(
    ("events", "holds"),
    [({"FP32": 40000}, "issue"), ({"SHARED": 9000, "FP32": 1}, "shared"), ({"CHAIN_LOAD": 300}, "latency")],
)
def test_a_unit_is_held_by_its_largest_cost(events, holds):
    got = spans(launch(50, **events), replace_issue(GTX280) if holds == "shared" else GTX280, NOTHING)
    assert [OWN[index] for index in got.holds] == [holds] * 50


def replace_issue(machine):
    """The machine with shared memory that is slower than its schedulers."""
    from tilestamp.models.machine import altered

    return altered(machine, {"memory.bank_pass_cycles": 20.0})


@pytest.mark.parametrize(("dispatch", "before"), [("blocks", 0.0), ("block_queue", H200.latency.block_launch_cycles)])
def test_the_first_unit_begins_after_the_overhead_and_the_start_of_persistent_blocks(dispatch, before):
    got = spans(launch(500, dispatch=dispatch, grid=132, FP32=1000), H200, NOTHING)
    assert got.start.min() == pytest.approx(H200.launch.kernel_us * H200.sm.clock_mhz + before)


def test_a_drawn_unit_is_held_by_its_queue():
    what = launch(50, dispatch="block_queue", grid=20, ATOMIC_REQUESTS=900)
    got = spans(replace(what, atomic_requests=np.array([45000])), H200, NOTHING)
    assert {OWN[index] for index in got.holds} == {"queue"}


def test_blocks_leave_when_memory_has_moved_their_bytes_in_order():
    what = replace(launch(600, FP32=100, LOAD_BYTES=2**19), streams=(Stream("a", "load", 600 * 2**19, 600 * 2**19),))
    moved = traffic([what], H200)[0]
    got, units = spans(what, H200, moved), opened(what, H200, moved).loads
    assert got.units_end - got.units_begin == pytest.approx(play(units).end)
    assert (got.end - got.units_begin >= np.cumsum(units.moves) * (1 - ROUNDING)).all()
    assert units.moves.sum() > 2 * units.alone.max()
