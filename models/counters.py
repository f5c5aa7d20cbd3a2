"""Counters: what a table of events shows in reports, declared beside the events.

::

    @shown(count("TESTS", "tests made"), ratio("yield", "HITS", "TESTS", "tests that hit"))
    class SomeEvent(IntEnum): ...

Reports show what is declared, by kind, and know no event by name.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

Kind = Literal["count", "bytes", "ratio", "distribution"]
Events = TypeVar("Events", bound=type[IntEnum])
_DECLARED: dict[type[IntEnum], tuple["Counter", ...]] = {}


@dataclass(frozen=True)
class Counter:
    """One column of a report, or two of a distribution.

    Parameters
    ----------
    name : str
        Of the column.
    title : str
        What it is, in words.
    kind : {"count", "bytes", "ratio", "distribution"}
        A sum over all units; a sum of bytes; a sum over another; mean and largest of the units.
    events : tuple of str
        The event; of a ratio, the part and the whole.
    """

    name: str
    title: str
    kind: Kind
    events: tuple[str, ...]

    @property
    def event(self) -> str:
        """The event; of a ratio, the part."""
        return next(iter(self.events))

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of its columns."""
        return (f"{self.name}_mean", f"{self.name}_max") if self.kind == "distribution" else (self.name,)

    def values(self, counts: Mapping[str, float], units: Sequence[NDArray[np.int64]]) -> dict[str, float]:
        """Values of its columns.

        Parameters
        ----------
        counts : mapping
            Sums of all events, by name; an event that is not there was not counted.
        units : sequence of ndarray, int64
            The event of a distribution in each unit, by launch.
        """
        if self.kind == "distribution":
            each = np.concatenate(units) if units else np.empty(0)
            found = (each.mean(), each.max()) if len(each) else (np.nan, np.nan)
            return dict(zip(self.columns, map(float, found), strict=True))
        first, *rest = (counts.get(event, 0) for event in self.events)
        if self.kind == "ratio":
            return {self.name: first / rest[0] if rest[0] else np.nan}
        return {self.name: first}


def count(event: str, title: str, name: str = "") -> Counter:
    """Sum of an event, under the event's name in small letters if not given another."""
    return Counter(name or event.lower(), title, "count", (event,))


def size(event: str, title: str) -> Counter:
    """Sum of an event that counts bytes."""
    return Counter(event.lower(), title, "bytes", (event,))


def ratio(name: str, part: str, whole: str, title: str) -> Counter:
    """Sum of one event over the sum of another."""
    return Counter(name, title, "ratio", (part, whole))


def distribution(name: str, event: str, title: str) -> Counter:
    """Mean and largest of an event over the units of work."""
    return Counter(name, title, "distribution", (event,))


def shown(*counters: Counter) -> Callable[[Events], Events]:
    """Declare what reports show of an enum of events; an event that it has not raises KeyError."""

    def declare(events: Events) -> Events:
        for counter in counters:
            for event in counter.events:
                events[event]
        _DECLARED[events] = counters
        return events

    return declare


def counters_of(events: type[IntEnum]) -> tuple[Counter, ...]:
    """What was declared of an enum of events."""
    return _DECLARED.get(events, ())


def by_name(counters: Iterable[Counter]) -> dict[str, Counter]:
    """Counters that several stages declare stand once, where they come first."""
    found: dict[str, Counter] = {}
    for counter in counters:
        found.setdefault(counter.name, counter)
    return found
