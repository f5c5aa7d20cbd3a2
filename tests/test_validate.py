"""Validation against stored measurements: the same shuffle, the same counters, clear sentences."""

import csv

import pytest

from tilestamp.experiments.command_line import run_command
from tilestamp.experiments.validation.back_end import back_end, cameras, grids_of
from tilestamp.experiments.validation.quantities import QUANTITIES
from tilestamp.experiments.validation.shuffle import SEED, mersenne_twister_64, shuffled
from tilestamp.models.machine import load_machine
from tilestamp.simulator.mix import load_mix

SCENE = "teapot_512x512_bb8"


def test_the_twister_is_that_of_the_c_plus_plus_standard():
    numbers = mersenne_twister_64(5489)
    assert [next(numbers) for _ in range(10000)][-1] == 9981545732273789042  # ISO C++, [rand.predef]


def test_a_shuffle_is_a_permutation_and_always_the_same():
    order = shuffled(1000)
    assert sorted(order.tolist()) == list(range(1000))
    assert order.tolist() == shuffled(1000).tolist()
    assert next(mersenne_twister_64(SEED)) % 1000 == order[999]


@pytest.fixture(scope="module")
def launches(shared):
    machine = load_machine("h200")
    camera = cameras(shared / "silicon")[SCENE]
    mix = load_mix("micropolygon", "9.0")
    cases = back_end(grids_of(camera, machine.simt, shuffle=False), camera, machine.simt)
    return {(c.tile, c.spp, c.kernel): mix.launch(c.work, 32) for c in cases if c.tile >= 8}


@pytest.fixture(scope="module")
def counters(shared):
    with (shared / "silicon" / "micropolygon.csv").open() as file:
        rows = [r for r in csv.DictReader(file) if r["scene"] == SCENE and r["source"] == "ncu_cold"]
    return {(int(r["tile"]), int(r["spp"]), r["kernel"], r["metric"]): float(r["value"]) for r in rows}


@pytest.mark.shared
@pytest.mark.parametrize("quantity", QUANTITIES[:6], ids=lambda q: q.name)
def test_counters_of_a_scene_that_nothing_was_fitted_to_are_met(launches, counters, quantity):
    met = 0
    for key, launch in launches.items():
        theirs = sum(counters.get((*key, metric), 0.0) for metric in quantity.metrics)
        if theirs:
            scale = 1.0 if quantity.absolute else theirs
            assert abs(quantity.ours(launch) - theirs) <= max(quantity.aim, 1e-9) * scale, key
            met += 1
    assert met >= 3


def test_a_folder_that_is_none_is_refused_in_a_sentence(capsys, tmp_path):
    assert run_command(["validate", "--measurements", str(tmp_path / "nothing")]) == 2
    assert "is not a folder of measurements" in capsys.readouterr().err


def test_a_folder_without_measurements_is_refused_in_a_sentence(capsys, tmp_path):
    assert run_command(["validate", "--measurements", str(tmp_path)]) == 2
    assert "holds no measurements" in capsys.readouterr().err
