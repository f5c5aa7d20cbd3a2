"""Meshes of OBJ files: textured, with a colour for each material, or with colours of vertices."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tilestamp.simulator.scenes.geometry import Mesh
from tilestamp.simulator.scenes.obj_file import ObjFile
from tilestamp.simulator.scenes.polygons import Polygons, model_mesh, triangulate, vertex_normals

Indices = NDArray[np.int64]


def mesh_from_obj(model: ObjFile, path: str | Path) -> Mesh:
    """Cut the polygons of an OBJ file into triangles, in the file's order.

    With a texture, corners that differ (in position, coordinate, normal or material) become vertices; without, all
    vertices stay, and one that several materials share becomes one vertex a material.
    """
    notes, colored = model.notes, model.colors is not None
    if model.surfaces.textured:
        notes.add_if(colored, "vertex colours are not used beside textures")
        return _textured(model, path)
    if model.colors is not None or not model.materials.any():
        notes.add_if(model.materials.any(), "colours of materials are not used beside vertex colours")
        colors = None if model.colors is None else np.pad(model.colors, ((0, 0), (0, 1)), constant_values=1.0)
        return Polygons(model.positions, model.corners, model.sizes, colors).mesh(path)
    cut, polygon = triangulate(model.positions, model.corners, model.sizes)
    triangles, base_colors = model.corners[cut], model.surfaces.base_colors
    keys, numbers = np.unique(triangles * len(base_colors) + model.materials[polygon][:, None], return_inverse=True)
    vertex, material = np.divmod(keys, len(base_colors))
    mesh = model_mesh(model.positions[vertex], numbers.reshape(-1, 3), base_colors[material], None, path)
    return replace(mesh, normals=vertex_normals(model.positions, triangles)[vertex])


def _textured(model: ObjFile, path: str | Path) -> Mesh:
    cut, polygon = triangulate(model.positions, model.corners, model.sizes)
    at, surfaces = cut.reshape(-1), model.surfaces
    material = model.materials[polygon]
    columns = [model.corners[at], model.coordinate_of[at] + 1, model.normal_of[at] + 1, material.repeat(3)]
    sample, index = _different(columns)
    position, coordinate, normal, surface = (column[sample] for column in columns)
    triangles = index.reshape(-1, 3)
    coordinates = np.concatenate([np.full((1, 2), np.nan, np.float32), model.coordinates])[coordinate]
    normals = np.concatenate([np.full((1, 3), np.nan, np.float32), model.normals])[normal]
    mesh = model_mesh(model.positions[position], triangles, surfaces.base_colors[surface], None, path)
    # normals that the file has not are made over shared positions, so that a texture seam does not show
    smooth = vertex_normals(model.positions.astype(np.float32), model.corners[cut])[position]
    missing = (surfaces.texture_of[model.materials] >= 0).repeat(model.sizes) & (model.coordinate_of < 0)
    model.notes.add_if(missing.any(), "faces with a texture but without texture coordinates show their colour")
    return replace(
        mesh,
        normals=np.where(np.isfinite(normals).all(axis=1, keepdims=True), normals, smooth),
        uvs=coordinates * np.array([1.0, -1.0], np.float32) + np.array([0.0, 1.0], np.float32),  # OBJ's v runs up
        texture_ids=surfaces.texture_of[material],
        textures=surfaces.textures,
    )


def _different(columns: list[Indices]) -> tuple[Indices, Indices]:
    """Find a place of each different row, in the order of the rows' values; and the row's number at every place."""
    key = columns[0]
    for column in columns[1:]:
        if int(key.max()) * (int(column.max()) + 1) >= 2**62:
            key = np.unique(key, return_inverse=True)[1]
        key = key * (int(column.max()) + 1) + column
    _, sample, index = np.unique(key, return_index=True, return_inverse=True)
    return sample, index
