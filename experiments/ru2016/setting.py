"""The scenes, the views and the machine of Ru's measurements.

800x800 pixels, perspective(45, aspect, 0.1, 100), the model 10 units before the eye, not turned: published. Two
readings of it are hypotheses. His library takes angles in radians, so that 45 opens the view to 58.3 degrees
(tan 22.5 = 0.558); `models` shows what 45 degrees would give. And his table of models was made with 16x16 tiles: one
version of his source has them, and the engine takes 38 ms in it as in his table of tile sizes at 16.

His per-primitive path culls backfaces in both published versions, and so does ours here; samples are ours, at the
centres of pixels, where his lie at integer coordinates (``samples="corners"``).

Box and triangle are ours: the glTF samples of those names are a unit cube and one triangle. The course's glTF cow is
the OBJ one scaled down to 0.97 units. Engine (740 units) and di (107) do not fit his view; how he scaled them is not
known: their size on the screen is chosen on their per-primitive times. Models that are not on the scene path are left
out.
"""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from tilestamp.models.errors import TilestampError
from tilestamp.models.fitted import Fitted
from tilestamp.models.price import Fidelity
from tilestamp.models.remembered import remembered
from tilestamp.simulator.run import Run
from tilestamp.simulator.scenes.camera import Camera, LookAt
from tilestamp.simulator.scenes.library import load_scene
from tilestamp.simulator.scenes.scene import Mesh, Scene
from tilestamp.simulator.simulation import simulate

MACHINE = "gt750m"
SIZE = 800  # pixels
SOURCE = "Ru 2016, README and spreadsheet (GT 750M, 800x800)"
FOLDER = Path(__file__).parent
DISTANCE = 10.0
RADIAN_VIEW = math.degrees(2.0 * math.atan(abs(math.tan(45.0 / 2.0))))  # 45 taken as radians
DEGREE_VIEW = 45.0
MODELS_TILE = 16  # pixels
COW_SCALE = 0.09283  # course's cow.gltf (2018 copy): 0.9695 units long; cow.obj: 10.444
SHARE_OF_WINDOW = {  # in steps of 0.05
    name: Fitted(
        f"ru2016: size of {name} on the screen",
        share,
        (f"{name} 800x800 | ru2016-models | {name} | per_primitive",),
        chosen=True,
    )
    for name, share in (("2CylinderEngine", 0.65), ("di", 0.05))
}
INTEROP = Fitted(
    "ru2016: milliseconds to map the window's buffer and give it back",
    2.13,
    ("triangle 800x800 | ru2016-models | triangle | tile or tile_without_culling",),
)


def published(name: str) -> pd.DataFrame:
    """Read a table of the source."""
    return pd.read_csv(FOLDER / f"{name}.csv")


def model(name: str) -> Scene:
    """Find one of his models, or make it, as large as he saw it."""
    if name == "triangle":
        corners = np.array([[0, 0, 0, 1], [1, 0, 0, 1], [0, 1, 0, 1]], np.float32)
        return Scene(name, mesh=Mesh(corners, np.array([[0, 1, 2]], np.int32)))
    if name == "box":
        return Scene(name, mesh=_cube())
    scene = load_scene({"duck": "Duck"}.get(name, name), kind="mesh")
    if name == "cow":
        return _scaled(scene, COW_SCALE, np.zeros(3))
    if name in SHARE_OF_WINDOW:
        points = _mesh(scene).positions[:, :3].astype(np.float64)
        low, high = points.min(axis=0), points.max(axis=0)
        window = 2.0 * DISTANCE * math.tan(math.radians(RADIAN_VIEW) / 2.0)
        return _scaled(
            scene, SHARE_OF_WINDOW[name].on(frame_name(name)) * window / (high - low)[:2].max(), (low + high) / 2.0
        )
    return scene


def _mesh(scene: Scene) -> Mesh:
    assert scene.mesh is not None  # noqa: S101 - model() makes meshes only
    return scene.mesh


def _scaled(scene: Scene, scale: float, middle: np.ndarray[tuple[int], np.dtype[np.float64]]) -> Scene:
    """Scale a model about a point, which goes to the origin."""
    positions = _mesh(scene).positions.copy()
    positions[:, :3] = (positions[:, :3] - middle) * scale
    return replace(scene, mesh=replace(_mesh(scene), positions=positions))


def _cube() -> Mesh:
    """Make a unit cube around the origin, 12 triangles that face outwards."""
    corners = np.array([[x, y, z, 1] for z in (-0.5, 0.5) for y in (-0.5, 0.5) for x in (-0.5, 0.5)], np.float32)
    quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
    return Mesh(corners, np.array([[q[0], q[k], q[k + 1]] for q in quads for k in (1, 2)], np.int32))


def camera(fov_degrees: float = RADIAN_VIEW) -> Camera:
    """His camera."""
    return LookAt((0.0, 0.0, DISTANCE), (0.0, 0.0, 0.0), fov_degrees=fov_degrees, near=0.1, far=100.0)


def frame_name(name: str) -> str:
    """The frame of a model, as fitted numbers name it."""
    return f"{name} {SIZE}x{SIZE}"


@remembered
def draw(
    name: str, pipeline: str, fidelity: Fidelity = "schedule", fov_degrees: float = RADIAN_VIEW, **options: Any
) -> Run | None:
    """Draw one model as he did; None where it is not on the scene path."""
    try:
        scene = model(name)
    except TilestampError:
        return None
    return simulate(
        scene, pipeline, MACHINE, width=SIZE, height=SIZE, camera=camera(fov_degrees), fidelity=fidelity, **options
    )


def host_ms(run: Run) -> float:
    """Milliseconds in which the GPU stands idle: the host waits after launches, and maps the window's buffer."""
    return waits_ms(run) + INTEROP.value


def waits_ms(run: Run) -> float:
    """Milliseconds of the launches that his host waits for, which the machine file prices."""
    waits = int(run.frame.facts["launches that the host waits for"])
    return waits * run.machine.as_moved.launch.sync_us / 1e3


def frame_ms(run: Run) -> float:
    """One frame as he timed it: the kernels, and the host between them."""
    return run.milliseconds + host_ms(run)


def missing(names: list[str]) -> list[str]:
    """Say which models were left out."""
    return [f"{name} is not on the scene path (TILESTAMP_SCENES): its rows are left out" for name in names]
