"""What fine raster does to several pixels or channels at once: compiled vectors against plain Python."""

import numpy as np
import pytest

from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.laine2011.lanes import below, mixed, write, write_reversed

ROWS = [(5, 7), (2**32 - 20, 9), (40, -6), (100, 0), (-3, 1)]  # first, step: some pass zero


@kernel
def _below(first, step, values, at, or_equal):
    return below(first, step, values, at, or_equal)


@kernel
def _write(first, step, values, at, bits):
    write(first, step, values, at, bits)


@kernel
def _write_reversed(values, at, target, i):
    write_reversed(values, at, target, i)


@kernel
def _mixed(colors, corners, weights):
    return mixed(colors, corners, weights)


def test_channels_are_rounded_to_nearest_and_saturate():
    colors = np.array([[0, 0.5, 1, 0.25], [0, 0.5, 1e30, np.nan], [-1, 0.5, 1, 1]], np.float32)
    weights = tuple(map(np.float32, (0.5, 0.25, 0.25)))
    assert _mixed(colors, (0, 0, 0), weights) == 0x40FF8000
    assert _mixed(colors, (2, 1, 0), weights) == 0x00FF8000
    least = np.array([[x / 510, np.nextafter(np.float32(x / 510), np.float32(0)), 0, 0] for x in (1, 509)], np.float32)
    zero = np.float32(0)
    for i in range(2):
        one = (np.float32(1), zero, zero)
        assert _mixed(least, (i, 0, 0), one) == mixed(least, (i, 0, 0), one)


@pytest.mark.parametrize(("first", "step"), ROWS)
@pytest.mark.parametrize("or_equal", [True, False])
def test_numbers_below_are_compared_as_32_bits_without_sign(first, step, or_equal):
    values = np.array([0, 9, 5, 12, 2**32 - 2, 2**31, 47, 40, 0, 54, 11], np.uint32)
    for at in range(4):
        assert _below(first, step, values, at, or_equal) == below(first, step, values, at, or_equal)


def test_a_number_that_is_the_same_is_below_only_if_equal_ones_are():
    values = np.array([5, 13, 18, 30, 33, 40, 40, 54], np.uint32)
    assert _below(5, 7, values, 0, False) == 0b00001010
    assert _below(5, 7, values, 0, True) == 0b10111011


@pytest.mark.parametrize(("first", "step"), ROWS)
@pytest.mark.parametrize("dtype", [np.uint32, np.int32])
def test_only_numbers_whose_bits_are_set_are_written(first, step, dtype):
    values = np.full(12, 77, dtype)
    _write(first, step, values, 3, np.uint64(0b10100101))
    numbers = np.array([first + i * step for i in range(8)]).astype(dtype)
    wanted = [77] * 3 + [n if 0b10100101 >> i & 1 else 77 for i, n in enumerate(numbers)] + [77]
    assert values.tolist() == wanted


@pytest.mark.parametrize("dtype", [np.uint32, np.int32])
def test_eight_numbers_are_written_with_the_last_one_first(dtype):
    target = np.zeros(11, dtype)
    _write_reversed(np.arange(20, dtype=dtype), 5, target, 2)
    assert target.tolist() == [0, 0, 12, 11, 10, 9, 8, 7, 6, 5, 0]
