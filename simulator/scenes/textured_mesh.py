"""Any mesh as the arrays that textured pipelines read.

Documented fallbacks: a mesh without normals gets area-weighted ones; a triangle without a texture, or with a texture
but without (or with NaN) coordinates, shows its base colour; triangles with a NaN or infinite vertex are not drawn.
Texels and colours are used as they are stored, as both originals do: no sRGB conversion.
"""

import dataclasses
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.simulator.scenes.polygons import vertex_normals
from tilestamp.simulator.scenes.scene import Scene
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
    positions, triangles, ids = mesh.positions, mesh.triangles, np.arange(len(mesh.triangles), dtype=np.int32)
    if not np.isfinite(positions).all():
        finite = np.asarray(np.isfinite(positions).all(axis=1))
        ids = np.flatnonzero(finite[triangles].all(axis=1)).astype(np.int32)
        triangles = triangles[ids]
        positions = np.where(finite[:, None], positions, np.float32(0.0))
    colors = np.ones((count, 4), np.float32) if mesh.colors is None else mesh.colors
    normals = vertex_normals(positions, triangles) if mesh.normals is None else mesh.normals
    uvs = np.zeros((count, 2), np.float32) if mesh.uvs is None else mesh.uvs
    textures = np.full(len(ids), -1, np.int32)
    if mesh.texture_ids is not None and mesh.uvs is not None:
        textures = mesh.texture_ids[ids].astype(np.int32)
        if not np.isfinite(uvs).all():
            known = np.asarray(np.isfinite(uvs).all(axis=1))
            textures[~known[triangles].all(axis=1)] = -1
    return Geometry(positions, triangles, _clean(colors), _clean(normals), _clean(uvs), textures, ids)


def input_ids(mesh: Geometry, drawn: NDArray[np.int32]) -> NDArray[np.int32]:
    """Input index of the triangle that each pixel shows, -1 where it shows none."""
    ids, shown = np.full(drawn.shape, -1, np.int32), drawn >= 0
    ids[shown] = mesh.ids[drawn[shown]]
    return ids


def with_texture(scene: Scene, image: NDArray[np.uint8]) -> Scene:
    """Lay one image, (H, W, 4) uint8, over all triangles of a mesh, by its coordinates.

    Raises
    ------
    TilestampError
        The mesh has no texture coordinates.
    """
    mesh = scene.mesh
    if mesh is None or mesh.uvs is None or not np.isfinite(mesh.uvs).any():
        raise TilestampError(f"{scene.name} has no texture coordinates, by which a texture could be laid on it")
    ids = np.zeros(len(mesh.triangles), np.int32)
    return dataclasses.replace(scene, mesh=dataclasses.replace(mesh, textures=(image,), texture_ids=ids))


def draws(scene: Scene, mesh: Geometry) -> NDArray[np.int64]:
    """Vertices and triangles (D, 2) of each draw of a scene whose geometry is ``mesh``; one where it knows of none."""
    parts = scene.mesh.draws if scene.mesh is not None else None
    if parts is None:
        return np.array([[len(mesh.positions), len(mesh.triangles)]])
    bounds = np.concatenate([[0], np.cumsum(parts[:, 1])])
    return np.stack([parts[:, 0], np.diff(np.searchsorted(mesh.ids, bounds))], axis=1)


def _clean(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Put 0 for what is not finite."""
    if values.dtype == np.float32 and np.isfinite(values).all():
        return values
    return np.nan_to_num(values, posinf=0.0, neginf=0.0).astype(np.float32)
