"""``tilestamp reproduce``: published tables beside ours."""

import os
import shlex
import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from tilestamp.experiments.commands.outputs import write_json
from tilestamp.experiments.commands.scoreboard import print_scoreboard
from tilestamp.experiments.commands.tables import print_lines, print_table
from tilestamp.experiments.commands.terminal import progress
from tilestamp.experiments.harness.folder import rebuild, stored
from tilestamp.experiments.harness.jobs import default_jobs, run_experiments
from tilestamp.experiments.harness.record import result_of
from tilestamp.experiments.harness.registry import experiment_names, question, select
from tilestamp.experiments.harness.result import Outcome, Result
from tilestamp.experiments.harness.texts import COLUMNS, PRINTED, answered, averages, cell_texts, fitted_numbers
from tilestamp.experiments.harness.validity import outdated
from tilestamp.models.errors import TilestampError

RESULTS = Path("reports") / "results"
KEYS = 2  # columns that say what a cell is
FAILED = 1  # exit code where an experiment gave no result


def reproduce(
    *names: str,
    all_: Annotated[bool, Parameter(name="--all", negative="")] = False,
    again: Annotated[bool, Parameter(negative="")] = False,
    verbose: Annotated[bool, Parameter(name=["--verbose", "-v"], negative="")] = False,
    output: Annotated[Path, Parameter(name=["--output", "-o"])] = RESULTS,
    json_: Annotated[bool, Parameter(name="--json", negative="")] = False,
    jobs: Annotated[int | None, Parameter(name=["--jobs", "-j"])] = None,
) -> int:
    """Put published tables beside what the model computes: a scoreboard, the tables by name, files and a page.

    A result that lies in the folder already, and that a run would give again, is not run again.

    Parameters
    ----------
    names
        Experiments (`tilestamp list experiments`), papers, or tables; those that are quick if none is given.
    all_
        Run the slow ones too.
    again
        Run all of them again, also where their results are still valid.
    verbose
        Print the whole table of every experiment; those that are named are printed anyway.
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
    invalid = [name for name in chosen if again or outdated(output, name)]
    printed = (lambda _: None) if json_ or not (names or verbose) else _print_result
    kept = {record["experiment"]: result_of(record) for record in stored(output)}
    for name in chosen:
        if name not in invalid:
            printed(kept[name])
    with progress(f"reproducing {len(invalid)} experiments") as say:
        options = {"names": list(names), "command": shlex.join(sys.argv)}
        failed = []
        for number, outcome in enumerate(run_experiments(invalid, output, options, say, jobs or default_jobs()), 1):
            say.count(number, len(invalid))
            failed += [outcome] if outcome.failure else []
            if outcome.result is not None:
                with say.paused():
                    printed(outcome.result)
        say("writing the page")
        rows, advice, page = rebuild(output)
    if json_:
        write_json(_as_json(output, chosen))
    else:
        print_scoreboard(rows, advice)
        left = set(experiment_names()) - {row.experiment for row in rows} if not names else set()
        _print_end(output, page, len(chosen) - len(invalid), left)
    return _print_failures(sorted(failed, key=lambda outcome: chosen.index(outcome.name)))


def _as_json(output: Path, chosen: list[str]) -> dict[str, list[dict[str, str]]]:
    """The cells of each result, as texts by column."""
    results = [result_of(record) for record in stored(output) if record["experiment"] in chosen]
    return {r.experiment: [dict(zip(COLUMNS, cell_texts(cell), strict=True)) for cell in r.cells] for r in results}


def _make(output: Path) -> None:
    """Make the folder for the results before anything is computed."""
    try:
        output.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise TilestampError(f"-o {output}: cannot be made ({error.strerror})") from error
    if not os.access(output, os.W_OK):
        raise TilestampError(f"-o {output}: the folder cannot be written to")


def _print_failures(failed: list[Outcome]) -> int:
    """Name what failed, and why; give the exit code."""
    sys.stderr.writelines(f"tilestamp: {outcome.name} failed: {outcome.failure}\n" for outcome in failed)
    return FAILED if failed else 0


def _print_end(output: Path, page: Path, valid: int, left: set[str]) -> None:
    """Say where everything is, what was not run again, and what was left out for its time."""
    if valid:
        results = "1 result was" if valid == 1 else f"{valid} results were"
        sys.stdout.write(f"{results} valid and not run again (--again runs them)\n")
    if left:
        sys.stdout.write(f"{len(left)} experiments take longer and were not run (name them, or --all)\n")
    sys.stdout.write(f"CSV, manifests and plots: {output}; the page: {page}\n")


def _print_result(result: Result) -> None:
    """Print one result as a table, with its warnings above and its notes below."""
    asked = f"{question(result.experiment)} {answered(result)}".strip()
    print_lines("", *(f"! {warning}" for warning in result.warnings), asked)
    title = f"{result.title} [{result.experiment or result.name}]"
    if result.cells:
        texts = [cell_texts(cell)[:PRINTED] for cell in result.cells]
        shown = [index for index, column in enumerate(zip(*texts, strict=True)) if index < KEYS or any(column)]
        rows = [[row[index] for index in shown] for row in texts]
        styles = ["dim" if c.status in {"fitted", "stand-in"} else "bold red" if c.missed else "" for c in result.cells]
        print_table(title, [COLUMNS[index] for index in shown], rows, styles, keys=KEYS)
    else:
        print_lines(title)
    print_lines(*averages(result), *(f"- {note}" for note in (*fitted_numbers(result), *result.notes)))
    sys.stdout.flush()  # as they come, into a file too
