"""Workers of a study: processes here or a cluster, the same table; one that dies takes nothing with it."""

import logging
import os
import signal
import time
from pathlib import Path

import pytest
from joblib import delayed

from tilestamp import Study, TilestampError
from tilestamp.experiments.harness import pool as pools
from tilestamp.experiments.harness.pool import pool
from tilestamp.experiments.studies.store import Store

GRID = {"zoom": [1.0, 1.5, 2.0], "machine": ["gtx280", "h200"], "sm.clock_mhz": [1000.0, 1200.0]}


def study(**changes):
    return Study(**{"fixed": {"scene": "teapot", "size": "64x48"}, "grid": GRID} | changes)


def die_once(mark: str) -> int:
    """End the process, unless somebody did before."""
    if mark and not Path(mark).exists():
        Path(mark).touch()
        os._exit(1)
    return os.getpid()


def die(mark: str) -> int:
    """End the process, if there is a mark."""
    return die_once(mark) if not mark else os._exit(1)


@pytest.fixture(scope="module")
def cluster():
    """Give a scheduler with two worker processes."""
    distributed = pytest.importorskip("distributed")
    settings = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": ":0", "silence_logs": logging.CRITICAL}
    with distributed.LocalCluster(**settings) as started:
        yield started


def test_a_process_that_dies_is_replaced_and_its_task_is_done(tmp_path):
    with pool(2) as workers:
        done = list(workers.map(die_once, ["", str(tmp_path / "died"), ""]))
    assert len(done) == 3
    assert (tmp_path / "died").exists()
    assert os.getpid() not in done


def test_a_task_that_ends_every_process_is_a_sentence(monkeypatch):
    monkeypatch.setattr(pools, "RETRIES", 0)
    with pool(2) as workers, pytest.raises(TilestampError, match="ended each worker process that took it"):
        list(workers.map(die, ["x", "x"]))


def test_one_process_is_this_one():
    with pool(1) as workers:
        assert list(workers.map(die_once, [""])) == [os.getpid()]


def test_tables_of_processes_and_of_a_cluster_of_which_a_worker_is_killed_are_identical(cluster, monkeypatch):
    from distributed import Client

    with Client(cluster) as client:
        victim = next(iter(client.run(os.getpid).values()))
    put, killed = Store.put, []

    def put_and_kill(*arguments):
        if not killed:
            killed.append(victim)
            os.kill(victim, signal.SIGKILL)
        put(*arguments)

    alone, spread = study(), study()
    assert alone.run(jobs=2).executions == 6
    monkeypatch.setattr(Store, "put", put_and_kill)
    assert spread.run(cluster=cluster.scheduler_address).new == 12
    assert killed == [victim]
    assert spread.table().equals(alone.table())


def test_a_task_that_ends_every_worker_of_a_cluster_is_a_sentence_too(cluster, monkeypatch):
    monkeypatch.setattr(cluster.scheduler, "allowed_failures", 0)
    with (
        pool(2, cluster.scheduler_address) as workers,
        pytest.raises(TilestampError, match="ended each worker process that took it"),
    ):
        list(workers.map(die, ["x", ""]))


def test_no_scheduler_at_an_address_is_a_sentence(monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr("tilestamp.experiments.harness.cluster.PATIENCE", 0.5)
    with pytest.raises(TilestampError, match="no scheduler of a cluster answers at tcp://127"):
        study().run(cluster="tcp://127.0.0.1:9")


def test_without_dask_the_sentence_says_how_to_install_it(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "distributed", None)
    with pytest.raises(TilestampError, match=r"pip install 'tilestamp\[cluster\]'"):
        study().run(cluster="local")


def test_a_run_that_ends_early_leaves_no_warning_of_joblib(recwarn):
    results = pools.unordered((delayed(time.sleep)(seconds) for seconds in (0.0, 2.0, 2.0, 2.0)), 2)
    next(results)
    results.close()
    assert not [warning for warning in recwarn if "tasks" in str(warning.message)]
