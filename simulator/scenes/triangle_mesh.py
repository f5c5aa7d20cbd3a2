"""Triangle meshes: files that trimesh reads, and OBJ files with their polygons in order.

Triangles keep the order of the file, degenerate and duplicate ones included: what to do with those is the rasterizer's
business. Colours are taken as linear. Textures are not sampled: a textured material counts with its base colour.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.simulator.scenes.clip_space import finite_positions, vertex_numbers
from tilestamp.simulator.scenes.obj_file import WHITE, ObjFile
from tilestamp.simulator.scenes.scene import Mesh

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]


def read_mesh(path: str | Path) -> Mesh:
    """Read any mesh that trimesh reads: all parts of the file's (default) scene, placed by their nodes.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    Mesh
        Parts one after another, in the order of the file; vertex colours, face colours (vertices are then not shared)
        or the materials' base colours; the file's normals, or area-weighted ones.

    Raises
    ------
    TilestampError
        Where the file cannot be read, has no triangles, or holds NaN or vertex numbers that do not exist.
    """
    import trimesh

    path = Path(path)
    if not path.is_file():
        raise TilestampError(f"{path}: there is no such file")
    try:
        with np.errstate(all="ignore"):  # numbers out of range are found, and named, below
            loaded = trimesh.load_scene(path, process=False)
        nodes = [loaded.graph[node] for node in loaded.graph.nodes_geometry]
        order = {name: number for number, name in enumerate(loaded.geometry)}
        parts = [(loaded.geometry[name], matrix) for matrix, name in sorted(nodes, key=lambda node: order[node[1]])]
    except Exception as error:  # noqa: BLE001 (whatever a reader of broken bytes raises, the file is to blame)
        raise TilestampError(f"{path}: cannot be read as a mesh ({type(error).__name__}: {error})") from None
    meshes = [_part(part, matrix, path) for part, matrix in parts if len(getattr(part, "faces", ()))]
    if not meshes:
        raise TilestampError(f"{path}: has no faces, so there is nothing to rasterize")
    return concatenate(meshes)


def mesh_from_obj(model: ObjFile, path: str | Path) -> Mesh:
    """Cut the polygons of an OBJ file into fans of triangles; base colours of materials (Kd, d) or vertex colours."""
    first = np.cumsum(model.sizes) - model.sizes
    fans = np.repeat(np.arange(len(model.sizes)), model.sizes - 2)
    step = np.arange(len(fans)) - np.repeat(np.cumsum(model.sizes - 2) - (model.sizes - 2), model.sizes - 2)
    start = first[fans]
    triangles = np.stack([model.corners[start + offset] for offset in (0 * step, step + 1, step + 2)], axis=1)
    if model.colors is not None:
        colors = np.concatenate([model.colors, np.ones((len(model.colors), 1))], axis=1)
        return model_mesh(model.positions, triangles, colors, None, path)
    if not model.materials.any():
        return model_mesh(model.positions, triangles, None, None, path)
    # A vertex that several materials share becomes one vertex a material.
    keys, numbers = np.unique(triangles * len(model.base_colors) + model.materials[fans][:, None], return_inverse=True)
    vertex, material = np.divmod(keys, len(model.base_colors))
    normals = vertex_normals(model.positions, triangles)[vertex]
    triangles = numbers.reshape(-1, 3)
    return model_mesh(model.positions[vertex], triangles, model.base_colors[material], normals, path)


def model_mesh(
    positions: Floats, triangles: ArrayLike, colors: Floats | None, normals: Floats | None, source: str | Path
) -> Mesh:
    """Make a mesh of model-space vertices (V, 3), checked; normals are made where there are none."""
    indices = vertex_numbers(triangles, len(positions), source)
    points = finite_positions(np.concatenate([positions, np.ones((len(positions), 1))], axis=1), source)
    if normals is None or not np.isfinite(normals).all():
        normals = vertex_normals(positions, indices)
    return Mesh(points, indices, None if colors is None else colors.astype(np.float32), normals.astype(np.float32))


def vertex_normals(positions: Floats, triangles: NDArray[Any]) -> Floats:
    """Average unit normals at the vertices, weighted by the areas of the triangles around; zero where none is."""
    a, b, c = (positions[triangles[:, corner]] for corner in range(3))
    faces = np.repeat(np.cross(b - a, c - a), 3, axis=0)
    targets = triangles.reshape(-1)
    sums = np.stack([np.bincount(targets, faces[:, axis], minlength=len(positions)) for axis in range(3)], axis=1)
    lengths = np.linalg.norm(sums, axis=1, keepdims=True)
    normals: Floats = np.divide(sums, lengths, out=np.zeros_like(sums), where=lengths > 0)
    return normals


def concatenate(meshes: list[Mesh]) -> Mesh:
    """Join meshes into one; a part without colours is white among parts with colours."""
    starts = np.cumsum([0] + [len(mesh.positions) for mesh in meshes[:-1]])
    white = np.array(WHITE, dtype=np.float32)
    colored = any(mesh.colors is not None for mesh in meshes)
    colors = [np.tile(white, (len(m.positions), 1)) if m.colors is None else m.colors for m in meshes]
    return Mesh(
        positions=np.concatenate([mesh.positions for mesh in meshes]),
        triangles=np.concatenate(
            [m.triangles + start for m, start in zip(meshes, starts, strict=True)], dtype=np.int32
        ),
        colors=np.concatenate(colors) if colored else None,
        normals=np.concatenate([mesh.normals for mesh in meshes if mesh.normals is not None]),
    )


def _part(part: Any, matrix: Floats, path: Path) -> Mesh:
    """One geometry of a trimesh scene, placed by its node's matrix."""
    positions, triangles = np.asarray(part.vertices, dtype=np.float64), np.asarray(part.faces)
    vertex_numbers(triangles, len(positions), path)
    colors, by_face = _colors(part)
    normals = np.asarray(part.vertex_normals) if "vertex_normals" in part._cache else None  # noqa: SLF001 (trimesh's own test for normals from the file)
    if by_face and colors is not None:
        positions, colors = positions[triangles.reshape(-1)], np.repeat(colors, 3, axis=0)
        normals = None if normals is None else normals[triangles.reshape(-1)]
        triangles = np.arange(len(positions)).reshape(-1, 3)
    linear = matrix[:3, :3]
    if normals is not None and abs(np.linalg.det(linear)) > 0:
        normals = normals @ np.linalg.inv(linear)
        normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(np.float64).tiny)
    with np.errstate(invalid="ignore"):
        placed = positions @ linear.T + matrix[:3, 3]
    return model_mesh(placed, triangles, colors, normals, path)


def _colors(part: Any) -> tuple[Floats | None, bool]:
    """RGBA in [0, 1] a vertex, or a face (then True); None where the file gives none."""
    visual = part.visual
    if visual.kind == "vertex":
        return np.asarray(visual.vertex_colors) / 255.0, False
    if visual.kind == "face":
        return np.asarray(visual.face_colors) / 255.0, True
    material = getattr(visual, "material", None)
    if material is None:
        return None, False
    base = getattr(material, "baseColorFactor", None) if hasattr(material, "baseColorFactor") else material.main_color
    color = np.array(WHITE) if base is None else np.asarray(base) / 255.0
    return np.tile(color, (len(part.vertices), 1)), False
