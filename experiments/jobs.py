"""Experiments side by side: those of one folder in one process, for they share frames and kernels.

Compiling kernels holds one core, so that two processes make the first run on two cores almost twice as fast.
"""

import multiprocessing
import os
import shutil
import signal
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tilestamp.experiments.registry import load_experiment
from tilestamp.experiments.result import Figure, Result
from tilestamp.experiments.write import SCRATCH, write_result
from tilestamp.models.errors import TilestampError

if TYPE_CHECKING:
    from multiprocessing.queues import SimpleQueue

Say = Callable[[str], None]
POLL_SECONDS = 0.2
END_SECONDS = 5.0  # that a process has to end once it is told to
_progress: "SimpleQueue[str] | None" = None  # of a worker process: to whom it says what it does


def default_jobs() -> int:
    """Processes by default: one a core, two at most, for each holds its own frames."""
    return min(2, os.cpu_count() or 1)


def run_experiments(names: Sequence[str], output: Path, options: dict[str, Any], say: Say, jobs: int) -> list[Result]:
    """Run experiments and write their results.

    Parameters
    ----------
    names : sequence of str
    output : Path
        Folder for the results.
    options : dict
        For the manifests.
    say : callable
        Told what is being done.
    jobs : int
        Processes; 1 runs everything in this one.

    Returns
    -------
    list of Result
        In the order of ``names``; from other processes without the functions that draw, for all is drawn.

    Raises
    ------
    TilestampError
        Of an experiment; or where a process ended before its time.
    """
    folders = [list(group) for _, group in groupby(names, key=lambda name: name.split("/")[0])]
    if jobs == 1 or len(folders) == 1:
        return [_run(name, output, options, say) for name in names]
    context = multiprocessing.get_context("spawn")  # threads and compiled code do not survive a fork
    progress: SimpleQueue[str] = context.SimpleQueue()
    pool = ProcessPoolExecutor(min(jobs, len(folders)), context, _start, (progress,))
    try:
        futures = [pool.submit(_run_folder, group, output, options) for group in folders]
        _watch(futures, progress, say)
        return [result for future in futures for result in future.result()]
    except BaseException as error:
        _end_workers(output)
        if isinstance(error, BrokenProcessPool):
            sentence = "a process that ran experiments ended before its time: out of memory? try -j 1"
            raise TilestampError(sentence) from error
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _run(name: str, output: Path, options: dict[str, Any], say: Say) -> Result:
    say(name)
    result = load_experiment(name)(say)
    write_result(result, output, options)
    return result


def _run_folder(names: Sequence[str], output: Path, options: dict[str, Any]) -> list[Result]:
    """In a worker: some experiments one after another; what draws stays here."""
    assert _progress is not None  # noqa: S101 - set when the worker started
    results = [_run(name, output, options, _progress.put) for name in names]
    return [replace(r, figures=[Figure(f.name, _drawn) for f in r.figures]) for r in results]


def _drawn(_path: Path) -> None:
    """Stand for a figure that another process has drawn."""


def _start(progress: "SimpleQueue[str]") -> None:
    """Set a worker up: Ctrl-C is the parent's business, which ends its workers and removes what they leave."""
    global _progress  # noqa: PLW0603 - a process has one
    _progress = progress
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_leave_with_parent, daemon=True).start()


def _leave_with_parent() -> None:
    """End when the parent is gone, however it went."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _watch(futures: list[Future[list[Result]]], progress: "SimpleQueue[str]", say: Say) -> None:
    """Pass on what workers say until all are done or one fails."""
    waiting = True
    while waiting:
        done, left = wait(futures, timeout=POLL_SECONDS)
        waiting = bool(left) and not any(future.exception() for future in done)
        while not progress.empty():
            say(progress.get())


def _end_workers(output: Path) -> None:
    """Stop the workers and remove what they had half-written."""
    children = multiprocessing.active_children()
    for child in children:
        child.terminate()
    for child in children:
        child.join(END_SECONDS)
        child.kill()
    for scratch in output.glob(f"{SCRATCH}*"):
        shutil.rmtree(scratch, ignore_errors=True)
