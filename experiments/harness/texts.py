"""A result in words: a cell as the texts of its columns, what errors come to on average, which numbers were fitted."""

import math

from tilestamp.experiments.harness.result import Cell, Kind, Result, Status
from tilestamp.experiments.harness.scoreboard import Errors, Row, errors_of, row_of

COLUMNS = ("row", "column", "unit", "published", "ours", "error", "status", "aim", "share", "fitted by")
PRINTED = COLUMNS.index("share") + 1  # columns of the printed table: the numbers of all cells are named below it


def cell_texts(cell: Cell) -> tuple[str, ...]:
    """A cell as the texts of its columns."""
    error = "" if cell.error is None else f"{100 * cell.error:+.1f} %"
    aim = "" if cell.aim is None else f"{100 * cell.aim:.0f} %"
    if isinstance(cell.published, str):
        error = "as published" if cell.published == cell.ours else "differs"
    share = f"{100 * cell.share:.0f} %" if cell.status in {"predicted", "partly fitted", "fitted"} else ""
    numbers = number(cell.published), number(cell.ours)
    return (cell.row, cell.column, cell.unit, *numbers, error, cell.status, aim, share, fitted_by(cell))


def fitted_by(cell: Cell) -> str:
    """The fitted numbers that a cell follows, and how much of each."""
    return "; ".join(f"{name} {100 * part:.0f} %" for name, part in cell.fitted_by)


def number(value: float | str | None) -> str:
    """A value as text: four digits, thousands apart."""
    if value is None or isinstance(value, str):
        return value or ""
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.4g}"


def averages(result: Result) -> list[str]:
    """Mean and worst error of the predicted cells and of the partly fitted ones, times apart from counts."""
    statuses: tuple[Status, ...] = ("predicted", "partly fitted")
    kinds: tuple[Kind, ...] = ("time", "count")
    said = [[errors_text(errors_of(result, s, kind), f"{s} {kind}s") for kind in kinds] for s in statuses]
    return ["; ".join(filter(None, parts)) for parts in said if any(parts)]


def errors_text(errors: Errors, what: str) -> str:
    """Number, mean and worst of some errors; nothing where there are none. ``what`` is in the plural."""
    if errors.mean is None or errors.worst is None:
        return ""
    if errors.number == 1:
        return f"1 {what.removesuffix('s')}: error {percent(errors.worst)} %"
    return f"{errors.number:,} {what}: mean error {percent(errors.mean)} %, worst {percent(errors.worst)} %"


def percent(share: float) -> str:
    """A share in percent, with a digit after the point."""
    return f"{100 * share:.1f}"


def score_text(row: Row) -> str:
    """A row of the scoreboard in words: times, counts, orders, and the cells that say nothing of the model."""
    parts = [
        f"{errors_text(errors, f'predicted {kind}')}, {errors.within:,} of {errors.aimed:,} within their aim"
        for kind, errors in (("times", row.times), ("counts", row.counts))
        if errors.number
    ]
    if row.orders.of:
        parts.append(f"{row.orders.right} of {row.orders.of} orders and winners right")
    numbers = {"fitted": row.fitted, "partly fitted": row.partly_fitted, "of stand-ins": row.stand_ins}
    cells = [f"{number:,} {what}" for what, number in numbers.items() if number]
    return "; ".join([*parts, *([f"cells {', '.join(cells)}"] if cells else [])])


def answered(result: Result) -> str:
    """What a result says to its question: its own sentence, or how far its cells are off."""
    said = score_text(row_of(result))
    return result.answer or (f"{said[0].upper()}{said[1:]}." if said else "")


def disagreements(result: Result) -> list[str]:
    """A sentence on each cell that is missed, largest errors first."""
    missed = sorted(
        (c for c in result.cells if c.missed), key=lambda c: -math.inf if c.error is None else -abs(c.error)
    )
    return [f"{cell.row}, {cell.column}: {_off(cell)}" for cell in missed]


def _off(cell: Cell) -> str:
    off = f"{number(cell.ours)} instead of {number(cell.published)} {cell.unit}".rstrip()
    if cell.error is None or cell.aim is None:
        return off
    return f"{off}, {100 * cell.error:+.1f} % (aim {100 * cell.aim:.0f} %)"


def fitted_numbers(result: Result) -> list[str]:
    """Each fitted number that cells of its own frames follow, and how many they are."""
    found: dict[str, list[float]] = {}
    for cell in result.cells:
        for name, part in cell.fitted_by if cell.status != "reported" else ():
            found.setdefault(name, []).append(100 * part)
    return [
        f"Fitted: {name} makes {min(parts):.0f} to {max(parts):.0f} % of {len(parts)} cells of its frame"
        if len(parts) > 1
        else f"Fitted: {name} makes {parts[0]:.0f} % of a cell of its frame"
        for name, parts in found.items()
    ]
