"""The executor of a pipeline: it runs the stages, ``execute(stage, *inputs)``, and keeps what they did."""

from collections.abc import Callable
from inspect import signature
from typing import TYPE_CHECKING, ParamSpec, TypeVar

from tilestamp.simulator.stage import StageResult

if TYPE_CHECKING:
    from tilestamp.simulator.work import Work

P = ParamSpec("P")
T = TypeVar("T")


class Executor:
    """Runs everything.

    Parameters
    ----------
    counting : bool
        Count what the machine does; without it there are no works.
    picture : bool
        Whether one is wanted; a pipeline may leave out what only makes the picture.
    """

    def __init__(self, *, counting: bool = True, picture: bool = True) -> None:
        self.counting = counting
        self.picture = picture
        self.works: list[Work] = []  # or FixedFunctionWork

    def __call__(self, stage: Callable[P, StageResult[T]], *inputs: P.args, **options: P.kwargs) -> StageResult[T]:
        """Run one stage and keep its works."""
        if not self.counting and "counting" in signature(stage).parameters:
            options["counting"] = False
        result = stage(*inputs, **options)
        if self.counting:
            self.works += result.works
        return result
