"""What made a result: whatever changes the numbers changes the manifest."""

import json
import shutil

import numpy as np
import pytest

import tilestamp
from tilestamp import Scene, altered, load_machine, simulate
from tilestamp.experiments.command_line import run_command
from tilestamp.experiments.harness.jobs import run_experiments
from tilestamp.experiments.harness.result import Result
from tilestamp.models.machine import FOLDER
from tilestamp.models.price import price
from tilestamp.models.remembered import remembered
from tilestamp.models.used import collect
from tilestamp.simulator import mix
from tilestamp.simulator.manifest import used_manifest

SMALL = {"width": 32, "height": 24}


@pytest.fixture
def mixes(tmp_path, monkeypatch):
    """Give a copy of the mixes, which simulations then use."""
    shutil.copytree(mix.MIXES, tmp_path / "mixes")
    monkeypatch.setattr(mix, "MIXES", tmp_path / "mixes")
    mix.load_mix.cache_clear()
    yield tmp_path / "mixes"
    mix.load_mix.cache_clear()


def triangle(x: float = 0.5) -> Scene:
    corners = [[-0.5, -0.5, 0, 1], [x, -0.5, 0, 1], [0, 0.5, 0, 1]]
    return Scene.from_clip_space(np.array(corners, np.float32), np.array([[0, 1, 2]], np.int32))


def manifest(scene=None, machine="gtx480", **options):
    made = simulate(scene or triangle(), "freepipe", machine, **SMALL, **options).manifest()
    return {key: value for key, value in made.items() if key != "date"}


def test_a_manifest_is_plain_data_and_the_same_again():
    assert json.loads(json.dumps(manifest())) == manifest()


def test_a_manifest_says_what_made_the_run():
    made = manifest()
    assert made["tilestamp"] == tilestamp.__version__
    assert made["mix"]["name"] == "freepipe/cc2"
    assert made["machine"] == {"name": "gtx480", "digest": load_machine("gtx480").digest, "changes": {}}
    assert (made["width"], made["height"], made["fidelity"]) == (32, 24, "schedule")
    assert np.shape(made["camera"]) == (4, 4)
    assert made["command"]


def test_options_that_were_not_given_stand_there_with_their_defaults():
    run = simulate("teapot", "micropolygon", "gtx280", **SMALL, tile=4, fidelity="counts")
    options = run.manifest()["options"]
    assert options["tile"] == 4
    assert options["spp"] == 1
    assert options["box_tests"] is True


def test_a_price_of_the_mix_times_a_hundred_changes_the_manifest(mixes):
    before = manifest()
    path = mixes / "freepipe" / "cc2.toml"
    text = path.read_text()
    assert "fp32 = " in text
    path.write_text(text.replace("fp32 = ", "fp32 = 100", 1))
    mix.load_mix.cache_clear()
    after = manifest()
    assert after["mix"]["name"] == before["mix"]["name"]
    assert [key for key in before if before[key] != after[key]] == ["mix"]


def test_a_quarter_of_the_clock_is_spelled_out():
    clock = load_machine("gtx480").sm.clock_mhz
    slow = altered(load_machine("gtx480"), {"sm.clock_mhz": clock / 4}, "assumed", "a test")
    after = manifest(machine=slow)["machine"]
    assert after["changes"] == {
        "sm.clock_mhz": {"from": clock, "to": clock / 4, "provenance": "assumed", "source": "a test"}
    }
    assert after["digest"] != load_machine("gtx480").digest
    assert after["name"] == f"gtx480 (sm.clock_mhz={clock / 4})"


@pytest.mark.parametrize(
    "change", [{"scene": triangle(0.6)}, {"fidelity": "bounds"}, {"camera": np.diag([2.0, 2, 1, 1])}]
)
def test_scene_fidelity_and_camera_change_the_manifest(change):
    assert manifest(**change) != manifest()


def test_environment_variables_that_matter_are_named(monkeypatch):
    monkeypatch.setenv("TILESTAMP_FRONTIER", "long")
    monkeypatch.setenv("HOSTNAME", "here")
    environment = manifest()["environment"]
    assert environment["TILESTAMP_FRONTIER"] == "long"
    assert "HOSTNAME" not in environment


def test_a_run_on_another_machine_says_so():
    run = simulate(triangle(), "freepipe", "h200", **SMALL)
    assert run.on("h100").manifest()["machine"]["name"] == "h100"


def test_changed_and_changed_back_is_the_plain_machine():
    machine = load_machine("gtx280")
    changed = altered(machine, {"sm.count": 60})
    assert changed.name == "gtx280 (sm.count=60)"
    assert altered(changed, {"sm.count": 30}).name == "gtx280"
    twice = altered(altered(changed, {"memory.banks": 32}, "assumed", ""), {"sm.count": 15}, "assumed", "")
    assert twice.name == "gtx280 (memory.banks=32, sm.count=15)"
    assert twice.changes["sm.count"] == (30, 15)


def test_a_users_file_that_bears_a_shipped_name_is_told_from_it(tmp_path):
    text = (FOLDER / "gtx280.toml").read_text()
    mine = tmp_path / "gtx280.toml"
    mine.write_text(text)
    assert load_machine(mine).name == "gtx280"
    mine.write_text(text.replace("clock_mhz = { value = 1296", "clock_mhz = { value = 324"))
    changed = load_machine(mine)
    assert changed.sm.clock_mhz == 324
    assert changed.name == f"gtx280 (gtx280.toml, digest {changed.digest})"


@pytest.mark.parametrize("shown", [["--json"], []])
def test_the_command_line_marks_a_changed_machine(shown, capsys):
    command = ["render", "teapot", "--size", "32x24", "--fidelity", "bounds", "--set", "sm.count=60", *shown]
    assert run_command(command) == 0
    printed = capsys.readouterr().out
    assert "gtx280 (sm.count=60)" in printed
    if shown:
        assert json.loads(printed)["manifest"]["machine"]["changes"]["sm.count"]["to"] == 60


def draw(machine="gtx480"):
    return simulate(triangle(), "freepipe", machine, **SMALL).milliseconds


def made_by(experiment, folder, monkeypatch):
    """Manifest of an experiment, without its date."""
    monkeypatch.setattr("tilestamp.experiments.harness.jobs.load_experiment", lambda _: experiment)
    list(run_experiments(["a/x"], folder, {"command": "tilestamp reproduce"}, lambda _: None, 1))
    return json.loads((folder / "a-x" / "manifest.json").read_text()) | {"date": ""}


def test_an_experiments_manifest_names_machines_mixes_scenes_and_runs(tmp_path, monkeypatch):
    made = made_by(lambda _: draw() and Result(name="a/x", title="", source="", cells=[]), tmp_path, monkeypatch)
    assert made["machines"] == {"gtx480": load_machine("gtx480").digest}
    assert list(made["mixes"]) == ["freepipe/cc2"]
    assert list(made["runs"]) == ["clip-space mesh by freepipe on gtx480"]
    assert made["command"] == "tilestamp reproduce"


def test_a_changed_mix_changes_the_manifest_of_an_experiment(tmp_path, monkeypatch, mixes):
    def experiment(_):
        draw()
        return Result(name="a/x", title="", source="", cells=[])

    before = made_by(experiment, tmp_path, monkeypatch)
    path = mixes / "freepipe" / "cc2.toml"
    path.write_text(path.read_text().replace("fp32 = ", "fp32 = 100", 1))
    mix.load_mix.cache_clear()
    after = made_by(experiment, tmp_path, monkeypatch)
    assert [key for key in before if before[key] != after[key]] == ["mixes"]


def test_a_quarter_of_the_clock_in_a_machine_file_changes_the_manifest_of_an_experiment(tmp_path, monkeypatch):
    def experiment(_):
        draw()
        return Result(name="a/x", title="", source="", cells=[])

    before = made_by(experiment, tmp_path, monkeypatch)
    shutil.copytree(FOLDER, tmp_path / "machines")
    path = tmp_path / "machines" / "gtx480.toml"
    text = path.read_text()
    assert "clock_mhz = { value = 1401" in text
    path.write_text(text.replace("clock_mhz = { value = 1401", "clock_mhz = { value = 350"))
    monkeypatch.setattr("tilestamp.models.machine.FOLDER", tmp_path / "machines")
    after = made_by(experiment, tmp_path, monkeypatch)
    assert [key for key in before if before[key] != after[key]] == ["machines", "runs"]


def test_pricing_by_itself_counts_as_use_of_the_mix_and_of_the_machine():
    run = simulate(triangle(), "freepipe", "gtx480", **SMALL)
    with collect() as found:
        price(run.launches, run.machine)
    names = {kind: list(used) for kind, used in found.items()}
    assert (names["mixes"], names["machines"]) == (["freepipe/cc2"], ["gtx480"])
    assert "freepipe/cc2: freepipe.SETUP_STEPS.fp32" in names["fitted numbers"]


def test_a_frame_that_was_remembered_counts_as_used_again():
    again = remembered(draw)
    with collect() as first:
        again()
    with collect() as second:
        again()
    assert first == second
    assert first["machines"]


def test_several_of_one_name_are_their_number_and_a_digest():
    shown = used_manifest({"scenes": {"soup": {"a", "b"}, "cow": {"c"}}})["scenes"]
    assert shown["cow"] == "c"
    assert shown["soup"].startswith("2 of digest ")
