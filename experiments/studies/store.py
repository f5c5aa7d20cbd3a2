"""The store: one SQLite file that keeps what was computed, cell by cell.

A cell has a key, the digest of all that it comes from (``parameters``), so studies may share a store: what one of them
computed, another one finds. Each cell is one commit, by the one process that reads the study; in WAL mode a process
that is killed loses nothing that it committed, and two processes may write by turns.
"""

import sqlite3
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import msgspec

from tilestamp.models.errors import TilestampError
from tilestamp.models.paths import is_folder

if TYPE_CHECKING:
    import pandas as pd

APPLICATION = 0x74737374  # "tsst", at the head of the file: it is ours
SCHEMA = 1
PATIENCE = 60.0  # seconds that a commit waits for that of another process
MANY = 500  # keys of one query
TABLES = """
CREATE TABLE cells (
  key BLOB PRIMARY KEY, parameters TEXT NOT NULL, recorded TEXT NOT NULL, numbers TEXT NOT NULL, problem TEXT NOT NULL,
  date TEXT NOT NULL DEFAULT CURRENT_TIMESTAMP
) WITHOUT ROWID;
CREATE TABLE inputs (kind TEXT, name TEXT, digest TEXT NOT NULL, PRIMARY KEY (kind, name)) WITHOUT ROWID;
CREATE TABLE times (pipeline TEXT, pixels INTEGER, executions INTEGER, execution_seconds REAL, cells INTEGER,
  pricing_seconds REAL);
"""


class Stored(NamedTuple):
    """What the store has of a cell."""

    numbers: dict[str, Any]
    problem: str


class Rates(NamedTuple):
    """How long things take, in the mean."""

    execution_seconds: float
    pixels: float
    pricing_seconds: float
    """Of a cell."""

    def execution(self, pixels: int) -> float:
        """Seconds of an execution: as long as the mean one, longer in proportion where it has more pixels."""
        return self.execution_seconds * max(1.0, pixels / self.pixels)


class Store:
    """An open store.

    Parameters
    ----------
    path : Path or None
        The file; None for one in memory.
    create : bool
        Whether to make a file that is not there; otherwise such a store is empty and in memory.

    Raises
    ------
    TilestampError
        A file that is no store, or one of another schema.
    """

    def __init__(self, path: Path | None = None, *, create: bool = True) -> None:
        self.path = path
        if path is not None and not is_folder(path.absolute().parent):
            raise TilestampError(f"{path}: there is no folder {path.absolute().parent} for the store")
        kept = path is not None and (create or path.exists())
        with self._sentences():
            self._base = sqlite3.connect(str(path) if kept else ":memory:", timeout=PATIENCE, isolation_level=None)
            self._open()

    def _open(self) -> None:
        """See that the file is ours, and make its tables if it is new."""
        if self._is_new():
            self._base.execute("PRAGMA journal_mode = WAL")  # of a file for good: of no other program's
            with self._transaction():
                if self._is_new():  # another process may have been quicker
                    for statement in TABLES.split(";")[:-1]:
                        self._base.execute(statement)
                    self._base.execute(f"PRAGMA application_id = {APPLICATION}")
                    self._base.execute(f"PRAGMA user_version = {SCHEMA}")
        self._base.execute("PRAGMA synchronous = NORMAL")
        application, schema = self._pragma("application_id"), self._pragma("user_version")
        if application != APPLICATION:
            raise TilestampError(f"{self.path} is a database, but no store of studies: name another file")
        if schema != SCHEMA:
            raise TilestampError(
                f"{self.path} is a store of schema {schema}, and this tilestamp has schema {SCHEMA}: name another file"
            )

    def _is_new(self) -> bool:
        tables = self._base.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]
        return not tables and not self._pragma("application_id")

    def _pragma(self, name: str) -> int:
        return int(self._base.execute(f"PRAGMA {name}").fetchone()[0])

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        self._base.execute("BEGIN IMMEDIATE")
        try:
            yield
        except BaseException:
            self._base.execute("ROLLBACK")
            raise
        self._base.execute("COMMIT")

    @contextmanager
    def _sentences(self) -> Iterator[None]:
        """Say in a sentence what SQLite says; nothing that was committed is lost."""
        try:
            yield
        except sqlite3.DatabaseError as error:
            told = str(error)
            if "not a database" in told:
                raise TilestampError(f"{self.path} is no store of studies: name another file") from error
            if "full" in told or "disk I/O" in told:
                raise TilestampError(
                    f"{self.path}: the disk is full ({told}); what was stored is safe: make room and run again"
                ) from error
            raise TilestampError(f"the store {self.path} cannot be used: {told}") from error

    def put(
        self,
        key: bytes,
        parameters: Mapping[str, Any],
        recorded: Sequence[str],
        numbers: Mapping[str, Any],
        problem: str,
    ) -> None:
        """Store a cell, or what more is recorded of it: one commit."""
        before = self._base.execute("SELECT recorded, numbers FROM cells WHERE key = ?", (key,)).fetchone()
        names, known = map(msgspec.json.decode, before) if before else ([], {})
        names = list(dict.fromkeys([*names, *recorded]))
        row = key, *(_json(part) for part in (parameters, names, {**known, **numbers})), problem
        with self._sentences():
            self._base.execute(
                "INSERT OR REPLACE INTO cells (key, parameters, recorded, numbers, problem) VALUES (?, ?, ?, ?, ?)", row
            )

    def find(self, keys: Iterable[bytes], record: Sequence[str]) -> dict[bytes, Stored]:
        """Give what the store has of some cells, of those of which all of ``record`` is stored."""
        rows = self._rows(iter(keys), record, "numbers")
        return {key: Stored(msgspec.json.decode(numbers), problem) for key, _, problem, numbers in rows}

    def has(self, keys: Iterable[bytes], record: Sequence[str]) -> set[bytes]:
        """Give those of some cells of which all of ``record`` is stored."""
        return {row[0] for row in self._rows(iter(keys), record, "''")}

    def _rows(self, keys: Iterator[bytes], record: Sequence[str], last: str) -> Iterator[tuple[bytes, str, str, str]]:
        wanted = set(record)
        with self._sentences():
            while some := list(islice(keys, MANY)):
                marks = ",".join("?" * len(some))
                query = f"SELECT key, recorded, problem, {last} FROM cells WHERE key IN ({marks})"  # noqa: S608 - no data
                rows = self._base.execute(query, some).fetchall()
                yield from (row for row in rows if row[2] or wanted <= _names(row[1]))

    def changed_inputs(self, inputs: Mapping[tuple[str, str], str]) -> list[tuple[str, str]]:
        """Kind and name of those inputs that were others when this store was last used; they are noted anew."""
        known = {(kind, name): digest for kind, name, digest in self._base.execute("SELECT * FROM inputs")}
        rows = [(*key, digest) for key, digest in inputs.items() if known.get(key) != digest]
        with self._sentences():
            self._base.executemany("INSERT OR REPLACE INTO inputs VALUES (?, ?, ?)", rows)
        return [(kind, name) for kind, name, _ in rows if (kind, name) in known]

    def note_times(
        self, pipeline: str, pixels: int, executions: int, execution_seconds: float, cells: int, pricing_seconds: float
    ) -> None:
        """Note how long a group of cells took, for forecasts."""
        row = pipeline, pixels, executions, execution_seconds, cells, pricing_seconds
        with self._sentences():
            self._base.execute("INSERT INTO times VALUES (?, ?, ?, ?, ?, ?)", row)

    def seconds(self, pipeline: str) -> Rates | None:
        """How long earlier groups of a pipeline took; None where nothing was noted."""
        query = """SELECT sum(execution_seconds) / sum(executions), sum(pixels * executions) / sum(executions),
                   sum(pricing_seconds) / sum(cells) FROM times WHERE pipeline = ? AND cells > 0"""
        with self._sentences():
            found = self._base.execute(query, (pipeline,)).fetchone()
        return None if None in found else Rates(*found)

    def __len__(self) -> int:
        """Cells that are stored."""
        return int(self._base.execute("SELECT count(*) FROM cells").fetchone()[0])

    def table(self) -> "pd.DataFrame":
        """All cells that are stored, of whatever study: a row each, a column a parameter or a number."""
        from tilestamp.experiments.studies.table import frame_of

        with self._sentences():
            rows = self._base.execute("SELECT parameters, numbers, problem FROM cells ORDER BY date, key").fetchall()
        parameters, numbers = (msgspec.json.decode(f"[{','.join(row[part] for row in rows)}]") for part in (0, 1))
        return frame_of(parameters, numbers, [row[2] for row in rows])

    def close(self) -> None:
        """Close the file."""
        self._base.close()


def _json(value: object) -> str:
    return msgspec.json.encode(value).decode()


def _names(text: str, _known: dict[str, set[str]] = {}) -> set[str]:  # noqa: B006 - few texts, decoded once
    if text not in _known:
        _known[text] = set(msgspec.json.decode(text))
    return _known[text]
