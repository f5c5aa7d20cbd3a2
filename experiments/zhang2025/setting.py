"""The scene and the candidates of Zhang's measurements: a bunny of 5,000 triangles at 1920x1080.

His bunny, his view and his GPU are not known: the bunny of 4,968 triangles fills the window here, with a checkered
texture by its position, so that the pixel shader samples as his does. His loader makes a vertex of each corner of a
face, so no vertex is shared. Nsight Compute locks the GPU to its base clock unless it is told not to.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from tilestamp.models.errors import TilestampError
from tilestamp.models.machine import Machine, altered, load_machine
from tilestamp.simulator.run import Run
from tilestamp.simulator.scenes.library import load_scene
from tilestamp.simulator.scenes.polygons import vertex_normals
from tilestamp.simulator.scenes.scene import Mesh, Scene
from tilestamp.simulator.simulation import simulate

WIDTH, HEIGHT = 1920, 1080
CANDIDATES = ("ga104", "rtx3080")
BASE_MHZ = {"ga104": 1110.0, "rtx3080": 1440.0}  # RTX 3080 Laptop (115 W), RTX 3080: from memory, not looked up
SOURCE = "Zhang 2025, README and Nsight Compute tables (1920x1080, 5,000 triangles; GPU not named)"
FOLDER = Path(__file__).parent
TEXTURE = 1024  # texels on a side


def published(name: str) -> pd.DataFrame:
    """Read a table of the source."""
    return pd.read_csv(FOLDER / f"{name}.csv")


def bunny() -> Scene | None:
    """Give the bunny a texture; None where it is not on the scene path."""
    try:
        scene = load_scene("bunny_5k", kind="mesh")
    except TilestampError:
        return None
    assert scene.mesh is not None  # noqa: S101 - asked for a mesh
    return replace(scene, mesh=unshared(textured(scene.mesh)))


def unshared(mesh: Mesh) -> Mesh:
    """Give each corner of each triangle a vertex of its own."""
    corners = mesh.triangles.ravel()
    normals = vertex_normals(mesh.positions, mesh.triangles) if mesh.normals is None else mesh.normals
    return replace(
        mesh,
        positions=mesh.positions[corners],
        triangles=np.arange(len(corners), dtype=np.int32).reshape(-1, 3),
        normals=normals[corners],
        uvs=None if mesh.uvs is None else mesh.uvs[corners],
        colors=None if mesh.colors is None else mesh.colors[corners],
    )


def textured(mesh: Mesh) -> Mesh:
    """Give a mesh texture coordinates by its position, and a checkered texture with noise."""
    points = mesh.positions[:, :3]
    low, high = points.min(axis=0), points.max(axis=0)
    uvs = ((points - low) / (high - low).max())[:, :2].astype(np.float32)
    y, x = np.mgrid[0:TEXTURE, 0:TEXTURE]
    checks = ((x // 64 + y // 64) % 2 * 96 + 128).astype(np.uint8)
    noise = np.random.default_rng(5).integers(0, 32, (TEXTURE, TEXTURE, 1), dtype=np.uint8)
    texture = np.full((TEXTURE, TEXTURE, 4), 255, np.uint8)
    texture[..., :3] = checks[..., None] + noise
    ids = np.zeros(len(mesh.triangles), np.int32)
    return replace(mesh, uvs=uvs, texture_ids=ids, textures=(texture,))


def profiled(name: str) -> Machine:
    """Lock a machine to its base clock, as the profiler does; what is not in the SM's clock keeps its time."""
    machine = load_machine(name)
    share = BASE_MHZ[name] / machine.sm.clock_mhz
    latency = machine.latency
    numbers = {
        "sm.clock_mhz": BASE_MHZ[name],
        "latency.dram_cycles": latency.l2_cycles + share * (latency.dram_cycles - latency.l2_cycles),
        "launch.blocks_per_us": share * machine.launch.blocks_per_us,
    }
    return altered(machine, numbers, "assumed", "base clock, which Nsight Compute locks to, from memory")


def draw(scene: Scene, machine: str, **options: Any) -> Run:
    """Draw the scene as he did."""
    return simulate(scene, "binned", machine, width=WIDTH, height=HEIGHT, fidelity="schedule", **options)
