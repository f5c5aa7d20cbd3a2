"""The command ``tilestamp``: parses arguments, turns errors into one sentence and an exit code."""

import errno
import gc
import io
import os
import shlex
import signal
import sys
from types import FrameType
from typing import TYPE_CHECKING

import tilestamp

if TYPE_CHECKING:
    from cyclopts import App

BAD_INPUT = 2
INTERRUPTED = 130
TERMINATED = 143
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
COMMANDS = {  # where each is, and its line in the list of commands: its own first, which is not loaded for it
    "render": ("render:render", "Draw SCENE and print what each stage did and how long it would take."),
    "compare": (
        "compare:compare",
        "Compare runs stage by stage: times, shares, ratios, bounds, and how the term that bounds changed.",
    ),
    "study": ("study:study", "Run the cells of a study file that its store lacks, and print its table."),
    "ask": ("ask:ask", "Ask a study: what is best where, what lies on a front, what matters, what is better still."),
    "reproduce": (
        "reproduce:reproduce",
        "Put published tables beside what the model computes: a scoreboard, the tables by name, files and a page.",
    ),
    "page": (
        "page:page",
        "Write the page and the scoreboard anew from the results that lie in a folder; nothing is run.",
    ),
    "validate": (
        "validate:validate",
        "Print model against machine: by kernel and counter, from stored measurements, or on the GPU of this computer.",
    ),
    "measure-machine": (
        "measure_machine:measure_machine",
        "Run micro-benchmarks on the GPU of this computer and write a machine file, each number with its provenance.",
    ),
    "list": (
        "catalogue:catalogue",
        "List scenes, pipelines, machines or experiments; or options, maps, numbers or views of one of them.",
    ),
}
HELP = "Reference simulator for rasterizers written in software for GPUs: exact pictures, counted work, priced time."


class _TerminatedError(BaseException):
    """The order to end, SIGTERM: like Ctrl-C it unwinds, so that nothing half-written and no process is left."""


def main() -> None:
    """Run the command line and leave with its exit code."""
    gc.set_threshold(100_000)  # what is imported stays: to look through it over and over takes a tenth of the imports
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # small products: threads would spin longer than they compute
    signal.signal(signal.SIGTERM, _terminate)
    if isinstance(sys.stdout, io.TextIOWrapper):  # a name that the terminal has no letters for is escaped
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        sys.exit(run_command(sys.argv[1:]))
    finally:
        gc.freeze()  # or Python looks through all that was imported for garbage, several times, before the process ends


def _terminate(_signal: int, _frame: FrameType | None) -> None:
    raise _TerminatedError


def run_command(arguments: list[str]) -> int:
    """Run one command.

    Returns
    -------
    int
        0; 1 where an experiment failed; 2 for bad input; 130 after Ctrl-C; 143 after SIGTERM.
    """
    try:  # the imports too: they take a second in which a user may change his mind
        code = _run(arguments)
        sys.stdout.flush()
    except KeyboardInterrupt:
        sys.stderr.write("tilestamp: interrupted; nothing was half-written\n")
        return INTERRUPTED
    except _TerminatedError:
        sys.stderr.write("tilestamp: told to end; nothing was half-written\n")
        return TERMINATED
    except BrokenPipeError:
        sys.stderr.close()
        return 0
    except SystemExit as ended:  # rich ends so where nobody reads on
        if isinstance(ended.__context__, BrokenPipeError):
            return 0
        raise
    except OSError as error:
        if error.errno not in FULL:
            raise
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # what is still to be written goes nowhere
        sys.stderr.write(f"tilestamp: the output cannot be written ({error.strerror})\n")
        return BAD_INPUT
    return code


def _run(arguments: list[str]) -> int:
    """Run one command; bad input is one sentence."""
    from cyclopts import CycloptsError
    from cyclopts.exceptions import UnusedCliTokensError

    from tilestamp.models.errors import TilestampError

    try:
        code = _app(arguments)(arguments, exit_on_error=False, print_error=False, result_action="return_value")
    except (TilestampError, CycloptsError) as error:
        said = " ".join(str(error).split())
        if isinstance(error, UnusedCliTokensError):
            said = f"{shlex.join(error.unused_tokens or [])}: more than this command takes (--help)"
        sys.stderr.write(f"tilestamp: {said}{_try(arguments, error)}\n")
        return BAD_INPUT
    return code if isinstance(code, int) else 0


def _try(arguments: list[str], error: Exception) -> str:
    """Clause with the command that would do, where another choice can."""
    instead: dict[str, str] = getattr(error, "instead", {})
    if not instead or arguments[:1] != ["render"]:
        return ""
    kept, flags = list(arguments), [f"--{name}" for name in instead]
    for index in reversed(range(len(kept))):
        flag, value, _ = kept[index].partition("=")
        if flag in flags:
            del kept[index : index + (1 if value else 2)]
    return f"; try: {shlex.join(['tilestamp', *kept, *(f'--{name}={value}' for name, value in instead.items())])}"


def _default(value: object) -> str | None:
    """A default as one would type it; nothing where it is nothing."""
    if isinstance(value, tuple):
        return " ".join(map(str, value)) or None
    return None if value in (None, "", False) else str(value)


def _app(arguments: list[str]) -> "App":
    """Put the commands together, loaded when used; ``render`` has the flags of the pipeline that is named."""
    from cyclopts import App, Parameter

    from tilestamp.experiments.commands.examples import epilogue

    app = App(
        name="tilestamp",
        version=tilestamp.__version__,
        version_format="plaintext",
        help=HELP,
        help_format="markdown",
        suppress_keyboard_interrupt=False,
        default_parameter=Parameter(show_default=_default),
    )
    used = arguments[:1]
    if not used or used[0].startswith("-"):
        app.register_install_completion_command(help="Complete commands, options and names in this shell from now on.")
        app.help_epilogue = epilogue("")
    for name, (place, line) in COMMANDS.items():
        examples = {"help_epilogue": epilogue(name)} if used == [name] != ["ask"] else {}
        if name == "render" and used == [name]:
            from tilestamp.experiments.commands.draw import PIPELINE
            from tilestamp.experiments.commands.option_flags import named_pipeline, with_flags
            from tilestamp.experiments.commands.render import render

            app.command(with_flags(render, named_pipeline(arguments[1:], PIPELINE)), **examples)
        else:
            text = None if used == [name] else line
            app.command(f"tilestamp.experiments.commands.{place}", name=name, help=text, **examples)
    return app
