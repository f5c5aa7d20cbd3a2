"""Kinds of units: grouped exactly, and priced to the bit as if each unit were one of its own."""

from dataclasses import replace

import numpy as np
import pytest

from tests.pricing import launch_of
from tilestamp.models import kinds
from tilestamp.models.kinds import each_a_kind, kinds_of
from tilestamp.models.machine import load_machine
from tilestamp.models.price import price


def columns(units, different, seed=1):
    """Events of units of some kinds in random order, (4, units); the second column is 0 in all."""
    random = np.random.default_rng(seed)
    each = random.integers(0, 3, (different, 4)) * [1.0, 0.0, 0.5, 3e9]
    return np.ascontiguousarray(each[random.integers(0, different, units)].T)


def used(events):
    return np.flatnonzero(events.any(axis=1))


@pytest.mark.parametrize("units", [0, 1, kinds.FEW, 5000])
def test_each_unit_has_the_events_of_its_kind(units):
    events = columns(units, 40)
    found = kinds_of(events, used(events))
    assert (found.events[:, found.which] == events).all()


def test_kinds_are_as_many_as_rows_differ():
    events = columns(5000, 40)
    assert kinds_of(events, used(events)).events.shape[1] == len(np.unique(events, axis=1).T)


def test_units_of_one_mark_and_other_events_are_two_kinds(monkeypatch):
    """Primes of 0 give all units the mark 0."""
    monkeypatch.setattr(kinds, "PRIMES", (0, 0))
    monkeypatch.setattr(kinds, "_group", kinds.kernel(lent=True)(getattr(kinds._group, "py_func", kinds._group)))
    events = columns(300, 5)
    found = kinds_of(events, used(events))
    assert found.events.shape[1] == len(np.unique(events, axis=1).T)
    assert (found.events[:, found.which] == events).all()


@pytest.mark.parametrize("machine", ["gtx280", "h200"])
@pytest.mark.parametrize("dispatch", ["blocks", "block_queue", "warp_queue"])
def test_a_price_is_that_of_units_of_which_each_is_a_kind(dispatch, machine):
    fp32, loads, requests = (1000.0 / (1 + row) for row in columns(3000, 7)[[0, 2, 3]])
    chain = {"CHAIN_LOAD": 7 / 3, "CHAIN_ATOMIC": 0.1}
    launch = launch_of(3000, 128, dispatch=dispatch, FP32=fp32, LOAD_BYTES=loads, ATOMIC_REQUESTS=requests, **chain)
    twin = replace(launch)
    twin.__dict__["kinds"] = each_a_kind(twin.columns)
    assert launch.kinds.events.shape[1] < 100
    assert price([launch], load_machine(machine)) == price([twin], load_machine(machine))


def test_each_unit_of_a_loop_is_a_kind():
    launch = replace(launch_of(500, FP32=3), loop=True)
    assert launch.kinds.which.tolist() == list(range(500))
