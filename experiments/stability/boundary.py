"""Where a method stops working: the boundary of one parameter, found by bisection, as a row of the atlas."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from math import sqrt
from typing import Literal

import pandas as pd

from tilestamp.experiments.harness.result import Cell, Figure, Result, reported

Scale = Literal["log", "linear", "integer"]
TOLERANCE = {"log": 0.01, "linear": 0.01, "integer": 1.0}  # ratio - 1; share of the range; units


@dataclass(frozen=True)
class Boundary:
    """One row of the atlas.

    Parameters
    ----------
    method : str
        Pipeline or variant, as a reader knows it.
    parameter, unit : str
        What is turned until it breaks.
    holds : float or None
        Last value that works; None where the gentlest value tried fails.
    breaks : float or None
        First value that fails; None where the hardest value tried (then ``holds``) still works.
    wrong : str
        What goes wrong, in words.
    cure : str
        What mends it.
    cost : str
        What the cure costs, measured in the run.
    """

    method: str
    parameter: str
    unit: str
    holds: float | None
    breaks: float | None
    wrong: str
    cure: str = ""
    cost: str = ""


def bisect(
    fails: Callable[[float], bool], low: float, high: float, *, scale: Scale = "log", tolerance: float | None = None
) -> tuple[float | None, float | None]:
    """Find the last value that works and the first that fails.

    The two ends are tried first; in between a single crossing is taken for granted, so sweep before (``bracket``).

    Parameters
    ----------
    fails : callable
        Whether the method fails at a value.
    low, high : float
        The gentle end and the hard end; the hard one may be the smaller number. Positive for ``log``.
    scale : {"log", "linear", "integer"}
        Where the middle is; ``integer`` calls ``fails`` with whole numbers.
    tolerance : float, optional
        Width to stop at: relative for ``log``, share of the range for ``linear``, units for ``integer``.

    Returns
    -------
    holds, breaks : float or None
        ``(high, None)`` where the hard end works, ``(None, low)`` where the gentle end fails.
    """
    if fails(low):
        return None, low
    if not fails(high):
        return high, None
    tolerance = TOLERANCE[scale] if tolerance is None else tolerance
    holds, breaks, span = low, high, abs(high - low)
    while _width(holds, breaks, span, scale) > tolerance:
        middle = _middle(holds, breaks, scale)
        if middle in (holds, breaks):  # floating point has no number between
            break
        holds, breaks = (holds, middle) if fails(middle) else (middle, breaks)
    return holds, breaks


def _middle(a: float, b: float, scale: Scale) -> float:
    """Geometric, arithmetic or whole mean."""
    if scale == "log":
        return sqrt(a) * sqrt(b)
    return (a + b) // 2 if scale == "integer" else (a + b) / 2


def _width(a: float, b: float, span: float, scale: Scale) -> float:
    """Distance of two values in the scale's own measure."""
    if scale == "log":
        return max(a, b) / min(a, b) - 1.0
    return abs(a - b) if scale == "integer" else abs(a - b) / span


def bracket(values: Sequence[float], failed: Sequence[bool]) -> tuple[float, float]:
    """Ends for ``bisect`` from a coarse sweep, gentle to hard: the first value that failed and the one before it.

    Where none failed, or all, the two ends of the sweep: ``bisect`` then says so.
    """
    first = next((i for i, bad in enumerate(failed) if bad), 0)
    return (values[first - 1], values[first]) if first else (values[0], values[-1])


def boundary_table(boundaries: Sequence[Boundary]) -> pd.DataFrame:
    """One row a boundary, a column a field."""
    return pd.DataFrame([asdict(boundary) for boundary in boundaries])


def atlas_result(
    name: str,
    title: str,
    boundaries: Sequence[Boundary],
    figures: Sequence[Figure] = (),
    notes: Sequence[str] = (),
    tables: dict[str, pd.DataFrame] | None = None,
) -> Result:
    """A row, or a family of rows, of the atlas as a result: a cell each for what holds and what breaks.

    Parameters
    ----------
    name, title : str
        ``stability/MODULE``, and a heading for the page.
    boundaries : sequence of Boundary
    figures, notes, tables
        As in ``Result``; every claim in a note is a number from the run. ``boundaries`` is added to the tables.
    """
    cells = [cell for boundary in boundaries for cell in _cells(boundary)]
    sentences = [_sentence(boundary) for boundary in boundaries if boundary.breaks is not None]
    tables = {"boundaries": boundary_table(boundaries), **(tables or {})}
    source = "Stability atlas: no published cells; boundaries by bisection on our own runs"
    return Result(
        name=name,
        title=title,
        source=source,
        cells=cells,
        answer=_answer(boundaries),
        figures=list(figures),
        notes=[*sentences, *_unbroken(boundaries), *notes],
        tables=tables,
    )


def _answer(boundaries: Sequence[Boundary]) -> str:
    """How many break, and where the first of them does."""
    broken = [boundary for boundary in boundaries if boundary.breaks is not None]
    if not broken:
        return f"None of {len(boundaries)} breaks within what was tried."
    first = broken[0]
    wrong = first.wrong.partition(":")[0].partition(" (")[0]
    return f"{len(broken)} of {len(boundaries)} break; {first.method} from {_where(first)} on: {wrong}."


def _where(boundary: Boundary) -> str:
    return f"{boundary.parameter} {boundary.breaks:.4g} {boundary.unit}".rstrip()


def _cells(boundary: Boundary) -> list[Cell]:
    """Last value that works, first that fails."""
    holds: float | str = "none tried" if boundary.holds is None else boundary.holds
    breaks: float | str = "none tried" if boundary.breaks is None else boundary.breaks
    columns = (("holds at", holds), ("breaks at", breaks))
    return [
        reported(boundary.method, f"{boundary.parameter} {column}", boundary.unit, value) for column, value in columns
    ]


def _sentence(boundary: Boundary) -> str:
    """What goes wrong and what the cure costs, for the page."""
    cure = f" Cure: {boundary.cure}" if boundary.cure else ""
    cost = f" ({boundary.cost})" if boundary.cost else ""
    return f"{boundary.method}: from {_where(boundary)}, {boundary.wrong}.{cure}{cost}{'.' if cure else ''}"


def _unbroken(boundaries: Sequence[Boundary]) -> list[str]:
    """A sentence for each range in which something never breaks."""
    methods: dict[str, list[str]] = {}
    for boundary in boundaries:
        if boundary.breaks is None:
            where = f"{boundary.parameter} {boundary.holds:.4g} {boundary.unit}".rstrip()
            methods.setdefault(where, []).append(boundary.method)
    return [f"Never breaks up to {where}: {'; '.join(names)}." for where, names in methods.items()]
