"""Stored results: what makes one invalid, what is run again, and that all others stay."""

import json
import os
from dataclasses import replace

import pytest

from tilestamp.experiments.command_line import run_command
from tilestamp.experiments.harness import validity
from tilestamp.experiments.harness.folder import rebuild, stored
from tilestamp.experiments.harness.record import FORMAT, result_of, strict
from tilestamp.experiments.harness.registry import experiment_names, folder_name, question
from tilestamp.experiments.harness.result import Cell, Result
from tilestamp.experiments.harness.validity import code_digest, made_from, outdated
from tilestamp.experiments.harness.write import Making, write_result
from tilestamp.simulator.scenes.library import scene_or_stand_in, stand_in
from tilestamp.simulator.scenes.search_path import FILES, SCENES_VARIABLE, find_scene

CELL = Cell("row", "column", "ms", published=10.0, ours=11.0, aim=0.2)
NAME = "eisenacher2010/table1"
RESULT = Result(name="eisenacher2010-table1", experiment=NAME, title="Table 1", source="A paper", cells=[CELL])


@pytest.fixture
def written(tmp_path):
    """Folder of a valid result."""
    write_result(RESULT, tmp_path, Making(made_from=made_from(NAME)))
    assert outdated(tmp_path, NAME) == ""
    return tmp_path


def changed(folder, **parts):
    """Let a manifest say that it was made from something else."""
    path = folder / "eisenacher2010-table1" / "manifest.json"
    manifest = json.loads(path.read_text())
    path.write_text(json.dumps(manifest | {"made from": manifest["made from"] | parts}))


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


def test_a_result_is_read_back_as_it_was(tmp_path):
    cell = replace(
        CELL, of=(("a", "b"),), fitted_by=(("gpu: clock", 0.5),), share=0.5, status="partly fitted", frame="cow"
    )
    whole = replace(RESULT, cells=[cell], answer="So.", notes=["a"], warnings=["b"])
    write_result(whole, tmp_path, Making())
    (record,) = stored(tmp_path)
    assert result_of(record) == whole


def test_json_has_null_for_what_is_no_number(tmp_path):
    write_result(replace(RESULT, cells=[replace(CELL, ours=float("nan"))]), tmp_path, Making())
    (record,) = stored(tmp_path)
    assert record["cells"][0]["ours"] is None
    assert result_of(record).cells[0].ours != result_of(record).cells[0].ours
    assert strict({"a": [float("inf"), 1.5]}) == {"a": [None, 1.5]}


@pytest.fixture
def runs(monkeypatch):
    """Names of the experiments that run, in place of the package's own."""
    ran = []

    def load(name):
        return lambda _: ran.append(name) or replace(RESULT, name=name.replace("/", "-"), title=name)

    monkeypatch.setattr("tilestamp.experiments.harness.jobs.load_experiment", load)
    return ran


def reproduce(folder, *arguments):
    return run_command(["reproduce", *arguments, "-j", "1", "-o", str(folder)])


def test_a_valid_result_is_shown_and_not_run_again(tmp_path, runs, capsys):
    assert reproduce(tmp_path, "table1") == reproduce(tmp_path, "table1") == 0
    assert runs == [NAME]
    assert capsys.readouterr().out.count(f"{NAME} [eisenacher2010/table1]") == 2


def test_again_runs_it_again(tmp_path, runs):
    assert reproduce(tmp_path, "table1") == reproduce(tmp_path, "table1", "--again") == 0
    assert runs == [NAME, NAME]


def test_one_experiment_run_again_leaves_all_others_on_the_page(tmp_path, runs):
    reproduce(tmp_path, "table1", "claims")
    reproduce(tmp_path, "table1", "--again")
    assert sorted(runs) == ["eisenacher2010/claims", NAME, NAME]
    assert [row["experiment"] for row in json.loads((tmp_path / "scoreboard.json").read_text())["rows"]] == [
        "eisenacher2010/claims", NAME,
    ]  # fmt: skip
    assert "eisenacher2010-claims" in (tmp_path / "index.html").read_text()


def test_the_page_is_made_from_the_folder_alone(tmp_path, runs):
    reproduce(tmp_path, "table1")
    made = (tmp_path / "index.html").read_text()
    (tmp_path / "index.html").unlink()
    assert run_command(["page", "-o", str(tmp_path)]) == 0
    assert runs == [NAME]
    assert (tmp_path / "index.html").read_text() == made


def test_a_result_that_another_version_wrote_is_none(written):
    path = written / folder_name(NAME) / "result.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"format": FORMAT - 1, "stand_ins": ["as it was"]}))
    assert outdated(written, NAME) == "another version of tilestamp wrote it"
    assert stored(written) == []


def test_stand_ins_without_a_cell_of_theirs_are_said_too(tmp_path):
    made = Making(used={"stand-ins": {"killeroo": {"killeroo.bpt"}}}, made_from=made_from(NAME))
    write_result(RESULT, tmp_path, made)
    (advice,) = rebuild(tmp_path)[1]
    assert advice.startswith("stand-ins were drawn: put killeroo.bpt")


def test_a_page_over_nothing_is_refused(tmp_path, capsys):
    assert run_command(["page", "-o", str(tmp_path)]) == 2
    assert "holds no results" in capsys.readouterr().err


def test_an_outdated_result_is_said_to_be_so(written):
    changed(written, code="0" * 16)
    (row,), advice, _ = rebuild(written)
    assert row.outdated == "the code has changed"
    assert advice == [f"1 result is out of date (the code has changed); run again where named: {NAME}"]


def test_what_to_do_for_the_real_models_is_said(tmp_path):
    drawn = replace(RESULT, cells=[replace(CELL, status="stand-in")])
    write_result(drawn, tmp_path, Making(used={"stand-ins": {"killeroo": {"killeroo.bpt"}}}, made_from=made_from(NAME)))
    (advice,) = rebuild(tmp_path)[1]
    assert advice.startswith("1 cell of stand-ins")
    assert "put killeroo.bpt into a folder, name that folder in TILESTAMP_SCENES" in advice


@pytest.mark.parametrize("name", experiment_names())
def test_every_experiment_asks_a_question(name):
    assert question(name).endswith("?")


def test_cells_of_a_stand_in_are_neither_predicted_nor_fitted_nor_missed():
    from tilestamp.experiments.harness.fit import run_judged

    def run(_say):
        stand_in("bigguy")
        cells = [
            replace(CELL, row="here", frame="teapot 64x48"),
            replace(CELL, row="absent", ours=99.0, frame="bigguy 64x48"),
            replace(CELL, row="said", frame="bigguy 64x48", status="reported"),
            replace(CELL, row="made of it", of=(("absent", "column"),)),
        ]
        return replace(RESULT, cells=cells)

    cells = run_judged(run, lambda _: None)[0].cells
    assert [cell.status for cell in cells] == ["predicted", "stand-in", "stand-in", "stand-in"]
    assert not any(cell.missed for cell in cells)


def test_cells_of_a_stand_in_name_no_fitted_numbers():
    from tilestamp.experiments.harness.fit import run_judged
    from tilestamp.models.fitted import Fitted

    number = Fitted("gpu: clock", 2.0, ("bigguy 64x48",))

    def run(_say):
        stand_in("bigguy")
        return replace(RESULT, cells=[replace(CELL, ours=5 * number.value, frame="bigguy 64x48")])

    (cell,) = run_judged(run, lambda _: None)[0].cells
    assert (cell.share, cell.fitted_by) == (0.0, ())


def test_a_model_that_is_remembered_is_noted_again(monkeypatch, tmp_path):
    from tilestamp.experiments.eisenacher2010.frames import model
    from tilestamp.models.used import collect

    monkeypatch.setenv(SCENES_VARIABLE, str(tmp_path))
    model("bigguy")
    with collect() as used:
        model("bigguy")
    assert "bigguy" in used[FILES]


def test_a_result_of_another_format_is_none(written):
    record = next(written.glob("*/result.json"))
    record.write_text(record.read_text().replace('"format": 2', '"format": 1'))
    assert stored(written) == []
