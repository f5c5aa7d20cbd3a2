"""Cut patches into smaller patches, and into triangles."""

import itertools
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.simulator.scenes.scene import Mesh, Patches, Scene

MOST_TRIANGLES = 500_000  # of a tessellation made for a triangle pipeline
FINEST_TESSELLATION = 16  # quads along a patch


def cut(patches: Patches, along_u: NDArray[np.int64] | int, along_v: NDArray[np.int64] | int = 1) -> Patches:
    """Cut each patch into parts of equal parameter range; the surface stays the same.

    Parameters
    ----------
    patches : Patches
        P of them.
    along_u, along_v : int or ndarray, (P,) int64
        Parts of each patch, at least one each way; u is along the rows of its net.

    Returns
    -------
    Patches
        The parts of a patch stand in its place, row by row.

    Source: Ramshaw, blossoming: a part's control points are the polar form at its ends.
    """
    nets = patches.points.astype(np.float64).reshape(-1, 4, 4, 4)
    across, down = (np.broadcast_to(np.asarray(parts, dtype=np.int64), len(nets)) for parts in (along_u, along_v))
    if min(across.min(initial=1), down.min(initial=1)) < 1:
        raise TilestampError("a patch cannot be cut into fewer parts than one")
    first = np.concatenate([[0], np.cumsum(across * down)])
    pieces = np.empty((first[-1], 16, 4))
    for u, v in np.unique(np.stack([across, down], axis=1), axis=0):
        alike = np.flatnonzero((across == u) & (down == v))
        parts = np.einsum(
            "bri,acj,pijk->pbarck", _parts_of_a_cubic(v), _parts_of_a_cubic(u), nets[alike], optimize=True
        )
        pieces[first[alike, None] + np.arange(u * v)] = parts.reshape(len(alike), u * v, 16, 4)
    return Patches(pieces.astype(np.float32))


def edge_lengths(patches: Patches) -> NDArray[np.float64]:
    """Mean length of each patch's control polygons along u and v, (P, 2)."""
    points = patches.points.astype(np.float64).reshape(-1, 4, 4, 4)
    points = points[..., :3] / points[..., 3:]
    steps = (np.linalg.norm(np.diff(points, axis=axis), axis=-1).sum(axis=axis).mean(axis=1) for axis in (2, 1))
    return np.stack(list(steps), axis=1)


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


def _parts_of_a_cubic(parts: int) -> NDArray[np.float64]:
    """Give the control points of each part as weights of those of the whole, (parts, 4, 4)."""
    ends = np.linspace(0.0, 1.0, parts + 1)
    return np.array([[_polar([a] * (3 - i) + [b] * i) for i in range(4)] for a, b in itertools.pairwise(ends)])


def _polar(at: list[float]) -> NDArray[np.float64]:
    """Weights of a cubic's control points in its polar form at three parameters, (4,)."""
    weights = np.ones(1)
    for t in at:
        weights = np.convolve(weights, [1.0 - t, t])
    return weights
