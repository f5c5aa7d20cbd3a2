"""The executor of a pipeline: it runs the stages, every unit of each, and keeps what they did.

A pipeline hands each stage and its inputs to its executor, ``execute(stage, *inputs)``; one of which only the picture
and the counts are wanted, and no later stage the outputs, by ``execute.last``: of such a stage another executor
(``simulator.sampling.executor``) may run part of the units.
"""

from collections.abc import Callable
from inspect import signature
from typing import TYPE_CHECKING, ParamSpec, TypeVar

from tilestamp.simulator.stage import Divisible, StageResult

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

    def last(self, stage: Divisible[P, T], *inputs: P.args, **options: P.kwargs) -> StageResult[T]:
        """Run a stage whose outputs only the picture needs."""
        return self(stage, *inputs, **options)
