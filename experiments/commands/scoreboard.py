"""The scoreboard on a terminal: a line an experiment, on a narrow one a line for each kind of its cells."""

import os
from collections.abc import Sequence
from itertools import groupby

from rich.console import Console
from rich.table import Table
from rich.text import Text

from tilestamp.experiments.harness.scoreboard import Errors, Row, total
from tilestamp.experiments.harness.texts import percent, score_text

WIDE = 110  # columns in a file or a pipe
ROOM = 1000  # columns that any table has room in
HEAD = ("times", "mean", "worst", "aim"), ("counts", "mean", "worst", "aim")
LEGEND = "Of predicted cells: number, mean and worst error in %, and how many of those with an aim are within it."


def print_scoreboard(rows: Sequence[Row], advice: Sequence[str]) -> None:
    """Print what each experiment comes to, all of them together, and what to do for more."""
    console = Console()
    console = console if console.is_terminal or os.environ.get("COLUMNS") else Console(width=WIDE)
    compared = [row for row in rows if row.compares]
    if compared:
        console.print("\n[bold]Published or measured beside the model[/]", highlight=False)
        table = _lines(compared)
        fits = console.measure(table, options=console.options.update(width=ROOM)).maximum <= console.width
        console.print(table if fits else _stacked(compared))
        console.print(LEGEND, style="dim", highlight=False)
    others = [row for row in rows if not row.compares and row.state == "done"]
    if others:
        console.print("\n[bold]Questions beside which nothing is published[/]", highlight=False)
        console.print(_answers(others))
    said = score_text(total(rows)) or "nothing that is published was compared"
    console.print(Text(f"\nAll {len(rows)}: {said}."))
    for sentence in advice:
        console.print(Text(f"! {sentence}"))


def _named(rows: Sequence[Row]) -> list[tuple[str, list[Row]]]:
    """Rows by the folder of their experiments."""
    return [(group, list(some)) for group, some in groupby(rows, key=lambda row: row.experiment.partition("/")[0])]


def _lines(rows: Sequence[Row]) -> Table:
    """A line an experiment."""
    table = Table(header_style="bold", box=None, pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column("", overflow="fold")
    for name in (*HEAD[0], *HEAD[1], "orders"):
        table.add_column(name, justify="right", no_wrap=True, vertical="bottom")
    others = {"fitted": "fitted", "partly_fitted": "partly\nfitted", "stand_ins": "stand-\nins"}
    shown = [name for name in others if any(getattr(row, name) for row in rows)]
    for name in shown:
        table.add_column(others[name], justify="right", no_wrap=True, vertical="bottom")
    for group, some in _named(rows):
        table.add_row(Text(group, style="bold"))
        for row in some:
            orders = f"{row.orders.right}/{row.orders.of}" if row.orders.of else ""
            rest = [_number(getattr(row, name)) for name in shown]
            name = f"  {row.experiment.partition('/')[2]}"
            table.add_row(name, *_texts(row.times), *_texts(row.counts), orders, *rest)
    return table


def _stacked(rows: Sequence[Row]) -> Table:
    """A line for each kind of an experiment's cells."""
    table = Table(header_style="bold", box=None, pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column("", overflow="fold")
    for name in ("", "", "mean", "worst", "aim"):
        table.add_column(name, justify="right", no_wrap=True)
    table.columns[2].justify = "left"
    for group, some in _named(rows):
        table.add_row(Text(group, style="bold"))
        for row in some:
            name = f"  {row.experiment.partition('/')[2]}"
            for line in _kinds(row):
                table.add_row(name, *line)
                name = ""
    return table


def _kinds(row: Row) -> list[tuple[str, ...]]:
    """Number, kind, mean, worst and what is within the aim, for each kind of cells that there are."""
    found = [(_texts(errors), kind) for kind, errors in (("times", row.times), ("counts", row.counts)) if errors.number]
    lines = [(number, kind, *rest) for (number, *rest), kind in found]
    if row.orders.of:
        lines.append((str(row.orders.of), "orders", "", "", f"{row.orders.right}/{row.orders.of}"))
    others = {"fitted": row.fitted, "partly fitted": row.partly_fitted, "stand-ins": row.stand_ins}
    others["reproduced"] = row.reproduced
    return [*lines, *((str(number), kind, "", "", "") for kind, number in others.items() if number)]


def _texts(errors: Errors) -> tuple[str, str, str, str]:
    """Number, mean, worst, within the aim."""
    if errors.mean is None or errors.worst is None:
        return "", "", "", ""
    within = f"{errors.within}/{errors.aimed}" if errors.aimed else ""
    return str(errors.number), percent(errors.mean), percent(errors.worst), within


def _number(value: int) -> str:
    return str(value) if value else ""


def _answers(rows: Sequence[Row]) -> Table:
    """Experiments and their answers."""
    table = Table(box=None, pad_edge=False, show_header=False, padding=(0, 1, 0, 0))
    table.add_column(no_wrap=True)
    table.add_column()
    for group, some in _named(rows):
        table.add_row(Text(group, style="bold"), "")
        for row in some:
            table.add_row(f"  {row.experiment.partition('/')[2]}", Text(row.answer))
    return table
