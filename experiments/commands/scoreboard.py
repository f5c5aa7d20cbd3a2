"""The scoreboard on a terminal: a line an experiment, on a narrow one a line for each kind of its cells."""

from collections.abc import Sequence
from itertools import groupby

from rich.table import Table
from rich.text import Text

from tilestamp.experiments.commands.tables import print_first_that_fits, print_lines, print_words
from tilestamp.experiments.harness.scoreboard import Errors, Row, total
from tilestamp.experiments.harness.texts import percent, score_text

HEAD = ("times", "mean", "worst", "aim", "counts", "mean", "worst", "aim", "orders")
OTHERS = {"fitted": "fitted", "partly_fitted": "partly\nfitted", "stand_ins": "stand-\nins"}
LEGEND = "Of predicted cells: number, mean and worst error in %, and how many of those with an aim are within it."


def print_scoreboard(rows: Sequence[Row], advice: Sequence[str]) -> None:
    """Print what each experiment comes to, all of them together, and what to do for more."""
    compared = [row for row in rows if row.compares]
    if compared:
        print_lines("", "Published or measured beside the model", style="bold")
        print_first_that_fits(_lines(compared), _stacked(compared))
        print_lines(LEGEND, style="dim")
    others = [row for row in rows if not row.compares and row.state == "done"]
    if others:
        print_lines("", "Questions beside which nothing is published", style="bold")
        print_words([line for group, some in _named(others) for line in ((group, ""), *map(_answer, some))])
    said = score_text(total(rows)) or "nothing that is published was compared"
    count = "1 experiment" if len(rows) == 1 else f"{len(rows)} experiments"
    print_lines("", f"{count}: {said}.", *(f"! {sentence}" for sentence in advice))


def _answer(row: Row) -> tuple[str, str]:
    return _name(row), row.answer


def _name(row: Row) -> str:
    """An experiment below its folder."""
    return f"  {row.experiment.partition('/')[2]}"


def _named(rows: Sequence[Row]) -> list[tuple[str, list[Row]]]:
    """Rows by the folder of their experiments."""
    return [(group, list(some)) for group, some in groupby(rows, key=lambda row: row.experiment.partition("/")[0])]


def _table(*columns: str) -> Table:
    """A table whose first column is the experiment."""
    table = Table(header_style="bold", box=None, pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column("", overflow="fold")
    for name in columns:
        table.add_column(name, justify="right", no_wrap=True, vertical="bottom")
    return table


def _lines(rows: Sequence[Row]) -> Table:
    shown = [name for name in OTHERS if any(getattr(row, name) for row in rows)]
    table = _table(*HEAD, *(OTHERS[name] for name in shown))
    for group, some in _named(rows):
        table.add_row(Text(group, style="bold"))
        for row in some:
            orders = f"{row.orders.right}/{row.orders.of}" if row.orders.of else ""
            rest = [str(getattr(row, name) or "") for name in shown]
            table.add_row(_name(row), *_texts(row.times), *_texts(row.counts), orders, *rest)
    return table


def _stacked(rows: Sequence[Row]) -> Table:
    """A line for each kind of an experiment's cells."""
    table = _table("", "", "mean", "worst", "aim")
    table.columns[2].justify = "left"
    for group, some in _named(rows):
        table.add_row(Text(group, style="bold"))
        for row in some:
            for index, line in enumerate(_kinds(row)):
                table.add_row("" if index else _name(row), *line)
    return table


def _kinds(row: Row) -> list[tuple[str, ...]]:
    """Number, kind, mean, worst and what is within the aim, for each kind of cells that there are."""
    found = [(_texts(errors), kind) for kind, errors in (("times", row.times), ("counts", row.counts)) if errors.number]
    lines = [(number, kind, *rest) for (number, *rest), kind in found]
    if row.orders.of:
        lines.append((str(row.orders.of), "orders", "", "", f"{row.orders.right}/{row.orders.of}"))
    others = {"fitted": row.fitted, "partly fitted": row.partly_fitted, "stand-ins": row.stand_ins}
    others["reproduced"] = row.reproduced
    lines += [(str(number), kind, "", "", "") for kind, number in others.items() if number]
    return [(number, kind.removesuffix("s") if number == "1" else kind, *rest) for number, kind, *rest in lines]


def _texts(errors: Errors) -> tuple[str, str, str, str]:
    """Number, mean, worst, within the aim."""
    if errors.mean is None or errors.worst is None:
        return "", "", "", ""
    within = f"{errors.within}/{errors.aimed}" if errors.aimed else ""
    return str(errors.number), percent(errors.mean), percent(errors.worst), within
