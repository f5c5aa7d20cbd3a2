"""The table of stages that ``tilestamp render`` prints: what matters first, the rest where it fits or on request."""

import math
from collections.abc import Sequence

from tilestamp.experiments.commands.tables import print_lines, print_table
from tilestamp.models.errors import TilestampError
from tilestamp.models.nearest_name import did_you_mean
from tilestamp.simulator.run import Run

ALL = "all"
LEADING = ("milliseconds", "share", "bound", "ste")  # on every terminal
NEXT = ("instructions", "simd_efficiency", "achieved_occupancy", "occupancy", "sample_tests", "sample_hits")
FORMATS = {"count": ",.0f", "bytes": ",.0f", "ratio": ".4f", "distribution": ",.1f"}  # by kind of a counter
RATES = {"simd_efficiency": ".3f", "occupancy": ".2f", "achieved_occupancy": ".2f", "cycles": ",.0f"}


def print_stages(run: Run, title: str, columns: str = "") -> None:
    """Print the stages of a run.

    Parameters
    ----------
    run : Run
    title : str
    columns : str
        ``all``, names between commas, or nothing for those that fit the terminal.

    Raises
    ------
    TilestampError
        A column that the run does not have.
    """
    texts = stage_texts(run)
    names = list(texts)
    if columns and columns != ALL:
        names = [_known(name.strip(), names) for name in columns.split(",")]
    rows = [[str(stage), *cells] for stage, *cells in zip(run.stage_rows, *(texts[n] for n in names), strict=True)]
    least = sum(name in LEADING for name in names)
    left = print_table(title, ["stage", *names], rows, first=0 if columns else least)
    if left:
        print_lines(f"--columns all has {len(left)} more, such as {left[0]}")


def _known(name: str, names: Sequence[str]) -> str:
    if name not in names:
        near = did_you_mean(name, names)
        raise TilestampError(f"--columns: there is no column {name}{near}; there are {', '.join(names)}, or all")
    return name


def stage_texts(run: Run) -> dict[str, list[str]]:
    """Cells of each column of the stages as texts: the leading ones first, none that says nothing."""
    rows = [dict(row) for row in run.stage_rows.values()]
    for row in rows:
        if run.milliseconds > 0:
            row["share"] = row["milliseconds"] / run.milliseconds
        else:  # nothing was priced
            del row["milliseconds"], row["bound"]
    found = list(dict.fromkeys(name for row in rows for name in row))
    names = [name for name in (*LEADING, *NEXT) if name in found]
    names += [name for name in found if name not in names]
    kinds = {name: FORMATS[counter.kind] for counter in run.counters.values() for name in counter.columns}
    texts = {name: [_text(row.get(name, math.nan), name, kinds) for row in rows] for name in names}
    return {name: cells for name, cells in texts.items() if any(cells)}


def _text(value: float | str, name: str, kinds: dict[str, str]) -> str:
    """One cell; nothing where a stage has no such number."""
    if value != value:  # noqa: PLR0124 - not-a-number
        return ""
    if name == "share":
        return f"{100 * value:.1f} %"
    form = kinds.get(name) or RATES.get(name)
    return format(value, form or ("s" if isinstance(value, str) else ".4g" if isinstance(value, float) else ","))
