"""Reader of `.bpt` files: bicubic Bezier patches that share their control points.

Line 1 the patch count n; n lines of 16 comma-separated 1-based point numbers (4x4, row-major); the point count;
that many lines ``x,y,z``, or ``x,y,z,w`` for rational points with their weight last. Numbers may be parted by blanks.
Or, the older form: the patch count; then for each patch a line of its two degrees, 1 to 3, and its points, row by row.
"""

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.simulator.scenes.geometry import Patches
from tilestamp.simulator.scenes.text_scan import plain_text, read_bytes

POINTS_PER_PATCH, MOST_DIGITS = 16, 16
_WORD = re.compile(r"\S+")
# By the number of points of a Bezier curve: the matrix that makes four of them (degree elevation; Farin 2002, 6.1).
RAISED = {
    2: np.array([[3, 0], [2, 1], [1, 2], [0, 3]]) / 3.0,
    3: np.array([[3, 0, 0], [1, 2, 0], [0, 2, 1], [0, 0, 3]]) / 3.0,
    4: np.eye(4),
}


def read_bpt(path: str | Path) -> Patches:
    """Read the patches of a `.bpt` file.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    Patches
        Points (P, 16, 4) float32, homogeneous: a rational point is stored as (w x, w y, w z, w).

    Raises
    ------
    TilestampError
        Where the file cannot be read or a line is broken (``file:line``), a point is not finite, or a weight is not
        positive.
    """
    lines = _Lines(Path(path))
    patches = lines.count("patches")
    if lines.degrees() is not None:
        return _headed(lines, patches)
    corners = lines.table(patches, (POINTS_PER_PATCH,), np.int64, "point numbers")
    first_corner_line = lines.next_line - patches
    points = lines.count("points")
    values = lines.table(points, (3, 4), np.float64, "coordinates")
    first_point_line = lines.next_line - points + 1
    lines.end()
    wrong = ((corners < 1) | (corners > points)).any(axis=1)
    if wrong.any():
        line = first_corner_line + int(wrong.argmax()) + 1
        raise TilestampError(f"{path}:{line}: a point number is not between 1 and {points}")
    return Patches(_homogeneous(values, path, first_point_line)[corners - 1])


def _headed(lines: "_Lines", patches: int) -> Patches:
    """Patches that each have a line of their degrees; lower degrees are raised to 3, which changes no point."""
    nets = []
    for patch in range(patches):
        degrees = lines.degrees()
        if degrees is None:
            raise lines.error(lines.next_line, f"the degrees (1 to 3) of patch {patch + 1} of {patches} should be here")
        lines.next_line += 1
        rows, columns = (degree + 1 for degree in degrees)
        values = lines.table(rows * columns, (3, 4), np.float64, "coordinates")
        first_line = lines.next_line - rows * columns + 1
        points = _homogeneous(values, lines.path, first_line).reshape(rows, columns, 4)
        nets.append(np.einsum("ar,bc,rck->abk", RAISED[rows], RAISED[columns], points).reshape(16, 4))
    lines.end()
    return Patches(np.stack(nets).astype(np.float32))


def homogeneous_points(values: NDArray[np.float64]) -> NDArray[np.float32]:
    """Homogeneous float32 points (N, 4) of plain points (N, 3), or of rational points (N, 4) with the weight last."""
    weights = values[:, 3:] if values.shape[1] == 4 else np.ones((len(values), 1))
    return np.concatenate([values[:, :3] * weights, weights], axis=1).astype(np.float32)


def _homogeneous(values: NDArray[np.float64], path: str | Path, first_line: int) -> NDArray[np.float32]:
    with np.errstate(over="ignore"):
        points = homogeneous_points(values)
    broken = ~np.isfinite(points).all(axis=1)
    if broken.any():
        line = first_line + int(broken.argmax())
        raise TilestampError(f"{path}:{line}: a control point is NaN, infinite or too large for float32")
    light = points[:, 3] <= 0.0
    if light.any():
        line = first_line + int(light.argmax())
        raise TilestampError(f"{path}:{line}: the weight of a control point must be positive")
    return points


class _Lines:
    """The lines of a file, taken from the top; every complaint names its line."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.next_line = 0  # 0-based
        try:
            text = plain_text(read_bytes(path)).decode("ascii").rstrip()
        except UnicodeDecodeError:
            raise TilestampError(f"{path}: is not a text file of patches") from None
        self.lines = [",".join(_WORD.findall(line)) if "," not in line else line for line in text.split("\n")]

    def error(self, index: int, what: str) -> TilestampError:
        """Say what is wrong with the line of a 0-based index."""
        return TilestampError(f"{self.path}:{index + 1}: {what}")

    def _skip_blanks(self) -> int:
        """Go on to a line that is not blank, and give its index."""
        while self.next_line < len(self.lines) - 1 and not self.lines[self.next_line].strip():
            self.next_line += 1
        return self.next_line

    def count(self, what: str) -> int:
        """Take one line that holds a positive number."""
        index = self._skip_blanks()
        if index >= len(self.lines):
            raise self.error(index, f"the file ends where the number of {what} should be")
        text = self.lines[index].strip()
        if not (text.isdecimal() and len(text) < MOST_DIGITS and int(text)):
            raise self.error(index, f"the number of {what} should be here, not {text[:40]!r}")
        self.next_line += 1
        return int(text)

    def degrees(self) -> tuple[int, int] | None:
        """Look at a line of two degrees, from 1 to 3; None where it is none."""
        words = self.lines[self._skip_blanks()].split(",") if self.next_line < len(self.lines) else []
        return (
            (int(words[0]), int(words[1]))
            if len(words) == 2 and all(word in ("1", "2", "3") for word in words)
            else None
        )

    def table(self, rows: int, widths: tuple[int, ...], dtype: type, what: str) -> NDArray[np.float64]:
        """Take ``rows`` lines of comma-separated numbers, all of one of the ``widths``."""
        start = self._skip_blanks()
        stop = start + rows
        if stop > len(self.lines):
            raise self.error(
                len(self.lines), f"the file ends after {len(self.lines) - start} of {rows} lines of {what}"
            )
        self.next_line = stop
        try:
            table: NDArray[np.float64] = np.loadtxt(
                self.lines[start:stop], dtype=dtype, delimiter=",", comments=None, ndmin=2
            )
        except ValueError:
            raise self._broken(start, stop, widths, dtype, what) from None
        if table.shape[0] != rows or table.shape[1] not in widths:
            raise self._broken(start, stop, widths, dtype, what)
        return table

    def _broken(self, start: int, stop: int, widths: tuple[int, ...], dtype: type, what: str) -> TilestampError:
        """Find the line that the fast reader refused."""
        width = self.lines[start].count(",") + 1
        for index in range(start, stop):
            parts = self.lines[index].split(",")
            try:
                values = [dtype(part) for part in parts]
            except (OverflowError, ValueError):
                values = []
            if len(values) not in widths or len(values) != width:
                wanted = " or ".join(map(str, widths))
                return self.error(index, f"{wanted} {what} should be here, not {self.lines[index].strip()[:60]!r}")
        return self.error(start, f"these lines of {what} cannot be read")

    def end(self) -> None:
        """Make sure that nothing follows."""
        if self.next_line < len(self.lines):
            raise self.error(self.next_line, "the file should end here: more lines than its counts say")
