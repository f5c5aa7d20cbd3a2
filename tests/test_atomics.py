"""Requests and conflicts of one atomic instruction."""

from collections import Counter

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from tilestamp.models.atomics import add_requests, conflicts, count_atomics, depth, requests
from tilestamp.models.simt import AtomicMerge

NONE, SECTOR = (int(rule) for rule in AtomicMerge)


def lanes_at(*addresses):
    return np.array(addresses, np.int64)


def test_lanes_at_distinct_addresses_do_not_conflict():
    assert count_atomics(np.arange(32, dtype=np.int64) * 64, 32, NONE) == (32, 32, 0, 1)


def test_all_lanes_at_one_address_leave_one_without_conflict():
    assert count_atomics(np.zeros(32, np.int64), 32, NONE) == (32, 32, 31, 32)


def test_depth_is_the_largest_crowd():
    assert depth(lanes_at(0, 4, 4, 8, 4, 8), 6) == 3
    assert conflicts(lanes_at(0, 4, 4, 8, 4, 8), 6) == 3


def test_gt200_merges_nothing():
    assert requests(np.arange(8, dtype=np.int64) * 4, 8, NONE) == 8


def test_h200_merges_distinct_words_of_a_sector():
    assert requests(np.arange(32, dtype=np.int64) * 4, 32, SECTOR) == 4


def test_h200_does_not_merge_lanes_at_one_address():
    assert requests(np.zeros(32, np.int64), 32, SECTOR) == 32


def test_eight_words_of_a_sector_with_four_lanes_each_are_four_requests_on_h200():
    assert requests(np.arange(32, dtype=np.int64) % 8 * 4, 32, SECTOR) == 4


def test_idle_lanes_ask_for_nothing():
    assert count_atomics(np.full(32, -1, np.int64), 32, SECTOR) == (0, 0, 0, 0)


@settings(deadline=None)  # the first call compiles
@given(st.lists(st.integers(0, 40), min_size=1, max_size=32), st.sampled_from([NONE, SECTOR]))
def test_counts_agree_with_counting_by_hand(words, merge):
    addresses = lanes_at(*[4 * w for w in words])
    crowd = Counter(words)
    sectors = {w // 8: max(crowd[v] for v in crowd if v // 8 == w // 8) for w in words}
    expected = sum(sectors.values()) if merge == SECTOR else len(words)
    assert count_atomics(addresses, len(words), merge) == (
        len(words),
        expected,
        len(words) - len(crowd),
        max(crowd.values()),
    )
    assert requests(addresses, len(words), merge) == expected


@settings(deadline=None)  # the first call compiles
@given(st.lists(st.integers(-1, 40), min_size=1, max_size=32), st.sampled_from([NONE, SECTOR]))
def test_the_queues_hold_every_request(words, merge):
    addresses = lanes_at(*[4 * w + 320 if w >= 0 else -1 for w in words])
    chunks = np.zeros(6, np.int64)
    add_requests(addresses, len(words), merge, 320, chunks)
    assert chunks.sum() == requests(addresses, len(words), merge)
