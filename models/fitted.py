"""Fitted numbers: what each was fitted to, and what comes out where one of them is another.

A fitted number names the cells that it was chosen on, each as ``FRAME | RESULT | ROW | COLUMN`` (parts from the right
may be left out; ``*`` stands for anything, and ``or`` stands between alternatives). A frame is a scene, a view and a
size (``killeroo 1600x1200``); options such as samples or tiles make no other frame. Inside ``moving(name)`` that number
is larger by ``STEP``: whoever uses it takes ``Fitted.value``, which also notes it (``tilestamp.models.used``).
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from fnmatch import fnmatchcase

from tilestamp.models.used import CHOSEN, FITTED, note

STEP = 0.01  # relative change of a number that is moved
_moved: ContextVar[str] = ContextVar("moved", default="")


@dataclass(frozen=True)
class Fitted:
    """One fitted number.

    Parameters
    ----------
    name : str
        Unique: ``gtx280: atomics.conflict_ns``.
    number : float
        As it was fitted.
    fitted_to : tuple of str
        The cells.
    chosen : bool
        Whether it is an input of the frame (the distance of a camera), which settles the work and not its price.
    """

    name: str
    number: float
    fitted_to: tuple[str, ...]
    chosen: bool = False

    @property
    def value(self) -> float:
        """The number, or a larger one where it is moved."""
        for target in self.fitted_to:
            note(CHOSEN if self.chosen else FITTED, self.name, target)
        return self.number * (1.0 + STEP) if moved() == self.name else self.number

    def on(self, frame: str) -> float:
        """``value`` on a frame that it was fitted to; on another one the plain number, of which nothing is noted."""
        return self.value if any(on_frame(target, frame) for target in self.fitted_to) else self.number


def moved() -> str:
    """Name of the number that is moved now, or nothing."""
    return _moved.get()


@contextmanager
def moving(name: str) -> Iterator[None]:
    """Move one number meanwhile; ``""``: none."""
    token = _moved.set(name)
    try:
        yield
    finally:
        _moved.reset(token)


def on_frame(target: str, frame: str) -> bool:
    """Whether a number that was fitted to ``target`` was fitted on ``frame``."""
    return bool(frame) and _fits(frame, _parts(target)[0])


def names_cell(target: str, cell: Sequence[str]) -> bool:
    """Whether ``target`` names a cell: its frame, result, row and column."""
    parts = _parts(target)
    return len(parts) == len(cell) and all(map(_fits, cell, parts))


def _fits(text: str, patterns: str) -> bool:
    return any(fnmatchcase(text, pattern) for pattern in patterns.split(" or "))


def _parts(target: str) -> list[str]:
    return [part.strip() for part in target.split(" | ")]
