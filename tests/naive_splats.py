"""Splats the slow way: textbook matrices in float64, every tile tried, lists sorted by Python, pixel by pixel.

Its numbers differ from float32 ones in the last digits: scenes that are compared keep clear of borders.
"""

import math

import numpy as np

LEAST_ALPHA, OPAQUE = 1 / 255, 1e-4


def rotation(w, x, y, z):
    """Matrix of a quaternion, which need not be a unit."""
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def projected(splats, camera, width, height):
    """Depth, position and covariance on the screen of each Gaussian; None where it is too near."""
    found = []
    view, whole = camera.view.astype(float), camera.proj_view.astype(float)
    tans = np.array([camera.tan_x, camera.tan_y], float)
    focal = np.array([width, height]) / (2 * tans)
    arrays = (splats.means, splats.scales, splats.rotations)
    for mean, scale, turn in zip(*(array.astype(float) for array in arrays), strict=True):
        point, clip = view @ [*mean, 1.0], whole @ [*mean, 1.0]
        if point[2] <= 0.2:
            found.append(None)
            continue
        place = ((clip[:2] / clip[3] + 1) * [width, height] - 1) / 2
        slope = np.clip(point[:2] / point[2], -1.3 * tans, 1.3 * tans)
        jacobian = np.array([[focal[0], 0, -focal[0] * slope[0]], [0, focal[1], -focal[1] * slope[1]]]) / point[2]
        flat = jacobian @ view[:3, :3] @ (rotation(*turn) * scale)
        found.append((point[2], place, flat @ flat.T + 0.3 * np.eye(2)))
    return found


def square(place, covariance, column, row, tile):
    """Whether a tile is one of those that the square of three sigmas touches, by the published rule."""
    radius = math.ceil(3 * math.sqrt(max(np.linalg.eigvalsh(covariance))))
    return all(
        max(0, math.trunc((place[k] - radius) / tile[k]))
        <= at
        < math.trunc((place[k] + radius + tile[k] - 1) / tile[k])
        for k, at in enumerate((column, row))
    )


def ellipse(place, covariance, opacity, column, row, tile):
    """Whether a point of a tile, tried on a fine grid, lies within the alpha cut-off or 3.33 sigmas."""
    if opacity < LEAST_ALPHA:
        return False
    reach = min(3.33**2, 2 * math.log(255 * opacity))
    x = np.linspace(column * tile[0], (column + 1) * tile[0], 65) - 0.5 - place[0]
    y = np.linspace(row * tile[1], (row + 1) * tile[1], 65) - 0.5 - place[1]
    inverse = np.linalg.inv(covariance)
    dx, dy = np.meshgrid(x, y)
    return bool((inverse[0, 0] * dx**2 + 2 * inverse[0, 1] * dx * dy + inverse[1, 1] * dy**2 <= reach).any())


def lists(found, width, height, tile, listed):
    """Gaussians of each tile, from near to far; ``listed`` (number, column, row) says which tiles list one."""
    return {
        (row, column): sorted(
            (i for i, one in enumerate(found) if one is not None and listed(i, column, row)), key=lambda i: found[i][0]
        )
        for row in range(-(-height // tile[1]))
        for column in range(-(-width // tile[0]))
    }


def blend(entries, x, y):
    """One pixel: colour, what is left of the background, last entry blended, evaluations, blends, whether it stopped.

    ``entries`` are (place, inverse covariance, opacity, colour), in order.
    """
    left, colour, last, evaluations, blends = 1.0, np.zeros(3), 0, 0, 0
    for number, (place, inverse, opacity, rgb) in enumerate(entries, 1):
        evaluations += 1
        offset = place - [x, y]
        alpha = min(0.99, opacity * math.exp(-0.5 * offset @ inverse @ offset))
        if alpha < LEAST_ALPHA:
            continue
        if left * (1 - alpha) < OPAQUE:
            return colour, left, last, evaluations, blends, True
        colour = colour + left * alpha * rgb
        left, last, blends = left * (1 - alpha), number, blends + 1
    return colour, left, last, evaluations, blends, False
