"""Loops: how long a unit takes whose warps issue all along its chain, alone and among residents."""

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tilestamp.experiments.silicon
from tests.pricing import launch_of
from tilestamp.models.events import MachineEvent
from tilestamp.models.machine import load_machine
from tilestamp.models.price import price
from tilestamp.models.turns import KNEE, both, in_turn, rest_of

H200 = load_machine("h200")
BLENDING = Path(tilestamp.experiments.silicon.__file__).parent / "measured" / "splat" / "blending.csv"
ENTRIES, WARPS, INSTRUCTIONS, STALLS, CHAIN = 2048, 8, 38.2, 3.1, 203.0  # of a tile of 16x16, an entry that is skipped


def test_a_loop_takes_longer_than_its_chain_and_its_issue_and_less_than_both():
    assert max(3.0, 4.0) < both(3.0, 4.0) < 7.0


@pytest.mark.parametrize(("chain", "own"), [(5.0, 0.0), (0.0, 5.0)])
def test_a_loop_with_nothing_else_takes_its_chain_or_its_issue(chain, own):
    assert both(chain, own) == pytest.approx(5.0)


def test_two_alike_loops_are_at_the_knee():
    assert both(1.0, 1.0) == pytest.approx(2.0 ** (1.0 / KNEE))


def test_a_lonely_loop_waits_for_nobody():
    assert in_turn(10.0, 20.0, 100.0, 0.0) == 0.0


def test_a_loop_waits_no_longer_than_others_have_work():
    waits = [in_turn(10.0, 20.0, rest, 3.0) for rest in (0.0, 10.0, 60.0, 600.0)]
    assert waits[0] == 0.0
    assert waits[1] == pytest.approx(waits[2] / 6.0)
    assert waits[2] == waits[3]


def test_the_rest_of_the_last_unit_is_half_of_what_runs_beside_it():
    sm = np.full(40, 4.0)
    assert rest_of(sm, 8, 4)[-1] == pytest.approx(0.5 * 4 * 4.0 / 4)


def test_the_rest_of_the_first_unit_is_all_others_by_sms():
    assert rest_of(np.full(40, 4.0), 8, 4)[0] == pytest.approx(39 * 4.0 / 4)


def test_a_longest_unit_an_sm_is_no_rest_of_the_others():
    sm = np.array([1.0, 1.0, 1.0, 900.0])
    assert rest_of(sm, 2, 1)[0] == pytest.approx(3.0)


def _tiles(blocks: int):
    """Equal tiles whose entries are all skipped."""
    trips = ENTRIES * WARPS
    chain = ENTRIES * CHAIN / H200.latency.alu_cycles
    tiles = launch_of(
        blocks, 256, shared_bytes=7168, INT32=trips * INSTRUCTIONS / 2, FP32=trips * INSTRUCTIONS / 2,
        ISSUE_STALLS=trips * STALLS, CHAIN_ALU=chain,
    )  # fmt: skip
    return replace(tiles, registers=32, loop=True)


def measured():
    """Tiles, and microseconds that an H200 took."""
    with BLENDING.open() as file:
        rows = [row for row in csv.DictReader(file) if row["tile"] == "16x16"]
    cases = [(row["case"].split(":"), float(row["us"])) for row in rows]
    return [
        (int(case[2].removeprefix("blocks=")), us)
        for case, us in cases
        if case[:2] == ["alpha_skip", f"entries={ENTRIES}"]
    ]


@pytest.mark.parametrize(("blocks", "us"), measured())
def test_equal_tiles_of_an_h200_come_out_within_a_sixth(blocks, us):
    assert 1e3 * price([_tiles(blocks)], H200)[0].milliseconds == pytest.approx(us, rel=0.16)


def test_more_of_anything_never_makes_a_loop_faster():
    rng = np.random.default_rng(3)
    base = _tiles(700)
    base = replace(base, events=base.events * rng.random((700, 1)) ** 2)
    before = price([base], H200)[0].milliseconds
    for column in (MachineEvent.INT32, MachineEvent.CHAIN_ALU, MachineEvent.ISSUE_STALLS):
        events = base.events.copy()
        events[:, column] *= 1.01
        more = price([replace(base, events=events)], H200)[0].milliseconds
        assert before <= more <= 1.01 * before
