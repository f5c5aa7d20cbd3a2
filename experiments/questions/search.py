"""A search for the best point of a study's space: optuna asks, cells answer, all of them in the study's store."""

import logging
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from tilestamp.experiments.harness.telling import so_far
from tilestamp.experiments.questions.space import Space, extra, values_at
from tilestamp.experiments.studies.axes import shown
from tilestamp.experiments.studies.study import Study
from tilestamp.models.errors import TilestampError

if TYPE_CHECKING:
    import pandas as pd
    from optuna.trial import Trial

TOGETHER = 8  # points of one question: executed and priced together


def search(
    study: Study,
    wanted: Sequence[str] = ("milliseconds",),
    cells: int = 64,
    seed: int = 0,
    say: Callable[[str], None] = lambda _: None,
) -> "pd.DataFrame":
    """Look for the least of one number, or for the front of several.

    The same search asks for the same points again, so that one that was ended goes on where it was.

    Parameters
    ----------
    study : Study
        Its axes are the space, whatever points they have.
    wanted : sequence of str
        Numbers, all of which are to be small.
    cells : int
    seed : int
        Of the sampler (tree of Parzen estimators).
    say : callable
        Told how far it is.

    Returns
    -------
    DataFrame
        A row a cell, as they were asked for: the axes, the numbers, why a cell has none (``problem``), and ``best``: of
        one number the least, of several those on the front.
    """
    try:
        import optuna
    except ImportError:
        raise extra("optuna") from None
    import pandas as pd

    if cells < 1 or not wanted:
        raise TilestampError("a search needs a cell at least, and a number that is to be small")
    space = Space(study)
    optuna.logging.set_verbosity(logging.ERROR)
    sampler = optuna.samplers.TPESampler(seed=seed, multivariate=True, constant_liar=True, n_startup_trials=16)
    asked = optuna.create_study(directions=["minimize"] * len(wanted), sampler=sampler)
    rows: list[dict[str, Any]] = []
    begin = time.perf_counter()
    while len(rows) < cells:
        trials = [asked.ask() for _ in range(min(TOGETHER, cells - len(rows)))]
        points = space.points([[_share(trial, name, space.length(name)) for name in space.names] for trial in trials])
        values, problems = values_at(study, points, wanted)
        for trial, point, row, problem in zip(trials, points, values, problems, strict=True):
            failed = not np.isfinite(row).all()
            asked.tell(trial, None if failed else row.tolist(), optuna.trial.TrialState.FAIL if failed else None)
            place = {name: shown(value) for name, value in point.items()}
            numbers = dict(zip(wanted, row.tolist(), strict=True))
            rows.append(place | numbers | ({"problem": problem} if problem else {}))
        say(so_far(len(rows), cells, time.perf_counter() - begin, " cells"))
    if all(trial.state == optuna.trial.TrialState.FAIL for trial in asked.trials):
        raise TilestampError(f"none of {cells} cells has a number to compare: {rows[0].get('problem', '')}")
    best = {trial.number for trial in asked.best_trials}
    return pd.DataFrame(rows).assign(best=[number in best for number in range(len(rows))])


def _share(trial: "Trial", name: str, length: int) -> float:
    """Ask for a point of one axis: anywhere in a range, or in the middle of a value's part."""
    if not length:
        return float(trial.suggest_float(name, 0.0, 1.0))
    return (int(trial.suggest_categorical(name, list(range(length)))) + 0.5) / length
