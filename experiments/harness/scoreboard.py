"""The scoreboard: what each experiment comes to, a row each. Terminal, page and files show these numbers.

Times and counts stand apart: counters that are exact would flatter the mean of the times. Only predicted cells are
averaged, and none whose error is already in another one's.
"""

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any

from tilestamp.experiments.harness.result import Kind, Result, Status

WORDS: tuple[Status, ...] = ("predicted", "partly fitted")  # statuses of orders and winners that say something


@dataclass(frozen=True)
class Errors:
    """Predicted cells of one kind: how many, absolute relative errors, and how many of those with an aim reach it."""

    number: int = 0
    mean: float | None = None
    worst: float | None = None
    within: int = 0
    aimed: int = 0


@dataclass(frozen=True)
class Words:
    """Orders and winners: how many are as published."""

    right: int = 0
    of: int = 0


@dataclass(frozen=True, kw_only=True)
class Row:
    """What one experiment comes to, or all of them together.

    Parameters
    ----------
    experiment, name, title, question, answer, state : str
        ``state`` is ``done``, or ``not run`` where its inputs are missing.
    outdated : str
        Why it is no longer what a run would give, if so.
    seconds : float
        That it took.
    times, counts : Errors
    orders : Words
    partly_fitted, fitted, stand_ins, reproduced, reported, missed : int
        Numbers of cells.
    """

    experiment: str = ""
    name: str = ""
    title: str = ""
    question: str = ""
    answer: str = ""
    state: str = "done"
    outdated: str = ""
    seconds: float = 0.0
    times: Errors = Errors()
    counts: Errors = Errors()
    orders: Words = Words()
    partly_fitted: int = 0
    fitted: int = 0
    stand_ins: int = 0
    reproduced: int = 0
    reported: int = 0
    missed: int = 0

    @property
    def compares(self) -> bool:
        """Whether anything stands in it that a source has published or measured."""
        return any((self.times.number, self.counts.number, self.orders.of, self.partly_fitted, self.fitted,
                    self.stand_ins, self.reproduced))  # fmt: skip


def row_of(result: Result, **about: Any) -> Row:
    """The row of a result; ``about`` it says what the cells do not: question, answer, state, outdated, seconds."""
    cells = result.cells
    words = [cell for cell in cells if cell.kind == "order" and cell.published is not None and cell.status in WORDS]
    number = {status: sum(cell.status == status for cell in cells) for status in
              ("partly fitted", "fitted", "stand-in", "reproduced", "reported")}  # fmt: skip
    return Row(
        experiment=result.experiment,
        title=result.title,
        times=errors_of(result, "predicted", "time"),
        counts=errors_of(result, "predicted", "count"),
        orders=Words(sum(not word.missed for word in words), len(words)),
        partly_fitted=number["partly fitted"],
        fitted=number["fitted"],
        stand_ins=number["stand-in"],
        reproduced=number["reproduced"],
        reported=number["reported"],
        missed=sum(cell.missed for cell in cells),
        **about,
    )


def errors_of(result: Result, status: Status, kind: Kind) -> Errors:
    """Errors of the cells of one status and kind."""
    cells = result.compared(status, kind)
    errors = [abs(cell.error) for cell in cells if cell.error is not None]
    if not errors:
        return Errors()
    aimed = [cell for cell in cells if cell.aim is not None]
    within = sum(not cell.missed for cell in aimed)
    return Errors(len(errors), sum(errors) / len(errors), max(errors), within, len(aimed))


def total(rows: Sequence[Row]) -> Row:
    """All rows together: means over all cells."""
    numbers = {f.name: sum(getattr(row, f.name) for row in rows) for f in fields(Row) if f.type in (int, "int")}
    return Row(
        **numbers,
        times=_together([row.times for row in rows]),
        counts=_together([row.counts for row in rows]),
        orders=Words(sum(row.orders.right for row in rows), sum(row.orders.of for row in rows)),
        seconds=sum(row.seconds for row in rows),
    )


def _together(parts: Iterable[Errors]) -> Errors:
    parts = [part for part in parts if part.number]
    number = sum(part.number for part in parts)
    return Errors(
        number,
        sum(part.number * (part.mean or 0.0) for part in parts) / number if number else None,
        max((part.worst or 0.0 for part in parts), default=None),
        sum(part.within for part in parts),
        sum(part.aimed for part in parts),
    )


def flat(row: Row) -> dict[str, Any]:
    """A row for a table: ``times_mean``, ``orders_right`` and so on; sentences are left to JSON."""
    record = asdict(row)
    for name in ("times", "counts", "orders"):
        inner = record.pop(name)
        record |= {name if key == "number" else f"{name}_{key}": value for key, value in inner.items()}
    return {key: value for key, value in record.items() if key not in {"name", "title", "question", "answer"}}
