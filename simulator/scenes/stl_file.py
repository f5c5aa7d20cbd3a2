"""Reader of STL files, text or binary: triangles that share no vertices, in the file's order."""

import re
from pathlib import Path

import numpy as np

from tilestamp.models.errors import TilestampError
from tilestamp.simulator.scenes.geometry import Mesh
from tilestamp.simulator.scenes.notes import Notes
from tilestamp.simulator.scenes.polygons import model_mesh
from tilestamp.simulator.scenes.text_scan import Row, plain_text, read_bytes, scan

HEADER_BYTES = 84
FACET = np.dtype([("normal", "<f4", 3), ("vertices", "<f4", (3, 3)), ("attribute", "<u2")])


def read_stl(path: Path, notes: Notes) -> Mesh:
    """Read the triangles of an STL file; their normals follow from the vertices. Raises TilestampError."""
    raw = read_bytes(path)
    count = int.from_bytes(raw[80:HEADER_BYTES], "little")
    wanted = HEADER_BYTES + count * FACET.itemsize
    if len(raw) >= HEADER_BYTES and len(raw) == wanted:  # a binary file may start with "solid" too
        facets = np.frombuffer(raw, FACET, count, HEADER_BYTES)
        notes.add_if(facets["attribute"].any(), "attributes (colours) of an STL file's facets are not read")
        points = facets["vertices"].reshape(-1, 3).astype(np.float64)
    else:
        text = plain_text(raw)
        if not re.match(rb"\s*solid\b", text[:HEADER_BYTES].lower()) or b"\0" in text:
            size = f"of {count} triangles would have {wanted} bytes, but there are {len(raw)}"
            raise TilestampError(f"{path}: cannot be read as a mesh: a binary STL file {size}")
        points = _text_points(path, text, notes)
    return model_mesh(points, np.arange(len(points)).reshape(-1, 3), None, None, path)


def _text_points(path: Path, raw: bytes, notes: Notes) -> np.ndarray:
    lower = raw.lower()
    facets, ends = (len(re.findall(word, lower)) for word in (rb"\bfacet\s+normal\b", rb"\bendfacet\b"))
    found = scan(path, lower)
    if len(found.rows(Row.VERTEX)) < 3 * facets:  # several to a line
        nameless = re.sub(rb"solid\b.*?(?=\bfacet\s+normal\b|\n|$)", b"solid ", lower)
        found = scan(path, re.sub(rb"\s(?=(vertex|endloop|endfacet|endsolid)\b)", b"\n", nameless))
    points = found.table(Row.VERTEX, 3, 3, "a vertex needs three numbers")
    if not 3 * facets == 3 * ends == len(points):
        what = f"{facets} facets begin, {ends} end, and they have {len(points)} vertices"
        raise TilestampError(f"{path}: cannot be read as a mesh: {what}")
    notes.add_if(not re.search(rb"\bendsolid\b", lower), "the file ends without endsolid")
    unread = len(found.rows(Row.NUMBERS)) + len(found.rows(Row.V)) + len(found.rows(Row.F))
    notes.add_if(unread, f"{unread} lines of an STL file are not read")
    return points
