"""Colours of a picture that was drawn as triangle numbers: interpolated afterwards, at pixel centres."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kernel import kernel
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stages.laine2011.pixel_barycentrics import pixel_barycentrics

_PART_ROWS = 16  # at least


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
    weights = pixel_barycentrics(ids, positions, triangles)
    for_parts(_shade_rows, parts_of(len(ids), _PART_ROWS), ids, weights, triangles, colors, image)
    return image


@kernel
def _shade_rows(part: int, parts: int, ids: Any, weights: Any, triangles: Any, colors: Any, image: Any) -> None:
    most = np.float32(255)
    for y in range(len(ids) * part // parts, len(ids) * (part + 1) // parts):
        for x in range(ids.shape[1]):
            t = ids[y, x]
            if t < 0:
                continue
            u, v = weights[y, x, 0], weights[y, x, 1]
            w = np.float32(1) - u - v
            a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
            for k in range(3):
                shaded = (u * colors[a, k] + v * colors[b, k] + w * colors[c, k]) * most + np.float32(0.5)
                if shaded > np.float32(0):  # not-a-number is black
                    image[y, x, k] = np.uint8(min(shaded, most))
