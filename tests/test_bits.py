"""Bits of a warp: which lanes want addresses close together, and a tile's pixels that three edges leave in."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tilestamp.models.bits import active_lanes, lanes_near, lowest_bits
from tilestamp.simulator.stages.zhang2025.fine_tile import coverage
from tilestamp.simulator.stages.zhang2025.stepped_tile import stepped_tile

LANES = st.lists(st.integers(-3, 300), min_size=1, max_size=40)


def bits(flags):
    return sum(int(flag) << i for i, flag in enumerate(flags))


@settings(max_examples=60, deadline=None)
@given(LANES, st.integers(0, 300), st.sampled_from([1, 4, 32, 128]), st.data())
def test_lanes_are_near_in_one_aligned_segment(addresses, here, size, data):
    first = data.draw(st.integers(0, len(addresses)))
    wanted = bits(a >= 0 and a // size == here // size for a in addresses[first:])
    assert lanes_near(np.array(addresses, np.int64), first, len(addresses), here, size) == wanted


@settings(max_examples=30, deadline=None)
@given(LANES)
def test_lanes_with_an_address_are_active(addresses):
    assert active_lanes(np.array(addresses, np.int64), 0, len(addresses)) == bits(a >= 0 for a in addresses)


@settings(max_examples=60, deadline=None)
@given(st.sets(st.integers(0, 63)), st.integers(0, 64))
def test_the_lowest_bits_are_the_first_that_are_set(places, count):
    wanted = sum(1 << i for i in sorted(places)[:count])
    assert lowest_bits(np.uint64(sum(1 << i for i in places)), count) == wanted


@pytest.mark.parametrize("seed", range(20))
def test_a_tile_is_stepped_as_plain_python_steps_it(seed):
    edges = np.random.default_rng(seed).normal(size=(3, 3)).astype(np.float32) * np.float32(3)
    half = np.float32(0.5)
    starts = [e[0] * half + e[1] * half + e[2] for e in edges]
    wanted = stepped_tile(*((start, e[0], e[1]) for start, e in zip(starts, edges, strict=True)))
    assert coverage(edges, 0, 0, 8, 8) == wanted


def test_a_tile_ends_with_the_screen():
    everywhere = np.array([[0, 0, 1]] * 3, np.float32)
    assert coverage(everywhere, 0, 0, 3, 2) == 0b111 | 0b111 << 8


def test_pixels_on_an_edge_are_covered_and_not_a_number_is_not():
    edges = np.array([[1, 0, -4.5], [0, 0, 1], [0, 0, 1]], np.float32)
    assert coverage(edges, 0, 0, 8, 8) == 0xF0F0F0F0F0F0F0F0
    edges[1, 2] = np.nan
    assert coverage(edges, 0, 0, 8, 8) == 0
