"""What is recorded of a run on a machine, by name.

``milliseconds``, ``low_milliseconds``, ``high_milliseconds`` and ``bound`` are the frame's; ``STAGE.COLUMN`` is a
column of ``run.stages`` (``tile_raster.milliseconds``, ``*.bound`` of every stage), ``STAGE.EVENT`` a count,
``facts.NAME`` what the pipeline says besides; ``area`` is the machine's (``experiments.studies.area``); the name of a
column alone is its sum over the stages.
"""

import math
from collections.abc import Iterable, Iterator
from functools import cached_property
from typing import Any

from tilestamp.experiments.studies.area import area
from tilestamp.simulator.prices import Prices
from tilestamp.simulator.run import Run

Number = float | int | str | None
TIMES = {"milliseconds": "milliseconds", "low_milliseconds": "low", "high_milliseconds": "high"}  # of each launch


class Recorded:
    """Values of one run on one machine, made as they are taken: times are at hand, a table of stages is work.

    Parameters
    ----------
    run : Run
    prices : Prices
        Of the run, on many machines.
    place : int
        Of the machine among them.
    """

    def __init__(self, run: Run, prices: Prices, place: int) -> None:
        self._run, self._prices, self._place = run, prices, place

    @cached_property
    def run(self) -> Run:
        """The run on the machine."""
        return self._run.on(self._prices.machines[self._place])

    def values(self, names: Iterable[str]) -> dict[str, Number]:
        """Give the values of some names, None where the run has nothing of the name."""
        return {key: _plain(value) for name in names for key, value in self._named(name)}

    def known(self) -> list[str]:
        """All names that the run has a value for."""
        own = [f"{stage}.{column}" for stage, row in self._stages.items() for column in row]
        facts = [f"facts.{name}" for name in self._run.frame.facts]
        return [*next(iter(self._stages.values()), {}), *own, *self._run.counts, *facts]

    def _named(self, name: str) -> Iterator[tuple[str, Any]]:
        stage, dot, column = name.rpartition(".")
        if name == "area":
            yield name, area(self._prices.machines[self._place])
        elif not dot:
            yield name, self._of(None, name)
        elif stage == "*":
            yield from ((f"{one}.{column}", self._of(one, column)) for one in dict.fromkeys(self._prices.stages))
        elif stage == "facts":
            yield name, self._run.frame.facts.get(column)
        elif column.isupper():
            yield name, self._run.counts.get(name)
        else:
            yield name, self._of(stage, column)

    def _of(self, stage: str | None, column: str) -> Any:
        launches = [place for place, one in enumerate(self._prices.stages) if stage in (None, one)]
        if column in TIMES and launches:
            times = getattr(self._prices, TIMES[column])[self._place].tolist()
            return sum(times[launch] for launch in launches)
        if column == "bound" and launches:
            times = self._prices.milliseconds[self._place].tolist()
            return str(self._prices.bounds[self._place, max(launches, key=times.__getitem__)])
        if stage is not None:
            return self._stages.get(stage, {}).get(column)
        numbers = [row[column] for row in self._stages.values() if _is_number(row.get(column))]
        return sum(numbers) if numbers else None

    @cached_property
    def _stages(self) -> dict[str, dict[str, Any]]:
        return {str(stage): row for stage, row in self.run.stages.astype(object).to_dict(orient="index").items()}


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not math.isnan(value)


def _plain(value: object) -> Number:
    """A number as JSON has it; not-a-number is none."""
    value = value.item() if hasattr(value, "item") else value
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value if value is None or isinstance(value, int | float | str) else str(value)
