"""The cells of a study, group by group: a group is one execution and what it is priced on.

Nothing is listed that does not have to be: a study may have more cells than fit in memory.
"""

from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from itertools import product
from math import prod
from pathlib import Path
from typing import Any, NamedTuple

from tilestamp.experiments.studies.axes import Choice
from tilestamp.experiments.studies.parameters import Execution, Pricing, Resolver, cell_key
from tilestamp.experiments.studies.values import is_priced

Factor = list[Choice]
PLAIN = (str, int, float, list, tuple, dict, Path, type(None))
MOST_PRICINGS = 100_000  # that are remembered


class Cell(NamedTuple):
    """One cell: its place in the order of the study, its key in the store, and what it is priced on."""

    order: int
    key: bytes
    shown: dict[str, Any]
    pricing: Pricing


class Group(NamedTuple):
    """Cells of one execution on machines of one SIMT shape."""

    execution: Execution
    parameters: dict[str, Any]
    """Of what is executed, as the study gives them."""
    shape: Hashable
    cells: list[Cell]


class _Part(NamedTuple):
    """Choices of a factor that execute the same."""

    executed: dict[str, Any]
    choices: list[tuple[int, Choice, dict[str, Any]]]
    """Place in the factor, the choice, and those of its parameters that are only priced."""


def cell_count(factors: Sequence[Factor]) -> int:
    """Cells of a study."""
    return prod(map(len, factors))


def walk(factors: Sequence[Factor], fixed: Mapping[str, Any], resolver: Resolver, most: int) -> Iterator[Group]:
    """Go through all cells.

    Parameters
    ----------
    factors : sequence of lists of Choice
        Their product are the cells.
    fixed : mapping
        Parameters that all cells have.
    resolver : Resolver
    most : int
        Cells of one group.
    """
    sizes = [len(factor) for factor in factors]
    strides = [prod(sizes[place + 1 :]) for place in range(len(sizes))]
    known: dict[Hashable, Pricing] = {}
    gathered = list(map(_parts, factors))
    for parts in product(*gathered):
        executed = _united(fixed, (part.executed for part in parts))
        execution = resolver.execution(executed)
        waiting: dict[Hashable, list[Cell]] = {}
        for row in product(*(part.choices for part in parts)):
            pricing = _pricing(fixed, [only for _, _, only in row if only], resolver, known)
            key = cell_key(execution, pricing)
            order = sum(place * stride for (place, _, _), stride in zip(row, strides, strict=True))
            shown = _united({}, (choice.shown for _, choice, _ in row))
            shape = pricing.shapes[execution.persistent]
            cells = waiting.setdefault(shape, [])
            cells.append(Cell(order, key, shown, pricing))
            if len(cells) == most:
                yield Group(execution, executed, shape, waiting.pop(shape))
        yield from (Group(execution, executed, shape, cells) for shape, cells in waiting.items())


def identity(value: object) -> Hashable:
    """What tells a parameter's values apart: what it is, or which object."""
    return repr(value) if isinstance(value, PLAIN) else id(value)


def _pricing(
    fixed: Mapping[str, Any], parts: list[dict[str, Any]], resolver: Resolver, known: dict[Hashable, Pricing]
) -> Pricing:
    """Resolve what is priced, once while it is remembered: the parts are the study's own, and the same ones again."""
    mark = tuple(map(id, parts))
    if mark not in known:
        if len(known) == MOST_PRICINGS:
            known.clear()
        known[mark] = resolver.pricing(_united(fixed, parts))
    return known[mark]


def _parts(factor: Factor) -> list[_Part]:
    """Gather the choices of a factor by what they execute."""
    parts: dict[Hashable, _Part] = {}
    for place, choice in enumerate(factor):
        executed = {name: value for name, value in choice.parameters.items() if not is_priced(name)}
        priced = {name: value for name, value in choice.parameters.items() if is_priced(name)}
        mark = tuple(sorted((name, str(identity(value))) for name, value in executed.items()))
        parts.setdefault(mark, _Part(executed, [])).choices.append((place, choice, priced))
    return list(parts.values())


def _united(first: Mapping[str, Any], others: Iterable[dict[str, Any]]) -> dict[str, Any]:
    united = dict(first)
    for other in others:
        united.update(other)
    return united
