"""The cells of a study beside what the store has of them."""

from collections.abc import Callable, Container, Iterable, Iterator, Sequence
from itertools import chain
from typing import TYPE_CHECKING, Any, TypeVar

from tilestamp.experiments.studies.design import Design
from tilestamp.experiments.studies.parameters import Resolver
from tilestamp.experiments.studies.plan import Cell, Group, walk
from tilestamp.experiments.studies.question import Candidate
from tilestamp.experiments.studies.store import MANY, Stored
from tilestamp.experiments.studies.table import frame_of
from tilestamp.models.errors import TilestampError

if TYPE_CHECKING:
    import pandas as pd

T = TypeVar("T")
MOST_PRICED = 250  # cells of one group
MOST_LISTED = 1_000_000  # cells up to which all are listed, and looked up before a run
MOST_ROWS = 10_000_000  # of a table
COARSE = "coarse"  # column of a study with a question: whether a cell is known less well than the error


def looked_up(
    study: Design, resolver: Resolver, error: float, look: Callable[[list[bytes], Sequence[str]], T]
) -> Iterator[tuple[Group, T]]:
    """Go through all groups of a study, each with what the store says of its cells at an error (and of others)."""
    waiting: list[Group] = []
    keys: list[bytes] = []
    for group in _groups(study, resolver, error):
        waiting.append(group)
        keys += [cell.key for cell in group.cells]
        if len(keys) >= MANY:
            found = look(keys, study.record)
            yield from ((group, found) for group in waiting)
            waiting, keys = [], []
    found = look(keys, study.record)
    yield from ((group, found) for group in waiting)


def _groups(study: Design, resolver: Resolver, error: float) -> Iterable[Group]:
    """All groups, resolved once by one resolver where they are not too many to be kept."""
    groups = walk(study.factors, study.fixed, resolver, error, MOST_PRICED)
    return resolver.once(("groups", error), lambda: list(groups)) if len(study) <= MOST_LISTED else groups


def missing(study: Design, resolver: Resolver, error: float, wanted: Container[int] | None = None) -> Iterator[Group]:
    """Go through the groups of cells that are not stored; of those whose place is ``wanted``, if that is given."""
    for group, found in looked_up(study, resolver, error, study.kept.has):
        cells = [cell for cell in group.cells if cell.key not in found and (wanted is None or cell.order in wanted)]
        if cells:
            yield group._replace(cells=cells)


def rows(study: Design, resolver: Resolver) -> list[tuple[Cell, Stored]]:
    """All cells that are stored, in the study's order, each as well known as it is."""
    if len(study) > MOST_ROWS:
        raise TilestampError(f"a table of {len(study):,} rows is too long; take the store's own")
    found: dict[int, tuple[Cell, Stored]] = {}
    for error in study.errors:
        for group, stored in looked_up(study, resolver, error, study.kept.find):
            found.update((cell.order, (cell, stored[cell.key])) for cell in group.cells if cell.key in stored)
    return [found[order] for order in sorted(found)]


def candidates(study: Design, resolver: Resolver) -> list[Candidate]:
    """All cells that are stored and have a time."""
    found = rows(study, resolver)
    return [_candidate(cell, stored) for cell, stored in found if stored.numbers.get("milliseconds") is not None]


def _candidate(cell: Cell, stored: Stored) -> Candidate:
    time = stored.numbers.get("milliseconds", 0.0)
    ends = stored.numbers.get("milliseconds_low", time), stored.numbers.get("milliseconds_high", time)
    return Candidate(cell.order, cell.shown, *ends)


def table(study: Design, resolver: Resolver) -> "pd.DataFrame":
    """All cells of a study that are stored, a row each."""
    found = rows(study, resolver)
    places = [{name: cell.shown.get(name) for name in study.axes} for cell, _ in found]
    wanted = _columns(study, [stored.numbers for _, stored in found])
    numbers = [{name: stored.numbers.get(name) for name in wanted} for _, stored in found]
    if len(study.errors) > 1:
        for (cell, stored), row in zip(found, numbers, strict=True):
            row[COARSE] = _candidate(cell, stored).is_wider(study.error)
    return frame_of(places, numbers, [stored.problem for _, stored in found])


def _columns(study: Design, numbers: list[dict[str, Any]]) -> list[str]:
    """Names that the study records, of all that the store has: another study may have recorded more."""
    have = dict.fromkeys(chain.from_iterable(dict.fromkeys(map(tuple, numbers))))
    columns: list[str] = []
    for name in (*study.record, "milliseconds_low", "milliseconds_high"):
        stage, _, column = name.rpartition(".")
        columns += [key for key in have if key == name or (stage == "*" and key.endswith(f".{column}"))]
    return list(dict.fromkeys(columns))
