"""Cells as bars: ours beside what is published."""

from collections.abc import Callable, Sequence
from pathlib import Path

from tilestamp.experiments.harness.result import Cell, CellFigure
from tilestamp.reports.bars import paired_bars


def row_and_column(cell: Cell) -> str:
    """Where a cell stands."""
    return f"{cell.row}, {cell.column}"


def cell_bars(
    name: str, of: Callable[[Cell], bool], title: str, unit: str, label: Callable[[Cell], str] = row_and_column
) -> CellFigure:
    """A plot with a bar for each cell that ``of`` chooses.

    Parameters
    ----------
    name, title : str
    of : callable
    unit : str
        What the bars are long in.
    label : callable
        What stands beside a cell's bar.
    """

    def draw(cells: Sequence[Cell], path: Path) -> None:
        import pandas as pd

        chosen = [cell for cell in cells if of(cell)]
        rows = [{"label": label(c), "ours": c.ours, "published": c.published, "status": c.status} for c in chosen]
        paired_bars(pd.DataFrame(rows), path, title=title, unit=unit)

    return CellFigure(name, draw)
