"""Reader of Wavefront OBJ files that keeps polygons, their order and their materials, and names broken lines.

Read are ``v`` (with vertex colours where there are six numbers), ``f``, ``usemtl`` and ``mtllib``, and ``newmtl``,
``Kd``, ``d`` of material files; texture coordinates, normals, groups, curves and everything else are passed over.
"""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError

WHITE = (1.0, 1.0, 1.0, 1.0)


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
        Row of ``base_colors`` for each polygon.
    base_colors : ndarray, (M, 4), float64
        Diffuse colour and opacity of each material; row 0 is white, for polygons with none.
    textured : bool
        Whether a material that is used has a texture (``map_Kd``): see `textured_obj`.
    """

    positions: NDArray[np.float64]
    colors: NDArray[np.float64] | None
    corners: NDArray[np.int64]
    sizes: NDArray[np.int64]
    materials: NDArray[np.int64]
    base_colors: NDArray[np.float64]
    textured: bool = False


@dataclass
class _Reading:
    """What has been read so far."""

    vertices: list[list[float]] = field(default_factory=list)
    corners: list[int] = field(default_factory=list)
    sizes: list[int] = field(default_factory=list)
    materials: list[int] = field(default_factory=list)
    names: dict[str, int] = field(default_factory=lambda: {"": 0})
    libraries: list[str] = field(default_factory=list)
    current: int = 0
    textured: bool = False


def read_obj(path: str | Path) -> ObjFile:
    """Read an OBJ file; raises TilestampError (``file:line``) where a line is broken or there is no face."""
    reading = _Reading()
    for number, line in enumerate(read_lines(Path(path)), start=1):
        words = line.split()
        if not words or words[0] not in ("v", "f", "usemtl", "mtllib"):
            continue
        try:
            _read_line(words, line, reading)
        except TilestampError as error:
            raise TilestampError(f"{path}:{number}: {error}") from None
    if not reading.sizes:
        raise TilestampError(f"{path}: the model has no faces")
    corners = np.array(reading.corners, dtype=np.int64)
    if corners.max() >= len(reading.vertices):
        raise TilestampError(
            f"{path}: a face uses vertex {corners.max() + 1}, but the file has {len(reading.vertices)} vertices"
        )
    base_colors = _base_colors(Path(path), reading)
    colored = all(len(vertex) >= 6 for vertex in reading.vertices)
    return ObjFile(
        positions=np.array([vertex[:3] for vertex in reading.vertices]),
        colors=np.array([vertex[3:6] for vertex in reading.vertices]) if colored else None,
        corners=corners,
        sizes=np.array(reading.sizes, dtype=np.int64),
        materials=np.array(reading.materials, dtype=np.int64),
        base_colors=base_colors,
        textured=reading.textured,
    )


def read_lines(path: Path) -> list[str]:
    """Read the lines of a text file, or raise a sentence."""
    try:
        return path.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError as error:
        raise TilestampError(f"{path}: cannot be read ({error.strerror})") from None


def _read_line(words: list[str], line: str, reading: _Reading) -> None:
    if words[0] == "v":
        reading.vertices.append(_vertex(words, line))
    elif words[0] == "f":
        corners = [_corner(word, len(reading.vertices), line) for word in words[1:]]
        if len(corners) < 3:
            raise TilestampError(f"a face needs at least three corners: {line.strip()[:60]!r}")
        reading.corners.extend(corners)
        reading.sizes.append(len(corners))
        reading.materials.append(reading.current)
    elif words[0] == "usemtl":
        reading.current = reading.names.setdefault(" ".join(words[1:]), len(reading.names))
    else:
        reading.libraries.append(" ".join(words[1:]))


def _vertex(words: list[str], line: str) -> list[float]:
    try:
        values = [float(word) for word in words[1:]]
    except ValueError:
        values = []
    if len(values) < 3:
        raise TilestampError(f"a vertex needs three numbers: {line.strip()[:60]!r}")
    if not np.isfinite(values[:3]).all():
        raise TilestampError(f"a vertex is NaN or infinite: {line.strip()[:60]!r}")
    return values


def _corner(word: str, vertices: int, line: str) -> int:
    """0-based vertex number of ``7``, ``7/1``, ``7//3`` or ``-1`` (the vertex read last)."""
    try:
        number = int(word.partition("/")[0])
    except ValueError:
        number = 0
    index = number - 1 if number > 0 else vertices + number
    if number == 0 or index < 0:
        raise TilestampError(f"a face names the vertex {word!r}, which does not exist: {line.strip()[:60]!r}")
    return index


def _base_colors(path: Path, reading: _Reading) -> NDArray[np.float64]:
    """Diffuse colours by material; a missing library leaves white, as viewers do."""
    colors = np.tile(np.array(WHITE), (len(reading.names), 1))
    for library in reading.libraries:
        file = path.parent / library
        current = -1
        for number, line in enumerate(read_lines(file) if file.is_file() else [], start=1):
            words = line.split()
            if words[:1] == ["newmtl"]:
                current = reading.names.get(" ".join(words[1:]), -1)
            elif current >= 0 and words[:1] == ["map_Kd"]:
                reading.textured = True
            elif current >= 0 and words[:1] in (["Kd"], ["d"]):
                values = _material_numbers(words, f"{file}:{number}")
                colors[current, slice(0, 3) if words[0] == "Kd" else slice(3, 4)] = values
    clipped: NDArray[np.float64] = np.clip(colors, 0.0, 1.0)
    return clipped


def _material_numbers(words: list[str], place: str) -> list[float]:
    wanted = 3 if words[0] == "Kd" else 1
    try:
        values = [float(word) for word in words[1 : 1 + wanted]]
    except ValueError:
        values = []
    if len(values) != wanted or not np.isfinite(values).all():
        raise TilestampError(f"{place}: {words[0]} needs {wanted} numbers")
    return values
