"""The sort of splats: stable, by the bits that a key has, and what each pass counts."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tilestamp import TilestampError
from tilestamp.models.simt import Simt
from tilestamp.simulator.stages.kerbl2023.duplicate import Pairs, keys_of
from tilestamp.simulator.stages.kerbl2023.sort import sort


@settings(max_examples=30, deadline=None)
@given(st.lists(st.integers(0, 2**45 - 1), max_size=200), st.integers(33, 48))
def test_the_sort_is_stable_by_the_lowest_bits(keys, bits):
    values = np.arange(len(keys), dtype=np.uint32)
    low = np.array(keys, np.uint64) & np.uint64(2**bits - 1)
    pairs = sort(Pairs(low.copy(), values.copy()), bits, Simt()).outputs
    assert pairs.values.tolist() == sorted(range(len(keys)), key=lambda i: low[i])
    assert (pairs.keys == low[pairs.values]).all()


def test_a_pass_counts_the_runs_of_each_block():
    keys = np.arange(5760 * 2, dtype=np.uint64)[::-1].copy()
    works = sort(Pairs(keys, np.zeros(len(keys), np.uint32)), 16, Simt()).works
    passes = [work.counts() for work in works if work.kernel == "sort_onesweep"]
    assert [one["DIGITS"] for one in passes] == [512, 90]  # two blocks with all digits
    assert [one["DIGITS_USED"] for one in passes] == [256, 45]
    assert [one["PAIRS"] for one in passes] == [len(keys)] * 2


@pytest.mark.parametrize(("tiles", "bits"), [(8160, 45), (2170, 44), (129600, 49), (1, 33), (1024, 43)])
def test_keys_have_the_bits_of_depth_and_of_the_number_of_tiles(tiles, bits):
    assert keys_of(tiles).sorted_bits == bits


def test_more_tiles_than_a_key_can_count_are_refused():
    with pytest.raises(TilestampError, match="leave no bit of 32 for the depth"):
        keys_of(2**31, 4)
