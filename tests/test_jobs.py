"""Experiments in processes of their own."""

import multiprocessing
import os
import signal
import subprocess
import sys

import pytest

from tilestamp.experiments.jobs import run_experiments
from tilestamp.experiments.result import Result


def test_one_job_runs_in_this_process(monkeypatch, tmp_path):
    here = str(os.getpid())
    monkeypatch.setattr(
        "tilestamp.experiments.jobs.load_experiment",
        lambda name: lambda _: Result(name=name, title=here, source="", cells=[]),
    )
    results = run_experiments(["a/x", "b/y"], tmp_path, {}, lambda _: None, 1)
    assert [result.name for result in results] == ["a/x", "b/y"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a-x", "b-y"]


def test_an_error_in_another_process_reaches_the_caller_and_leaves_no_process(tmp_path):
    said: list[str] = []
    with pytest.raises(ModuleNotFoundError, match="nowhere"):
        run_experiments(["nowhere/a", "nobody/b"], tmp_path, {}, said.append, 2)
    assert not multiprocessing.active_children()
    assert not list(tmp_path.iterdir())


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
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)  # noqa: S603 - it is our own command
    assert process.stderr is not None
    for line in process.stderr:
        if line.strip() in names:  # a worker says so: it runs
            break
    process.send_signal(order)
    said = process.communicate(timeout=30)[1]  # ends when no process holds the pipe any more
    assert process.returncode == code
    assert said.strip().splitlines()[-1].endswith("nothing was half-written")
    assert not list(tmp_path.iterdir())
