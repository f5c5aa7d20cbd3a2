"""``tilestamp render --why``: what holds each stage, and what would help."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from tilestamp.experiments.commands.outputs import writing
from tilestamp.experiments.commands.tables import print_entries, print_lines, print_table
from tilestamp.simulator.run import Run
from tilestamp.simulator.sensitivity import FRAME, Sensitivity
from tilestamp.simulator.why import LITTLE, MEANING, plain, sentences

if TYPE_CHECKING:
    import pandas as pd


def print_why(run: Run, found: Sensitivity) -> None:
    """Print a sentence a stage, then times with one thing free, elasticities, and steps of whole numbers."""
    print_lines("", "What holds a stage would take most off it if it were free; bound, above, is its largest term.")
    print_entries(sentences(found))
    _print_free(found)
    _print_elasticities(found)
    _print_steps(found)
    loud = {*_moving(found.numbers, "elasticity").index, *_stepping(found.numbers).index}
    notes = {
        "quiet": f"{found.numbers['number'].nunique() - len(loud)} more numbers change no stage by 0.5 %",
        "fixed": f"{', '.join(found.fixed)}: the counts depend on them, or no machine has another value near",
        "zero": f"{', '.join(found.zero)}: 0 on {run.machine.name}, of which a percentage is nothing",
    }
    print_entries({name: note for name, note in notes.items() if note[0] != ":"})


def _print_free(found: Sensitivity) -> None:
    free = found.free
    helps = [term for term in free if term == "now" or (free[term] < free["now"] * (1 - LITTLE)).any()]
    rows = [[str(stage), *(f"{times[term]:.4g}" for term in helps)] for stage, times in free[helps].iterrows()]
    print_lines("")
    print_table("Milliseconds now, and if one thing were free, priced anew", ["stage", *helps], rows)
    print_lines(*(f"  {term}: {MEANING[term]}" for term in ("start", "balance", "tail") if term in helps))


def _print_elasticities(found: Sensitivity) -> None:
    table = _moving(found.numbers, "elasticity")
    rows = [[str(number), *(_signed(value, ".2f") for value in row)] for number, row in table.iterrows()]
    print_lines("")
    print_table("Change of time in % as a number grows by 1 %", ["number", *map(str, table.columns)], rows)


def _print_steps(found: Sensitivity) -> None:
    table = _stepping(found.numbers)
    if not len(table):
        return
    rows = []
    for number, row in table.iterrows():
        here = found.numbers[found.numbers["number"] == number].iloc[0]
        for to, side in (("lower", "less"), ("higher", "more")):
            changes = [row[side, stage] for stage in _stages(found.numbers)]
            texts = [_signed(100 * (change - 1), "+.1f") for change in changes]
            rows.append([str(number), plain(here["value"]), plain(here[to]), *texts])
    title = "Whole numbers step: change of time in % (-: no such machine, or no block fits)"
    print_lines("")
    print_table(title, ["number", "from", "to", *_stages(found.numbers)], rows, keys=3)


def _signed(value: float, form: str) -> str:
    """A change; that of nothing has no sign, and where there is none a dash."""
    text = format(value, form)
    return "-" if value != value else text if float(text) else "0"  # noqa: PLR0124 - not-a-number


def _stages(numbers: "pd.DataFrame") -> list[str]:
    return list(dict.fromkeys(numbers["stage"]))


def _moving(numbers: "pd.DataFrame", column: str) -> "pd.DataFrame":
    """Numbers by stages, of those that move one by more than a little, the largest for the frame first."""
    table = numbers.pivot_table(index="number", columns="stage", values=column, sort=False)[_stages(numbers)]
    table = table[(table.abs() >= LITTLE).any(axis=1)]
    return table.loc[table[FRAME].abs().sort_values(ascending=False, kind="stable").index]


def _stepping(numbers: "pd.DataFrame") -> "pd.DataFrame":
    """Times after a step of whole numbers over those before, by direction and stage, of those that matter."""
    whole = numbers[numbers["elasticity"].isna()]
    table = whole.pivot_table(index="number", columns="stage", values=["less", "more"], sort=False, dropna=False)
    return table[((table - 1).abs() >= LITTLE).any(axis=1)]


def why_json(found: Sensitivity) -> dict[str, Any]:
    """The same as plain data."""
    return {
        "sentences": sentences(found),
        "free": found.free.to_dict(orient="index"),
        "limits": found.limits.to_dict(orient="index"),
        "numbers": found.numbers.to_dict(orient="records"),
        "fixed": list(found.fixed),
        "zero": list(found.zero),
    }


def write_tornado(run: Run, found: Sensitivity, path: Path) -> None:
    """Draw what each number does to the frame and to its longest stages."""
    from tilestamp.reports.tornado import tornado

    title = f"{run.scene} by {run.pipeline} on {run.machine.name}, {run.width}x{run.height}: {run.milliseconds:.4g} ms"
    order = found.numbers["stage"].map(found.free["now"]).sort_values(ascending=False, kind="stable")  # the frame first
    with writing(path, "--tornado") as partial:
        tornado(found.numbers.loc[order.index], partial, panel="stage", label="number", title=title, least=LITTLE)
