"""Vertices before the pipeline: model space to clip space in float32, and a colour where the mesh has none."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.kernel import kernel
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.scenes.scene import Mesh, Scene
from tilestamp.simulator.scenes.subpatches import with_mesh

ALPHA = np.float32(0.5)  # of colours made here, as in the published benchmarks
AMBIENT = np.float32(0.2)
_PART_VERTICES = 4096  # at least


@kernel(lent=True)
def _transform_part(part: int, parts: int, positions: Any, matrix: Any, out: Any) -> None:
    for v in range(positions.shape[0] * part // parts, positions.shape[0] * (part + 1) // parts):
        for c in range(4):
            value = matrix[c, 0] * positions[v, 0]
            for k in range(1, 4):
                value += matrix[c, k] * positions[v, k]
            out[v, c] = value


@kernel(lent=True)
def _add_normals(positions: Any, triangles: Any, normals: Any) -> None:
    """Add each triangle's normal, as long as its area, to its vertices."""
    for t in range(triangles.shape[0]):
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        if min(a, b, c) < 0 or max(a, b, c) >= positions.shape[0]:
            continue
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            e, f = positions[b, i] - positions[a, i], positions[b, j] - positions[a, j]
            g, h = positions[c, i] - positions[a, i], positions[c, j] - positions[a, j]
            for v in (a, b, c):
                normals[v, k] += e * h - f * g


def triangle_mesh(scene: Scene) -> Mesh:
    """Return the scene's mesh; patches are cut into triangles where there is none.

    Raises
    ------
    TilestampError
        Where the scene has no triangles.
    """
    mesh = with_mesh(scene).mesh
    if mesh is None or len(mesh.triangles) == 0:
        raise TilestampError(f"the scene {scene.name} has no triangles, and this pipeline draws nothing else")
    return mesh


def clip_positions(mesh: Mesh, matrix: NDArray[np.floating]) -> NDArray[np.float32]:
    """Clip positions of all vertices, (V, 4) float32; ``matrix`` is row-major for column vectors."""
    if mesh.clip_space:
        return np.ascontiguousarray(mesh.positions)
    out = np.empty_like(mesh.positions)
    parts = parts_of(len(out), _PART_VERTICES)
    for_parts(_transform_part, parts, np.ascontiguousarray(mesh.positions), np.asarray(matrix, np.float32, "C"), out)
    return out


def vertex_colors(mesh: Mesh, matrix: NDArray[np.floating]) -> NDArray[np.float32]:
    """Colours of all vertices, (V, 4) float32: the mesh's own, or lit from the eye by the normals."""
    if mesh.colors is not None:
        return np.ascontiguousarray(mesh.colors, np.float32)
    normals = mesh.normals
    if normals is None:
        normals = np.zeros((len(mesh.positions), 3), np.float32)
        _add_normals(np.ascontiguousarray(mesh.positions), mesh.triangles, normals)
    toward = np.array([0, 0, 1], np.float32) if mesh.clip_space else view_direction(matrix)
    with np.errstate(all="ignore"):
        facing = np.abs(normals @ toward) / np.sqrt((normals * normals).sum(axis=1))
    light = AMBIENT + (1 - AMBIENT) * np.nan_to_num(facing, nan=0.0, posinf=0.0)
    return np.stack([light, light, light, np.full_like(light, ALPHA)], axis=1).astype(np.float32)


def view_direction(matrix: NDArray[np.floating]) -> NDArray[np.float32]:
    """Find the unit vector along which the camera looks, in model space."""
    row = matrix[3, :3] if np.any(matrix[3, :3]) else matrix[2, :3]
    return np.asarray(row / max(float(np.linalg.norm(row)), 1e-30), np.float32)
