"""Cells of every experiment: what is published, what is ours, and what kind of number it is.

The experiments run on the real scenes where these are at hand, which changes their numbers: such an experiment is
compared only where they are.
"""

from tests.ledger.book import Entries
from tilestamp.experiments.harness.registry import load_experiment

HEADER = ("row", "column", "unit", "what", "value")


def entries(name: str) -> Entries:
    """Every cell of an experiment: (row, column, unit, what) -> value as text."""
    result = load_experiment(name)(lambda _: None)
    made: Entries = {}
    for cell in result.cells:
        place = (cell.row, cell.column, cell.unit)
        turn = sum(key[:3] == place and key[3] == "status" for key in made)
        place = (cell.row + f" #{turn + 1}" * bool(turn), cell.column, cell.unit)
        made[*place, "published"] = _text(cell.published)
        made[*place, "ours"] = _text(cell.ours)
        made[*place, "status"] = cell.status
        made[*place, "aim"] = _text(cell.aim)
    for index, warning in enumerate(result.warnings):
        made["warning", str(index), "", "text"] = warning
    return made


def _text(value: float | str | None) -> str:
    if value is None or isinstance(value, str):
        return value or ""
    return f"{value:.7g}"
