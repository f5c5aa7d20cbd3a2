"""Paths of cameras: nearer or farther on the line of sight, and around what is looked at."""

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.simulator.scenes.camera import Camera, FittedCamera, LookAt


def moved_camera(camera: Camera, width: int, height: int, zoom: float = 1.0, orbit: float = 0.0) -> Camera:
    """Move a camera along its line of sight, and around the axis ``up`` through its target.

    Parameters
    ----------
    camera : Camera
        With an eye and a target; one that is only a matrix stays as it is, and cannot be moved.
    width, height : int
        Pixels: a fitted camera depends on them.
    zoom : float
        At 2 the eye is at half the distance, and what is at the target twice as large.
    orbit : float
        Degrees, counter-clockwise as seen from above.

    Raises
    ------
    TilestampError
        A camera that cannot be moved, or a zoom that is not above 0.
    """
    if zoom == 1.0 and orbit == 0.0:
        return camera
    if not zoom > 0.0:
        raise TilestampError(f"zoom must be above 0, not {zoom:g}")
    placed = camera.look_at(width, height) if isinstance(camera, FittedCamera) else camera
    if not isinstance(placed, LookAt):
        raise TilestampError("zoom and orbit need a camera with an eye and a target; this one is a matrix")
    target, up = np.asarray(placed.target), np.asarray(placed.up) / np.linalg.norm(placed.up)
    sight = np.asarray(placed.eye) - target
    distance = float(np.linalg.norm(sight))
    eye = target + _turned(sight, up, np.radians(orbit)) / zoom
    far = placed.far + max(distance / zoom - distance, 0.0)
    return LookAt(eye, target, placed.up, placed.fov_degrees, placed.near / max(zoom, 1.0), far)


def _turned(vector: NDArray[np.float64], axis: NDArray[np.float64], angle: float) -> NDArray[np.float64]:
    """Turn a vector around a unit axis (Rodrigues' formula)."""
    along = axis * (axis @ vector)
    turned: NDArray[np.float64] = along + np.cos(angle) * (vector - along) + np.sin(angle) * np.cross(axis, vector)
    return turned
