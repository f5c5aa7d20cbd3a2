"""What a stage is: a function that returns ``(outputs, works, facts)``."""

from collections.abc import Mapping
from typing import Any, Generic, NamedTuple, TypeVar

from tilestamp.simulator.work import Work

T = TypeVar("T")


class StageResult(NamedTuple, Generic[T]):
    """What a stage returns.

    Parameters
    ----------
    outputs : T
        What the stages behind it take.
    works : tuple of Work
        One for each kernel launch; none where nothing was counted.
    facts : dict
        What a report may say besides.
    """

    outputs: T
    works: tuple[Work, ...] = ()
    facts: Mapping[str, Any] = {}
