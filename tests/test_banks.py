"""Passes of one shared-memory access."""

import numpy as np
import pytest

from tilestamp.models.banks import atomic_passes, bank_passes, bank_replays

FERMI = (32, 32)  # banks, lanes that go together
GT200 = (16, 16)


def warp(step):
    return np.arange(32, dtype=np.int64) * step


def test_consecutive_words_take_one_pass():
    assert bank_passes(warp(1), 32, *FERMI) == 1


def test_a_warp_takes_two_passes_with_sixteen_banks():
    assert bank_passes(warp(1), 32, *GT200) == 2
    assert bank_replays(warp(1), 32, *GT200) == 0


@pytest.mark.parametrize("stride", [1, 2, 4, 8, 16, 32])
def test_a_power_of_two_stride_takes_as_many_passes_as_the_stride(stride):
    """Measured on an H200: 1.01, 2.01, 4.01, 8.01, 16.01, 32.01 clocks a warp."""
    assert bank_passes(warp(stride), 32, *FERMI) == stride


def test_an_odd_stride_is_free_of_conflicts():
    assert bank_passes(warp(33), 32, *FERMI) == 1


def test_lanes_at_one_word_share_it():
    assert bank_passes(warp(0), 32, *FERMI) == 1


def test_two_words_of_one_bank_take_two_passes_however_many_lanes_want_them():
    words = np.where(np.arange(32) % 2 == 0, 0, 32).astype(np.int64)
    assert bank_passes(words, 32, *FERMI) == 2


def test_idle_lanes_take_no_pass():
    assert bank_passes(np.full(32, -1, np.int64), 32, *FERMI) == 0


def test_atomics_at_one_word_take_a_pass_a_lane():
    assert atomic_passes(warp(0), 32, *FERMI) == 32


def test_atomics_on_words_of_their_own_banks_take_one_pass():
    assert atomic_passes(warp(1), 32, *FERMI) == 1
