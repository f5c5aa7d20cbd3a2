"""Triangles of the measured scenes, written as pipelines read them; a changed one is noticed and left out."""

from collections.abc import Callable, Mapping
from hashlib import sha256
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.simulator.scenes import load_scene, read_camera
from tilestamp.simulator.scenes.camera import Camera
from tilestamp.simulator.stages.vertex_transform import clip_positions, triangle_mesh

SIZE = (1024, 768)  # pixels: only its aspect ratio counts
Triangles = tuple[NDArray[np.float32], NDArray[np.int32]]


def write_inputs(folder: Path, scenes: Mapping[str, tuple[str, Callable[[], Triangles]]]) -> list[str]:
    """Write every scene to ``folder/ids``.

    Parameters
    ----------
    folder : Path
    scenes : mapping
        By name: the digest of what was measured, and the function that makes it.

    Returns
    -------
    list of str
        What was left out and why.
    """
    (folder / "ids").mkdir(exist_ok=True)
    left_out = []
    for name, (digest, make) in scenes.items():
        try:
            positions, triangles = make()
        except TilestampError as error:
            left_out.append(f"{name} is left out: {error}")
            continue
        if digest_of(positions, triangles) != digest:
            left_out.append(f"{name} is left out: its triangles or its camera are not those that were measured")
            continue
        np.savez(folder / "ids" / f"{name}_input.npz", positions=positions, triangles=triangles)
    return left_out


def digest_of(positions: NDArray[np.float32], triangles: NDArray[np.int32]) -> str:
    """Sixteen digits for the arrays of a scene."""
    return sha256(positions.tobytes() + triangles.tobytes()).hexdigest()[:16]


def seen_by(name: str, camera: Camera | None = None) -> Triangles:
    """Triangles of a library scene in clip space, by a camera or by its default one."""
    scene = load_scene(name)
    mesh = triangle_mesh(scene)
    matrix = read_camera(camera, scene).matrix(*SIZE)
    return clip_positions(mesh, matrix).astype(np.float32), mesh.triangles.astype(np.int32)
