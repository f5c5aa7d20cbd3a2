"""``tilestamp study``: the cells of a study file, those that are missing, into a store."""

import sys
from contextlib import closing
from itertools import takewhile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from tilestamp.experiments.commands.outputs import check_file
from tilestamp.experiments.commands.tables import print_table
from tilestamp.experiments.commands.terminal import progress
from tilestamp.experiments.studies.cells import MOST_LISTED
from tilestamp.experiments.studies.parameters import Resolver
from tilestamp.experiments.studies.places import StudyError
from tilestamp.experiments.studies.store import Store
from tilestamp.experiments.studies.study import Study
from tilestamp.experiments.studies.study_file import StudyFile
from tilestamp.experiments.studies.table import export
from tilestamp.models.errors import TilestampError

if TYPE_CHECKING:
    import pandas as pd

PRINTED = 40  # rows of a table on the terminal
FAILED = 1  # exit code where a cell failed through a fault of ours


def study(
    file: Path,
    /,
    *,
    store: Path | None = None,
    jobs: Annotated[int | None, Parameter(name=["--jobs", "-j"])] = None,
    cluster: str | None = None,
    dry_run: Annotated[bool, Parameter(negative="")] = False,
    yes: Annotated[bool, Parameter(name=["--yes", "-y"], negative="")] = False,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
) -> int:
    """Run the cells of a study file that its store lacks, and print its table.

    Parameters
    ----------
    file
        The study, TOML (docs/studies.md).
    store
        SQLite file that keeps the cells; beside the study, with the same name, if not given. Studies may share one.
    jobs
        Processes; as many as the forecast is worth if not given.
    cluster
        Run on dask.distributed: `local`, which starts a cluster here, or the address of a scheduler (tcp://HOST:8786).
    dry_run
        Say what would be done, and do nothing.
    yes
        Do not ask, however many cells there are.
    output
        Write the table as .csv, or as .parquet where pyarrow is installed.
    """
    _check(output, jobs)
    read, path, resolver = StudyFile(file), store or file.with_suffix(".sqlite"), Resolver()
    try:
        with closing(Store(path, create=False)) as kept:  # nothing is written before all is known to be right
            asked = read.study(kept)
            agree(len(asked), yes=yes or dry_run)
            with progress("looking at the study"):
                expected = asked.forecast(jobs, resolver)
        sys.stdout.write(f"{asked.title}: {expected.sentence()}\n")
        sys.stdout.flush()
        if dry_run:
            return 0
        with closing(Store(path)) as kept, progress("running the study") as say:
            asked = read.study(kept)
            summary = asked.run(jobs, cluster, say, resolver)
            table = asked.table(resolver)
    except StudyError as error:
        raise read.placed(error) from None
    sys.stdout.writelines(f"{sentence}\n" for sentence in (*summary.changed, *summary.sentences()))
    print_rows(table, asked)
    if output is not None:
        export(table, output)
        sys.stdout.write(f"table: {output}\n")
    return FAILED if summary.faults else 0


def _check(output: Path | None, jobs: int | None) -> None:
    """Refuse what could not be done, before anything is computed."""
    if jobs is not None and jobs < 1:
        raise TilestampError(f"{jobs} jobs: at least one process is needed")
    if output is not None:
        check_file(output, "-o", ".csv", ".parquet")


def agree(cells: int, *, yes: bool) -> None:
    """Ask before a study of very many cells."""
    if yes or cells <= MOST_LISTED:
        return
    if not sys.stdin.isatty():
        raise TilestampError(f"this study has {cells:,} cells: say --yes if that is meant")
    sys.stdout.write(f"This study has {cells:,} cells. Run it? [y/N] ")
    sys.stdout.flush()
    if sys.stdin.readline().strip().lower() not in ("y", "yes"):
        raise TilestampError(f"nothing was run of {cells:,} cells")


def print_rows(table: "pd.DataFrame", asked: Study) -> None:
    """Print the first rows of a table: where it is parted, its leading axes stand in each part."""
    columns = list(map(str, table.columns))
    axes = len(list(takewhile(asked.axes.__contains__, columns)))
    rows = [[cell_text(value) for value in row] for row in table.head(PRINTED).itertuples(index=False)]
    print_table(asked.title, columns, rows, keys=max(axes, 1))
    if len(table) > PRINTED:
        sys.stdout.write(f"... and {len(table) - PRINTED:,} rows more: -o FILE.csv has all\n")


def cell_text(value: object) -> str:
    """A value as a table on the terminal has it."""
    if value is None or value != value:  # noqa: PLR0124 - not-a-number
        return ""
    return f"{value:.5g}" if isinstance(value, float) else str(value)
