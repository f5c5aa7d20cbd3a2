"""Colours of splats as the eye sees them: spherical harmonics of the direction, up to degree 3, never negative."""

import numpy as np
from numpy.typing import NDArray

from tilestamp.simulator.scenes.pinhole import Pinhole
from tilestamp.simulator.scenes.splats import Splats

FIRST = 0.4886025119029199
SECOND = (1.0925484305920792, -1.0925484305920792, 0.31539156525252005, -1.0925484305920792, 0.5462742152960396)
THIRD = (
    -0.5900435899266435, 2.890611442640554, -0.4570457994644658, 0.3731763325901154,
    -0.4570457994644658, 1.445305721320277, -0.5900435899266435,
)  # fmt: skip
_PART = 1 << 18  # Gaussians at a time


def colours_seen(splats: Splats, camera: Pinhole) -> NDArray[np.float32]:
    """Colour of each Gaussian from the eye of a camera, (N, 3) float32.

    Where there are harmonics, what comes out negative is zero; colours that are given are taken as they are.
    """
    harmonics = splats.harmonics
    if harmonics is None:
        return splats.colours
    eye, colours = camera.eye.astype(np.float32), np.empty_like(splats.colours)
    for first in range(0, len(splats), _PART):
        part = slice(first, first + _PART)
        direction = splats.means[part] - eye
        with np.errstate(all="ignore"):
            direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        weights = _basis(direction, harmonics.shape[1])
        added = np.einsum("nk,nkc->nc", weights, harmonics[part])
        colours[part] = np.maximum(splats.colours[part] + added, 0)
    return colours


def _basis(direction: NDArray[np.float32], count: int) -> NDArray[np.float32]:
    """Real spherical harmonics from degree 1 on, (N, count), in the order and with the signs of the published files."""
    x, y, z = direction.T
    xx, yy, zz = x * x, y * y, z * z
    second = (x * y, y * z, 2 * zz - xx - yy, x * z, xx - yy)
    rest = 4 * zz - xx - yy
    third = (
        y * (3 * xx - yy), x * y * z, y * rest, z * (2 * zz - 3 * xx - 3 * yy),
        x * rest, z * (xx - yy), x * (xx - 3 * yy),
    )  # fmt: skip
    parts = [-FIRST * y, FIRST * z, -FIRST * x]
    parts += [weight * part for weight, part in zip(SECOND, second, strict=True)]
    parts += [weight * part for weight, part in zip(THIRD, third, strict=True)]
    return np.stack(parts[:count], axis=1).astype(np.float32)
