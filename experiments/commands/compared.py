"""Runs beside each other: read back, printed, drawn."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from math import isclose
from pathlib import Path
from typing import Any

from tilestamp.experiments.commands.outputs import writing
from tilestamp.experiments.commands.tables import print_lines, print_table
from tilestamp.models.errors import TilestampError
from tilestamp.simulator.run import Run
from tilestamp.simulator.why import LITTLE

FRAME = "frame"


@dataclass(frozen=True)
class Compared:
    """What is compared of a run.

    Parameters
    ----------
    name : str
        What makes it another than those beside it.
    scene, about : str
        What is drawn, and all that it is.
    times : dict of str to float
        Milliseconds by stage, ``frame`` last: the sum.
    bounds : dict of str to str
        What holds the longest launch of each stage.
    terms : dict of str to dict
        Milliseconds of each term of the time, by stage.
    """

    name: str
    scene: str
    about: str
    times: dict[str, float]
    bounds: dict[str, str]
    terms: dict[str, dict[str, float]]

    def plain(self) -> dict[str, Any]:
        """All of it as plain data."""
        return asdict(self)


def from_run(run: Run, name: str) -> Compared:
    """What is compared of a run that is here."""
    stages: dict[str, dict[str, Any]] = run.stages.astype(object).to_dict(orient="index")
    return _compared(
        name, run.scene, f"{run.scene} by {run.pipeline} on {run.machine.name}, {run.width}x{run.height}", stages
    )


def saved(path: Path) -> Compared:
    """Read what is compared of a run that ``tilestamp render --json`` printed.

    Raises
    ------
    TilestampError
        No such file, or one that holds no run with times.
    """
    try:
        run = json.loads(path.read_text("utf-8"))
        about = f"{run['scene']} by {run['pipeline']} on {run['machine']}, {run['width']}x{run['height']}"
        return _compared(path.stem, run["scene"], about, run["stages"])
    except OSError as error:
        raise TilestampError(f"{path}: cannot be read ({error.strerror or error})") from error
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise TilestampError(f"{path} holds no run with times, as tilestamp render --json prints one") from error


def _compared(name: str, scene: str, about: str, stages: dict[str, dict[str, Any]]) -> Compared:
    times = {stage: float(row["milliseconds"]) for stage, row in stages.items()}
    bounds = {stage: str(row["bound"]) for stage, row in stages.items()}
    terms = {
        stage: {
            key.removesuffix("_ms"): float(value)
            for key, value in row.items()
            if key.endswith("_ms") and value is not None and value == value  # noqa: PLR0124 - not-a-number
        }
        for stage, row in stages.items()
    }
    return Compared(name, scene, about, times | {FRAME: sum(times.values())}, bounds, terms)


def print_comparison(runs: Sequence[Compared]) -> None:
    """Print times, shares and ratios, then the bound of each stage and how that term changed."""
    print_lines(*(f"{run.name}: {run.about}" for run in runs))
    first, *others = runs
    stages = [*dict.fromkeys(stage for run in runs for stage in run.times if stage != FRAME), FRAME]
    columns = ["stage"]
    for run in runs:
        columns += [f"{run.name} ms", "share", "ratio"]
    rows = [[stage, *(text for run in runs for text in _cells(stage, run, first))] for stage in stages]
    print_lines("")
    print_table(f"Milliseconds; ratio: to {first.name}", columns, rows, together=3)
    rows = [_change(stage, first, run) for stage in stages[:-1] for run in others if _differs(stage, first, run)]
    if rows:
        print_lines("")
        columns = ["stage", "run", "bound", "then", "term", "ms", "then ms", "ratio"]
        print_table(
            "Bound of each stage, and how that term changed; where it did not, the largest change",
            columns,
            rows,
            keys=2,
            together=2,
        )


def _cells(stage: str, run: Compared, first: Compared) -> list[str]:
    """Time and share of a stage, and the ratio to that of another run."""
    if stage not in run.times:
        return ["", "", ""]
    time, whole = run.times[stage], run.times[FRAME]
    share = f"{100 * time / whole:.1f} %" if whole else ""
    return [f"{time:.4g}", share, f"{time / first.times[stage]:.4g}" if first.times.get(stage) else ""]


def _differs(stage: str, first: Compared, run: Compared) -> bool:
    """Whether two runs have a stage, with other times."""
    return stage in run.times and stage in first.times and run.times[stage] != first.times[stage]


def _change(stage: str, first: Compared, run: Compared) -> list[str]:
    """The bound of a stage in two runs, and how that term changed; where it did not, the one that changed most."""
    before, after = first.terms[stage], run.terms[stage]
    row = [stage, run.name, first.bounds[stage], run.bounds[stage]]
    both = before.keys() & after.keys()
    if not both:
        return [*row, "", "", "", ""]
    held = both & {first.bounds[stage], run.bounds[stage]}
    moved = {name for name in held if not isclose(after[name], before[name], rel_tol=LITTLE)} or both
    term = max(sorted(moved), key=lambda name: abs(after[name] - before[name]))
    ratio = f"{after[term] / before[term]:.4g}" if before[term] else ""
    return [*row, term, f"{before[term]:.4g}", f"{after[term]:.4g}", ratio]


def write_plot(runs: Sequence[Compared], path: Path) -> None:
    """Draw the times of the stages, a bar a run, with its bound at the end."""
    import pandas as pd

    from tilestamp.reports.compare_plot import grouped_bars

    rows = [
        {"stage": stage, "run": run.name, "milliseconds": time, "bound": run.bounds.get(stage, "")}
        for run in runs
        for stage, time in run.times.items()
    ]
    title = f"{', '.join(dict.fromkeys(run.scene for run in runs))}: milliseconds, and the bound"
    columns = {"group": "stage", "bar": "run", "value": "milliseconds", "note": "bound"}
    with writing(path) as partial:
        grouped_bars(pd.DataFrame(rows), partial, **columns, title=title, label="milliseconds")
