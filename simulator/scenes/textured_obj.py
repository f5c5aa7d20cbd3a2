"""Reader of OBJ + MTL with texture coordinates: corners become vertices, materials become colours and textures.

A missing material file or texture is not fatal, as in every viewer: the surface is white, or shows its Kd.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.simulator.scenes.gltf_file import read_image
from tilestamp.simulator.scenes.scene import Mesh
from tilestamp.simulator.scenes.textured_mesh import vertex_normals


def is_textured(path: Path) -> bool:
    """Whether a material library of an OBJ file names a texture."""
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    libraries = (path.parent / line.split(maxsplit=1)[1].strip() for line in lines if line.startswith("mtllib "))
    return any("map_Kd" in library.read_text(errors="replace") for library in libraries if library.is_file())


def read_textured_obj(path: str | Path) -> Mesh:
    """Read an OBJ file with its texture coordinates, normals and materials.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    Mesh
        One vertex for each different corner (position, coordinate, normal, material); polygons as fans.

    Raises
    ------
    TilestampError
        ``file:line`` of a line that cannot be used, or no faces.
    """
    path = Path(path)
    tables: dict[str, list[list[float]]] = {"v": [], "vt": [], "vn": []}
    corners: list[tuple[int, int, int, int]] = []
    names: dict[str, int] = {"": 0}
    libraries: list[str] = []
    current = 0
    for number, line in enumerate(path.read_text(encoding="utf-8", errors="replace").splitlines(), 1):
        words = line.split()
        try:
            if words[:1] and words[0] in tables:
                tables[words[0]].append([float(word) for word in words[1 : 3 if words[0] == "vt" else 4]])
            elif words[:1] == ["f"]:
                fan = [(*_corner(word, tables), current) for word in words[1:]]
                corners += [fan[i] for k in range(1, len(fan) - 1) for i in (0, k, k + 1)]
            elif words[:1] == ["usemtl"]:
                current = names.setdefault(" ".join(words[1:]), len(names))
            elif words[:1] == ["mtllib"]:
                libraries.append(" ".join(words[1:]))
        except (ValueError, IndexError):
            raise TilestampError(
                f"{path.name}:{number}: {line.strip()[:60]!r} is not a line that can be read"
            ) from None
    if not corners:
        raise TilestampError(f"{path.name}: the model has no faces")
    return _mesh(path, tables, corners, *_materials(path, libraries, names))


def _corner(word: str, tables: dict[str, list[list[float]]]) -> tuple[int, int, int]:
    """0-based position, coordinate, normal of ``7/3/2``, ``7//2``, ``-1/-1``; -1 for none."""
    fields = [*word.split("/"), "", ""][:3]
    found = []
    for text, rows in zip(fields, tables.values(), strict=True):
        index = int(text) if text else 0
        index = index - 1 if index > 0 else len(rows) + index if index < 0 else -1
        if text and not 0 <= index < len(rows):
            raise ValueError(word)
        found.append(index)
    if found[0] < 0:
        raise ValueError(word)
    return found[0], found[1], found[2]


def _mesh(
    path: Path,
    tables: dict[str, list[list[float]]],
    corners: list[tuple[int, int, int, int]],
    colors: NDArray[np.float32],
    texture_of: NDArray[np.int32],
    textures: tuple[NDArray[np.uint8], ...],
) -> Mesh:
    """Different corners become vertices."""
    unique, index = np.unique(np.array(corners), axis=0, return_inverse=True)
    triangles = index.reshape(-1, 3).astype(np.int32)
    try:
        points = np.array(tables["v"], np.float32).reshape(-1, 3)[unique[:, 0]]
        coordinates = np.array([*tables["vt"], [np.nan, np.nan]], np.float32)[unique[:, 1]]
        normals = np.array([*tables["vn"], [np.nan] * 3], np.float32)[unique[:, 2]]
    except ValueError:
        raise TilestampError(f"{path.name}: a vertex, coordinate or normal has too few numbers") from None
    smooth = _smooth(np.array(tables["v"], np.float32), unique[:, 0], triangles)
    return Mesh(
        positions=np.concatenate([points, np.ones((len(points), 1), np.float32)], axis=1),
        triangles=triangles,
        colors=colors[unique[:, 3]],
        normals=np.where(np.isfinite(normals).all(axis=1, keepdims=True), normals, smooth),
        uvs=coordinates * np.array([1.0, -1.0], np.float32) + np.array([0.0, 1.0], np.float32),  # OBJ's v runs up
        texture_ids=texture_of[unique[triangles[:, 0], 3]],
        textures=textures,
    )


def _smooth(
    points: NDArray[np.float32], position: NDArray[np.int64], triangles: NDArray[np.int32]
) -> NDArray[np.float32]:
    """Make normals over shared positions, so that a texture seam does not show."""
    return vertex_normals(points, position[triangles].astype(np.int32))[position]


def _materials(
    path: Path, libraries: list[str], names: dict[str, int]
) -> tuple[NDArray[np.float32], NDArray[np.int32], tuple[NDArray[np.uint8], ...]]:
    """Colour and texture of each material in use."""
    colors = np.ones((len(names), 4), np.float32)
    texture_of = np.full(len(names), -1, np.int32)
    files: dict[Path, int] = {}
    for library in libraries:
        file = path.parent / library
        current = -1
        for number, line in enumerate(file.read_text(errors="replace").splitlines() if file.is_file() else [], 1):
            words = line.split()
            if words[:1] == ["newmtl"]:
                current = names.get(" ".join(words[1:]), -1)
            elif current >= 0 and words[:1] in (["Kd"], ["d"]):
                try:
                    values = [float(word) for word in words[1:4]]
                except ValueError:
                    raise TilestampError(f"{file.name}:{number}: {line.strip()[:60]!r} has no numbers") from None
                colors[current, slice(0, 3) if words[0] == "Kd" else slice(3, 4)] = values
            elif current >= 0 and words[:1] == ["map_Kd"] and (path.parent / words[-1]).is_file():
                texture_of[current] = files.setdefault(path.parent / words[-1], len(files))
    images = tuple(read_image(file.read_bytes(), file.name) for file in files)
    return colors, texture_of, images
