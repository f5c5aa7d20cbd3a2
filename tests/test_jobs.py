"""Experiments in processes of their own."""

import json
import os
import signal
import subprocess
import sys
from multiprocessing import active_children

import pytest

from tilestamp.experiments.command_line import run_command
from tilestamp.experiments.harness.jobs import default_jobs, run_experiments
from tilestamp.experiments.harness.pool import pool
from tilestamp.experiments.harness.result import Cell, Result
from tilestamp.experiments.harness.telling import so_far
from tilestamp.models.compile_cache import note_compiled, note_compiling
from tilestamp.models.errors import MissingInputError
from tilestamp.models.fitted import Fitted


@pytest.fixture
def experiments(monkeypatch):
    """Run what a test puts in here instead of the package's own experiments, in this process."""
    found = {}
    monkeypatch.setattr("tilestamp.experiments.harness.jobs.load_experiment", found.__getitem__)
    monkeypatch.setattr("tilestamp.experiments.harness.jobs.describe", lambda name: f"What {name} is.")
    monkeypatch.setattr("tilestamp.experiments.commands.reproduce.select", lambda *_, **__: list(found))
    return found


def result(name):
    return lambda _: Result(name=name, title=str(os.getpid()), source="", cells=[])


def missing(_say):
    raise MissingInputError("put bunny.ply into a folder")


@pytest.mark.parametrize(("cores", "jobs"), [(None, 1), (1, 1), (2, 2), (64, 2)])
def test_two_processes_at_most_where_nothing_is_said(cores, jobs, monkeypatch):
    monkeypatch.setattr(os, "cpu_count", lambda: cores)
    assert default_jobs() == jobs


def test_one_job_runs_in_this_process(experiments, tmp_path):
    experiments |= {"a/x": result("a/x"), "b/y": result("b/y")}
    outcomes = list(run_experiments(list(experiments), tmp_path, {}, lambda _: None, 1))
    assert [outcome.name for outcome in outcomes] == ["a/x", "b/y"]
    assert {outcome.result.title for outcome in outcomes} == {str(os.getpid())}
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a-x", "b-y"]


def test_what_an_experiment_says_is_passed_on(experiments, tmp_path):
    said = []
    experiments["a/x"] = lambda say: say("half way") or Result(name="a/x", title="", source="", cells=[])
    list(run_experiments(["a/x"], tmp_path, {}, said.append, 1))
    assert said == ["a/x", "half way"]


def test_how_fitted_the_cells_are_is_computed(experiments, tmp_path):
    number = Fitted("gpu: clock", 2.0, ("cow 64x48",))

    def run(_say):
        cell = Cell("a", "b", "ms", published=4.0, ours=2.0 + number.value, frame="cow 64x48")
        return Result(name="a/x", title="", source="", cells=[cell])

    experiments["a/x"] = run
    (outcome,) = run_experiments(["a/x"], tmp_path, {}, lambda _: None, 1)
    assert outcome.result.cells[0].fitted_by == (("gpu: clock", pytest.approx(0.5)),)
    manifest = json.loads((tmp_path / "a-x" / "manifest.json").read_text())
    assert manifest["fitted numbers"] == {"gpu: clock": "cow 64x48"}


def test_missing_input_is_said_in_its_place_and_the_others_go_on(experiments, tmp_path, capsys):
    experiments |= {"a/x": missing, "b/y": result("b/y")}
    assert run_command(["reproduce", "-j", "1", "-o", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    assert "! a/x was not run: put bunny.ply into a folder" in printed
    assert "What a/x is." in (tmp_path / "index.html").read_text()
    assert (tmp_path / "b-y" / "manifest.json").is_file()


def test_a_failure_is_named_at_the_end_with_exit_code_1_and_the_others_go_on(experiments, tmp_path, capsys):
    experiments |= {"a/x": lambda _: 1 / 0, "b/y": result("b/y")}
    assert run_command(["reproduce", "-v", "-j", "1", "-o", str(tmp_path)]) == 1
    told = capsys.readouterr()
    assert "[b/y]" in told.out
    assert told.err.strip().splitlines()[-1].startswith("tilestamp: a/x failed: ZeroDivisionError: division by zero (")
    assert [path.name for path in tmp_path.iterdir() if path.is_dir()] == ["b-y"]


def test_a_result_is_given_before_the_next_experiment_runs(experiments, tmp_path):
    experiments |= {"a/x": result("a/x"), "b/y": missing}
    coming = run_experiments(list(experiments), tmp_path, {}, lambda _: None, 1)
    assert next(coming).name == "a/x"
    assert [path.name for path in tmp_path.iterdir()] == ["a-x"]
    coming.close()


def test_an_error_in_another_process_is_an_outcome_and_leaves_no_process(tmp_path):
    outcomes = list(run_experiments(["ste/nowhere", "silicon/nobody"], tmp_path, {}, lambda _: None, 2))
    assert sorted(outcome.name for outcome in outcomes) == ["silicon/nobody", "ste/nowhere"]
    assert all("ModuleNotFoundError" in outcome.failure for outcome in outcomes)
    assert not active_children()
    assert not list(tmp_path.iterdir())


def test_a_worker_that_dies_is_a_sentence(tmp_path, monkeypatch):
    monkeypatch.setattr("tilestamp.experiments.harness.jobs._run_all", lambda *_: os._exit(1))
    outcomes = list(run_experiments(["ste/nowhere", "silicon/nobody"], tmp_path, {}, lambda _: None, 2))
    assert {outcome.name for outcome in outcomes} == {"silicon/nobody", "ste/nowhere"}
    assert all("ended before its time" in outcome.failure for outcome in outcomes)
    assert not active_children()


def _compile_something(_):
    note_compiling(_compile_something)
    note_compiled()


def test_processes_say_what_they_compile():
    told = []
    with pool(2, say=told.append) as workers:
        list(workers.map(_compile_something, [1]))
    assert told == ["running: compiling test_jobs.compile_something (first run only)", "running"]


def test_what_is_so_far_done_says_how_long_the_rest_takes():
    assert so_far(3, 9, 30.0, " cells") == "3 of 9 cells, about 60 s left"


@pytest.mark.parametrize(("done", "said"), [(0, "0 of 9"), (9, "9 of 9")])
def test_before_the_first_and_after_the_last_no_time_is_left(done, said):
    assert so_far(done, 9, 30.0) == said


def test_a_worker_whose_parent_is_gone_ends(tmp_path):
    code = f"from tilestamp.experiments.harness.telling import tell; tell('{tmp_path}/nobody', 'here')"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 1  # noqa: S603 - it is our own command


COMMAND = """
import signal
from tilestamp.experiments.command_line import main
signal.signal(signal.SIGINT, signal.default_int_handler)  # a background job begins by ignoring it
main()
"""


@pytest.mark.parametrize(("order", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_an_order_to_end_leaves_no_process_and_no_file(order, code, tmp_path):
    names = ["eisenacher2010/claims", "laine2011/memory"]
    command = [sys.executable, "-c", COMMAND, "reproduce", *names, "-j", "2", "-o", str(tmp_path)]
    shown = os.environ | {"FORCE_COLOR": "1"}  # rich then takes a pipe for a terminal
    process = subprocess.Popen(command, stderr=subprocess.PIPE, env=shown, text=True, start_new_session=True)  # noqa: S603 - it is our own command
    assert process.stderr is not None
    said = ""
    while not any(name in said for name in names):  # until a worker says that it runs
        said += process.stderr.read(1)
    os.killpg(process.pid, order)  # as a terminal does: the workers hear it too
    said = process.communicate(timeout=30)[1]  # ends when no process holds the pipe any more
    assert process.returncode == code
    assert said.strip().splitlines()[-1].endswith("nothing was half-written")
    assert "Traceback" not in said
    assert not list(tmp_path.iterdir())
