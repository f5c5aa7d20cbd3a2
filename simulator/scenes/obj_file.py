"""Reader of Wavefront OBJ files that keeps polygons, their order, materials and textures, and names broken lines.

Our own, because no library does (1.3 million triangles of 49 MB; trimesh 5.2: 7.9 s, pymeshlab 2025.7: 4.3 s, meshio
5.3: 13 s, and none keeps polygons in the file's order beside line numbers; tinyobjloader has no wheels for Linux).
Read are ``v``, ``vt``, ``vn``, ``f``, ``usemtl`` and ``mtllib``; the notes name what else there is.
"""

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.simulator.scenes.material_file import Materials, read_materials
from tilestamp.simulator.scenes.notes import Notes
from tilestamp.simulator.scenes.text_scan import BROKEN, LARGEST, Row, Scan, plain_text, read_bytes, scan

SILENT = ("g", "o", "usemtl", "mtllib")  # names of groups change no picture


@dataclass
class ObjFile:
    """What an OBJ file holds.

    Parameters
    ----------
    positions : ndarray, (V, 3), float64
    colors : ndarray, (V, 3), float64, or None
        Vertex colours, where every vertex has one.
    corners : ndarray, (sum of sizes,), int64
        Vertex numbers of the polygons, one polygon after another.
    sizes : ndarray, (F,), int64
        Corners of each polygon: 3 or more.
    materials : ndarray, (F,), int64
        Row of ``surfaces`` for each polygon.
    surfaces : Materials
        Row 0 is white, for polygons with none.
    coordinates, normals : ndarray, (VT, 2), (VN, 3), float32
    coordinate_of, normal_of : ndarray, (sum of sizes,), int64
        Rows of these for each corner; -1 for none.
    """

    positions: NDArray[np.float64]
    colors: NDArray[np.float64] | None
    corners: NDArray[np.int64]
    sizes: NDArray[np.int64]
    materials: NDArray[np.int64]
    surfaces: Materials
    coordinates: NDArray[np.float32]
    normals: NDArray[np.float32]
    coordinate_of: NDArray[np.int64]
    normal_of: NDArray[np.int64]
    notes: Notes = field(default_factory=Notes)


def read_obj(path: str | Path, texture: NDArray[np.uint8] | None = None) -> ObjFile:
    """Read an OBJ file; raises TilestampError (``file:line``) where a line is broken or there is no face.

    A ``texture``, (H, W, 4) uint8, is laid over all faces in place of those of the materials.
    """
    path, notes = Path(path), Notes()
    found = scan(path, plain_text(read_bytes(path)))
    positions, colors = _vertices(found, notes)
    tables = {Row.VT: (1, 2, "a texture coordinate needs a number"), Row.VN: (3, 3, "a normal needs three numbers")}
    coordinates, normals = (found.table(kind, *needs).astype(np.float32) for kind, needs in tables.items())
    sizes = found.counts(Row.F)
    if (sizes < 3).any():
        raise found.error(int(found.rows(Row.F)[(sizes < 3).argmax()]), "a face needs at least three corners")
    if not len(sizes):
        raise TilestampError(f"{path}: the model has no faces")
    materials, names, libraries = _statements(found, notes)
    surfaces = read_materials(path, libraries, names, notes)
    if texture is not None:
        surfaces.cover(texture)
    corners = _resolved(found, sizes, 0, Row.V)
    coordinate_of = normal_of = np.broadcast_to(np.int64(-1), corners.shape)
    if surfaces.textured:
        coordinate_of, normal_of = (_resolved(found, sizes, k, kind) for k, kind in ((1, Row.VT), (2, Row.VN)))
    notes.add_if(len(normals) and not surfaces.textured, "vertex normals (vn) are not used: the model has no texture")
    coordinates[:, 1:] = np.nan_to_num(coordinates[:, 1:])
    return ObjFile(
        positions, colors, corners, sizes, materials, surfaces, coordinates, normals, coordinate_of, normal_of, notes
    )


def _vertices(found: Scan, notes: Notes) -> tuple[NDArray[np.float64], NDArray[np.float64] | None]:
    """Positions, and colours where every vertex has one."""
    values, counts = found.table(Row.V, 3, 3, "a vertex needs three numbers"), found.counts(Row.V)
    infinite = ~np.isfinite(values).all(axis=1)
    if infinite.any():
        raise found.error(int(found.rows(Row.V)[infinite.argmax()]), "a vertex is NaN or infinite")
    weights = found.table(Row.V, 3, 4, "")[counts == 4, 3] if (counts == 4).any() else counts[:0]
    notes.add_if((weights != 1.0).any(), "weights of vertices are not read")
    notes.add_if(((counts == 5) | (counts > 6)).any(), "numbers behind a vertex's position or its colour are not read")
    colored = counts >= 6
    if not len(counts) or not colored.all():
        notes.add_if(
            colored.any(), f"colours of {colored.sum()} of {len(counts)} vertices are not used: not all have one"
        )
        return values, None
    colors = found.table(Row.V, 6, 6, "a colour needs three numbers")[:, 3:]
    if np.nanmax(colors) > 1.0:
        notes.add("vertex colours are taken to be from 0 to 255")
        colors /= 255.0
    return values, colors


def _resolved(found: Scan, sizes: NDArray[np.int64], column: int, kind: Row) -> NDArray[np.int64]:
    """0-based rows that the corners name; negative numbers count back from the row read last; -1 for none."""
    numbers, count = found.corners[:, column].astype(np.int64), int((found.kinds == kind).sum())
    rows = found.rows(Row.F)
    index = numbers - 1
    if numbers.min() < 0:
        before = np.cumsum(found.kinds == kind)[rows].repeat(sizes)
        index = np.where(numbers < 0, numbers + before, index)
    wrong = (index >= count) | (index < -1) | ((index < 0) & ((numbers != 0) | (column == 0)))
    if wrong.any():
        corner = int(wrong.argmax())
        row = int(rows[np.searchsorted(np.cumsum(sizes), corner, side="right")])
        what = ("vertex", "texture coordinate", "normal")[column]
        word = {BROKEN: "that is no number", LARGEST: "of more than nine digits"}.get(
            number := int(numbers[corner]), number
        )
        raise found.error(row, f"a face names the {what} {word}, which does not exist (the file has {count})")
    return index


def _statements(found: Scan, notes: Notes) -> tuple[NDArray[np.int64], dict[str, int], list[str]]:
    """Material of each face, the materials' numbers by name, and the libraries; note what is not read."""
    names, libraries, skipped = {"": 0}, [], Counter[str]()
    starts, current = [0], [0]
    for row in found.rows(Row.OTHER).tolist():
        word, _, rest = found.text(row).replace("\t", " ").partition(" ")
        if word == "usemtl":
            starts.append(row)
            current.append(names.setdefault(" ".join(rest.split()), len(names)))
        elif word == "mtllib":
            libraries.append(rest)
        elif word not in SILENT:
            skipped[word[:20]] += 1
    skipped["numbers without a word"] = len(found.rows(Row.NUMBERS)) + len(found.rows(Row.VERTEX))
    words = ", ".join(f"{word} ({count})" for word, count in skipped.items() if count)
    notes.add_if(words, f"statements that are not read: {words}")
    notes.add_if("crease" in words or "t" in skipped, "crease tags (t crease) are ignored: edges are smooth")
    return np.array(current)[np.searchsorted(starts, found.rows(Row.F), side="right") - 1], names, libraries
