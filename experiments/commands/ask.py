"""``tilestamp ask``: questions to a study file; what the answer needs and the store lacks is run."""

import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from tilestamp.experiments.commands.examples import epilogue
from tilestamp.experiments.commands.outputs import check_png, writing
from tilestamp.experiments.commands.study import agree, print_rows
from tilestamp.experiments.commands.terminal import Progress, progress
from tilestamp.experiments.questions import answers
from tilestamp.experiments.studies.places import StudyError
from tilestamp.experiments.studies.store import Store
from tilestamp.experiments.studies.study import Study
from tilestamp.experiments.studies.study_file import StudyFile

KEPT_IN = "SQLite file that keeps the cells; beside the study, with the same name, if not given."
StudyPath = Annotated[Path, Parameter(help="The study, TOML (docs/studies.md).")]
StorePath = Annotated[Path | None, Parameter(name="--store", help=KEPT_IN)]
Picture = Annotated[Path | None, Parameter(name=["--output", "-o"], help="Write a picture of the answer as .png.")]
Jobs = Annotated[
    int | None, Parameter(name=["--jobs", "-j"], help="Processes; as many as the forecast is worth if not given.")
]
ask = App(
    name="ask",
    help="Ask a study: what is best where, what lies on a front, what matters, what is better still.",
    help_epilogue=epilogue("ask"),
)


@ask.command
def best(
    file: StudyPath,
    axis: str,
    /,
    *,
    over: str,
    number: str = "milliseconds",
    output: Picture = None,
    store: StorePath = None,
    jobs: Jobs = None,
) -> None:
    """Which value of an axis is the best at each place of a plane, and where that changes.

    Parameters
    ----------
    axis
        The axis whose best value is wanted, such as `tile`.
    over
        The plane: two other axes, `zoom,machine`. Each place on all further axes is a panel.
    number
        What is to be small.
    """
    check_png(output)
    with _study(file, store) as (asked, say):
        agree(len(asked), yes=False)
        _show(answers.best(asked, axis, _names(over), number, jobs, say), asked, output)


@ask.command
def front(
    file: StudyPath, one: str, other: str, /, *, output: Picture = None, store: StorePath = None, jobs: Jobs = None
) -> None:
    """Which cells nothing beats in two numbers at once: the Pareto front, both to be small.

    Parameters
    ----------
    one
        A number of a cell, such as `milliseconds`, or an axis.
    other
        Another one, such as `area`.
    """
    check_png(output)
    with _study(file, store) as (asked, say):
        agree(len(asked), yes=False)
        _show(answers.front(asked, one, other, jobs, say), asked, output)


@ask.command
def screen(
    file: StudyPath, number: str = "milliseconds", /, *, walks: int = 8, output: Picture = None, store: StorePath = None
) -> None:
    """Which axes matter: Morris screening of the space between the ends of the study's axes.

    Parameters
    ----------
    number
        What is looked at.
    walks
        Through the space; each has a cell more than there are axes.
    """
    check_png(output)
    with _study(file, store) as (asked, _):
        _show(answers.screened(asked, number, walks), asked, output)


@ask.command
def sobol(
    file: StudyPath,
    number: str = "milliseconds",
    /,
    *,
    points: int = 64,
    output: Picture = None,
    store: StorePath = None,
) -> None:
    """What share of a number's variance each axis accounts for: Sobol indices.

    Parameters
    ----------
    number
        What is looked at.
    points
        A power of two; as many cells as points times (axes and two).
    """
    check_png(output)
    with _study(file, store) as (asked, _):
        _show(answers.shared(asked, number, points), asked, output)


@ask.command
def search(
    file: StudyPath, wanted: str = "milliseconds", /, *, cells: int = 64, seed: int = 0, output: Picture = None,
    store: StorePath = None,
) -> None:  # fmt: skip
    """Look for the best point between the ends of the study's axes, or for the front of several numbers (optuna).

    Parameters
    ----------
    wanted
        What is to be small: `milliseconds`, or several numbers, `milliseconds,area`.
    cells
        To run, those that are stored included.
    seed
        Of the search: the same one asks for the same points.
    """
    check_png(output)
    with _study(file, store) as (asked, say):
        _show(answers.searched(asked, _names(wanted), cells, seed, say), asked, output)


@contextmanager
def _study(file: Path, store: Path | None) -> Iterator[tuple[Study, Progress]]:
    """The study of a file with its store open, and whom to tell how far it is."""
    read = StudyFile(file)
    try:
        with closing(Store(store or file.with_suffix(".sqlite"))) as kept, progress("running cells") as say:
            yield read.study(kept), say
    except StudyError as error:
        raise read.placed(error) from None


def _show(answer: answers.Answer, asked: Study, output: Path | None) -> None:
    """Print an answer, and draw it."""
    print_rows(answer.table, asked)
    sys.stdout.writelines(f"- {sentence}\n" for sentence in answer.sentences)
    if output is not None:
        with writing(output) as partial:
            answer.draw(partial)
        sys.stdout.write(f"picture: {output}\n")


def _names(text: str) -> list[str]:
    """Names between commas."""
    return [name.strip() for name in text.split(",") if name.strip()]
