"""What the commands share on a terminal: progress on standard error, tables on standard output."""

import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import zip_longest
from pathlib import Path

from rich.console import Console
from rich.status import Status
from rich.table import Table
from rich.text import Text

from tilestamp.models.compile_cache import on_compiling
from tilestamp.models.errors import TilestampError

WIDE = 240  # columns of a table that goes to a file or a pipe
GAP = 2  # blanks between two columns


@contextmanager
def writing(path: Path, flag: str = "-o") -> Iterator[None]:
    """Say in a sentence why a file cannot be written."""
    try:
        yield
    except OSError as error:
        raise TilestampError(f"{flag} {path}: cannot be written ({error.strerror or error})") from error


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


def print_table(
    title: str, columns: Sequence[str], rows: Sequence[Sequence[str]], styles: Sequence[str] = (), keys: int = 1
) -> None:
    """Print a table on standard output; on a narrow terminal in parts below each other, each with the key columns.

    Parameters
    ----------
    title : str
    columns : sequence of str
    rows : sequence of sequences of str
    styles : sequence of str
        Of the rows, as rich names them.
    keys : int
        Leading columns that say what a row is. The first is on the left, all others on the right.
    """
    console = Console()
    wide = console if console.is_terminal else Console(width=WIDE)
    wide.print(title, style="italic", markup=False, soft_wrap=True)
    for index, part in enumerate(_parts([columns, *rows], keys, wide.width)):
        if index:
            wide.print()
        wide.print(_part(part, columns, rows, styles, keys))


def _parts(lines: Sequence[Sequence[str]], keys: int, width: int) -> list[list[int]]:
    """Columns of each part that fits the width: the keys, whose words may go on below, and whole columns."""
    key_words = [max((len(word) for line in lines for word in line[key].split()), default=0) for key in range(keys)]
    room = width + GAP - sum(word + GAP for word in key_words)  # none after the last
    parts: list[list[int]] = [] if keys < len(lines[0]) else [list(range(keys))]
    left = 0
    for column in range(keys, len(lines[0])):
        needed = max(len(line[column]) for line in lines) + GAP
        if not parts or needed > left:
            parts.append(list(range(keys)))
            left = room
        parts[-1].append(column)
        left -= needed
    return parts


def _part(
    part: list[int], columns: Sequence[str], rows: Sequence[Sequence[str]], styles: Sequence[str], keys: int
) -> Table:
    """Lay out some columns of a table."""
    table = Table(header_style="bold", box=None, pad_edge=False)
    for column in part:
        whole = column >= keys and len(part) > keys + 1  # a column alone in its part may be wider than the terminal
        table.add_column(columns[column], justify="right" if column else "left", no_wrap=whole)
    for row, style in zip_longest(rows, styles[: len(rows)]):
        table.add_row(*(row[column] for column in part), style=style)
    return table


def print_wrapped(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table of words on standard output: long cells go on below, but for the names in the first column."""
    table = Table(header_style="bold", box=None, pad_edge=False)
    for index, column in enumerate(columns):
        table.add_column(column, no_wrap=index == 0)
    for row in rows:
        table.add_row(*map(Text, row))
    Console().print(table)


def print_entries(lines: Mapping[str, str]) -> None:
    """Print a name and a sentence a line on standard output; on a terminal a long sentence goes on below itself."""
    console = Console()
    if not console.is_terminal:
        width = max(map(len, lines), default=0)
        sys.stdout.writelines(f"{name:{width}}  {line}\n" for name, line in lines.items())
        return
    table = Table(box=None, pad_edge=False, show_header=False)
    table.add_column(no_wrap=True)
    table.add_column()
    for name, line in lines.items():
        table.add_row(Text(name), Text(line))
    console.print(table)
