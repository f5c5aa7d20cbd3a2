"""Reader of PLY files, text or binary of either byte order: faces of any number of corners, in the file's order.

Our own, because no library does (974,000 faces, of them a third quads: trimesh 5.2 refuses, plyfile 1.1
takes 9.5 s, meshio 5.3 23 s; all triangles: trimesh 1.1 s, plyfile 13 s).
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.kernel import kernel
from tilestamp.simulator.scenes.geometry import Mesh
from tilestamp.simulator.scenes.notes import Notes
from tilestamp.simulator.scenes.polygons import Polygons, whole_numbers
from tilestamp.simulator.scenes.strips import strip_triangles
from tilestamp.simulator.scenes.text_scan import UTF8_MARK, UTF16_MARKS, plain_text, read_bytes, scan

TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4"}
TYPES |= {"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"}
TYPES |= {"float32": "f4", "float64": "f8", "double": "f8", "int64": "i8", "uint64": "u8"}
Order = Literal["=", "<", ">"]
ORDERS: dict[str, Order] = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}
XYZ, NORMAL = ("x", "y", "z"), ("nx", "ny", "nz")
COLOR = ("red", "green", "blue", "alpha")
CORNERS = ("vertex_indices", "vertex_index")


@dataclass
class _Property:
    name: str
    kind: np.dtype[Any]
    count: np.dtype[Any] | None  # of a list's length
    white: float = 1.0  # as a colour


@dataclass
class Element:
    """Rows of one kind: the values of each property by its name, of lists one behind another, and their lengths."""

    name: str
    rows: int
    properties: list[_Property] = field(default_factory=list)
    values: dict[str, NDArray[Any]] = field(default_factory=dict)
    lengths: dict[str, NDArray[np.int64]] = field(default_factory=dict)


def read_ply(path: Path, notes: Notes) -> Mesh:
    """Read the faces (and strips of triangles), colours and normals of a PLY file; raises TilestampError."""
    return _polygons(path, read_elements(path, notes), notes).mesh(path)


def read_elements(path: Path, notes: Notes) -> dict[str, Element]:
    """Read the elements of a PLY file with the values of their properties, by name; raises TilestampError."""
    raw = read_bytes(path)
    raw = plain_text(raw) if raw[:2] in UTF16_MARKS else raw.removeprefix(UTF8_MARK)
    header = re.compile(rb"\s*ply\s*[\r\n](?:.*?[\r\n])?end_header[ \t]*(?:\r\n|\n|\r|$)", re.DOTALL).match(raw)
    if header is None:
        raise TilestampError(f"{path}: cannot be read as a mesh: it has no PLY header")
    text, elements = _header(path, header[0].decode(errors="replace"), notes)
    end = header.end() - (header[0].count(b"\n") == 1 and header[0].endswith(b"\r\n"))  # a newline may be a number's
    body = np.frombuffer(raw, np.uint8)[end:]
    if text:
        body = _numbers(path, raw, end).view(np.uint8)
        for one in (one for element in elements for one in element.properties):
            one.kind = np.dtype("f8")
            one.count = one.count and one.kind
    _read_elements(path, body, elements, text=text, notes=notes)
    return {element.name: element for element in elements}


def _header(path: Path, text: str, notes: Notes) -> tuple[bool, list[Element]]:
    """Whether the body is text, and the elements without their values."""
    order, elements = "", list[Element]()
    for number, line in enumerate(re.split(r"\r\n|\n|\r", text.strip()), start=1):
        words = line.split()
        try:
            if words[:1] == ["format"]:
                order = words[1] if words[1] in ORDERS else ""
            elif words[:1] == ["element"]:
                elements.append(Element(words[1], _count(words[2])))
            elif words[:2] == ["property", "list"]:
                kind, count = (
                    np.dtype(TYPES[word]).newbyteorder(ORDERS.get(order, "=")) for word in (words[3], words[2])
                )
                elements[-1].properties.append(_Property(words[4], kind, count))
            elif words[:1] == ["property"]:
                kind = np.dtype(TYPES[words[1]]).newbyteorder(ORDERS.get(order, "="))
                white = 1.0 if kind.kind == "f" else float(np.iinfo(kind).max)
                elements[-1].properties.append(_Property(words[2].removeprefix("diffuse_"), kind, None, white))
            elif words[:2] == ["comment", "TextureFile"]:
                notes.add("the texture of a PLY file is not read")
            elif words and words[0] not in ("ply", "comment", "obj_info", "end_header"):
                _count("")
        except (IndexError, KeyError, ValueError):
            raise TilestampError(f"{path}:{number}: no line of a PLY header: {line.strip()[:60]!r}") from None
    if not order:
        raise TilestampError(f"{path}: cannot be read as a mesh: its header has no known format")
    return order == "ascii", elements


def _count(word: str) -> int:
    if not (word.isdecimal() and len(word) < 16):
        raise ValueError(word)
    return int(word)


def _numbers(path: Path, raw: bytes, start: int) -> NDArray[np.float64]:
    """Give the body of a text file as float64."""
    found = scan(path, raw[:start].count(b"\n") * b"\n" + plain_text(raw[start:]))
    words = found.kinds != 1
    if words.any() or found.broken:
        row = int(words.argmax()) if words.any() else int(np.searchsorted(found.firsts, found.broken[0], "right")) - 1
        raise found.error(row, "numbers should be here")
    return found.values


def _read_elements(path: Path, data: NDArray[np.uint8], elements: list[Element], *, text: bool, notes: Notes) -> None:
    numbers = data.view(np.float64) if text else None
    at = 0
    for element in elements:
        if not (text or any(one.count for one in element.properties)):
            at = _read_table(path, data, at, element)
            continue
        sizes = np.array([one.kind.itemsize for one in element.properties], np.int64)
        counts = np.array([one.count.itemsize if one.count else 0 for one in element.properties], np.int64)
        least = max(int(np.where(counts > 0, counts, sizes).sum()), 1)
        rows = min(element.rows, (len(data) - at) // least + 1)
        starts = np.empty((len(sizes), rows), np.int64)
        lengths = np.ones((len(sizes), rows), np.int64) if counts.any() else starts[:0]
        big = any(one.count and one.count.str[0] == ">" for one in element.properties)
        whole, at = _walk(data, numbers, at, sizes, counts, big, starts, lengths)
        _check_rows(path, element, whole)
        for k, one in enumerate(element.properties):
            length = lengths[k] if one.count else np.ones(rows, np.int64)
            element.values[one.name] = _copied(data, starts[k], length, sizes[k]).view(one.kind)
            if one.count:
                element.lengths[one.name] = length
    notes.add_if(len(data) - at > 2, "the file goes on after its last element: what follows is not read")


def _read_table(path: Path, data: NDArray[np.uint8], at: int, element: Element) -> int:
    """Read rows of numbers, all of one size, from byte ``at`` on; gives where they end."""
    row = np.dtype([(f"{k}", one.kind) for k, one in enumerate(element.properties)])
    rows = min(element.rows, (len(data) - at) // max(row.itemsize, 1))
    _check_rows(path, element, rows)
    end = at + rows * row.itemsize
    table = data[at:end].view(row) if row.itemsize else None
    for k, one in enumerate(element.properties):
        element.values[one.name] = table[f"{k}"].copy() if table is not None else np.empty(0, one.kind)
    return end


def _check_rows(path: Path, element: Element, whole: int) -> None:
    """Refuse a file that ends too early."""
    if whole < element.rows and element.properties:
        raise TilestampError(f"{path}: the file ends after {whole} of {element.rows} rows of {element.name}")


def _polygons(path: Path, elements: dict[str, Element], notes: Notes) -> Polygons:
    vertex, face = elements.get("vertex"), elements.get("face", Element("face", 0))
    if vertex is None or not all(axis in vertex.values for axis in XYZ):
        raise TilestampError(f"{path}: has no vertices with x, y and z")
    columns = _columns(vertex, XYZ)
    normals = _columns(vertex, NORMAL) if all(axis in vertex.values for axis in NORMAL) else None
    corners, sizes = next(
        ((whole_numbers(face.values[name], path), face.lengths[name]) for name in CORNERS if name in face.lengths),
        (np.empty(0, np.int64), np.empty(0, np.int64)),
    )
    colors, face_colors = _colors(vertex, notes), _colors(face, notes)
    kept = sizes >= 3
    notes.add_if(not kept.all(), f"{(~kept).sum()} faces have fewer than three corners and are not drawn")
    notes.add_if(colors is not None and face_colors is not None, "face colours are not used beside vertex colours")
    strips = list(_strips(elements.get("tristrips")))
    if face_colors is not None:
        notes.add_if(strips, "strips are not drawn beside faces with colours")
        strips, face_colors = [], face_colors[kept]
    corners = np.concatenate([corners[kept.repeat(sizes)], *strips])
    sizes = np.concatenate([sizes[kept], np.full(sum(map(len, strips)) // 3, 3)])
    known = {"vertex": (*XYZ, *NORMAL, *COLOR), "face": (*CORNERS, *COLOR), "tristrips": CORNERS}
    unread = [f"{e.name}.{name}" for e in elements.values() for name in e.values if name not in known.get(e.name, ())]
    notes.add_if(unread, f"properties that are not read: {', '.join(unread)}")
    return Polygons(columns, corners, sizes, colors, None if colors is not None else face_colors, normals)


def _columns(element: Element, names: tuple[str, ...]) -> NDArray[np.float64]:
    return np.stack([element.values[name].astype(np.float64) for name in names], axis=1)


def _colors(element: Element, notes: Notes) -> NDArray[np.float64] | None:
    """RGBA in [0, 1], (rows, 4): integers by their type's largest value, fractions as they are."""
    if not all(name in element.values and name not in element.lengths for name in COLOR[:3]):
        return None
    colors = np.ones((element.rows, 4))
    whites = {one.name: one.white for one in element.properties}
    for k, name in enumerate(COLOR):
        if name in element.values:
            colors[:, k] = element.values[name] / whites[name]
    if colors.max(initial=0.0) <= 1.0:
        return colors
    notes.add(f"colours of {element.name} are taken to be from 0 to 255")
    return colors / 255.0


def _strips(element: Element | None) -> Iterator[NDArray[np.int64]]:
    """Corners of the triangles of strips, which -1 ends."""
    for name in CORNERS if element is not None else ():
        if element is not None and name in element.lengths:
            ends = np.cumsum(element.lengths[name])
            for row in np.split(element.values[name].astype(np.int64), ends[:-1]):
                for part in np.split(row, np.flatnonzero(row < 0)):
                    yield strip_triangles(part[part >= 0]).reshape(-1)


@kernel
def _walk(data: Any, numbers: Any, at: int, sizes: Any, counts: Any, big: bool, starts: Any, lengths: Any) -> Any:
    """Store where each property of each row lies and how long its list is; give the whole rows, and the end."""
    for row in range(starts.shape[1]):
        for k in range(len(sizes)):
            length: Any = 1
            if counts[k]:
                if at + counts[k] > len(data):
                    return row, at
                if numbers is not None:
                    length = int(min(max(numbers[at // 8], -1.0), 1e15))
                else:
                    length = 0
                    for byte in range(counts[k]):
                        length = (length << 8) + np.int64(data[at + (byte if big else counts[k] - 1 - byte)])
                lengths[k, row] = length
                at += counts[k]
            if length < 0 or length > len(data) or at + length * sizes[k] > len(data):
                return row, at
            starts[k, row] = at
            at += length * sizes[k]
    return starts.shape[1], at


@kernel
def _copied(data: Any, starts: Any, lengths: Any, size: int) -> Any:
    """Put what lies at several places one behind another."""
    out = np.empty(lengths.sum() * size, np.uint8)
    n = 0
    for row in range(len(starts)):
        for byte in range(starts[row], starts[row] + lengths[row] * size):
            out[n] = data[byte]
            n += 1
    return out
