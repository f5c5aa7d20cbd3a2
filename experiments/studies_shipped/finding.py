"""What shipped studies and roads not taken say, and how: numbers and sentences are computed from the run."""

from collections.abc import Mapping, Sequence

import pandas as pd

from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Cell, Chart, Figure, Result
from tilestamp.experiments.studies.study import Study

SOURCE = "tilestamp's own runs: nothing published stands beside these numbers"
WHAT_IF = "what-if: machines with changed numbers do not exist, and their numbers are assumed"


def table_of(study: Study, progress: Progress) -> pd.DataFrame:
    """Run a study in this process; its table."""
    study.run(jobs=1, say=lambda how_far: progress(f"{study.title}: {how_far}"))
    return study.table()


def finding(
    name: str,
    title: str,
    cells: Sequence[Cell],
    figures: Sequence[Figure],
    notes: Sequence[str],
    tables: Mapping[str, pd.DataFrame],
    warnings: Sequence[str] = (),
    charts: Sequence[Chart] = (),
    folder: str = "studies_shipped",
) -> Result:
    """Make the result of an experiment beside which nothing is published; its first note is its answer."""
    return Result(
        f"{folder}-{name}", title, SOURCE, list(cells), notes[0],
        figures=list(figures), charts=list(charts),
        notes=list(notes), warnings=list(warnings), tables=dict(tables),
    )  # fmt: skip
