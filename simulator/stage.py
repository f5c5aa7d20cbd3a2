"""What a stage is: a function that returns ``(outputs, works, facts)``; some can also run on part of their units.

A stage that can run in part is written as three functions of the same inputs, bound together by ``divisible``:

- the stage itself takes ``units`` (None: all) and returns its outputs and the rows of those units;
- ``known`` says, before anything runs, what is known of each unit (``Known``);
- ``work`` makes the ``Work`` from the rows of all units: launch shape, and the buffers touched.

Called like any stage, it runs all units. An executor (``simulator.executor``, ``simulator.sampling.executor``) may run
some.
"""

from collections.abc import Callable, Mapping
from functools import update_wrapper
from inspect import signature
from typing import Any, Generic, NamedTuple, ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray

from tilestamp.simulator.work import Work

T = TypeVar("T")
P = ParamSpec("P")
Rows = NDArray[np.int64]
SWITCHES = ("counting", "units")  # inputs of a stage that change no number: known and work do not take them


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


class Known(NamedTuple):
    """What is known of each unit of a stage before any runs, an array of (units,) each.

    Parameters
    ----------
    seconds : float
        CPU time of all units, about (measured on two cores of a server): where it is short a sample does not pay.
    size : ndarray
        The work that it will be, up to a factor.
    more : tuple of ndarray
        Further things, of which some events may be proportional.
    exact : dict of int to ndarray
        By event (a column of the work table): what follows from the inputs alone.
    """

    seconds: float
    size: NDArray[Any]
    more: tuple[NDArray[Any], ...] = ()
    exact: Mapping[int, NDArray[np.int64]] = {}


class Divisible(Generic[P, T]):
    """A stage that can run on part of its units; see the module."""

    def __init__(
        self,
        run: Callable[P, tuple[T, Rows | None]],
        known: Callable[..., Known],
        work: Callable[..., Work],
    ) -> None:
        update_wrapper(self, run)
        self.run, self.known, self.work = run, known, work

    def __call__(self, *inputs: P.args, **options: P.kwargs) -> StageResult[T]:
        """Run all units."""
        outputs, rows = self.run(*inputs, **options)
        works = () if rows is None else (self.work(rows, **self.inputs(*inputs, **options)),)
        return StageResult(outputs, works)

    def inputs(self, *inputs: P.args, **options: P.kwargs) -> dict[str, Any]:
        """All inputs by name, defaults too, as ``known`` and ``work`` take them."""
        bound = signature(self.run).bind(*inputs, **options)
        bound.apply_defaults()
        return {name: value for name, value in bound.arguments.items() if name not in SWITCHES}


def divisible(
    known: Callable[..., Known], work: Callable[..., Work]
) -> Callable[[Callable[P, tuple[T, Rows | None]]], Divisible[P, T]]:
    """Make a function of inputs and ``units`` a stage that can run in part.

    Parameters
    ----------
    known : callable
        Takes the inputs by name.
    work : callable
        Takes the rows of all units, and the inputs by name.
    """
    return lambda run: Divisible(run, known, work)
