"""Colours of a picture that was drawn as triangle numbers: interpolated afterwards, at pixel centres."""

import numpy as np
from numpy.typing import NDArray

from tilestamp.simulator.stages.laine2011.pixel_barycentrics import pixel_barycentrics


def pixel_colors(
    ids: NDArray[np.int32],
    positions: NDArray[np.float32],
    triangles: NDArray[np.int32],
    colors: NDArray[np.float32],
) -> NDArray[np.uint8]:
    """Perspective-correct colour of each pixel's triangle, (H, W, 3) uint8; black where there is none.

    Parameters
    ----------
    ids : ndarray, (H, W), int32
        Row 0 at clip y = -1.
    positions : ndarray, (V, 4), float32
    triangles : ndarray, (F, 3), int32
    colors : ndarray, (V, 4), float32
    """
    image = np.zeros((*ids.shape, 3), np.uint8)
    drawn = ids >= 0
    u, v = np.moveaxis(pixel_barycentrics(ids, positions, triangles)[drawn][:, :2], 1, 0)
    corners = triangles[ids[drawn]]
    shaded = sum(weight[:, None] * colors[corners[:, k], :3] for k, weight in enumerate((u, v, 1 - u - v)))
    image[drawn] = np.clip(np.nan_to_num(shaded) * 255 + 0.5, 0, 255)
    return image
