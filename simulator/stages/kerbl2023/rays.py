"""Where along a pixel's ray a Gaussian is densest: its depth at that pixel (StopThePop, Radl et al. 2024)."""

import numpy as np
from numpy.typing import NDArray

from tilestamp.simulator.scenes.pinhole import Pinhole
from tilestamp.simulator.scenes.splats import Splats

THINNEST = 1e-6  # of the largest scale: a disc has a normal, too


def ray_rows(splats: Splats, camera: Pinhole) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Matrices that make each Gaussian of camera space a unit sphere, and the centres of those spheres.

    For a ray d from the eye, ``u = rows @ d``: the Gaussian is densest at ``u @ centre / u @ u`` times d.

    Returns
    -------
    rows : ndarray, (N, 3, 3), float64
    centres : ndarray, (N, 3), float64
    """
    w, x, y, z = splats.rotations.astype(np.float64).T
    axes = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    ).transpose(2, 1, 0)  # transposed: to the own axes
    view, scales = camera.view.astype(np.float64), splats.scales.astype(np.float64)
    scales = np.maximum(scales, np.maximum(THINNEST * scales.max(axis=1, keepdims=True), 1e-12))
    rows = axes @ view[:3, :3].T / scales[:, :, None]
    centres = splats.means.astype(np.float64) @ view[:3, :3].T + view[:3, 3]
    return rows, np.einsum("nij,nj->ni", rows, centres)
