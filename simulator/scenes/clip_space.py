"""Clip-space meshes, and what every mesh is checked for."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.simulator.scenes.geometry import Mesh
from tilestamp.simulator.scenes.notes import Notes


def read_clip_space(path: str | Path, notes: Notes | None = None) -> Mesh:
    """Read a `.npz` of ``positions`` (V, 4) float32 in clip space and ``triangles`` (F, 3) int32."""
    wanted = ("positions", "triangles")
    try:
        with np.load(path, allow_pickle=False) as arrays:
            members: dict[str, Any] = {name: arrays[name] if name in wanted else None for name in arrays}
    except FileNotFoundError:
        raise TilestampError(f"{path}: there is no such file") from None
    except Exception:  # noqa: BLE001 (whatever zip and array readers raise, the file is to blame)
        raise TilestampError(f"{path}: is not a .npz file of plain arrays") from None
    for name in wanted:
        if name not in members:
            raise TilestampError(f"{path}: has no array {name!r} (it has: {', '.join(members) or 'none'})")
    unread = ", ".join(name for name in members if name not in wanted)
    if notes is not None:
        notes.add_if(unread, f"arrays that are not read: {unread}")
    return clip_space_mesh(members["positions"], members["triangles"], path)


def clip_space_mesh(positions: ArrayLike, triangles: ArrayLike, source: str | Path = "clip-space mesh") -> Mesh:
    """Make a mesh of clip-space vertices, for triangle setup as they are.

    Parameters
    ----------
    positions : array-like, (V, 4)
        Rounded to float32. w may be zero or negative: the pipelines do with it what their originals do.
    triangles : array-like, (F, 3), integers
    source : str or Path
        What errors call it.
    """
    array = np.asarray(positions)
    if array.ndim != 2 or array.shape[1] != 4 or array.dtype.kind not in "fiu":
        raise TilestampError(f"{source}: positions must be (V, 4) numbers, not {array.shape} of {array.dtype}")
    return Mesh(finite_positions(array, source), vertex_numbers(triangles, len(array), source), clip_space=True)


def model_to_clip(mesh: Mesh | None, matrix: NDArray[Any]) -> NDArray[Any]:
    """Give the matrix to draw a mesh with: the camera's, or none (the identity) where it is in clip space."""
    return np.eye(4) if mesh is not None and mesh.clip_space else matrix


def checked_mesh(mesh: Mesh, source: str | Path) -> Mesh:
    """Give a mesh back, once its positions are known to be finite and its triangles to exist."""
    finite_positions(mesh.positions, source)
    vertex_numbers(mesh.triangles, len(mesh.positions), source)
    return mesh


def vertex_numbers(triangles: ArrayLike, vertices: int, source: str | Path) -> NDArray[np.int32]:
    """Check and round vertex numbers to (F, 3) int32; errors name ``source`` and the first triangle that is wrong."""
    array = np.asarray(triangles)
    if array.ndim != 2 or array.shape[1] != 3 or array.dtype.kind not in "iu":
        raise TilestampError(f"{source}: triangles must be (F, 3) integers, not {array.shape} of {array.dtype}")
    if not len(array):
        raise TilestampError(f"{source}: has no triangles, so there is nothing to rasterize")
    wrong = ((array < 0) | (array >= vertices)).any(axis=1)
    if wrong.any():
        row = int(wrong.argmax())
        raise TilestampError(
            f"{source}: triangle {row} uses vertices {array[row].tolist()}, but there are {vertices} (from 0)"
        )
    return array.astype(np.int32)


def finite_positions(positions: NDArray[Any], source: str | Path) -> NDArray[np.float32]:
    """Round positions to float32; errors name ``source`` and the first vertex that is not finite."""
    with np.errstate(over="ignore"):
        array = positions.astype(np.float32)
    broken = ~np.isfinite(array).all(axis=1)
    if broken.any():
        raise TilestampError(f"{source}: vertex {int(broken.argmax())} is NaN, infinite or too large for float32")
    return array
