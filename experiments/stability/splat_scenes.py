"""Splats for the atlas: a camera at the origin that looks along z, and frames of few Gaussians."""

import numpy as np
from numpy.typing import ArrayLike

from tilestamp.simulator.run import Run
from tilestamp.simulator.scenes.pinhole import PinholeCamera
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.simulation import simulate

MACHINE = "h200"
TAN = 0.5  # of half the field of view
NO_TURN = (1.0, 0.0, 0.0, 0.0)


def camera(yaw: float = 0.0, pixels: int = 128) -> PinholeCamera:
    """At the origin, turned by ``yaw`` radians to the right."""
    view = np.eye(4)
    view[0, 0] = view[2, 2] = np.cos(yaw)
    view[0, 2], view[2, 0] = -np.sin(yaw), np.sin(yaw)
    projection = np.diag([1 / TAN, 1 / TAN, 1.0, 0.0])
    projection[3, 2] = 1.0
    return PinholeCamera.from_mapping(
        {
            "W": pixels,
            "H": pixels,
            "tan_fovx": TAN,
            "tan_fovy": TAN,
            "view_row_major": view.tolist(),
            "proj_view_row_major": (projection @ view).tolist(),
        }
    )


def gaussians(
    means: ArrayLike, scales: ArrayLike, opacities: ArrayLike, colours: ArrayLike, rotations: ArrayLike = NO_TURN
) -> Scene:
    """A scene of Gaussians; what is given once is that of all."""
    means = np.atleast_2d(np.asarray(means, float))
    n = len(means)
    return Scene.from_splats(
        means,
        np.broadcast_to(np.asarray(scales, float), (n, 3)),
        np.broadcast_to(np.asarray(rotations, float), (n, 4)),
        np.broadcast_to(np.asarray(opacities, float), (n,)),
        np.broadcast_to(np.asarray(colours, float), (n, 3)),
    )


def draw(scene: Scene, yaw: float = 0.0, pixels: int = 128, **options: object) -> Run:
    """Draw it."""
    return simulate(
        scene,
        "splat",
        MACHINE,
        width=pixels,
        height=pixels,
        camera=camera(yaw, pixels),
        **options,  # type: ignore[arg-type]
    )
