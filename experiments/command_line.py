"""The command ``tilestamp``: parses arguments, turns errors into one sentence and an exit code."""

import sys

from cyclopts import App, CycloptsError

from experiments.commands.catalogue import catalogue
from experiments.commands.measure_machine import measure_machine
from experiments.commands.render import render
from experiments.commands.reproduce import reproduce
from experiments.commands.validate import validate
from models.errors import TilestampError

BAD_INPUT = 2
INTERRUPTED = 130

app = App(
    name="tilestamp",
    help="Reference simulator for rasterizers written in software for GPUs: exact pictures, counted work, priced time.",
    help_format="markdown",
    suppress_keyboard_interrupt=False,
)
app.command(render)
app.command(reproduce)
app.command(catalogue, name="list")
app.command(validate)
app.command(measure_machine)


def main() -> None:
    """Run the command line and leave with its exit code."""
    sys.exit(run_command(sys.argv[1:]))


def run_command(arguments: list[str]) -> int:
    """Run one command.

    Returns
    -------
    int
        0; 2 for bad input; 130 after Ctrl-C.
    """
    try:
        app(arguments, exit_on_error=False, print_error=False, result_action="return_value")
    except (TilestampError, CycloptsError) as error:
        sys.stderr.write(f"tilestamp: {' '.join(str(error).split())}\n")
        return BAD_INPUT
    except KeyboardInterrupt:
        sys.stderr.write("tilestamp: interrupted; nothing was half-written\n")
        return INTERRUPTED
    except BrokenPipeError:
        sys.stderr.close()
    return 0
