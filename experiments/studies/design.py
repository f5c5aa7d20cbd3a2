"""The design of a study: its axes, what is recorded, where it is kept."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import Any

import msgspec

from tilestamp.experiments.studies.axes import Axis, Choice, Sample, choices, merged, sampled, zipped
from tilestamp.experiments.studies.places import StudyError, place, refused
from tilestamp.experiments.studies.plan import Factor, cell_count
from tilestamp.experiments.studies.store import Store
from tilestamp.experiments.studies.values import KNOWN, SHARED, TIMES, is_whole
from tilestamp.models.errors import TilestampError
from tilestamp.models.nearest_name import did_you_mean
from tilestamp.simulator.pipelines import options_type, pipeline_names


@dataclass(frozen=True, kw_only=True)
class Design:
    """Many cells: the product of the axes of ``grid``, of those of ``zip`` walked together, and of a sample.

    Parameters
    ----------
    title : str
    fixed : mapping
        Parameters that all cells have: ``scene``, ``camera``, ``zoom``, ``orbit``, ``size``, ``pipeline`` and its
        options, ``machine``, ``fidelity``, numbers of the machine (``memory.dram_gb_per_s``), or factors of
        them (``times.memory.dram_gb_per_s``).
    grid, zip : mapping of str to axis
        An axis is a list of values of the parameter of that name; a range ``{"from": 1, "to": 4, "points": 5, "scale":
        "log"}``; or variants that set several parameters, ``{"8x8": {"tile": 8, "spp": 4}, ...}``, under any name.
    sample : Sample or mapping, optional
        ``{"points": 64, "method": "sobol", "seed": 0, "axes": {...}}``; a range has no points of its own.
    record : sequence of str
        What is recorded (``experiments.studies.record``).
    store : Store, str or Path, optional
        Where cells are kept; in memory if not given.

    Raises
    ------
    TilestampError
        With the place, where a name or a value is none.
    """

    title: str = ""
    fixed: Mapping[str, Any] = field(default_factory=dict)
    grid: Mapping[str, Axis] = field(default_factory=dict)
    zip: Mapping[str, Axis] = field(default_factory=dict)
    sample: Sample | Mapping[str, Any] | None = None
    record: Sequence[str] = ("milliseconds",)
    store: Store | str | Path | None = None

    def __post_init__(self) -> None:
        with place("record"):
            if isinstance(self.record, str) or not self.record:
                raise TilestampError("record is a list of names, such as ['milliseconds', 'tile_raster.milliseconds']")

    @cached_property
    def factors(self) -> list[Factor]:
        """Lists of choices, whose product are the cells."""
        parts: list[tuple[tuple[str, ...], Factor]] = [
            (("grid", name), factor) for name, factor in self._choices("grid", self.grid).items()
        ]
        if self.zip:
            with place("zip"):
                parts.append((("zip",), zipped(self._choices("zip", self.zip))))
        if self.sample is not None:
            parts.append((("sample",), self._sampled()))
        _check_apart(parts)
        for where, factor in parts:
            _check_names(where, factor, self.pipelines)
        _check_names(("fixed",), [Choice({}, dict(self.fixed))], self.pipelines)
        return [factor for _, factor in parts]

    def _choices(self, table: str, axes: Mapping[str, Axis]) -> dict[str, Factor]:
        found = {}
        for name, axis in axes.items():
            with place(table, name):
                found[name] = choices(name, axis, whole=is_whole(name, self.pipelines))
        return found

    def _sampled(self) -> Factor:
        with place("sample"):
            try:
                sample = msgspec.convert(self.sample, Sample)
            except msgspec.ValidationError as error:
                keys, why = refused(error)
                raise StudyError(("sample", *keys), why) from error
            return sampled(sample, {name: is_whole(name, self.pipelines) for name in sample.axes})

    @cached_property
    def pipelines(self) -> list[str]:
        """Pipelines that are named anywhere, and the one where none is."""
        sample = self.sample.axes if isinstance(self.sample, Sample) else (self.sample or {}).get("axes", {})
        axes: dict[str, Any] = {**self.grid, **self.zip, **sample}
        named = [*axes.get("pipeline", [self.fixed.get("pipeline", SHARED["pipeline"])])]
        for axis in axes.values():
            parts = axis.values() if isinstance(axis, Mapping) else ()
            named += [part["pipeline"] for part in parts if isinstance(part, Mapping) and "pipeline" in part]
        known = pipeline_names()
        return [name for name in dict.fromkeys(map(str, named)) if name in known]

    @cached_property
    def axes(self) -> dict[str, list[Any]]:
        """What a table shows of each axis: all its values."""
        found: dict[str, dict[str, Any]] = {}
        for choice in chain.from_iterable(self.factors):
            for name, value in choice.shown.items():
                found.setdefault(name, {})[repr(value)] = value
        return {name: list(values.values()) for name, values in found.items()}

    def __len__(self) -> int:
        """Cells."""
        return cell_count(self.factors)

    @cached_property
    def kept(self) -> Store:
        """The store, open."""
        return self.store if isinstance(self.store, Store) else Store(Path(self.store) if self.store else None)


def _check_apart(parts: Sequence[tuple[tuple[str, ...], Factor]]) -> None:
    """Refuse a parameter that two axes set."""
    seen: dict[str, tuple[str, ...]] = {}
    for where, factor in parts:
        for name in merged(factor).parameters:
            if name in seen:
                with place(*where):
                    raise TilestampError(f"{name} is set by {'.'.join(seen[name])} too")
            seen[name] = where


def _check_names(where: tuple[str, ...], factor: Factor, pipelines: Sequence[str]) -> None:
    """Refuse a parameter that is none, before anything is resolved."""
    options = [name for pipeline in pipelines for name in options_type(pipeline).__struct_fields__]
    for name in merged(factor).parameters:
        if name not in KNOWN and "." not in name and name not in options:
            with place(*where) if where[-1] == name else place(*where, name):
                told = did_you_mean(name, [*KNOWN, *options])
                raise TilestampError(
                    f"{name} is neither {', '.join(KNOWN)} nor an option of {', '.join(pipelines)}{told};"
                    f" a number of the machine has its section before a dot, and {TIMES} before that for a factor"
                )
