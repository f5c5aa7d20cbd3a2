"""Transactions of one memory instruction, as the CUDA guide's appendix F has them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tilestamp.models.coalescing import contiguous, touched_lines, transactions, transactions_of_runs
from tilestamp.models.simt import Coalescing

SEGMENTS, LINES, SECTORS = (int(rule) for rule in Coalescing)
IDLE = -1


def words(*indices):
    return np.array([4 * i if i >= 0 else IDLE for i in indices], np.int64)


def warp_of(start, step, lanes=32):
    return np.arange(lanes, dtype=np.int64) * step + start


def test_sixteen_lanes_reading_consecutive_words_need_one_64_byte_transaction_on_cc_1_3():
    assert transactions(words(*range(16)), 16, 4, SEGMENTS) == (1, 64)


def test_a_full_warp_of_consecutive_words_is_two_half_warps_on_cc_1_3():
    assert transactions(warp_of(0, 4), 32, 4, SEGMENTS) == (2, 128)


def test_order_does_not_matter_on_cc_1_3():
    assert transactions(words(*reversed(range(16))), 16, 4, SEGMENTS) == (1, 64)


def test_one_lane_needs_a_32_byte_transaction_on_cc_1_3():
    assert transactions(words(5), 1, 4, SEGMENTS) == (1, 32)


def test_a_misaligned_half_warp_in_one_segment_keeps_128_bytes_on_cc_1_3():
    assert transactions(warp_of(32, 4, 16), 16, 4, SEGMENTS) == (1, 128)


def test_a_half_warp_across_two_segments_needs_32_and_64_bytes_on_cc_1_3():
    assert transactions(warp_of(96, 4, 16), 16, 4, SEGMENTS) == (2, 32 + 32)


def test_a_half_warp_off_by_one_word_across_two_segments():
    assert transactions(warp_of(68, 4, 16), 16, 4, SEGMENTS) == (2, 64 + 32)


def test_scattered_lanes_need_a_transaction_each_on_cc_1_3():
    assert transactions(warp_of(0, 256, 16), 16, 4, SEGMENTS) == (16, 16 * 32)


def test_bytes_are_gathered_in_32_byte_segments_on_cc_1_3():
    assert transactions(warp_of(0, 1, 16), 16, 1, SEGMENTS) == (1, 32)
    assert transactions(warp_of(24, 1, 16), 16, 1, SEGMENTS) == (2, 64)


def test_sixteen_byte_words_of_a_half_warp_fill_two_128_byte_segments_on_cc_1_3():
    assert transactions(warp_of(0, 16, 16), 16, 16, SEGMENTS) == (2, 256)


def test_a_warp_of_consecutive_words_is_one_line_on_fermi():
    assert transactions(warp_of(0, 4), 32, 4, LINES) == (1, 128)


def test_one_lane_fetches_a_whole_line_on_fermi():
    assert transactions(words(7), 1, 4, LINES) == (1, 128)


def test_eight_byte_words_go_as_two_requests_on_fermi():
    assert transactions(np.zeros(32, np.int64), 32, 8, LINES) == (2, 256)


def test_sixteen_byte_words_go_as_four_requests_on_fermi():
    assert transactions(warp_of(0, 16), 32, 16, LINES) == (4, 512)


def test_a_warp_of_consecutive_words_is_four_sectors_since_volta():
    assert transactions(warp_of(0, 4), 32, 4, SECTORS) == (4, 128)


def test_lanes_at_one_address_share_a_sector():
    assert transactions(np.full(32, 64, np.int64), 32, 4, SECTORS) == (1, 32)


def test_scattered_lanes_fetch_a_sector_each_since_volta():
    assert transactions(warp_of(0, 128), 32, 4, SECTORS) == (32, 1024)


@pytest.mark.parametrize("rule", [SEGMENTS, LINES, SECTORS])
def test_an_instruction_without_active_lanes_moves_nothing(rule):
    assert transactions(np.full(32, IDLE, np.int64), 32, 4, rule) == (0, 0)


@pytest.mark.parametrize("rule", [SEGMENTS, LINES, SECTORS])
def test_inactive_lanes_do_not_count(rule):
    addresses = np.full(32, IDLE, np.int64)
    addresses[20] = 400
    assert transactions(addresses, 32, 4, rule)[0] == 1


@settings(deadline=None)  # the first call compiles
@given(start=st.integers(0, 400), count=st.integers(1, 100), rule=st.sampled_from([SEGMENTS, LINES, SECTORS]))
def test_the_closed_form_of_consecutive_words_agrees_with_the_rule(start, count, rule):
    lanes = np.arange(count, dtype=np.int64) * 4 + start * 4
    warps = [lanes[i : i + 32] for i in range(0, count, 32)]
    expected = np.sum([transactions(warp, len(warp), 4, rule) for warp in warps], axis=0)
    assert contiguous(start * 4, count * 4, rule) == tuple(expected)


@pytest.mark.parametrize(("step", "lines"), [(4, 1), (8, 2), (56, 14), (128, 32), (0, 1)])
def test_lines_that_a_warp_touches(step, lines):
    assert touched_lines(np.arange(32, dtype=np.int64) * step, 32) == lines


def test_idle_lanes_touch_no_line():
    assert touched_lines(np.full(32, -1, np.int64), 32) == 0


@given(
    st.lists(st.tuples(st.integers(0, 40), st.integers(1, 6)), min_size=1, max_size=10),
    st.booleans(),
    st.sampled_from([(4, 4), (8, 16), (16, 16), (64, 16)]),
    st.sampled_from([SEGMENTS, LINES, SECTORS]),
)
@settings(max_examples=150, derandomize=True, deadline=None)
def test_runs_of_lanes_at_one_address_need_what_their_lanes_need(runs, rising, sizes, rule):
    step, size = sizes
    lanes = [i for i, n in (sorted(runs) if rising else runs) for _ in range(n)]
    starts = sum(1 << i for i in range(len(lanes)) if i == 0 or lanes[i] != lanes[i - 1])
    addresses = np.array(lanes, np.int64) * step
    at_starts = np.array([a if starts >> i & 1 else -7 for i, a in enumerate(addresses)], np.int64)
    found = transactions_of_runs(at_starts, np.uint64(starts), len(lanes), size, rule)
    assert found == transactions(addresses, len(lanes), size, rule)


def halved(lanes, size):
    """Bytes of the transactions of a half-warp of 1.2 and 1.3, by the programming guide's words."""
    segment = min(128, 32 * size)
    for base in sorted({address // segment for address in lanes}):
        inside = [address for address in lanes if address // segment == base]
        low, high, bytes_ = base * segment, base * segment + segment, segment
        while bytes_ > 32:
            middle = low + bytes_ // 2
            if max(inside) + size <= middle:
                high = middle
            elif min(inside) >= middle:
                low = middle
            else:
                break
            bytes_ = high - low
        yield bytes_


@given(st.lists(st.integers(0, 400), min_size=1, max_size=16), st.sampled_from([1, 2, 4, 8, 16]))
@settings(max_examples=200, derandomize=True, deadline=None)
def test_a_half_warp_of_any_addresses_takes_the_segments_of_the_programming_guide(lanes, size):
    segment = min(128, 32 * size)
    lanes = [address for address in lanes if address % segment + size <= segment]  # unaligned, yet in one segment
    expected = list(halved(lanes, size))
    assert transactions(np.array(lanes, np.int64), len(lanes), size, SEGMENTS) == (len(expected), sum(expected))


@given(
    steps=st.lists(st.sampled_from([0, 0, 1, 1, 1, 2, 9, -1]), min_size=1, max_size=32),
    falls=st.booleans(),
    apart=st.integers(-120, 120),
    rule=st.sampled_from([LINES, SECTORS]),
)
@settings(max_examples=300, deadline=None)
def test_two_rows_of_vertices_by_turns_need_the_distinct_segments_of_both(steps, falls, apart, rule):
    size = 16 if rule == SECTORS else 4  # a line takes 16 bytes of eight lanes alone
    rows = np.cumsum([abs(step) if not falls else step for step in steps], dtype=np.int64)
    rows[1::2] += apart
    addresses = size * (rows + 400)
    segment = 32 if rule == SECTORS else 128
    count = len({address // segment for address in addresses.tolist()})
    assert transactions(addresses, len(addresses), size, rule) == (count, count * segment)
