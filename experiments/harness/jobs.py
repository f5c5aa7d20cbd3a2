"""Experiments side by side, in processes of joblib's.

Compiling kernels holds one core, so that two processes make the first run on two cores almost twice as fast.
"""

import os
import shutil
import time
import traceback
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain, groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tilestamp.experiments.harness.fit import run_judged
from tilestamp.experiments.harness.pool import end_processes, unordered
from tilestamp.experiments.harness.registry import Progress, describe, load_experiment, process_of
from tilestamp.experiments.harness.result import Figure, Outcome, Result
from tilestamp.experiments.harness.telling import listening, tell, tell_compiling
from tilestamp.experiments.harness.validity import made_from
from tilestamp.experiments.harness.write import SCRATCH, Making, write_result
from tilestamp.models.errors import MissingInputError, TilestampError

if TYPE_CHECKING:
    from tilestamp.models.used import Used


def default_jobs() -> int:
    """Processes by default: one a core, two at most, for each holds its own frames."""
    return min(2, os.cpu_count() or 1)


def run_experiments(
    names: Sequence[str], output: Path, options: dict[str, Any], say: Progress, jobs: int
) -> Iterator[Outcome]:
    """Run experiments and write their results.

    Parameters
    ----------
    names : sequence of str
    output : Path
        Folder for the results.
    options : dict
        For the manifests.
    say : callable
        Told what is being done; from another thread where there are several processes.
    jobs : int
        Processes; 1 runs everything in this one.

    Yields
    ------
    Outcome
        As they come; results without their figures' functions, for all is drawn.
    """
    from joblib import delayed
    from joblib.externals.loky.process_executor import TerminatedWorkerError

    groups = [list(group) for _, group in groupby(names, key=(lambda name: name) if jobs == 1 else process_of)]
    left = dict.fromkeys(names)
    try:
        with listening(say) as address:
            told = say if jobs == 1 else address
            tasks = [delayed(_run_all)(group, output, options, told) for group in groups]
            for outcome in chain.from_iterable(unordered(tasks, jobs)):
                del left[outcome.name]
                yield outcome
    except TerminatedWorkerError:
        sentence = "a process that ran experiments ended before its time: out of memory? try -j 1"
        yield from (Outcome(name, failure=sentence) for name in left)
    finally:
        end_processes()
        for scratch in output.glob(f"{SCRATCH}*"):
            shutil.rmtree(scratch, ignore_errors=True)


def _run_all(names: Sequence[str], output: Path, options: dict[str, Any], told: Progress | str) -> list[Outcome]:
    """Run some experiments one after another, here or in a process that tells an address what it does."""
    if callable(told):
        return [_run(name, output, options, told) for name in names]
    outcomes = []
    for name in names:
        tell_compiling(told, name)
        outcomes.append(_run(name, output, options, partial(tell, told)))
    return outcomes


def _run(name: str, output: Path, options: dict[str, Any], say: Progress) -> Outcome:
    """Run one experiment; what it lacks is said in its place."""
    try:
        say(name)
        made, begin = made_from(name), time.perf_counter()
        used: Used = {}
        try:
            result, used = run_judged(load_experiment(name), say)
        except MissingInputError as missing:
            result = Result(name, describe(name), "", [], warnings=[f"not run: {missing}"])
        result = replace(result, experiment=name)
        write_result(result, output, Making(options, used, made, time.perf_counter() - begin))
    except TilestampError as error:
        return Outcome(name, failure=str(error))
    except Exception as error:  # noqa: BLE001 - one experiment's fault ends no other
        place = traceback.extract_tb(error.__traceback__)[-1]
        return Outcome(name, failure=f"{type(error).__name__}: {error} ({Path(place.filename).name}:{place.lineno})")
    return Outcome(name, replace(result, figures=[Figure(figure.name, _drawn) for figure in result.figures]))


def _drawn(_path: Path) -> None:
    """Stand for a figure that has been drawn."""
