"""Pinhole cameras: what splats are projected by, as the published rasterizer takes it.

Its camera looks along z with x to the right and y down, and is given twice: world to camera, and world to clip space
(of which only x, y and w are used).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.simulator.scenes.camera import Camera, clip_matrix

VIEW_KEY = "view_row_major"
KEYS = ("tan_fovx", "tan_fovy", VIEW_KEY, "proj_view_row_major")
SKEW = 1e-4  # cosine of the angle between two axes that are still taken to be at right angles


@dataclass(frozen=True, eq=False)
class Pinhole:
    """One camera, in float32.

    Parameters
    ----------
    view : ndarray, (4, 4), float32
        World to camera, row-major, for column vectors: x right, y down, z forward.
    proj_view : ndarray, (4, 4), float32
        World to clip space, y down.
    tan_x, tan_y : float32
        Tangents of half the fields of view.
    """

    view: NDArray[np.float32]
    proj_view: NDArray[np.float32]
    tan_x: np.float32
    tan_y: np.float32

    @property
    def eye(self) -> NDArray[np.floating]:
        """Where it stands, (3,); raises TilestampError where its axes lie in a plane."""
        view = self.view.astype(np.float64)
        try:
            return -np.linalg.solve(view[:3, :3], view[:3, 3])
        except np.linalg.LinAlgError:
            raise TilestampError("camera: the axes of its view lie in a plane, so that it has no eye") from None


@dataclass(frozen=True, eq=False)
class PinholeCamera:
    """A camera that is given as the rasterizer takes it; ``screen`` is that which it was made for."""

    pinhole: Pinhole
    screen: tuple[int, int] | None = None

    @classmethod
    def from_mapping(cls, fields: Mapping[str, Any]) -> "PinholeCamera":
        """Make one of W, H, tan_fovx, tan_fovy, view_row_major, proj_view_row_major, unchanged to the bit."""
        missing = [key for key in KEYS if key not in fields]
        if missing:
            raise TilestampError(f"camera: has no {', '.join(missing)}")
        view, proj_view = (_floats(fields[key], 16, key).reshape(4, 4) for key in KEYS[2:])
        tan_x, tan_y = (_floats([fields[key]], 1, key)[0] for key in KEYS[:2])
        if not (tan_x > 0 and tan_y > 0):
            raise TilestampError(f"camera: tan_fovx and tan_fovy must be over 0, not {tan_x:g} and {tan_y:g}")
        try:
            size = (int(fields["W"]), int(fields["H"])) if {"W", "H"} <= fields.keys() else None
        except (TypeError, ValueError, OverflowError):
            raise TilestampError("camera: W and H must be whole numbers") from None
        return cls(Pinhole(view, proj_view, tan_x, tan_y), size)

    def pinhole_for(self, width: int, height: int) -> Pinhole:  # noqa: ARG002 - as it was given
        """Give it as it is."""
        return self.pinhole

    def matrix(self, width: int, height: int) -> NDArray[np.float64]:  # noqa: ARG002 - the tangents know the screen
        """Model-to-clip matrix of y up, (4, 4) float64: by what other pipelines see the same view."""
        matrix: NDArray[np.float64] = self.pinhole.proj_view * np.array([[1.0], [-1.0], [1.0], [1.0]])
        return matrix


def pinhole_camera(camera: Camera, width: int, height: int) -> Pinhole:
    """Pinhole of any camera for an image; raises TilestampError where it is none."""
    own = getattr(camera, "pinhole_for", None)
    return own(width, height) if own is not None else pinhole_of(clip_matrix(camera, width, height))


def pinhole_of(matrix: NDArray[np.float64]) -> Pinhole:
    """Take a model-to-clip matrix apart.

    Parameters
    ----------
    matrix : ndarray, (4, 4), float64
        Of any perspective camera with right angles: y up, row-major, for column vectors.

    Raises
    ------
    TilestampError
        A matrix without perspective, or of a skewed view.
    """
    rows = matrix[[0, 1, 3]] * np.array([[1.0], [-1.0], [1.0]])
    lengths = np.linalg.norm(rows[:, :3], axis=1)
    if not lengths.all():
        raise TilestampError("camera: splats need a perspective camera, and this matrix has no perspective")
    axes = rows / lengths[:, None]
    if np.abs(np.triu(axes[:, :3] @ axes[:, :3].T, 1)).max() > SKEW:
        raise TilestampError("camera: splats need a camera with right angles, and this matrix is skewed")
    tan_x, tan_y = (lengths[2] / lengths[:2]).astype(np.float32)
    view = np.concatenate([axes, [[0.0, 0.0, 0.0, 1.0]]])
    proj_view = matrix / lengths[2] * np.array([[1.0], [-1.0], [1.0], [1.0]])
    return Pinhole(view.astype(np.float32), proj_view.astype(np.float32), tan_x, tan_y)


def _floats(values: object, count: int, name: str) -> NDArray[np.float32]:
    try:
        array = np.array(values, np.float32).reshape(-1)
    except (TypeError, ValueError):
        raise TilestampError(f"camera: {name} is not made of numbers") from None
    if array.shape != (count,) or not np.isfinite(array).all():
        raise TilestampError(f"camera: {name} needs {count} finite numbers")
    return array
