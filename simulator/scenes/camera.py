"""Cameras: whatever says where a model lands in clip space, as one 4x4 matrix.

Clip space is OpenGL's: a point is visible where -w <= x, y, z <= w; column vectors, row-major arrays, y up.
"""

from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tilestamp.models.errors import TilestampError

Matrix = NDArray[Any]  # (4, 4), from model to clip space, for column vectors
FIT_FOV_DEGREES = 40.0  # vertical; a portrait lens, so that perspective shows but does not distort
FIT_MARGIN = 1.05  # room left around a fitted model
FIT_DIRECTION = (0.5, 0.35, 1.0)  # right, up, towards the eye: a three-quarter view from above


@runtime_checkable
class Camera(Protocol):
    """Anything with a model-to-clip matrix for a screen of a given size."""

    def matrix(self, width: int, height: int) -> NDArray[np.float64]:
        """Model-to-clip matrix, (4, 4) float64, for an image of ``width`` by ``height`` pixels."""
        ...


@dataclass(frozen=True)
class LookAt:
    """A perspective camera at a place, looking at a place.

    Parameters
    ----------
    eye, target, up : sequence of 3 floats
        In model space.
    fov_degrees : float
        Vertical field of view.
    near, far : float
        Distances of the clip planes from the eye, in model units.
    """

    eye: Any
    target: Any
    up: Any = (0.0, 1.0, 0.0)
    fov_degrees: float = FIT_FOV_DEGREES
    near: float = 0.1
    far: float = 100.0

    def __post_init__(self) -> None:
        for name in ("eye", "target", "up"):
            object.__setattr__(self, name, tuple(_numbers(getattr(self, name), (3,), name).tolist()))
        for name in ("fov_degrees", "near", "far"):
            object.__setattr__(self, name, float(_numbers(getattr(self, name), (), name)))
        if self.eye == self.target:
            raise TilestampError("camera: eye and target are the same point, so there is no direction to look in")
        if not 0.0 < self.fov_degrees < 180.0:
            raise TilestampError(f"camera: fov_degrees must lie between 0 and 180, not {self.fov_degrees:g}")
        if not 0.0 < self.near < self.far:
            raise TilestampError(f"camera: 0 < near < far is needed, not near {self.near:g} and far {self.far:g}")
        view_axes(self.eye, self.target, self.up)

    def matrix(self, width: int, height: int) -> NDArray[np.float64]:
        """Model-to-clip matrix, (4, 4) float64; the field of view is the vertical one at any ``width``."""
        aspect = _aspect(width, height)
        view = np.eye(4)
        view[:3, :3] = view_axes(self.eye, self.target, self.up)
        view[:3, 3] = -view[:3, :3] @ np.asarray(self.eye)
        cotangent = 1.0 / np.tan(np.radians(self.fov_degrees) / 2.0)
        depth = self.near - self.far
        projection = np.zeros((4, 4))
        projection[0, 0] = cotangent / aspect
        projection[1, 1] = cotangent
        projection[2, 2:] = (self.near + self.far) / depth, 2.0 * self.near * self.far / depth
        projection[3, 2] = -1.0
        product: NDArray[np.float64] = projection @ view
        return product


class ModelToClip:
    """A camera that is its matrix, whatever the image's size.

    Parameters
    ----------
    matrix : array-like, (4, 4)
        Model space to clip space, row-major, for column vectors.
    """

    def __init__(self, matrix: ArrayLike) -> None:
        self._matrix = _numbers(matrix, (4, 4), "the model-to-clip matrix")
        if np.linalg.matrix_rank(self._matrix) < 4:
            raise TilestampError("camera: the model-to-clip matrix is singular, so it flattens the model")

    def matrix(self, width: int, height: int) -> NDArray[np.float64]:  # noqa: ARG002 (the matrix knows its screen)
        """Model-to-clip matrix, (4, 4) float64: as given."""
        return self._matrix.copy()

    def __repr__(self) -> str:
        return f"ModelToClip({self._matrix.tolist()})"


@dataclass(frozen=True)
class FittedCamera:
    """A three-quarter view that shows a whole box, as large as the image's shape allows.

    Parameters
    ----------
    low, high : sequence of 3 floats
        Corners of the box in model space.
    up : sequence of 3 floats
        The model's own up: y or z as a rule.
    """

    low: tuple[float, float, float]
    high: tuple[float, float, float]
    up: tuple[float, float, float] = (0.0, 1.0, 0.0)

    def look_at(self, width: int, height: int) -> LookAt:
        """Give the camera for one shape of image."""
        low, high = np.asarray(self.low), np.asarray(self.high)
        center = (low + high) / 2.0
        up = np.asarray(self.up, dtype=np.float64)
        side = np.array([0.0, 0.0, 1.0]) if abs(up[2]) < 0.9 else np.array([0.0, -1.0, 0.0])  # a z-up model's front
        right, rise, ahead = FIT_DIRECTION
        towards = right * np.cross(up, side) + rise * up + ahead * side
        towards /= np.linalg.norm(towards)
        axes = view_axes(center + towards, center, up)
        bits = (np.arange(8)[:, None] >> np.arange(3)) & 1
        corners = (np.where(bits, high, low) - center) @ axes.T
        tangent = np.tan(np.radians(FIT_FOV_DEGREES) / 2.0) / FIT_MARGIN
        sides = np.abs(corners[:, :2]) / (tangent * np.array([_aspect(width, height), 1.0]))
        size = float(np.linalg.norm(high - low)) or 1.0  # a single point is seen from one unit
        distance = max(float((corners[:, 2] + sides.max(axis=1)).max()), 0.6 * size)
        front, back = distance - corners[:, 2].max(), distance - corners[:, 2].min()
        eye = center + distance * towards
        return LookAt(eye, center, up, FIT_FOV_DEGREES, near=0.5 * front, far=back + 0.5 * size)

    def matrix(self, width: int, height: int) -> NDArray[np.float64]:
        """Model-to-clip matrix, (4, 4) float64, that fits the box into ``width`` by ``height`` pixels."""
        return self.look_at(width, height).matrix(width, height)


def clip_matrix(camera: Camera, width: int, height: int) -> NDArray[np.float64]:
    """Matrix of a camera for an image; raises TilestampError where a camera of the user's gives another thing."""
    return _numbers(camera.matrix(width, height), (4, 4), "its matrix")


def fit_camera(bounds: ArrayLike, up: ArrayLike = (0.0, 1.0, 0.0)) -> FittedCamera:
    """Give a camera that shows the whole of a model.

    Parameters
    ----------
    bounds : array-like, (2, 3)
        Lower and upper corner of the model's box.
    up : array-like, (3,)
    """
    low, high = _numbers(bounds, (2, 3), "the model's box").tolist()
    return FittedCamera(tuple(low), tuple(high), tuple(_numbers(up, (3,), "up").tolist()))


def view_axes(eye: ArrayLike, target: ArrayLike, up: ArrayLike) -> NDArray[np.float64]:
    """Right, up and backward axes of a camera as rows, (3, 3); raises where ``up`` is along the line of sight."""
    backward = np.asarray(eye, dtype=np.float64) - np.asarray(target, dtype=np.float64)
    backward /= np.linalg.norm(backward)
    right = np.cross(np.asarray(up, dtype=np.float64), backward)
    length = float(np.linalg.norm(right))
    if length <= 1e-9 * float(np.linalg.norm(np.asarray(up))):
        raise TilestampError("camera: up points along the line of sight (or is zero), so the image has no upright")
    right /= length
    return np.stack([right, np.cross(backward, right), backward])


def _aspect(width: int, height: int) -> float:
    if width < 1 or height < 1:
        raise TilestampError(f"camera: an image of {width}x{height} pixels has no shape")
    return width / height


def _numbers(values: object, shape: tuple[int, ...], name: str) -> NDArray[np.float64]:
    """Finite float64 values of a shape, or a sentence."""
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise TilestampError(f"camera: {name} is not made of numbers") from None
    if array.shape != shape:
        wanted = "x".join(map(str, shape)) or "one"
        raise TilestampError(f"camera: {name} needs {wanted} numbers, not {'x'.join(map(str, array.shape)) or 'one'}")
    if not np.isfinite(array).all():
        raise TilestampError(f"camera: {name} holds NaN or infinity")
    return array
