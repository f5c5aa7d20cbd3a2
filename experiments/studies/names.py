"""Names to record that nothing has: a slip, which is said as soon as a cell of each pipeline has come back."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from tilestamp.experiments.studies.places import StudyError
from tilestamp.models.nearest_name import did_you_mean

Values = Mapping[str, Any]


class Names:
    """The recorded names that no cell had so far.

    Parameters
    ----------
    record : iterable of str
    pipelines : iterable of str
        A name that one pipeline lacks another one may have.
    stored : callable
        Gives the values of all cells of the study that are stored: earlier runs may have had a name.
    """

    def __init__(self, record: Iterable[str], pipelines: Iterable[str], stored: Callable[[], Iterable[Values]]) -> None:
        self._left = set(record)
        self._awaited = set(pipelines)
        self._stored = stored
        self._known: set[str] = set()

    def saw(self, pipeline: str, cells: Iterable[Values], known: Iterable[str]) -> None:
        """Take in the cells of a task, and the names that could have been recorded.

        Raises
        ------
        TilestampError
            No cell of any pipeline has a name.
        """
        if not self._left:
            return
        self._known.update(known)
        self._left = {name for name in self._left if not any(has(values, name) for values in cells)}
        self._awaited.discard(pipeline)
        if self._left and not self._awaited:
            cells = list(self._stored())
            for name in sorted(name for name in self._left if not any(has(values, name) for values in cells)):
                told = did_you_mean(name, self._known)
                raise StudyError(("record",), f"no cell has {name}{told}; what was computed is stored")
            self._left = set()


def has(values: Values, name: str) -> bool:
    """Whether a cell has a value of a name; ``*.COLUMN`` is that of any stage."""
    if name.startswith("*."):
        return any(key.endswith(name[1:]) for key in values)
    return values.get(name) is not None
