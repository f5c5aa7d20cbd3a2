"""The view of a splat scene that names none: from outside, a little above, towards the middle of its Gaussians."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tilestamp.simulator.scenes.pinhole import Pinhole, PinholeCamera
from tilestamp.simulator.scenes.splats import Splats

HALF_FOV_DEGREES = 25.0  # vertical
DISTANCE = 2.2  # in sizes of the scene: the distance within which 98 % of the centres lie
SIZE_PERCENT = 98
DIRECTION = (np.sin(0.6), -0.25, np.cos(0.6))  # from the middle to the eye; y points down
NEAR, FAR = 0.01, 100.0


@dataclass(frozen=True)
class SplatView:
    """A pinhole camera that sees a whole scene on a screen of any size.

    Parameters
    ----------
    center : sequence of 3 floats
    size : float
        Half the extent of the scene.
    """

    center: tuple[float, float, float]
    size: float

    def pinhole_for(self, width: int, height: int) -> Pinhole:
        """The camera for a screen, computed in float64 and rounded once."""
        center = np.array(self.center)
        eye = center + DISTANCE * self.size * np.array(DIRECTION)
        forward = center - eye
        forward /= np.linalg.norm(forward)
        right = np.cross(forward, [0, -1, 0])
        right /= np.linalg.norm(right)
        view = np.eye(4)
        view[:3, :3] = np.stack([right, np.cross(forward, right), forward])
        view[:3, 3] = -view[:3, :3] @ eye
        tangent = np.tan(np.radians(HALF_FOV_DEGREES))
        return perspective(view, tangent * width / height, tangent)

    def matrix(self, width: int, height: int) -> NDArray[np.float64]:
        """Model-to-clip matrix of y up, (4, 4) float64."""
        return PinholeCamera(self.pinhole_for(width, height)).matrix(width, height)


def perspective(view: NDArray[np.float64], tan_x: float, tan_y: float) -> Pinhole:
    """Give a camera by world-to-camera matrix (x right, y down, z forward) and tangents of half its fields of view."""
    projection = np.zeros((4, 4))
    projection[0, 0], projection[1, 1], projection[3, 2] = 1 / tan_x, 1 / tan_y, 1
    projection[2, 2], projection[2, 3] = FAR / (FAR - NEAR), -FAR * NEAR / (FAR - NEAR)
    whole = (projection @ view).astype(np.float32)
    return Pinhole(view.astype(np.float32), whole, np.float32(tan_x), np.float32(tan_y))


def view_of(splats: Splats) -> SplatView:
    """Look at the middle of the centres; those far outside do not count."""
    means = splats.means.astype(np.float64)
    means = means[np.isfinite(means).all(axis=1)]
    if not len(means):
        return SplatView((0.0, 0.0, 0.0), 1.0)
    center = np.median(means, axis=0)
    size = float(np.percentile(np.linalg.norm(means - center, axis=1), SIZE_PERCENT))
    return SplatView((float(center[0]), float(center[1]), float(center[2])), size or 1.0)
