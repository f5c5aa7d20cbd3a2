"""A run made small: a few primitives in a few pixels, by which others learn what kernels it needs."""

from collections.abc import Callable
from typing import Any

import numpy as np

from tilestamp.models.machine import Machine
from tilestamp.simulator.run import Run
from tilestamp.simulator.scenes import Scene
from tilestamp.simulator.scenes.geometry import Mesh, Patches
from tilestamp.simulator.scenes.splats import Splats

PRIMITIVES, WIDTH, HEIGHT = 4, 64, 48
TEXELS = 8


def small(scene: Scene) -> Scene:
    """The first primitives of a scene, without its views; copied, so that nothing keeps the rest in memory."""
    patches, mesh, splats = scene.patches, scene.mesh, scene.splats
    return Scene(
        scene.name,
        patches=patches and Patches(patches.points[:PRIMITIVES].copy()),
        mesh=mesh and _small_mesh(mesh),
        splats=splats and _small_splats(splats),
    )


def _small_splats(splats: Splats) -> Splats:
    parts: dict[str, Any] = {
        name: part if part is None else part[:PRIMITIVES].copy() for name, part in vars(splats).items()
    }
    return Splats(**parts)


def _small_mesh(mesh: Mesh) -> Mesh:
    """The first triangles, with corners of their own."""
    used = mesh.triangles[:PRIMITIVES]
    parts: dict[str, Any] = vars(mesh) | {
        "draws": None,
        "triangles": np.arange(used.size, dtype=np.int32).reshape(-1, 3),
    }
    for name in ("positions", "colors", "normals", "uvs"):
        parts[name] = None if parts[name] is None else parts[name][used.ravel()]
    parts["texture_ids"] = None if mesh.texture_ids is None else mesh.texture_ids[:PRIMITIVES].copy()
    parts["textures"] = tuple(image[:TEXELS, :TEXELS].copy() for image in mesh.textures)
    return Mesh(**parts)


def rehearse(
    simulate: Callable[..., Run],
    scene: Scene,
    pipeline: str,
    machine: Machine,
    drawing: dict[str, object],
    options: dict[str, object],
) -> None:
    """Run it, and price it."""
    run = simulate(scene, pipeline, machine, width=WIDTH, height=HEIGHT, **drawing, **options)
    run.stage_rows  # noqa: B018 - they are made where they are read
