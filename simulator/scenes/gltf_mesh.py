"""Meshes of glTF files: lists, strips and fans of triangles, placed by their nodes and joined, with their textures."""

from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.simulator.scenes.clip_space import checked_mesh
from tilestamp.simulator.scenes.geometry import Mesh
from tilestamp.simulator.scenes.gltf_file import READ, GltfFile
from tilestamp.simulator.scenes.notes import Notes
from tilestamp.simulator.scenes.polygons import lengths, vertex_normals
from tilestamp.simulator.scenes.strips import fan_triangles, strip_triangles

POINTS, LINES, LINE_LOOP, LINE_STRIP, TRIANGLES, STRIP, FAN = range(7)
MODES = {POINTS: "points", LINES: "lines", LINE_LOOP: "line loops", LINE_STRIP: "line strips"}
REPEAT, WRAPS = 10497, {33071: "clamp", 33648: "mirror"}
MOST_VERTICES = 2**25  # of all instances together
PLAIN = ([0, 0, 0], "OPAQUE")  # values that say nothing
UNREAD = {
    "normalTexture",
    "occlusionTexture",
    "emissiveTexture",
    "emissiveFactor",
    "alphaMode",
    "metallicRoughnessTexture",
}


def read_gltf(path: str | Path, notes: Notes | None = None) -> Mesh:
    """Read every triangle that a glTF file's scene draws, placed by its nodes, in drawing order.

    Parameters
    ----------
    path : str or Path
        A .glb or .gltf file.
    notes : Notes, optional
        Gets a sentence for all that is not read.

    Returns
    -------
    Mesh
        With texture coordinates and textures where the materials have them; base-colour factors as vertex colours.

    Raises
    ------
    TilestampError
        A broken file, an extension that is not read, or no triangles.
    """
    path = Path(path)
    try:
        return checked_mesh(_read(GltfFile(path, Notes() if notes is None else notes)), path)
    except TilestampError:
        raise
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:  # of another kind or length
        raise TilestampError(f"{path.name}: broken glTF: {error}") from None


def _read(file: GltfFile) -> Mesh:
    """Join the parts of a file."""
    parts: list[dict[str, Any]] = []
    images: dict[int, int] = {}
    meshes = file.tree.get("meshes", [])
    vertices = 0
    for mesh, matrix in file.instances():
        if not 0 <= mesh < len(meshes):
            raise TilestampError(f"{file.path.name}: broken glTF: there is no mesh {mesh}")
        for primitive in meshes[mesh].get("primitives", []):
            mode = primitive.get("mode", TRIANGLES)
            if mode not in (TRIANGLES, STRIP, FAN):
                file.notes.add(f"primitives that are {MODES.get(mode, f'of mode {mode}')} are not drawn")
                continue
            parts.append(_part(file, primitive, matrix, images))
            vertices += len(parts[-1]["positions"])
            if vertices > MOST_VERTICES:
                raise TilestampError(f"{file.path.name}: draws more than {MOST_VERTICES} vertices, too many to read")
    if not parts:
        raise TilestampError(
            f"{file.path.name}: has no lists of triangles, strips or fans (lines, points are not read)"
        )
    _note_rest(file)
    return _join(parts, tuple(file.image(image) for image in images))


def _note_rest(file: GltfFile) -> None:
    """Name what a file has beside its triangles."""
    tables = ("animations", "cameras", "skins")
    unread = [f"{table} ({len(file.tree[table])})" for table in tables if file.tree.get(table)]
    unread += [
        name
        for name in {**dict.fromkeys(file.tree.get("extensionsUsed", []) + file.tree.get("extensionsRequired", []))}
        if name not in READ
    ]
    file.notes.add_if(unread, f"parts of the file that are not read: {', '.join(map(str, unread))}")


def _part(file: GltfFile, primitive: dict[str, Any], matrix: NDArray[np.float64], images: dict[int, int]) -> Any:
    """One primitive of a mesh, placed by ``matrix``."""
    attributes = primitive.get("attributes", {})
    if "KHR_draco_mesh_compression" in primitive.get("extensions", {}):
        raise TilestampError(f"{file.path.name}: is compressed with Draco, which is not read")
    if "POSITION" not in attributes:
        raise TilestampError(f"{file.path.name}: broken glTF: a primitive has no positions")
    local = file.accessor(attributes["POSITION"], "VEC3").astype(np.float64)
    count = len(local)
    triangles = _triangles(file, primitive, count)
    if np.linalg.det(matrix[:3, :3]) < 0.0:  # a mirror turns the winding
        triangles = triangles[:, [0, 2, 1]]
    positions = np.ones((count, 4), np.float32)
    positions[:, :3] = local @ matrix[:3, :3].T + matrix[:3, 3]
    color, texture, info = _material(file, primitive, images)
    colors = np.tile(color, (count, 1))
    if "COLOR_0" in attributes:
        shade = file.accessor(attributes["COLOR_0"], "VEC3", "VEC4")
        colors[:, : shade.shape[1]] *= shade
    file.notes.add_if(primitive.get("targets"), "morph targets are not applied")
    return {
        "positions": positions,
        "triangles": triangles,
        "colors": colors,
        "normals": _normals(file, attributes, matrix, positions, triangles),
        "uvs": _coordinates(file, attributes, info, count),
        "texture_ids": np.full(len(triangles), texture, np.int32),
    }


def _triangles(file: GltfFile, primitive: dict[str, Any], count: int) -> NDArray[np.int32]:
    """Vertex indices, (F, 3); a last incomplete triangle is dropped, as glTF says."""
    indices = file.accessor(primitive["indices"], "SCALAR")[:, 0] if "indices" in primitive else np.arange(count)
    if len(indices) and not 0 <= indices.min() <= indices.max() < count:
        raise TilestampError(f"{file.path.name}: broken glTF: an index {indices.max()} in a mesh of {count} vertices")
    mode = primitive.get("mode", TRIANGLES)
    if mode != TRIANGLES:
        return (strip_triangles if mode == STRIP else fan_triangles)(indices).astype(np.int32)
    file.notes.add_if(len(indices) % 3, "the last one or two corners of a list make no triangle and are not drawn")
    return indices[: len(indices) // 3 * 3].astype(np.int32).reshape(-1, 3)


def _material(
    file: GltfFile, primitive: dict[str, Any], images: dict[int, int]
) -> tuple[NDArray[np.float32], int, dict[str, Any]]:
    """Find the base colour of a primitive, the number of its texture (-1 for none), and how that is mapped."""
    materials = file.tree.get("materials", [])
    index = primitive.get("material", -1)
    if not -1 <= index < len(materials):
        raise TilestampError(f"{file.path.name}: broken glTF: there is no material {index}")
    material = materials[index] if index >= 0 else {}
    surface = material.get("pbrMetallicRoughness", {})
    unread = sorted(key for key in UNREAD & {*material, *surface} if material.get(key) not in PLAIN)
    file.notes.add_if(unread, f"properties of materials that are not read: {', '.join(unread)}")
    color = np.asarray(surface.get("baseColorFactor", (1.0, 1.0, 1.0, 1.0)), np.float32)
    if color.shape != (4,):
        raise TilestampError(f"{file.path.name}: broken glTF: material {index} has a colour of {color.size} numbers")
    info = surface.get("baseColorTexture", {})
    number = info.get("index", -1)
    if number < 0:
        return color, -1, {}
    textures = file.tree.get("textures", [])
    texture = textures[number] if number < len(textures) else {}
    source = texture.get("extensions", {}).get("EXT_texture_webp", texture).get("source")
    if source is None:
        raise TilestampError(f"{file.path.name}: broken glTF: texture {number} has no image that can be read")
    sampler = file.tree["samplers"][texture["sampler"]] if "sampler" in texture else {}
    wraps = sorted({WRAPS[sampler[key]] for key in ("wrapS", "wrapT") if sampler.get(key) in WRAPS})
    file.notes.add_if(wraps, f"samplers that {' or '.join(wraps)} are not applied: textures repeat")
    return color, images.setdefault(source, len(images)), info


def _coordinates(file: GltfFile, attributes: dict[str, Any], info: dict[str, Any], count: int) -> NDArray[np.float32]:
    """Give the texture coordinates that a texture is mapped by, moved as KHR_texture_transform says; NaN for none."""
    change = info.get("extensions", {}).get("KHR_texture_transform", {})
    name = f"TEXCOORD_{change.get('texCoord', info.get('texCoord', 0))}"
    uvs = np.full((count, 2), np.nan, np.float32)
    file.notes.add_if(
        info and name not in attributes, f"a mesh without {name}, which its texture needs, shows its colour"
    )
    if name in attributes:
        uvs[:] = file.accessor(attributes[name], "VEC2")
    if change:
        angle, scale = change.get("rotation", 0.0), np.asarray(change.get("scale", (1.0, 1.0)), np.float64)
        turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        uvs = ((uvs * scale) @ turn.T + np.asarray(change.get("offset", (0.0, 0.0)))).astype(np.float32)
    return uvs


def _normals(
    file: GltfFile,
    attributes: dict[str, Any],
    matrix: NDArray[np.float64],
    positions: NDArray[np.float32],
    triangles: NDArray[np.int32],
) -> NDArray[np.float32]:
    """Give the normals of a part in the scene's space."""
    if "NORMAL" not in attributes:
        return vertex_normals(positions, triangles)
    normals = file.accessor(attributes["NORMAL"], "VEC3").astype(np.float64) @ _inverse(matrix[:3, :3].tobytes())
    if len(normals) != len(positions):
        raise TilestampError(f"{file.path.name}: broken glTF: {len(normals)} normals for {len(positions)} vertices")
    far = lengths(normals)
    return (normals / np.where(far > 0.0, far, 1.0)).astype(np.float32)


@lru_cache(256)
def _inverse(matrix: bytes) -> NDArray[np.float64]:
    """Pseudo-inverse of a matrix, (3, 3) float64: parts of a model mostly share a few."""
    return np.asarray(np.linalg.pinv(np.frombuffer(matrix).reshape(3, 3)), np.float64)


def _join(parts: list[dict[str, Any]], textures: tuple[NDArray[np.uint8], ...]) -> Mesh:
    starts = np.cumsum([0] + [len(part["positions"]) for part in parts[:-1]])
    for part, start in zip(parts, starts, strict=True):
        part["triangles"] = part["triangles"] + np.int32(start)
    columns: dict[str, Any] = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    draws = np.array([[len(part["positions"]), len(part["triangles"])] for part in parts], np.int64)
    return Mesh(**columns, textures=textures, draws=draws)
