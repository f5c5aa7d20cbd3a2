"""What the commands share on a terminal: progress on standard error, tables on standard output."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from rich.console import Console
from rich.table import Table

from models.compile_cache import is_cold


@contextmanager
def progress(text: str) -> Iterator["Progress"]:
    """Show what is being done on standard error; say so when kernels are being compiled."""
    console = Console(stderr=True)
    if is_cold():
        console.print("compiling kernels: only the first time, a minute or two")
    with console.status(text) as status:
        yield Progress(console, status.update)


class Progress:
    """Call it with what is being done now."""

    def __init__(self, console: Console, update: object) -> None:
        self._console = console
        self._update = update

    def __call__(self, text: str) -> None:
        """Say what is being done: in place on a terminal, a line each elsewhere."""
        if self._console.is_terminal:
            self._update(text)  # type: ignore[operator]  # rich's Status.update
        else:
            self._console.print(text)


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
