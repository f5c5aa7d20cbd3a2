"""A result in words: a cell as the texts of its columns, what errors come to on average, which numbers were fitted."""

from tilestamp.experiments.harness.result import Cell, Result

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
    sentences = []
    for status in ("predicted", "partly fitted"):
        parts = []
        for what, times in (("times", True), ("counts", False)):
            errors = result.errors(status, times=times)
            if errors:
                mean, worst = 100 * sum(errors) / len(errors), 100 * max(errors)
                parts.append(f"{len(errors)} {status} {what}: mean error {mean:.1f} %, worst {worst:.1f} %")
        sentences += ["; ".join(parts)] if parts else []
    return sentences


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
