"""Passes of one shared-memory access, by generation."""

import numpy as np
import pytest

from tests import naive_banks
from tilestamp.models.banks import bank_passes
from tilestamp.models.machine import altered, load_machine
from tilestamp.models.simt import Simt


def shape(banks=32, bank_lanes=32, bank_bytes=4, mode=4):
    plain = Simt(banks=banks, bank_lanes=bank_lanes, bank_bytes=bank_bytes, bank_mode_bytes=mode)
    return Simt(*map(int, plain))


GT200, FERMI = shape(16, 16), shape()
KEPLER, KEPLER_8 = shape(bank_bytes=8), shape(bank_bytes=8, mode=8)
ORACLES = {
    GT200: naive_banks.passes_1x,
    FERMI: naive_banks.passes_4_byte,
    KEPLER: naive_banks.passes_3x_4_byte_mode,
    KEPLER_8: naive_banks.passes_3x_8_byte_mode,
}


def warp(step):
    return np.arange(32, dtype=np.int64) * step


def halves(first, second):
    """Even lanes at one word, odd ones at another."""
    return np.where(np.arange(32) % 2 == 0, first, second).astype(np.int64)


@pytest.mark.parametrize("simt", list(ORACLES), ids=["1.x", "2.x", "3.x", "3.x 8-byte"])
@pytest.mark.parametrize("access_words", [1, 2, 4])
def test_passes_are_those_of_the_naive_rule(simt, access_words):
    rng = np.random.default_rng(access_words)
    for _ in range(300):
        words = rng.integers(0, rng.choice([4, 40, 200, 2000]) // access_words + 1, 32) * access_words
        words[rng.random(32) < rng.choice([0, 0.3, 0.9])] = -1
        assert bank_passes(words, 32, simt, access_words) == ORACLES[simt](words.tolist(), access_words)


@pytest.mark.parametrize(("simt", "passes"), [(GT200, 2), (FERMI, 1), (KEPLER, 1), (KEPLER_8, 1)])
def test_consecutive_words_take_a_pass_for_all_lanes_that_go_together(simt, passes):
    assert bank_passes(warp(1), 32, simt) == passes


@pytest.mark.parametrize("stride", [1, 2, 4, 8, 16, 32])
def test_a_power_of_two_stride_takes_as_many_passes_as_the_stride(stride):
    """Measured on an H200: 1.01, 2.01, 4.01, 8.01, 16.01, 32.01 clocks a warp."""
    assert bank_passes(warp(stride), 32, FERMI) == stride


@pytest.mark.parametrize(("stride", "passes"), [(1, 1), (2, 1), (4, 2), (32, 16), (64, 32)])
def test_a_stride_takes_half_as_many_passes_on_kepler(stride, passes):
    """Each bank serves two words of a row: CUDA 4.2 guide, F.5.3.2."""
    assert bank_passes(warp(stride), 32, KEPLER) == passes


@pytest.mark.parametrize(("access_words", "passes"), [(1, 1), (2, 1), (4, 2)])
def test_vectors_take_the_passes_of_a_k80(access_words, passes):
    """Profiled on a K80 (gpumembench, issue 1): float, float2 and float4 take 1, 1 and 2."""
    assert bank_passes(warp(access_words), 32, KEPLER, access_words) == passes


@pytest.mark.parametrize(("simt", "passes"), [(GT200, 32), (FERMI, 4)])
def test_a_vector_of_four_words_a_lane(simt, passes):
    """Measured on an H200: 4.01 clocks; word by word at a stride of four on 1.x."""
    assert bank_passes(warp(4), 32, simt, 4) == passes


def test_words_32_apart_share_a_row_of_64_in_4_byte_mode_only():
    assert bank_passes(halves(0, 32), 32, KEPLER) == 1
    assert bank_passes(halves(32, 64), 32, KEPLER) == 2
    assert bank_passes(halves(0, 32), 32, KEPLER_8) == 1  # other banks
    assert bank_passes(halves(0, 64), 32, KEPLER_8) == 2


def test_halves_of_an_8_byte_word_share_it_in_8_byte_mode_only():
    words = np.where(np.arange(32) < 16, np.arange(32) * 2, np.arange(32) * 2 - 31).astype(np.int64)
    assert bank_passes(words, 32, KEPLER_8) == 1
    assert bank_passes(words + 64 * (words % 2), 32, KEPLER_8) == 2


def test_one_word_is_broadcast_a_step_on_1x():
    """Four lanes at each of four words of four banks: one pass on 2.x, a step a word on 1.x."""
    words = np.arange(16, dtype=np.int64) // 4
    assert bank_passes(words, 16, GT200) == 4
    assert bank_passes(words, 16, FERMI) == 1


def test_an_odd_stride_is_free_of_conflicts():
    assert bank_passes(warp(33), 32, FERMI) == 1


def test_lanes_at_one_word_share_it():
    assert [bank_passes(warp(0), 32, simt) for simt in ORACLES] == [2, 1, 1, 1]


def test_idle_lanes_take_no_pass():
    assert [bank_passes(np.full(32, -1, np.int64), 32, simt) for simt in ORACLES] == [0, 0, 0, 0]


def test_a_what_if_sets_the_mode():
    changed = altered(load_machine("gtx680"), {"memory.bank_mode_bytes": 8}, "assumed", "cudaDeviceSetSharedMemConfig")
    assert changed.simt.bank_mode_bytes == 8


@pytest.mark.parametrize(
    ("name", "banks"), [("gtx280", (16, 4, 4)), ("gtx480", (32, 4, 4)), ("gtx680", (32, 8, 4)), ("h200", (32, 4, 4))]
)
def test_banks_of_a_generation(name, banks):
    simt = load_machine(name).simt
    assert (simt.banks, simt.bank_bytes, simt.bank_mode_bytes) == banks
