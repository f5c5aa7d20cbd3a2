"""Cut patches into smaller patches, and into triangles."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.simulator.scenes.scene import Mesh, Patches, Scene

# De Casteljau at one half: the control points of the first half of a cubic; the second half is its mirror image.
FIRST_HALF = np.array([[8, 0, 0, 0], [4, 4, 0, 0], [2, 4, 2, 0], [1, 3, 3, 1]]) / 8.0
SECOND_HALF = FIRST_HALF[::-1, ::-1]

MOST_TRIANGLES = 500_000  # of a tessellation made for a triangle pipeline
FINEST_TESSELLATION = 16  # quads along a patch

Nets = NDArray[np.float64]


def split_to_count(patches: Patches, count: int) -> Patches:
    """Split patches, the largest first, until there are exactly ``count``; the surface stays the same.

    Every patch is cut in four as often as ``count`` allows, then the largest in four again, then one in two or three.
    The pieces of a patch stay together, in the patch's place.
    """
    nets = patches.points.astype(np.float64).reshape(-1, 4, 4, 4)
    if not 0 < len(nets) <= count:
        raise TilestampError(f"{len(nets)} patches cannot be split into {count}")
    while 4 * len(nets) <= count:
        nets = _split(nets, np.full(len(nets), 4))
    quartered, rest = divmod(count - len(nets), 3)
    by_size = np.argsort(-_sizes(nets), kind="stable")
    parts = np.ones(len(nets), dtype=np.int64)
    parts[by_size[:quartered]] = 4
    parts[by_size[quartered : quartered + 1]] += rest
    return Patches(_split(nets, parts).reshape(-1, 16, 4).astype(np.float32))


def with_mesh(scene: Scene) -> Scene:
    """Give a scene that has a mesh: its patches cut into triangles, where it has none of its own."""
    if scene.mesh is not None:
        return scene
    if scene.patches is None:
        raise TilestampError(f"scene {scene.name!r} has neither patches nor triangles")
    cells = int(np.sqrt(MOST_TRIANGLES / (2 * len(scene.patches.points))))
    return replace(scene, mesh=tessellate(scene.patches, min(max(cells, 1), FINEST_TESSELLATION)))


def tessellate(patches: Patches, cells: int) -> Mesh:
    """Turn every patch into a grid of ``cells`` by ``cells`` quads, two triangles each, patch by patch, row by row.

    Patches share no vertices. Normals are those of the surface (zero where it has none).
    """
    t = np.linspace(0.0, 1.0, cells + 1)[:, None]
    powers = np.concatenate([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t**3], axis=1)
    slopes = np.concatenate([-3 * (1 - t) ** 2, 3 * (1 - t) * (1 - 3 * t), 3 * t * (2 - 3 * t), 3 * t * t], axis=1)
    nets = patches.points.astype(np.float64).reshape(-1, 4, 4, 4)
    points, along_u, along_v = (
        np.einsum("ri,cj,pijk->prck", rows, columns, nets, optimize=True)
        for rows, columns in ((powers, powers), (powers, slopes), (slopes, powers))
    )
    weight = points[..., 3:]
    tangents = [(slope[..., :3] * weight - points[..., :3] * slope[..., 3:]) for slope in (along_u, along_v)]
    normals = np.cross(*tangents)
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), np.finfo(np.float64).tiny)
    corner = np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)
    v0, v1, v2, v3 = (corner + offset for offset in (0, 1, cells + 2, cells + 1))
    grid = np.stack([v0, v1, v2, v0, v2, v3], axis=-1).reshape(-1, 3)
    triangles = (np.arange(len(nets))[:, None, None] * (cells + 1) ** 2 + grid).reshape(-1, 3)
    return Mesh(
        positions=(points / weight).reshape(-1, 4).astype(np.float32),
        triangles=triangles.astype(np.int32),
        normals=normals.reshape(-1, 3).astype(np.float32),
    )


def _split(nets: Nets, parts: NDArray[np.int64]) -> Nets:
    """Cut each patch into 1, 2 (along u), 3 (a half and two quarters) or 4 parts (u first), in place."""
    first, second = (np.einsum("ij,prjk->prik", half, nets) for half in (FIRST_HALF, SECOND_HALF))
    quarters = [
        np.einsum("ij,pjck->pick", half, side) for half in (FIRST_HALF, SECOND_HALF) for side in (first, second)
    ]
    pieces = np.stack(quarters, axis=1)
    pieces[parts == 1, 0] = nets[parts == 1]
    pieces[parts == 2, 0], pieces[parts == 2, 1] = first[parts == 2], second[parts == 2]
    pieces[parts == 3, 0], pieces[parts == 3, 2] = first[parts == 3], pieces[parts == 3, 3]
    kept: Nets = pieces[np.arange(4) < parts[:, None]]
    return kept


def _sizes(nets: Nets) -> NDArray[np.float64]:
    """Diagonal of the box around each patch's control points, (P,)."""
    points = (nets[..., :3] / nets[..., 3:]).reshape(len(nets), 16, 3)
    diagonal: NDArray[np.float64] = np.linalg.norm(np.ptp(points, axis=1), axis=1)
    return diagonal
