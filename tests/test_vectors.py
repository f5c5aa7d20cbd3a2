"""Sixteen numbers at once: compiled vectors against the plain Python beside them, bit by bit."""

import subprocess
import sys

import numpy as np
import pytest

from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages import vectors
from tilestamp.simulator.stages.vectors import bits, columns, first, greatest, least, load, spread, store

TWO, ZERO = np.float32(2), np.float32(0)


@kernel(error_model="numpy")
def _compute(a, b, out):
    x, y = load(a, 0), load(b, 2)
    rows, parts = vectors.load_rows(a, 4), columns(y)
    store(out, 0, x * y + TWO - x / y)
    store(out, 16, rows[1] + parts[2] * (-rows[3]))
    store(out, 32, vectors.select((x < y) & ~(x >= ZERO) | (x > TWO), x, ZERO))
    store(out, 48, vectors.smaller(x, y) - vectors.larger(ZERO, x))
    store(out, 64, vectors.floor(x) + vectors.ceil(y) + vectors.root(vectors.size(x)))
    store(out, 80, spread(TWO) * x)
    vectors.store_vertices(out, 96, (x, y, rows[0], parts[1]))
    corners = vectors.load_vertices(a, 0)
    store(out, 160, corners[0] + corners[1] * corners[2] - corners[3])
    store(out, 176, vectors.rgba(vectors.smaller(vectors.size(y), TWO), spread(TWO), vectors.floor(spread(TWO))))
    out[192], out[193], out[194] = first(y), least(x, first(x)), greatest(x, TWO)


@kernel
def _masks(a, b, found):
    x, y = load(a, 0), load(b, 0)
    found[0], found[1], found[2], found[3] = bits(x < y), bits(x <= y), bits(x != y), bits(x > y)


@kernel
def _ends(a, start, out):
    out[0], out[1] = least(load(a, 0), start), greatest(load(a, 0), start)


def _numbers(seed):
    numbers = np.random.default_rng(seed).normal(scale=3, size=(2, 64)).astype(np.float32)
    return np.where(np.abs(numbers) < 0.5, np.float32(0.25), numbers)


@pytest.mark.small
@pytest.mark.parametrize("seed", range(3))
def test_compiled_vectors_do_what_plain_python_does(seed):
    a, b = _numbers(seed)
    compiled, plain = np.zeros((2, 200), np.float32)
    _compute(a, b, compiled)
    getattr(_compute, "py_func", _compute)(a, b, plain)
    np.testing.assert_array_equal(compiled.view(np.uint32), plain.view(np.uint32))


@pytest.mark.small
def test_vertices_are_written_one_after_another():
    out, a, b = np.zeros(200, np.float32), np.arange(1, 65, dtype=np.float32), np.full(64, 7, np.float32)
    _compute(a, b, out)
    vertices = out[96:160].reshape(16, 4)
    np.testing.assert_array_equal(vertices[:, 0], a[:16])
    np.testing.assert_array_equal(vertices[:, 2], np.tile(a[4:8], 4))


def test_lanes_that_are_no_numbers_compare_as_different_only():
    a, b, found = np.arange(16, dtype=np.float32), np.full(16, 5, np.float32), np.zeros(4, np.uint64)
    a[3] = np.nan
    _masks(a, b, found)
    assert [int(mask) for mask in found] == [0b10111, 0b110111, 0xFFFF - (1 << 5), 0xFFC0]


@pytest.mark.parametrize("place", [0, 7, 15])
def test_ends_pass_over_what_is_no_number(place):
    a, out = np.arange(3, 19, dtype=np.float32), np.zeros(2, np.float32)
    a[place] = np.nan
    for start, ends in ((a[place], [np.nan, np.nan]), (np.float32(10), [min(10, np.nanmin(a)), np.nanmax(a)])):
        _ends(a, start, out)
        np.testing.assert_array_equal(out, ends)


@kernel
def _gather(a, places, out):
    store(out, 0, vectors.gather(a, places, 2, 3))
    found = np.zeros(2, np.uint64)
    found[0] = bits((load(a, 0) > TWO) == (load(a, 1) > TWO))
    return found[0]


@pytest.mark.small
def test_numbers_are_gathered_by_four():
    a, out, places = (
        np.arange(200, dtype=np.float32),
        np.zeros(16, np.float32),
        (np.arange(20, dtype=np.uint64) * 7) % 31,
    )
    assert _gather(a, places, out) == 0xFFFF ^ 0b100
    np.testing.assert_array_equal(out, 4 * places[2:18].astype(np.float32) + 3)


def test_kernels_of_numbers_compile_also_where_vectors_are_imported_later():
    """What is compiled for vectors is not taken for numbers."""
    code = """
from numba import float32, njit
njit(float32(float32, float32))(lambda a, b: a * b if a < b else -a)
import tilestamp.simulator.stages.vectors
print(njit(float32(float32, float32))(lambda a, b: a * b + a / b - b if a < b else -a)(2, 4))
"""
    command = [sys.executable, "-c", code]
    assert subprocess.run(command, capture_output=True, check=False, text=True).stdout.strip() == "4.5"  # noqa: S603 - our own
