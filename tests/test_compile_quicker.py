"""What is changed of Python and Numba while a kernel is compiled is as it was afterwards."""

import gc

import numba
import pytest

from tilestamp.models.compile_quicker import REPLACED, quicker
from tilestamp.models.kernel import kernel


def _state():
    return gc.isenabled(), [getattr(of, name) for of, name, _ in REPLACED]


def test_a_kernel_that_fails_leaves_all_as_it_was():
    before = _state()
    with pytest.raises(TypeError), quicker():
        len(0)
    assert _state() == before


def test_nothing_is_collected_meanwhile():
    with quicker():
        assert not gc.isenabled()
    assert gc.isenabled()


def test_a_collector_that_was_off_stays_off():
    gc.disable()
    try:
        with quicker():
            pass
        assert not gc.isenabled()
    finally:
        gc.enable()


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled with NUMBA_DISABLE_JIT")
def test_a_function_of_numbas_own_that_a_kernel_calls_can_be_passed_to_another():
    typed = numba.float64(numba.float64)

    @numba.njit
    def doubled(x):
        return 2 * x

    @kernel
    def stage(x):
        return doubled(x)

    @numba.njit(numba.float64(numba.types.FunctionType(typed), numba.float64))
    def applied(function, x):
        return function(x)

    assert stage(4.0) == 8.0
    assert applied(doubled, 4.0) == 8.0
