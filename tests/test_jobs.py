"""Experiments in processes of their own."""

import multiprocessing
import os

import pytest

from experiments.jobs import run_experiments
from experiments.result import Result


def test_one_job_runs_in_this_process(monkeypatch, tmp_path):
    here = str(os.getpid())
    monkeypatch.setattr("experiments.jobs.load_experiment", lambda name: lambda _: Result(name, here, "", []))
    results = run_experiments(["a/x", "b/y"], tmp_path, {}, lambda _: None, 1)
    assert [result.name for result in results] == ["a/x", "b/y"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a-x", "b-y"]


def test_an_error_in_another_process_reaches_the_caller_and_leaves_no_process(tmp_path):
    said: list[str] = []
    with pytest.raises(ModuleNotFoundError, match="nowhere"):
        run_experiments(["nowhere/a", "nobody/b"], tmp_path, {}, said.append, 2)
    assert not multiprocessing.active_children()
    assert not list(tmp_path.iterdir())
