"""What is changed of Python and Numba while a kernel is compiled is as it was afterwards."""

import gc

import pytest

from tilestamp.models.compile_quicker import REPLACED, quicker


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
