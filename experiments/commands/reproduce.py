"""``tilestamp reproduce``: published tables beside ours."""

import shlex
import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from tilestamp.experiments.commands.outputs import write_json
from tilestamp.experiments.commands.tables import print_table
from tilestamp.experiments.commands.terminal import progress
from tilestamp.experiments.harness.jobs import default_jobs, run_experiments
from tilestamp.experiments.harness.registry import experiment_names, select
from tilestamp.experiments.harness.result import Outcome, Result
from tilestamp.experiments.harness.texts import COLUMNS, PRINTED, averages, cell_texts, fitted_numbers
from tilestamp.experiments.harness.write import write_index
from tilestamp.models.errors import TilestampError

RESULTS = Path("reports") / "results"
FAILED = 1  # exit code where an experiment gave no result


def reproduce(
    *names: str,
    all_: Annotated[bool, Parameter(name="--all", negative="")] = False,
    output: Annotated[Path, Parameter(name=["--output", "-o"])] = RESULTS,
    json_: Annotated[bool, Parameter(name="--json", negative="")] = False,
    jobs: Annotated[int | None, Parameter(name=["--jobs", "-j"])] = None,
) -> int:
    """Print published tables beside what the model computes, cell by cell; write CSV, manifests, plots and a page.

    Parameters
    ----------
    names
        Experiments (`tilestamp list experiments`), papers, or tables; those that are quick if none is given.
    all_
        Run the slow ones too.
    output
        Folder for the results.
    json_
        Print one JSON object instead of tables.
    jobs
        Processes that run experiments side by side; one a core, two at most, if not given.
    """
    chosen = select(names, everything=all_)
    if jobs is not None and jobs < 1:
        raise TilestampError(f"{jobs} jobs: at least one process is needed")
    _make(output)
    with progress(f"reproducing {len(chosen)} experiments") as say:
        options = {"names": list(names), "command": shlex.join(sys.argv)}
        outcomes: dict[str, Outcome] = {}
        for outcome in run_experiments(chosen, output, options, say, jobs or default_jobs()):
            outcomes[outcome.name] = outcome
            say.count(len(outcomes), len(chosen))
            if outcome.result is not None and not json_:
                with say.paused():
                    _print_result(outcome.result)
        results = [result for name in chosen if (result := outcomes[name].result) is not None]
        page = write_index(results, output)
    if json_:
        cells = {r.name: [dict(zip(COLUMNS, cell_texts(cell), strict=True)) for cell in r.cells] for r in results}
        write_json(cells)
    else:
        _print_end(output, page, set(experiment_names()) - set(chosen) if not names else set())
    return _print_failures([outcomes[name] for name in chosen if outcomes[name].failure])


def _make(output: Path) -> None:
    """Make the folder for the results before anything is computed."""
    try:
        output.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise TilestampError(f"-o {output}: cannot be made ({error.strerror})") from error


def _print_failures(failed: list[Outcome]) -> int:
    """Name what failed, and why; give the exit code."""
    sys.stderr.writelines(f"tilestamp: {outcome.name} failed: {outcome.failure}\n" for outcome in failed)
    return FAILED if failed else 0


def _print_end(output: Path, page: Path, left: set[str]) -> None:
    """Say where everything is, and what was left out for its time."""
    sys.stdout.write(f"\nCSV, manifests and plots: {output}; the page: {page}\n")
    if left:
        sys.stdout.write(f"Not run, for their time (name them, or --all): {', '.join(sorted(left))}\n")


def _print_result(result: Result) -> None:
    """Print one result as a table, with its warnings above and its notes below."""
    sys.stdout.write("\n")
    for warning in result.warnings:
        sys.stdout.write(f"! {warning}\n")
    title = f"{result.title} [{result.name}]"
    if result.cells:
        rows = [cell_texts(cell)[:PRINTED] for cell in result.cells]
        styles = ["dim" if c.status == "fitted" else "bold red" if c.missed else "" for c in result.cells]
        print_table(title, COLUMNS[:PRINTED], rows, styles, keys=2)
    else:
        sys.stdout.write(f"{title}\n")
    sys.stdout.writelines(f"{sentence}\n" for sentence in averages(result))
    sys.stdout.writelines(f"- {note}\n" for note in (*fitted_numbers(result), *result.notes))
    sys.stdout.flush()  # as they come, into a file too
