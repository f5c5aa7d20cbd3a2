"""The cells of a study beside what the store has of them."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain
from typing import TYPE_CHECKING, Any, TypeVar

from tilestamp.experiments.studies.design import Design
from tilestamp.experiments.studies.parameters import Resolver
from tilestamp.experiments.studies.plan import Cell, Group, walk
from tilestamp.experiments.studies.store import MANY, Stored
from tilestamp.experiments.studies.table import frame_of
from tilestamp.models.errors import TilestampError

if TYPE_CHECKING:
    import pandas as pd

T = TypeVar("T")
MOST_PRICED = 250  # cells of one group
MOST_LISTED = 1_000_000  # cells up to which all are listed, and looked up before a run
MOST_ROWS = 10_000_000  # of a table


def looked_up(
    study: Design, resolver: Resolver, look: Callable[[list[bytes], Sequence[str]], T]
) -> Iterator[tuple[Group, T]]:
    """Go through all groups of a study, each with what the store says of its cells (and of others)."""
    waiting: list[Group] = []
    keys: list[bytes] = []
    for group in _groups(study, resolver):
        waiting.append(group)
        keys += [cell.key for cell in group.cells]
        if len(keys) >= MANY:
            found = look(keys, study.record)
            yield from ((group, found) for group in waiting)
            waiting, keys = [], []
    found = look(keys, study.record)
    yield from ((group, found) for group in waiting)


def _groups(study: Design, resolver: Resolver) -> Iterable[Group]:
    """All groups, resolved once by one resolver where they are not too many to be kept."""
    groups = walk(study.factors, study.fixed, resolver, MOST_PRICED)
    return resolver.once("groups", lambda: list(groups)) if len(study) <= MOST_LISTED else groups


def missing(study: Design, resolver: Resolver) -> Iterator[Group]:
    """Go through the groups of cells that are not stored."""
    for group, found in looked_up(study, resolver, study.kept.has):
        cells = [cell for cell in group.cells if cell.key not in found]
        if cells:
            yield group._replace(cells=cells)


def rows(study: Design, resolver: Resolver) -> list[tuple[Cell, Stored]]:
    """All cells that are stored, in the study's order."""
    if len(study) > MOST_ROWS:
        raise TilestampError(f"a table of {len(study):,} rows is too long; take the store's own")
    found: dict[int, tuple[Cell, Stored]] = {}
    for group, stored in looked_up(study, resolver, study.kept.find):
        found.update((cell.order, (cell, stored[cell.key])) for cell in group.cells if cell.key in stored)
    return [found[order] for order in sorted(found)]


def table(study: Design, resolver: Resolver) -> "pd.DataFrame":
    """All cells of a study that are stored, a row each."""
    found = rows(study, resolver)
    places = [{name: cell.shown.get(name) for name in study.axes} for cell, _ in found]
    wanted = _columns(study, [stored.numbers for _, stored in found])
    numbers = [{name: stored.numbers.get(name) for name in wanted} for _, stored in found]
    return frame_of(places, numbers, [stored.problem for _, stored in found])


def _columns(study: Design, numbers: list[dict[str, Any]]) -> list[str]:
    """Names that the study records, of all that the store has: another study may have recorded more."""
    have = dict.fromkeys(chain.from_iterable(dict.fromkeys(map(tuple, numbers))))
    columns: list[str] = []
    for name in study.record:
        stage, _, column = name.rpartition(".")
        columns += [key for key in have if key == name or (stage == "*" and key.endswith(f".{column}"))]
    return list(dict.fromkeys(columns))
