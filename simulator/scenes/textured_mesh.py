"""Textured meshes: glTF parts joined into one mesh, and any mesh as the arrays that textured pipelines read.

Documented fallbacks: a mesh without normals gets area-weighted ones; a triangle without a texture, or with a texture
but without (or with NaN) coordinates, shows its base colour; triangles with a NaN or infinite vertex are not drawn.
Texels and colours are used as they are stored, as both originals do: no sRGB conversion.
"""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.simulator.scenes.gltf_file import TRIANGLES, GltfFile
from tilestamp.simulator.scenes.scene import Mesh, Scene
from tilestamp.simulator.scenes.subpatches import with_mesh


class Geometry(NamedTuple):
    """A mesh with nothing missing, for kernels.

    Parameters
    ----------
    positions : ndarray, (V, 4), float32
    triangles : ndarray, (F, 3), int32
        Without those that have a vertex that is not finite.
    colors, normals, uvs : ndarray, (V, 4), (V, 3), (V, 2), float32
    texture_ids : ndarray, (F,), int32
    ids : ndarray, (F,), int32
        Input index of each triangle.
    """

    positions: NDArray[np.float32]
    triangles: NDArray[np.int32]
    colors: NDArray[np.float32]
    normals: NDArray[np.float32]
    uvs: NDArray[np.float32]
    texture_ids: NDArray[np.int32]
    ids: NDArray[np.int32]


def geometry(scene: Scene) -> Geometry:
    """Fill in what a scene's mesh lacks; patches are cut into triangles where there is no mesh.

    Raises
    ------
    TilestampError
        The scene has no triangles.
    """
    mesh = with_mesh(scene).mesh
    if mesh is None or len(mesh.triangles) == 0:
        raise TilestampError(f"the scene {scene.name} has no triangles, which the textured pipelines draw")
    count = len(mesh.positions)
    finite = np.asarray(np.isfinite(mesh.positions).all(axis=1))
    ids = np.flatnonzero(finite[mesh.triangles].all(axis=1)).astype(np.int32)
    triangles = mesh.triangles[ids]
    positions = np.where(finite[:, None], mesh.positions, np.float32(0.0))
    colors = np.ones((count, 4), np.float32) if mesh.colors is None else mesh.colors
    normals = vertex_normals(positions, triangles) if mesh.normals is None else mesh.normals
    uvs = np.zeros((count, 2), np.float32) if mesh.uvs is None else mesh.uvs
    textures = np.full(len(ids), -1, np.int32)
    if mesh.texture_ids is not None and mesh.uvs is not None:
        known = np.asarray(np.isfinite(uvs).all(axis=1))
        mapped = known[triangles].all(axis=1)
        textures = np.where(mapped, mesh.texture_ids[ids], np.int32(-1)).astype(np.int32)
    return Geometry(positions, triangles, _clean(colors), _clean(normals), _clean(uvs), textures, ids)


def draws(scene: Scene, mesh: Geometry) -> NDArray[np.int64]:
    """Vertices and triangles (D, 2) of each draw of a scene whose geometry is ``mesh``; one where it knows of none."""
    parts = scene.mesh.draws if scene.mesh is not None else None
    if parts is None:
        return np.array([[len(mesh.positions), len(mesh.triangles)]])
    bounds = np.concatenate([[0], np.cumsum(parts[:, 1])])
    return np.stack([parts[:, 0], np.diff(np.searchsorted(mesh.ids, bounds))], axis=1)


def _clean(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Put 0 for what is not finite."""
    return np.nan_to_num(values, posinf=0.0, neginf=0.0).astype(np.float32)


def vertex_normals(positions: NDArray[np.float32], triangles: NDArray[np.int32]) -> NDArray[np.float32]:
    """Make normals at the vertices, weighted by the areas around, (V, 3)."""
    a, b, c = (positions[triangles[:, k], :3].astype(np.float64) for k in range(3))
    normals = np.zeros((len(positions), 3))
    face = np.cross(b - a, c - a)
    for k in range(3):
        np.add.at(normals, triangles[:, k], face)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return (normals / np.where(lengths > 0.0, lengths, 1.0)).astype(np.float32)


def read_gltf(path: str | Path) -> Mesh:
    """Read every triangle that a glTF file's scene draws, placed by its nodes, in drawing order.

    Parameters
    ----------
    path : str or Path
        A .glb or .gltf file.

    Returns
    -------
    Mesh
        With texture coordinates and textures where the materials have them; base-colour factors as vertex colours.

    Raises
    ------
    TilestampError
        A broken file, an extension that is not read, or no triangles.
    """
    file = GltfFile(Path(path))
    try:
        return _read(file)
    except TilestampError:
        raise
    except (AttributeError, IndexError, KeyError, TypeError, ValueError) as error:  # a value of another kind or length
        raise TilestampError(f"{file.path.name}: broken glTF: {error}") from None


def _read(file: GltfFile) -> Mesh:
    """Join the parts of a file."""
    parts: list[dict[str, Any]] = []
    images: dict[int, int] = {}
    meshes = file.tree.get("meshes", [])
    for mesh, matrix in file.instances():
        if not 0 <= mesh < len(meshes):
            raise TilestampError(f"{file.path.name}: broken glTF: there is no mesh {mesh}")
        parts += [
            _part(file, primitive, matrix, images)
            for primitive in meshes[mesh].get("primitives", [])
            if primitive.get("mode", TRIANGLES) == TRIANGLES
        ]
    if not parts:
        raise TilestampError(f"{file.path.name}: has no lists of triangles (strips, fans, lines, points are not read)")
    return _join(parts, tuple(file.image(image) for image in images))


def _part(file: GltfFile, primitive: dict[str, Any], matrix: NDArray[np.float64], images: dict[int, int]) -> Any:
    """One primitive of a mesh, placed by ``matrix``."""
    attributes = primitive.get("attributes", {})
    if "KHR_draco_mesh_compression" in primitive.get("extensions", {}):
        raise TilestampError(f"{file.path.name}: is compressed with Draco, which is not read")
    if "POSITION" not in attributes:
        raise TilestampError(f"{file.path.name}: broken glTF: a primitive has no positions")
    local = file.accessor(attributes["POSITION"]).astype(np.float64)
    count = len(local)
    triangles = _triangles(file, primitive, count)
    if np.linalg.det(matrix[:3, :3]) < 0.0:  # a mirror turns the winding
        triangles = triangles[:, [0, 2, 1]]
    positions = np.ones((count, 4), np.float32)
    positions[:, :3] = local @ matrix[:3, :3].T + matrix[:3, 3]
    color, texture = _material(file, primitive, images)
    colors = np.tile(color, (count, 1))
    if "COLOR_0" in attributes:
        shade = file.accessor(attributes["COLOR_0"])
        colors[:, : shade.shape[1]] *= shade
    uvs = np.full((count, 2), np.nan, np.float32)
    if "TEXCOORD_0" in attributes:
        uvs[:] = file.accessor(attributes["TEXCOORD_0"])
    return {
        "positions": positions,
        "triangles": triangles,
        "colors": colors,
        "normals": _normals(file, attributes, matrix, positions, triangles),
        "uvs": uvs,
        "texture_ids": np.full(len(triangles), texture, np.int32),
    }


def _triangles(file: GltfFile, primitive: dict[str, Any], count: int) -> NDArray[np.int32]:
    """Vertex indices, (F, 3); a last incomplete triangle is dropped, as glTF says."""
    indices = file.accessor(primitive["indices"])[:, 0] if "indices" in primitive else np.arange(count)
    if len(indices) and indices.max() >= count:
        raise TilestampError(f"{file.path.name}: broken glTF: an index {indices.max()} in a mesh of {count} vertices")
    return indices[: len(indices) // 3 * 3].astype(np.int32).reshape(-1, 3)


def _material(file: GltfFile, primitive: dict[str, Any], images: dict[int, int]) -> tuple[NDArray[np.float32], int]:
    """Find the base colour of a primitive and the number of its texture, -1 for none."""
    materials = file.tree.get("materials", [])
    index = primitive.get("material", -1)
    if not -1 <= index < len(materials):
        raise TilestampError(f"{file.path.name}: broken glTF: there is no material {index}")
    surface = materials[index].get("pbrMetallicRoughness", {}) if index >= 0 else {}
    color = np.asarray(surface.get("baseColorFactor", (1.0, 1.0, 1.0, 1.0)), np.float32)
    if color.shape != (4,):
        raise TilestampError(f"{file.path.name}: broken glTF: material {index} has a colour of {color.size} numbers")
    texture = surface.get("baseColorTexture", {}).get("index", -1)
    if texture < 0:
        return color, -1
    textures = file.tree.get("textures", [])
    if texture >= len(textures) or "source" not in textures[texture]:
        raise TilestampError(f"{file.path.name}: broken glTF: texture {texture} has no image that can be read")
    return color, images.setdefault(textures[texture]["source"], len(images))


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
    normals = file.accessor(attributes["NORMAL"]).astype(np.float64) @ np.linalg.pinv(matrix[:3, :3])
    if len(normals) != len(positions):
        raise TilestampError(f"{file.path.name}: broken glTF: {len(normals)} normals for {len(positions)} vertices")
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return (normals / np.where(lengths > 0.0, lengths, 1.0)).astype(np.float32)


def _join(parts: list[dict[str, Any]], textures: tuple[NDArray[np.uint8], ...]) -> Mesh:
    """All parts as one mesh."""
    starts = np.cumsum([0] + [len(part["positions"]) for part in parts[:-1]])
    for part, start in zip(parts, starts, strict=True):
        part["triangles"] = part["triangles"] + np.int32(start)
    columns: dict[str, Any] = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    draws = np.array([[len(part["positions"]), len(part["triangles"])] for part in parts], np.int64)
    return Mesh(**columns, textures=textures, draws=draws)
