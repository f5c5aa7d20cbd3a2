"""Splats the slow way: every pair of tile and Gaussian tried, lists sorted by Python, pixels one by one.

The projection is float64 and by textbook matrices, lists compare by its own depths; the blending loop is the published
one in float32 with the exp of the math module, rounded: equal to a GPU's within a unit in the last place.
"""

import math

import numpy as np

F = np.float32


def projected(splats, camera, width, height):
    """Depth, position and covariance on the screen of each Gaussian in float64; None where it is too near."""
    found = []
    view, whole = camera.view.astype(float), camera.proj_view.astype(float)
    tans = np.array([camera.tan_x, camera.tan_y], float)
    focal = np.array([width, height]) / (2 * tans)
    for mean, scale, (w, x, y, z) in zip(
        *map(np.float64, (splats.means, splats.scales, splats.rotations)), strict=True
    ):
        point = view @ [*mean, 1.0]
        if point[2] <= 0.2:
            found.append(None)
            continue
        clip = whole @ [*mean, 1.0]
        place = ((clip[:2] / clip[3] + 1) * [width, height] - 1) / 2
        turn = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )
        axes = turn * scale
        slope = np.clip(point[:2] / point[2], -1.3 * tans, 1.3 * tans)
        jacobian = np.array([[focal[0], 0, -focal[0] * slope[0]], [0, focal[1], -focal[1] * slope[1]]]) / point[2]
        flat = jacobian @ view[:3, :3] @ axes
        found.append((point[2], place, flat @ flat.T + 0.3 * np.eye(2)))
    return found


def square_tiles(place, covariance, size, sides):
    """Tiles that the square of three sigmas touches, as (row, column)."""
    radius = math.ceil(3 * math.sqrt(max(np.linalg.eigvalsh(covariance))))
    counts = [-(-size[k] // sides[k]) for k in (0, 1)]
    spans = [
        [t for t in range(counts[k]) if t * sides[k] <= place[k] + radius + sides[k] - 1 - 1e-9 - (sides[k] - 1) % 1]
        for k in (0, 1)
    ]
    low = [max(0, math.trunc((place[k] - radius) / sides[k])) for k in (0, 1)]
    high = [max(0, math.trunc((place[k] + radius + sides[k] - 1) / sides[k])) for k in (0, 1)]
    columns, rows = ([t for t in spans[k] if low[k] <= t < high[k]] for k in (0, 1))
    return {(row, column) for row in rows for column in columns}


def blend(entries, x, y):
    """One pixel: colour, transmittance, place of the last entry blended, evaluations, blends; entries in order."""
    left, colour, last, evaluations, blends = F(1), np.zeros(3, np.float32), 0, 0, 0
    for number, (place, conic, rgb) in enumerate(entries, 1):
        evaluations += 1
        dx, dy = float(place[0] - F(x)), float(place[1] - F(y))
        a, b, c, opacity = map(float, conic)
        power = -0.5 * (a * dx * dx + c * dy * dy) - b * dx * dy
        if power > 0:
            continue
        alpha = min(0.99, opacity * math.exp(power))
        if alpha < 1 / 255:
            continue
        after = float(left) * (1 - alpha)
        if after < 1e-4:
            break
        colour = colour + F(alpha) * rgb * left
        left, last, blends = F(after), number, blends + 1
    return colour, left, last, evaluations, blends
