"""The scenes and the machine of Ru's measurements.

800x800 pixels, perspective(45, aspect, 0.1, 100), the model 10 units before the eye: published. The engine spans 740
units, so he must have zoomed; it fills the window here (assumed). Box and triangle are ours: the glTF samples of those
names are a unit cube and one triangle. Models that are not on the scene path are left out, with a warning.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from models.errors import TilestampError
from models.price import Fidelity
from simulator.run import Run
from simulator.scenes.camera import Camera, LookAt, fit_camera
from simulator.scenes.library import load_scene
from simulator.scenes.scene import Mesh, Scene
from simulator.simulation import simulate

MACHINE = "gt750m"
SIZE = 800  # pixels
SOURCE = "Ru 2016, README and spreadsheet (GT 750M, 800x800)"
FOLDER = Path(__file__).parent
CAMERA = LookAt((0.0, 0.0, 10.0), (0.0, 0.0, 0.0), fov_degrees=45.0, near=0.1, far=100.0)
FLOOR_STAGES = ("clear", "fragment_shading", "copy")  # independent of the model


def published(name: str) -> pd.DataFrame:
    """Read a table of the source."""
    return pd.read_csv(FOLDER / f"{name}.csv")


def model(name: str) -> Scene:
    """Find one of his models, or make it."""
    if name == "triangle":
        corners = np.array([[0, 0, 0, 1], [1, 0, 0, 1], [0, 1, 0, 1]], np.float32)
        return Scene(name, mesh=Mesh(corners, np.array([[0, 1, 2]], np.int32)))
    if name == "box":
        return Scene(name, mesh=_cube())
    return load_scene({"duck": "Duck"}.get(name, name), kind="mesh")


def _cube() -> Mesh:
    """Make a unit cube around the origin, 12 triangles, seen from a corner so that three sides show."""
    corners = np.array([[x, y, z] for z in (-0.5, 0.5) for y in (-0.5, 0.5) for x in (-0.5, 0.5)])
    turn = np.array([[0.707, 0.0, 0.707], [0.408, 0.816, -0.408], [-0.577, 0.577, 0.577]])
    quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
    triangles = [[q[0], q[k], q[k + 1]] for q in quads for k in (1, 2)]
    positions = np.concatenate([corners @ turn.T, np.ones((8, 1))], axis=1)
    return Mesh(positions.astype(np.float32), np.array(triangles, np.int32))


def camera(scene: Scene) -> Camera:
    """His camera; the whole model where it is too large for it."""
    assert scene.mesh is not None  # noqa: S101 - model() makes meshes only
    points = scene.mesh.positions[:, :3]
    if np.abs(points).max() > 10.0:
        return fit_camera([points.min(axis=0), points.max(axis=0)])
    return CAMERA


def draw(name: str, pipeline: str, fidelity: Fidelity = "schedule", **options: Any) -> Run | None:
    """Draw one model as he did; None where it is not on the scene path."""
    try:
        scene = model(name)
    except TilestampError:
        return None
    view = camera(scene)
    return simulate(scene, pipeline, MACHINE, width=SIZE, height=SIZE, camera=view, fidelity=fidelity, **options)


def missing(names: list[str]) -> list[str]:
    """Say which models were left out."""
    return [f"{name} is not on the scene path (TILESTAMP_SCENES): its rows are left out" for name in names]
