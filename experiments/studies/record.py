"""What is recorded of a run, by name.

``milliseconds``, ``low_milliseconds``, ``high_milliseconds`` and ``bound`` are the frame's; ``STAGE.COLUMN`` is a
column of ``run.stages`` (``tile_raster.milliseconds``, ``*.bound`` of every stage), ``STAGE.EVENT`` a count,
``facts.NAME`` what the pipeline says besides; the name of a column alone is its sum over the stages.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property
from typing import Any

from tilestamp.models.timing import Timing
from tilestamp.simulator.run import Run

Number = float | int | str | None
QUICK = ("milliseconds", "cycles", "bound")  # columns of a stage that need no table of stages


class Recorded:
    """Values of one priced run, made as they are taken."""

    def __init__(self, run: Run) -> None:
        self.run = run

    def values(self, names: Iterable[str]) -> dict[str, Number]:
        """Give the values of some names, None where the run has nothing of the name, and the interval of a sample."""
        found = {key: _plain(value) for name in names for key, value in self._named(name)}
        if self.run.sampled:
            _, low, high = self.run.milliseconds_interval
            found |= {"milliseconds_low": low, "milliseconds_high": high}
        return found

    def known(self) -> list[str]:
        """All names that the run has a value for."""
        stages = self._stages
        own = [f"{stage}.{column}" for stage, row in stages.items() for column in row]
        facts = [f"facts.{name}" for name in self.run.frame.facts]
        return ["milliseconds", "bound", *next(iter(stages.values()), {}), *own, *self.run.counts, *facts]

    def _named(self, name: str) -> Iterator[tuple[str, Any]]:
        stage, dot, column = name.rpartition(".")
        if not dot:
            yield name, self._frame(name)
        elif stage == "*":
            yield from ((f"{one}.{column}", self._of_stage(one, column)) for one in self._timings)
        elif stage == "facts":
            yield name, self.run.frame.facts.get(column)
        elif column.isupper():
            yield name, self.run.counts.get(name)
        else:
            yield name, self._of_stage(stage, column)

    def _frame(self, name: str) -> Any:
        timings = self.run.timings
        if name == "milliseconds":
            return self.run.milliseconds
        if name == "bound":
            return _longest(timings).bound if timings else None
        if name in ("low_milliseconds", "high_milliseconds"):
            return sum(getattr(timing, name.partition("_")[0]) for timing in timings)
        parts = [row[name] for row in self._stages.values() if name in row]
        numbers = [part for part in parts if isinstance(part, int | float) and not math.isnan(part)]
        return sum(numbers) if numbers else None

    def _of_stage(self, stage: str, column: str) -> Any:
        timings = self._timings.get(stage, [])
        if column not in QUICK or not timings:
            return self._stages.get(stage, {}).get(column)
        if column == "bound":
            return _longest(timings).bound
        return sum(getattr(timing, column) for timing in timings)

    @cached_property
    def _timings(self) -> dict[str, list[Timing]]:
        found: dict[str, list[Timing]] = {}
        for timing in self.run.timings:
            found.setdefault(timing.stage, []).append(timing)
        return found

    @cached_property
    def _stages(self) -> dict[str, dict[str, Any]]:
        return {str(stage): row for stage, row in self.run.stages.astype(object).to_dict(orient="index").items()}


def _longest(timings: Sequence[Timing]) -> Timing:
    return max(timings, key=lambda timing: timing.milliseconds)


def _plain(value: Any) -> Number:
    """A number as JSON has it; not-a-number is none."""
    value = value.item() if hasattr(value, "item") else value
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value if value is None or isinstance(value, int | float | str) else str(value)
