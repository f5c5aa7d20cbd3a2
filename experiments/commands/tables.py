"""Tables on standard output: no number is cut; what does not fit the terminal stands below, or is named."""

import os
import sys
import textwrap
from collections.abc import Mapping, Sequence
from itertools import zip_longest
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console, JustifyMethod
    from rich.table import Table

WIDE = 240  # columns of a table that goes to a file or a pipe
UNLIMITED = 1000  # columns in which any table has room
GAP = 2  # blanks between two columns
SENTENCE = 30  # columns that a sentence needs beside others
BELOW = "    "  # before one that stands below them


def print_table(
    title: str,
    columns: Sequence[str],
    rows: Sequence[Sequence[str]],
    styles: Sequence[str] = (),
    *,
    keys: int = 1,
    together: int = 1,
    first: int = 0,
) -> list[str]:
    """Print a table; where it is wider than the terminal, in parts below each other, each with the key columns.

    Parameters
    ----------
    title : str
    columns : sequence of str
    rows : sequence of sequences of str
    styles : sequence of str
        Of the rows, as rich names them.
    keys : int
        Leading columns that say what a row is. The first is on the left, all others on the right.
    together : int
        Columns behind the keys that stay in one part: of each run its time, share and ratio.
    first : int
        Print only these columns behind the keys and those that fit beside them; 0 prints all.

    Returns
    -------
    list of str
        Columns that were not printed.
    """
    console = _console()
    lines = [columns, *rows]
    while keys > 1 and sum(_key_words(lines, keys)) > console.width / 2:
        keys -= 1  # or little else would stand beside them
    parts = _parts(lines, keys, together, console.width)
    if first:
        parts = [part for part in parts if part[keys] < keys + first]
    print_lines(title, style="italic")
    for index, part in enumerate(parts):
        if index:
            console.print()
        _print_part(console, part, columns, rows, styles, keys)
    printed = {column for part in parts for column in part}
    return [name for column, name in enumerate(columns) if column not in printed]


def _console() -> "Console":
    """Standard output: a terminal's width, or COLUMNS, or room for everything in a file or a pipe."""
    from rich.console import Console

    console = Console()
    return console if console.is_terminal or os.environ.get("COLUMNS") else Console(width=WIDE)


def print_lines(*lines: str, style: str = "") -> None:
    """Print lines; on a terminal long ones go on below, between words."""
    from rich.text import Text

    console = _console()
    for line in lines:
        console.print(Text(line, style=style), soft_wrap=not console.is_terminal)


def print_first_that_fits(*tables: "Table") -> None:
    """Print the first of several layouts that is no wider than the terminal; the last one if none is."""
    console = _console()
    wide = console.options.update(width=UNLIMITED)
    fitting = [table for table in tables if console.measure(table, options=wide).maximum <= console.width]
    console.print((fitting or tables[-1:])[0])


def _parts(lines: Sequence[Sequence[str]], keys: int, together: int, width: int) -> list[list[int]]:
    """Columns of each part that fits the width: the keys, whose words may go on below, and whole columns."""
    from rich.cells import cell_len

    def wide(column: int) -> int:
        return max(cell_len(line[column]) for line in lines) + GAP

    room = width + GAP - sum(_key_words(lines, keys))  # none after the last
    parts: list[list[int]] = [] if keys < len(lines[0]) else [list(range(keys))]
    left = 0
    for column in range(keys, len(lines[0]), together):
        group = range(column, min(column + together, len(lines[0])))
        needed = sum(map(wide, group))
        for each in [group] if needed <= room else [[one] for one in group]:
            needed = sum(map(wide, each))
            if not parts or needed > left:
                parts.append(list(range(keys)))
                left = room
            parts[-1] += each
            left -= needed
    return parts


def _key_words(lines: Sequence[Sequence[str]], keys: int) -> list[int]:
    """Columns of the longest word of each key, with the gap behind it."""
    from rich.cells import cell_len

    return [
        GAP + max((cell_len(word) for line in lines for word in line[key].split()), default=0) for key in range(keys)
    ]


def _print_part(
    console: "Console",
    part: Sequence[int],
    columns: Sequence[str],
    rows: Sequence[Sequence[str]],
    styles: Sequence[str],
    keys: int,
) -> None:
    from rich.table import Table
    from rich.text import Text

    table = Table(header_style="bold", box=None, pad_edge=False)
    for column in part:
        whole = column >= keys and len(part) > keys + 1  # a column alone in its part may be wider than the terminal
        side: JustifyMethod = "right" if column else "left"
        table.add_column(Text(columns[column]), justify=side, no_wrap=whole, overflow="fold")
    for row, style in zip_longest(rows, styles[: len(rows)]):
        table.add_row(*(Text(row[column]) for column in part), style=style)
    console.print(table)


def print_words(rows: Sequence[Sequence[str]], columns: Sequence[str] = ()) -> None:
    """Print a table of words: on a terminal long cells go on below themselves, but for the names in the first column.

    Parameters
    ----------
    rows : sequence of sequences of str
    columns : sequence of str
        What stands above them, if anything.
    """
    console = _console()
    lines = [*([columns] if columns else []), *rows]
    if not lines:
        return
    if not console.is_terminal:
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        padded = ["  ".join(map(str.ljust, line, widths)).rstrip() for line in lines]
        sys.stdout.writelines(f"{line}\n" for line in padded)
        return
    if _too_narrow(lines, console.width):
        for *short, long in rows:
            print_lines(
                "  ".join(short), *textwrap.wrap(long, console.width, initial_indent=BELOW, subsequent_indent=BELOW)
            )
        return
    from rich.table import Table
    from rich.text import Text

    table = Table(header_style="bold", box=None, pad_edge=False, show_header=bool(columns))
    for index in range(len(lines[0])):
        table.add_column(Text(columns[index] if columns else ""), no_wrap=index == 0, overflow="fold")
    for row in rows:
        table.add_row(*map(Text, row))
    console.print(table)


def _too_narrow(lines: Sequence[Sequence[str]], width: int) -> bool:
    """Whether sentences in the last column would stand in a strip beside short cells."""
    *short, long = (max(map(len, column)) for column in zip(*lines, strict=True))
    left = width - sum(each + GAP for each in short)
    return len(short) > 1 and left < min(long, SENTENCE)


def print_entries(lines: Mapping[str, str]) -> None:
    """Print a name and a sentence a line."""
    print_words(list(lines.items()))
