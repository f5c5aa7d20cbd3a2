"""Places: which is free first, beside a heap, while times come in order and after."""

import heapq

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tilestamp.models.kernel import kernel
from tilestamp.models.places import Next, put, times_of


@kernel
def taken(count, stays):
    """When each unit gets its place, and which; it stays so long."""
    times, free, found = times_of(count), Next(0.0, np.uint64(0), 0.0), np.empty((2, len(stays)))
    for i in range(len(stays)):
        found[0, i], found[1, i] = free.time, free.place
        free = put(times, free, free.time + stays[i])
    return found


@settings(deadline=None, max_examples=100)
@given(count=st.integers(1, 40), alike=st.integers(0, 100), stays=st.lists(st.integers(0, 9).map(float), max_size=100))
def test_the_place_taken_is_free_first(count, alike, stays):
    """Units that stay alike come in order; those behind them do not."""
    stays = np.array([4.0] * alike + stays)
    when, where = taken(count, stays)
    free, until = [0.0] * count, [0.0] * count
    for time, place, stay in zip(when, where.astype(int), stays, strict=True):
        assert time == heapq.heapreplace(free, time + stay) == until[place]
        until[place] = time + stay


@pytest.mark.parametrize("count", [1, 3, 8])
def test_places_take_turns_while_units_end_in_order(count):
    assert taken(count, np.full(20, 5.0))[1].tolist() == [i % count for i in range(20)]
