"""The folder of results: read back, run again only where not valid, the page and what is advised."""

import json
from dataclasses import replace

import pytest

from tests.stored_results import CELL, NAME, RESULT, changed, write_valid
from tilestamp.experiments.command_line import run_command
from tilestamp.experiments.harness.folder import rebuild, stored
from tilestamp.experiments.harness.record import FORMAT, result_of, strict
from tilestamp.experiments.harness.registry import experiment_names, folder_name, question
from tilestamp.experiments.harness.validity import made_from, outdated
from tilestamp.experiments.harness.write import Making, write_result


@pytest.fixture
def written(tmp_path):
    """Folder of a valid result."""
    write_valid(tmp_path)
    return tmp_path


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
