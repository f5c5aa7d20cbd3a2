"""Reader of OFF files (Geomview): text, with normals and colours of vertices, and colours of faces."""

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.simulator.scenes.geometry import Mesh
from tilestamp.simulator.scenes.notes import Notes
from tilestamp.simulator.scenes.polygons import Polygons
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
    vertices, faces, rows = _sizes(found)
    per_vertex = np.diff(np.append(found.firsts, len(found.values)))[rows : rows + vertices]
    widths = [3 + bool(weights), 3 * bool(normals), 4 * bool(colored), 2 * bool(coordinates)]
    table = _table(found, rows, vertices, widths[0] + widths[1])
    positions = table[:, :3] / table[:, 3:4] if weights else table[:, :3]
    found_normals = table[:, widths[0] : widths[0] + 3] if normals else None
    colors, extra = None, int(per_vertex.min(initial=99)) - widths[0] - widths[1] - widths[3]
    if colored or (extra in (3, 4) and not coordinates):
        notes.add_if(
            not colored, "numbers behind the vertices' positions are taken for colours, though the file is no COFF"
        )
        colors = _colors(
            _table(found, rows, vertices, widths[0] + widths[1] + (4 if extra >= 4 else 3))[:, widths[0] + widths[1] :]
        )
    notes.add_if(coordinates, "texture coordinates of an OFF file are not read: it has no texture")
    notes.add_if(not colored and extra > 0 and colors is None, "numbers behind the vertices' positions are not read")
    corners, sizes, face_colors = _faces(found, rows + vertices, faces, notes)
    notes.add_if(colors is not None and face_colors is not None, "face colours are not used beside vertex colours")
    notes.add_if(
        len(found.kinds) > rows + vertices + faces, "the file goes on after its last face: what follows is not read"
    )
    return Polygons(positions, corners, sizes, colors, None if colors is not None else face_colors, found_normals).mesh(
        path
    )


def _sizes(found: Scan) -> tuple[int, int, int]:
    """Vertices and faces, and the row of the first vertex."""
    if found.kinds[:1].tolist() != [Row.NUMBERS]:
        raise TilestampError(f"{found.path}: cannot be read as a mesh: it does not start as an OFF file")
    end = int(found.firsts[1]) if len(found.kinds) > 1 else len(found.values)
    counts = found.values[:end]
    if len(counts) not in (2, 3) or not (np.isfinite(counts).all() and (counts >= 0).all() and (counts < 2**31).all()):
        raise found.error(0, "the numbers of vertices, faces and edges should be here")
    vertices, faces = int(counts[0]), int(counts[1])
    rows = len(found.kinds) - 1
    if rows < vertices + faces:
        raise TilestampError(
            f"{found.path}: says {vertices} vertices and {faces} faces, but ends after {min(rows, vertices)} vertices"
            f" and {max(rows - vertices, 0)} faces"
        )
    wrong = (found.kinds[1 : 1 + vertices + faces] != Row.NUMBERS) | np.isin(
        np.arange(1, 1 + vertices + faces), np.searchsorted(found.firsts, found.broken, side="right") - 1
    )
    if wrong.any():
        raise found.error(1 + int(wrong.argmax()), "numbers should be here")
    return vertices, faces, 1


def _table(found: Scan, first: int, rows: int, width: int) -> NDArray[np.float64]:
    """Give the first ``width`` numbers of each row."""
    counts = np.diff(np.append(found.firsts, len(found.values)))[first : first + rows]
    if (counts < width).any():
        raise found.error(first + int((counts < width).argmax()), f"{width} numbers should be here")
    values: NDArray[np.float64] = found.values[found.firsts[first : first + rows][:, None] + np.arange(width)]
    return values


def _colors(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """RGBA in [0, 1] of 3 or 4 numbers each: from 0 to 255 where one is above 1."""
    colors = np.ones((len(values), 4))
    colors[:, : values.shape[1]] = values / (255.0 if values.max(initial=0.0) > 1.0 else 1.0)
    return colors


def _faces(
    found: Scan, first: int, rows: int, notes: Notes
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64] | None]:
    """Corners, sizes and colours of the faces of three corners and more."""
    starts = found.firsts[first : first + rows]
    counts = np.diff(np.append(found.firsts, len(found.values)))[first : first + rows]
    said = found.values[starts]
    wrong = ~((said >= 0) & (said < counts))
    if wrong.any():
        row = int(wrong.argmax())
        raise found.error(first + row, f"a face of {said[row]:g} corners has {counts[row] - 1} numbers")
    sizes = said.astype(np.int64)
    kept = sizes >= 3
    notes.add_if(not kept.all(), f"{(~kept).sum()} faces have fewer than three corners and are not drawn")
    starts, extra, sizes = starts[kept], (counts - 1 - sizes)[kept], sizes[kept]
    place = np.arange(sizes.sum()) + (starts + 1 - (np.cumsum(sizes) - sizes)).repeat(sizes)
    corners = found.values[place].astype(np.int64)
    notes.add_if((extra == 1).any(), "colours of faces that are numbers of a colour map are not read")
    colored = extra >= 3
    if not colored.any():
        return corners, sizes, None
    notes.add_if(not colored.all(), "faces without a colour are white beside those with one")
    at = (starts + 1 + sizes)[colored][:, None] + np.arange(4)
    values = np.where(
        np.arange(4) < extra[colored][:, None], found.values[np.minimum(at, len(found.values) - 1)], np.nan
    )
    white = 255.0 if np.nanmax(values) > 1.0 else 1.0
    colors = np.ones((len(sizes), 4))
    colors[colored] = np.where(np.isnan(values), 1.0, values / white)
    return corners, sizes, colors
