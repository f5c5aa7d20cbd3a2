"""A study file: TOML into a ``Study``; what is wrong is said with its line."""

import tomllib
from pathlib import Path
from typing import Any

import msgspec

from tilestamp.experiments.studies.places import StudyError, line_of, refused
from tilestamp.experiments.studies.store import Store
from tilestamp.experiments.studies.study import Study
from tilestamp.models.errors import TilestampError
from tilestamp.models.nearest_name import did_you_mean
from tilestamp.models.paths import is_file


class _File(msgspec.Struct, forbid_unknown_fields=True):
    """What a study file may say: the parameters of ``Study``."""

    title: str = ""
    fixed: dict[str, Any] = {}
    grid: dict[str, Any] = {}
    zip: dict[str, Any] = {}
    sample: dict[str, Any] | None = None
    record: tuple[str, ...] = ("milliseconds",)


class StudyFile:
    """A study file that was read: it knows the line of whatever is wrong.

    Parameters
    ----------
    path : str or Path

    Raises
    ------
    TilestampError
        No such file, or no TOML.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        if not is_file(self.path):
            raise TilestampError(f"there is no study file {self.path}")
        try:
            self.text = self.path.read_text("utf-8-sig")
            self._tables = tomllib.loads(self.text)
        except OSError as error:
            raise TilestampError(f"cannot read the study file {self.path}: {error.strerror}") from error
        except (ValueError, RecursionError) as error:
            raise TilestampError(f"{self.path} is not a TOML file: {error}") from error

    def study(self, store: Store | str | Path | None = None) -> Study:
        """Make the study; raises TilestampError with the line of what is wrong."""
        try:
            file = msgspec.convert(self._tables, _File)
        except msgspec.ValidationError as error:
            raise self.placed(_refused(error)) from None
        try:
            known = msgspec.structs.asdict(file) | {"title": file.title or self.path.stem}
            study = Study(store=store, **known)
            _ = study.factors
        except StudyError as error:
            raise self.placed(error) from None
        return study

    def placed(self, error: StudyError) -> TilestampError:
        """The error with its line: that of the place, or of the parameter, wherever that is set."""
        line = line_of(self.text, error.place)
        if len(error.place) == 1 and line == 1:  # a parameter: fixed, or on an axis
            tables = ("fixed",), ("grid",), ("zip",), ("sample", "axes")
            line = max(
                line_of(self.text, (*table, *error.place)) if self._has(*table, *error.place) else 1 for table in tables
            )
        return TilestampError(f"{self.path}:{line}: {'.'.join(error.place)}: {error.sentence}")

    def _has(self, *keys: str) -> bool:
        table: Any = self._tables
        for key in keys:
            table = table.get(key) if isinstance(table, dict) else None
        return table is not None


def read_study(path: str | Path, store: Store | str | Path | None = None) -> Study:
    """Read a study file.

    Parameters
    ----------
    path : str or Path
    store : Store, str or Path, optional
        In memory if not given.

    Raises
    ------
    TilestampError
        With the line.
    """
    return StudyFile(path).study(store)


def _refused(error: msgspec.ValidationError) -> StudyError:
    """What msgspec refuses: which key, and why."""
    place, why = refused(error)
    if "unknown field" in why:
        name = why.rpartition(" ")[2]
        known = _File.__struct_fields__
        return StudyError((*place, name), f"no key of a study{did_you_mean(name, known)}; there are {', '.join(known)}")
    return StudyError(place, why)
