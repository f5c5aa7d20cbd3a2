"""Reader of OFF files (Geomview): text, with normals and colours of vertices, and colours of faces."""

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.simulator.scenes.geometry import Mesh
from tilestamp.simulator.scenes.notes import Notes
from tilestamp.simulator.scenes.polygons import Polygons, whole_numbers
from tilestamp.simulator.scenes.text_scan import Row, Scan, plain_text, read_bytes, scan

HEADER = re.compile(rb"(?:\s|#[^\n]*\n)*(ST)?(C)?(N)?(4)?(n)?(?:C)?OFF\b([ \t]*BINARY)?")


def read_off(path: Path, notes: Notes) -> Mesh:
    """Read the polygons of an OFF file; raises TilestampError."""
    raw = plain_text(read_bytes(path))
    header = HEADER.match(raw)
    coordinates, colored, normals, weights, space, binary = header.groups() if header else (None,) * 6
    if space or binary:
        raise TilestampError(f"{path}: {'binary' if binary else 'n-dimensional'} OFF files are not read")
    start = header.end() if header else 0
    found = scan(path, raw[:start].count(b"\n") * b"\n" + raw[start:])
    vertices, faces, first = _sizes(found)
    width = 3 + bool(weights)
    color = width + 3 * bool(normals)  # place of the first one of a vertex
    least = int(_lengths(found, first, vertices).min(initial=99)) - 2 * bool(coordinates)
    table = _table(found, first, vertices, max(min(least, color + 4), color + 3 * bool(colored)))
    behind = table.shape[1] - color
    shaded = bool(colored) or (behind >= 3 and not coordinates)
    notes.add_if(
        shaded and not colored,
        "numbers behind the vertices' positions are taken for colours, though the file is no COFF",
    )
    notes.add_if(coordinates, "texture coordinates of an OFF file are not read: it has no texture")
    notes.add_if(behind > 0 and not shaded, "numbers behind the vertices' positions are not read")
    corners, sizes, face_colors = _faces(found, first + vertices, faces, notes)
    notes.add_if(shaded and face_colors is not None, "face colours are not used beside vertex colours")
    end = first + vertices + faces
    notes.add_if(len(found.kinds) > end, "the file goes on after its last face: what follows is not read")
    return Polygons(
        table[:, :3] / table[:, 3:4] if weights else table[:, :3],
        corners,
        sizes,
        _colors(table[:, color:]) if shaded else None,
        None if shaded else face_colors,
        table[:, width:color] if normals else None,
    ).mesh(path)


def _sizes(found: Scan) -> tuple[int, int, int]:
    """Vertices and faces, and the row of the first vertex."""
    if found.kinds[:1].tolist() != [Row.NUMBERS]:
        raise TilestampError(f"{found.path}: cannot be read as a mesh: it does not start as an OFF file")
    end = int(found.firsts[1]) if len(found.kinds) > 1 else len(found.values)
    first = 1 if end > 1 else int(np.searchsorted(found.firsts, 3))  # the three may have a line each
    counts = found.values[: end if end > 1 else 3]
    if len(counts) not in (2, 3) or not (np.isfinite(counts).all() and (counts >= 0).all() and (counts < 2**31).all()):
        raise found.error(0, "the numbers of vertices, faces and edges should be here")
    vertices, faces = int(counts[0]), int(counts[1])
    rows = len(found.kinds) - first
    if rows < vertices + faces:
        raise TilestampError(
            f"{found.path}: says {vertices} vertices and {faces} faces, but ends after {min(rows, vertices)} vertices"
            f" and {max(rows - vertices, 0)} faces"
        )
    wrong = found.kinds != Row.NUMBERS
    wrong[np.searchsorted(found.firsts, found.broken, side="right") - 1] = True
    wrong = wrong[: first + vertices + faces]
    if wrong.any():
        raise found.error(int(wrong.argmax()), "numbers should be here")
    return vertices, faces, first


def _lengths(found: Scan, first: int, rows: int) -> NDArray[np.int64]:
    """Numbers on each of some rows."""
    lengths: NDArray[np.int64] = np.diff(np.append(found.firsts, len(found.values)))[first : first + rows]
    return lengths


def _table(found: Scan, first: int, rows: int, width: int) -> NDArray[np.float64]:
    """Give the first ``width`` numbers of each row."""
    short = _lengths(found, first, rows) < width
    if short.any():
        raise found.error(first + int(short.argmax()), f"{width} numbers should be here")
    values: NDArray[np.float64] = found.values[found.firsts[first : first + rows][:, None] + np.arange(width)]
    return values


def _colors(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """RGBA in [0, 1] of 3 or 4 numbers each (NaN for none): from 0 to 255 where one is above 1, but for fractions."""
    large = np.nanmax(values, initial=0.0) > 1.0
    fractions = ((values > 0.0) & (values < 1.0)).any(axis=1, keepdims=True)
    colors = np.ones((len(values), 4))
    colors[:, : values.shape[1]] = values / np.where(large & ~fractions, 255.0, 1.0)
    return np.nan_to_num(colors, nan=1.0)


def _faces(
    found: Scan, first: int, rows: int, notes: Notes
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64] | None]:
    """Corners, sizes and colours of the faces of three corners and more."""
    starts, counts = found.firsts[first : first + rows], _lengths(found, first, rows)
    said = found.values[starts]
    wrong = ~((said >= 0) & (said < counts) & (said % 1 == 0))
    if wrong.any():
        row = int(wrong.argmax())
        raise found.error(first + row, f"a face of {said[row]:g} corners has {counts[row] - 1} numbers")
    sizes = said.astype(np.int64)
    kept = sizes >= 3
    notes.add_if(not kept.all(), f"{(~kept).sum()} faces have fewer than three corners and are not drawn")
    starts, extra, sizes = starts[kept], (counts - 1 - sizes)[kept], sizes[kept]
    place = np.arange(sizes.sum()) + (starts + 1 - (np.cumsum(sizes) - sizes)).repeat(sizes)
    corners = whole_numbers(found.values[place], found.path)
    notes.add_if((extra == 1).any(), "colours of faces that are numbers of a colour map are not read")
    colored = extra >= 3
    if not colored.any():
        return corners, sizes, None
    notes.add_if(not colored.all(), "faces without a colour are white beside those with one")
    at, column = (starts + 1 + sizes)[:, None] + np.arange(4), np.arange(4)
    there = colored[:, None] & (column < extra[:, None])
    return corners, sizes, _colors(np.where(there, found.values[np.minimum(at, len(found.values) - 1)], np.nan))
