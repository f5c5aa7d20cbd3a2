"""What the commands share on a terminal: progress on standard error, tables on standard output."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console
from rich.status import Status
from rich.table import Table
from rich.text import Text

from tilestamp.models.compile_cache import on_compiling
from tilestamp.models.errors import TilestampError


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Say in a sentence why a file cannot be written."""
    try:
        yield
    except OSError as error:
        raise TilestampError(f"-o {path}: cannot be written ({error.strerror or error})") from error


@contextmanager
def progress(text: str) -> Iterator["Progress"]:
    """Show what is being done on standard error, and which kernels are being compiled meanwhile."""
    console = Console(stderr=True)
    with console.status(text) as status:
        said = Progress(console, status, text)
        on_compiling(said.compiling)
        yield said


class Progress:
    """Call it with what is being done now."""

    def __init__(self, console: Console, status: Status, text: str) -> None:
        self._console = console
        self._status = status
        self._text = text
        self._compiled = 0

    def compiling(self, kernel: str) -> None:
        """Say that a kernel is being compiled: each in place on a terminal, elsewhere only the first."""
        self._compiled += 1
        if self._console.is_terminal:
            self._status.update(f"{self._text}: compiling {kernel}, once (kernel {self._compiled})")
        elif self._compiled == 1:
            self._console.print("compiling kernels: only the first time, a minute or two")

    def __call__(self, text: str) -> None:
        """Say what is being done: in place on a terminal, a line each elsewhere."""
        self._text = text
        if self._console.is_terminal:
            self._status.update(text)
        else:
            self._console.print(text)

    @contextmanager
    def paused(self) -> Iterator[None]:
        """Show nothing meanwhile: rich sends to standard error what is printed beside a line in place."""
        self._status.stop()
        yield
        self._status.start()


def print_table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]], styles: Sequence[str] = ()) -> None:
    """Print a table on standard output: first column left, the others right."""
    table = Table(header_style="bold", box=None, pad_edge=False)
    for index, column in enumerate(columns):
        table.add_column(column, justify="left" if index == 0 else "right", no_wrap=True)
    for index, row in enumerate(rows):
        table.add_row(*row, style=styles[index] if index < len(styles) else None)
    console = Console()
    width = None if console.is_terminal else 240
    wide = Console(width=width)
    wide.print(title, style="italic", markup=False, soft_wrap=True)
    wide.print(table)


def print_wrapped(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table of words on standard output: long cells go on below, but for the names in the first column."""
    table = Table(header_style="bold", box=None, pad_edge=False)
    for index, column in enumerate(columns):
        table.add_column(column, no_wrap=index == 0)
    for row in rows:
        table.add_row(*map(Text, row))
    Console().print(table)
