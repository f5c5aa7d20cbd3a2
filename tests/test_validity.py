"""What makes a stored result invalid."""

import json
import os
from dataclasses import replace

import pytest

from tests.stored_results import NAME, RESULT, changed, write_valid
from tilestamp.experiments.harness import validity
from tilestamp.experiments.harness.registry import experiment_names
from tilestamp.experiments.harness.validity import code_digest, made_from, outdated
from tilestamp.experiments.harness.write import Making, write_result
from tilestamp.simulator.scenes.library import scene_or_stand_in
from tilestamp.simulator.scenes.search_path import FILES, SCENES_VARIABLE, find_scene


@pytest.fixture
def written(tmp_path):
    """Folder of a valid result."""
    write_valid(tmp_path)
    return tmp_path


def test_what_was_never_run_is_not_valid(tmp_path):
    assert outdated(tmp_path, NAME) == "there is no result yet"


def test_other_code_makes_a_result_invalid(written):
    changed(written, code="0" * 16)
    assert outdated(written, NAME) == "the code has changed"


def test_another_version_of_a_package_makes_a_result_invalid(written):
    changed(written, versions=made_from(NAME)["versions"] | {"numba": "0.1"})
    assert outdated(written, NAME) == "other versions of numba"


def test_another_setting_makes_a_result_invalid(written, monkeypatch):
    monkeypatch.setenv("TILESTAMP_SLIDES", "all")
    assert outdated(written, NAME) == "TILESTAMP_SLIDES has another value"


def test_another_scene_path_alone_does_not(written, monkeypatch, tmp_path):
    monkeypatch.setenv(SCENES_VARIABLE, str(tmp_path))
    assert outdated(written, NAME) == ""


def test_what_lacked_an_input_is_run_again(tmp_path):
    lacking = replace(RESULT, cells=[], warnings=["not run: put bunny.ply into a folder"])
    write_result(lacking, tmp_path, Making(made_from=made_from(NAME)))
    assert outdated(tmp_path, NAME) == "it lacked an input"


@pytest.fixture
def digest_of(monkeypatch):
    """The digest of an experiment's code where one file, given by its place, reads otherwise."""
    plain = validity._of_file

    def digest(place="", experiment=NAME):
        for cached in (validity._floors, validity._data):
            cached.cache_clear()
        monkeypatch.setattr(
            validity, "_of_file", lambda path: b"edited" if place and path.as_posix().endswith(place) else plain(path)
        )
        return code_digest.__wrapped__(experiment)

    yield digest
    validity._floors.cache_clear()


@pytest.mark.parametrize(
    "place",
    [
        "models/traffic.py",
        "models/machines/h200.toml",
        "simulator/stages/eisenacher2010/dice.py",
        "simulator/mixes/freepipe/cc2.toml",
        "experiments/eisenacher2010/table1.py",
        "experiments/eisenacher2010/frames.py",
        "experiments/eisenacher2010/table1.csv",
        "experiments/harness/fit.py",
        "reports/plots.py",
    ],
)
def test_an_edit_of_what_an_experiment_uses_is_other_code(digest_of, place):
    assert digest_of(place) != digest_of()


@pytest.mark.parametrize(
    "place",
    [
        "experiments/eisenacher2010/table2.py",
        "experiments/command_line.py",
        "experiments/ste/blur.py",
        "reports/page.py",
    ],
)
def test_an_edit_elsewhere_is_not(digest_of, place):
    assert digest_of(place) == digest_of()


def test_every_experiment_has_code_of_its_own():
    assert len({code_digest(name) for name in experiment_names()}) == len(experiment_names())


def with_scene(folder, run):
    """The reason why a result that ``run`` made is invalid."""
    from tilestamp.models.used import collect

    with collect() as used:
        run()
    write_result(RESULT, folder, Making(made_from=made_from(NAME), used=used))
    return lambda: outdated(folder, NAME)


def test_a_scene_that_has_come_makes_the_result_of_its_stand_in_invalid(tmp_path, monkeypatch):
    monkeypatch.setenv(SCENES_VARIABLE, str(tmp_path / "scenes"))
    (tmp_path / "scenes").mkdir()
    why = with_scene(tmp_path, lambda: scene_or_stand_in("killeroo"))
    assert why() == ""
    (tmp_path / "scenes" / "killeroo.bpt").write_text("1\n")
    assert why() == "the scene killeroo is here now"


@pytest.mark.parametrize(("text", "why"), [("2\n", "another one"), (None, "missing")])
def test_another_file_of_a_scene_makes_its_result_invalid(tmp_path, monkeypatch, text, why):
    monkeypatch.setenv(SCENES_VARIABLE, str(tmp_path / "scenes"))
    (tmp_path / "scenes").mkdir()
    path = tmp_path / "scenes" / "killeroo.bpt"
    path.write_text("1\n")
    reason = with_scene(tmp_path, lambda: find_scene("killeroo"))
    assert reason() == ""
    path.unlink()
    if text:
        path.write_text(text)
        os.utime(path, (1, 1))
    assert reason() == f"the scene killeroo is {why}"


def test_the_manifest_names_stand_ins_and_the_files_that_were_looked_for(tmp_path, monkeypatch):
    monkeypatch.setenv(SCENES_VARIABLE, str(tmp_path))
    with_scene(tmp_path, lambda: scene_or_stand_in("bigguy"))
    manifest = json.loads((tmp_path / "eisenacher2010-table1" / "manifest.json").read_text())
    assert manifest[FILES] == {"bigguy": "missing"}
    assert manifest["stand-ins"] == {"bigguy": "bigguy.bpt"}


def test_a_result_does_not_depend_on_results_that_lie_in_the_folder_of_reports():
    """They lie there by default: each one written would make those before it out of date."""
    beside = [path for path in validity.decisive(NAME) if path.relative_to(validity.ROOT).parts[0] == "reports"]
    assert {path.suffix for path in beside} == {".py"}
