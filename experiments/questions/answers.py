"""Answers: a table, sentences and a picture for each question to a study."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING

from tilestamp.experiments.frontier.pareto import pareto_front
from tilestamp.experiments.questions import effects
from tilestamp.experiments.questions.best import Boundary, are_numbers, best_values, boundaries, check_axes
from tilestamp.experiments.questions.search import search
from tilestamp.experiments.questions.space import numbers, recording
from tilestamp.experiments.studies.parameters import Resolver
from tilestamp.experiments.studies.study import Study
from tilestamp.experiments.studies.study_views import table_card
from tilestamp.models.errors import TilestampError
from tilestamp.reports.card import card
from tilestamp.reports.choice_map import choice_map
from tilestamp.reports.effects_plot import effects_plot
from tilestamp.reports.frontier_plot import frontier
from tilestamp.reports.plots import lines

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

    from tilestamp.reports.style import Into

Say = Callable[[str], None]
MOST_PANELS = 12
DOUBT = 0.01  # margin below which two are as good as each other


@dataclass(frozen=True, eq=False)
class Answer:
    """What a question found."""

    table: "pd.DataFrame"
    sentences: list[str]
    draw: "Callable[[Into], Axes]" = field(repr=False)
    """Draws into a file, or a new figure (None)."""

    def _repr_html_(self) -> str:
        return card("; ".join(self.sentences), [table_card(self.table)])

    def plot(self) -> "Axes":
        """Draw it; of several panels the first is given, and ``.figure.axes`` has all."""
        return self.draw(None)


def silent(_: str) -> None:
    """Tell nobody how far it is."""


def best(
    study: Study, axis: str, over: Sequence[str], number: str = "milliseconds", jobs: int | None = 1, say: Say = silent
) -> Answer:
    """Which value of an axis has the least number at each place of a plane of two others.

    Raises
    ------
    TilestampError
        No plane, no such axis, or too many panels.
    """
    check_axes(list(study.axes), axis, *over)
    if len(over) != 2:
        raise TilestampError("a plane has two axes, such as zoom,machine")
    others = [name for name in study.axes if name != axis]
    further = [name for name in others if name not in over]
    table = _run(study, [number], jobs, say)
    found = best_values(table, axis, others, number)
    panels = [", ".join(f"{name} {row[name]}" for name in further) for row in found.to_dict("records")]
    if len(set(panels)) > MOST_PANELS:
        raise TilestampError(f"the axes {', '.join(further)} make {len(set(panels))} maps: fix some of them")
    x, y = sorted(over, key=lambda name: not are_numbers(study.axes[name]))
    draw = partial(
        choice_map, found.assign(panel=panels), x=x, y=y, panel="panel", title=f"Best {axis} by {number}", legend=axis
    )
    changes = boundaries(table, axis, x, [name for name in others if name != x], number)
    return Answer(found, [_shares(found, axis), *(_change(axis, x, one) for one in changes)], draw)


def _shares(found: "pd.DataFrame", axis: str) -> str:
    counts = found["best"].value_counts()
    told = ", ".join(f"{axis} {value} at {count}" for value, count in counts.items())
    close = int((found["margin"] < DOUBT).sum())
    return f"Best of {len(found)} places: {told}" + (
        f"; at {close} the second best is within {100 * DOUBT:.0f} %" * bool(close)
    )


def _change(axis: str, along: str, one: Boundary) -> str:
    where = ", ".join(f"{name} {value}" for name, value in one.place.items())
    return f"{where}{': ' * bool(where)}{axis} {one.before} up to {along} {one.at:.4g}, then {one.after}"


def front(study: Study, one: str, other: str, jobs: int | None = 1, say: Say = silent) -> Answer:
    """Which cells nothing else beats in two numbers at once."""
    table = _run(study, [one, other], jobs, say)
    pairs = numbers(table, [one, other])
    table = table.assign(front=pareto_front(pairs[:, 0], pairs[:, 1]))
    shown = table[table.front].drop(columns="front").sort_values([one, other], ignore_index=True)
    said = f"Nothing else of {len(table)} cells beats these {len(shown)} in both"
    return Answer(shown, [said], partial(_draw_front, table, list(study.axes), one, other))


def _draw_front(table: "pd.DataFrame", axes: list[str], one: str, other: str, into: "Into") -> "Axes":
    import pandas as pd

    group = next((name for name in axes if not are_numbers(list(table[name]))), None)
    names = [", ".join(f"{name} {_short(row[name])}" for name in axes) for row in table.to_dict("records")]
    points = {"name": names, "group": table[group] if group else "cells", "cost": table[one], "error": table[other]}
    frame = pd.DataFrame({**points, "published": False, "front": table["front"]})
    return frontier(into, frame, one, other, f"{other} against {one}: lower left is better")


def _short(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def screened(study: Study, number: str = "milliseconds", walks: int = 8) -> Answer:
    """Which axes move a number: Morris."""
    table, is_factor = effects.screen(study, number, walks)
    start, unit = (1.0, "factor") if is_factor else (0.0, "change")
    told = ", ".join(f"{row.axis} {row.effect:.3g}" for row in table.head(3).itertuples())
    sentence = f"Mean {unit} of {number} across the whole axis: {told}; a large spread: it depends on the other axes"
    label = f"{unit} of {number} across the axis"
    draw = partial(
        effects_plot, table, value="effect", x_label=label, title=f"What moves {number} (Morris)", start=start
    )
    return Answer(table, [sentence], draw)


def shared(study: Study, number: str = "milliseconds", points: int = 64) -> Answer:
    """What share of a number's variance each axis has: Sobol."""
    table = effects.sobol(study, number, points)
    told = ", ".join(f"{row.axis} {100 * max(row.total, 0.0):.0f} %" for row in table.head(3).itertuples())
    sentence = f"Share of the variance of {number}, with all that an axis does together with others: {told}"
    draw = partial(
        effects_plot, table, value="total", inner="alone", x_label=f"share of the variance of {number}",
        title=f"What {number} depends on (Sobol)",
    )  # fmt: skip
    return Answer(table, [sentence], draw)


def searched(study: Study, wanted: Sequence[str], cells: int = 64, seed: int = 0, say: Say = silent) -> Answer:
    """The best point, or the front of several numbers, that a search found."""
    table = search(study, wanted, cells, seed, say)
    shown = table[table["best"]].drop(columns="best").sort_values(wanted[0], ignore_index=True)
    first = table[wanted[0]].dropna()
    sentence = f"The best of {cells} cells has {wanted[0]} {first.min():.4g}; the first one had {first.iloc[0]:.4g}"
    return Answer(shown, [sentence], partial(_draw_search, table, list(wanted)))


def _draw_search(table: "pd.DataFrame", wanted: list[str], into: "Into") -> "Axes":
    """Draw the front of the first two numbers, or how the least of one fell."""
    import pandas as pd

    if len(wanted) > 1:
        return _draw_front(table.assign(front=table["best"]), [], wanted[0], wanted[1], into)
    number = wanted[0]
    steps = pd.DataFrame(
        {"cell": range(1, len(table) + 1), "each": table[number], "least so far": table[number].cummin()}
    )
    tidy = steps.melt("cell", var_name="what", value_name=number).dropna()
    return lines(
        tidy, into, x="cell", y=number, by="what", title=f"A search for little {number}", x_label="cell", y_label=number
    )


def _run(study: Study, names: Sequence[str], jobs: int | None, say: Say) -> "pd.DataFrame":
    """Run what is missing of a study; give its table, with the numbers that the question needs."""
    asked, resolver = recording(study, names), Resolver()
    faults = asked.run(jobs, say=say, resolver=resolver).faults
    if faults:
        raise TilestampError(f"cells failed: {faults[0]}")
    return asked.table(resolver)
