"""Text files of numbers, scanned by a kernel: rows of numbers, and OBJ statements with their corners.

Bytes are read once to count and once to fill, so that memory is exact. A decimal of at most 2**53 and 22 places is
converted exactly by one multiplication or division (Clinger 1990); Python converts all others.
"""

import re
from dataclasses import dataclass, field
from enum import IntEnum
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.kernel import kernel
from tilestamp.models.paths import is_file

UTF8_MARK, UTF16_MARKS = b"\xef\xbb\xbf", (b"\xff\xfe", b"\xfe\xff")
NEWLINE, SPACE, HASH, MINUS, PLUS, DOT, SLASH, ZERO, NINE, BACKSLASH = b"\n #-+./09\\"
E, UPPER_E, LETTER_F, LETTER_N, LETTER_O, LETTER_T, LETTER_V = b"eEfnotv"
MOST_DIGITS, MOST_PLACES = 2**53 // 10 - 1, 22
LARGEST, BROKEN = 2**31 - 1, -(2**31)  # of a corner's numbers: beyond any vertex, and not a number
TENS = 10.0 ** np.arange(MOST_PLACES + 1)


class Row(IntEnum):
    """What a line is."""

    OTHER = 0
    NUMBERS = 1  # no word in front
    V = 2
    VT = 3
    VN = 4
    F = 5
    VERTEX = 6  # of an STL file


@dataclass
class Scan:
    """The lines of a file that are not empty and no comments.

    Parameters
    ----------
    path : Path
    raw : bytes
    kinds : ndarray, (R,), uint8
        `Row` of each line.
    starts : ndarray, (R,), int64
        Byte of each line's first word.
    firsts : ndarray, (R,), int64
        First of ``values`` (of ``corners``, on a line F) that is on this line or follows it.
    values : ndarray, (N,), float64
        NaN where a word is no number; then ``broken`` has its place in ``values``.
    corners : ndarray, (C, 3), int32
        Numbers of position, coordinate and normal; 0 for none.
    """

    path: Path
    raw: bytes
    kinds: NDArray[np.uint8]
    starts: NDArray[np.int64]
    firsts: NDArray[np.int64]
    values: NDArray[np.float64]
    corners: NDArray[np.int32]
    broken: list[int] = field(default_factory=list)

    def error(self, row: int, what: str) -> TilestampError:
        """Say what is wrong with a line."""
        line = self.raw.count(b"\n", 0, int(self.starts[row])) + 1
        return TilestampError(f"{self.path}:{line}: {what}: {self.text(row)[:60]!r}")

    def text(self, row: int) -> str:
        """Give a line with those that continue it, without what surrounds it."""
        found = re.compile(rb"(?:\\\n|[^\n])*").match(self.raw, int(self.starts[row]))
        return (found[0] if found else b"").replace(b"\\\n", b" ").decode(errors="replace").strip()

    def rows(self, kind: Row) -> NDArray[np.int64]:
        """Lines of a kind."""
        return np.flatnonzero(self.kinds == kind)

    def counts(self, kind: Row) -> NDArray[np.int64]:
        """Numbers (corners, for F) on each line of a kind."""
        family = np.flatnonzero((self.kinds == Row.F) if kind == Row.F else (self.kinds != Row.F))
        ends = np.append(self.firsts[family], len(self.corners) if kind == Row.F else len(self.values))
        counts: NDArray[np.int64] = np.diff(ends)[self.kinds[family] == kind]
        return counts

    def table(self, kind: Row, least: int, most: int, what: str) -> NDArray[np.float64]:
        """Give the numbers of all lines of a kind, (n, most): NaN where there are fewer; under ``least`` raises."""
        rows, counts = self.rows(kind), self.counts(kind)
        wrong = counts < least
        if self.broken:
            at = np.searchsorted(self.firsts[rows], self.broken, side="right") - 1
            inside = (at >= 0) & (np.array(self.broken) < (self.firsts[rows] + counts)[at]) if len(rows) else at < -1
            wrong[at[inside]] = True
        if wrong.any():
            raise self.error(int(rows[wrong.argmax()]), what)
        place = self.firsts[rows][:, None] + np.arange(most)
        if (counts >= most).all():
            full: NDArray[np.float64] = self.values[place]
            return full
        return np.where(np.arange(most) < counts[:, None], self.values[np.minimum(place, len(self.values) - 1)], np.nan)


def read_bytes(path: Path) -> bytes:
    """Read a file, or raise a sentence."""
    if not is_file(path):  # a folder, a pipe, a name that no file can have
        raise TilestampError(f"{path}: there is no such file")
    try:
        return path.read_bytes()
    except OSError as error:
        raise TilestampError(f"{path}: cannot be read ({error.strerror})") from None


def plain_text(raw: bytes) -> bytes:
    """Give the UTF-8 text of a file: without byte order marks, lines ended by a newline or a backslash before it."""
    if raw[:2] in UTF16_MARKS:
        raw = raw.decode("utf-16", errors="replace").encode()
    raw = raw.replace(b"\r\n", b"\n").replace(b"\r", b"\n") if b"\r" in raw else raw
    raw = raw.replace(b"\n" + UTF8_MARK, b"\n")  # of files that were put one behind another
    while raw.startswith(UTF8_MARK):
        raw = raw.removeprefix(UTF8_MARK)
    return re.sub(rb"\\[ \t]*(?=\n|$)", rb"\\", raw).removesuffix(b"\\") if b"\\" in raw else raw


def scan(path: Path, raw: bytes) -> Scan:
    """Find the numbers of a text (as `plain_text` gives it)."""
    data = np.frombuffer(raw, np.uint8)
    rows, numbers, corners = _scan(data, None, None, None, None, None, None)
    result = Scan(
        path,
        raw,
        np.empty(rows, np.uint8),
        np.empty(rows, np.int64),
        np.empty(rows, np.int64),
        np.empty(numbers),
        np.zeros((corners, 3), np.int32),
    )
    places = np.empty(numbers, np.int64)
    _scan(data, result.kinds, result.starts, result.firsts, result.values, places, result.corners)
    word = re.compile(rb"[^\s#_]+(?![^\s#])|")  # nothing for 1_000, which only Python takes for a number
    for index in np.flatnonzero(places >= 0).tolist():
        try:
            result.values[index] = float(word.match(raw, places[index])[0])  # type: ignore[index]
        except ValueError:
            result.values[index] = np.nan
            result.broken.append(index)
    return result


@kernel
def _scan(data: Any, kinds: Any, starts: Any, firsts: Any, values: Any, places: Any, corners: Any) -> Any:
    """Count lines, numbers and corners, and store them where there are arrays."""
    rows = numbers = found = at = 0
    while True:
        at = _skip_blanks(data, at)
        if at >= len(data):
            return rows, numbers, found
        if data[at] == NEWLINE or data[at] == HASH:
            at = _line_end(data, at, data[at] != HASH) + 1
            continue
        kind, words = _kind(data, at)
        if kinds is not None:
            kinds[rows] = kind
            starts[rows] = at
            firsts[rows] = found if kind == Row.F else numbers
        rows += 1
        if kind == Row.OTHER:
            at = _line_end(data, at, True) + 1
            continue
        at = _skip_blanks(data, words)
        while at < len(data) and data[at] != NEWLINE and data[at] != HASH:
            if kind == Row.F:
                end = _corner(data, at, corners, found)
                found += 1
            else:
                value, end, exact = _number(data, at)
                last = _word_end(data, end)
                if values is not None:
                    values[numbers] = value
                    places[numbers] = -1 if exact and last == end else at
                end = last
                numbers += 1
            at = _skip_blanks(data, end)


@kernel
def _skip_blanks(data: Any, at: int) -> int:
    """Go on to a word, the line's end, or the data's; a backslash at a line's end counts as blank."""
    while at < len(data):
        joined = data[at] == BACKSLASH and at + 1 < len(data) and data[at + 1] == NEWLINE
        if not joined and (data[at] > SPACE or data[at] == NEWLINE):
            return at
        at += 2 if joined else 1
    return at


@kernel
def _word_end(data: Any, at: int) -> int:
    while at < len(data) and data[at] > SPACE and data[at] != HASH:
        if data[at] == BACKSLASH and at + 1 < len(data) and data[at + 1] == NEWLINE:
            return at
        at += 1
    return at


@kernel
def _line_end(data: Any, at: int, joins: bool) -> int:
    """Find the newline that ends a line; one behind a backslash does not, where lines join."""
    while at < len(data) and not (data[at] == NEWLINE and not (joins and at > 0 and data[at - 1] == BACKSLASH)):
        at += 1
    return at


@kernel
def _kind(data: Any, at: int) -> Any:
    """Kind of the line that starts here, and where its first word ends (starts, if it is a number)."""
    if (ZERO <= data[at] <= NINE) or data[at] == MINUS or data[at] == PLUS or data[at] == DOT:
        return Row.NUMBERS, at
    end = _word_end(data, at)
    length = end - at
    second = data[at + 1] if length > 1 else data[at]
    if data[at] == LETTER_V:
        if length == 1:
            return Row.V, end
        if length == 2 and second == LETTER_T:
            return Row.VT, end
        if length == 2 and second == LETTER_N:
            return Row.VN, end
        if length == 6 and second == E:  # "vertex": nothing else of these formats starts with "ve"
            return Row.VERTEX, end
    if data[at] == LETTER_F and (length == 1 or (length == 2 and second == LETTER_O)):
        return Row.F, end
    return Row.OTHER, end


@kernel
def _number(data: Any, at: Any) -> Any:
    """Value of a decimal, where it ends, and whether the value is exact."""
    negative = data[at] == MINUS
    if negative or data[at] == PLUS:
        at += 1
    digits: Any = 0
    power: Any = 0
    places, seen, exact, fraction = 0, 0, True, False
    while at < len(data):
        if ZERO <= data[at] <= NINE:
            exact &= digits <= MOST_DIGITS
            digits = digits * 10 + np.int64(data[at] - ZERO) if exact else 0
            places -= int(fraction)
            seen += 1
        elif data[at] == DOT and not fraction:
            fraction = True
        else:
            break
        at += 1
    if at + 1 < len(data) and (data[at] == E or data[at] == UPPER_E):
        down = data[at + 1] == MINUS
        at += 2 if down or data[at + 1] == PLUS else 1
        known = False
        while at < len(data) and ZERO <= data[at] <= NINE:
            power = min(power * 10 + np.int64(data[at] - ZERO), 9999)
            known = True
            at += 1
        exact &= known
        places += -power if down else power
    exact &= seen > 0 and -MOST_PLACES <= places <= MOST_PLACES
    if not exact:
        return np.nan, at, False
    value = digits / TENS[-places] if places < 0 else digits * TENS[places]
    return -value if negative else value, at, True


@kernel
def _corner(data: Any, at: Any, corners: Any, index: int) -> Any:
    """Store the numbers of ``7/3/2``, ``7//2`` or ``-1``; give where the word ends."""
    for column in range(3):
        negative = at < len(data) and data[at] == MINUS
        if negative or (at < len(data) and data[at] == PLUS):
            at += 1
        value: Any = 0
        while at < len(data) and ZERO <= data[at] <= NINE:
            value = min(value * 10 + np.int64(data[at] - ZERO), LARGEST)
            at += 1
        if corners is not None:
            corners[index, column] = -value if negative else value
        if at >= len(data) or data[at] != SLASH:
            break
        at += 1
    end = _word_end(data, at)
    if end > at and corners is not None:
        corners[index, 0] = BROKEN
    return end
