"""Cells of every experiment: what is published, what is ours, and what kind of number it is.

The experiments run on the real scenes, which change their numbers: they are compared only where those are at hand.
"""

from tests.ledger.book import Entries
from tilestamp.experiments.harness.fit import run_judged
from tilestamp.experiments.harness.registry import experiment_names, load_experiment

HEADER = ("row", "column", "unit", "what", "value")
MEASURED = {"frontier/model", "frontier/sampled"}  # their cells are CPU seconds, or depend on those of a calibration
ELSEWHERE = {"silicon/textured_binned", "silicon/textured_ru"}  # judged for minutes: docs/accuracy.md has their numbers
QUICK = {  # compared in the default suite; the others by ``pytest -m cells``
    "eisenacher2010/claims", "eisenacher2010/table1", "eisenacher2010/table2", "eisenacher2010/table3",
    "laine2011/memory", "laine2011/table3", "ru2016/tile_size", "zhang2025/graph",
}  # fmt: skip


def experiments() -> list[str]:
    """Experiments whose cells are in the ledger."""
    return [name for name in experiment_names() if name not in MEASURED | ELSEWHERE]


def file_name(name: str) -> str:
    """Name of an experiment's file."""
    return name.replace("/", "-")


def entries(name: str) -> Entries:
    """Every cell of an experiment: (row, column, unit, what) -> value as text."""
    result, _ = run_judged(load_experiment(name), lambda _: None)
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
