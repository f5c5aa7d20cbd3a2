"""Which tiles list a Gaussian: the published square, or what the alpha cut-off of 1/255 leaves of it.

``SQUARE``: all tiles of the square of three sigmas. ``BOX``: those of the box around the ellipse on which alpha is
1/255 (or of 3.33 sigmas, where that is smaller). ``ELLIPSE``: those that the ellipse itself touches, row by row; in use
since 2025 (Speedy-Splat, gsplat). Box and ellipse are float32, each operation rounded by itself.
"""

from typing import Any

import numpy as np

from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.kerbl2023.tiles import Tiles, square_tiles, to_int

SQUARE, BOX, ELLIPSE = 0, 1, 2
BOUNDS = {"square": SQUARE, "box": BOX, "ellipse": ELLIPSE}
LEAST_ALPHA = np.float32(1) / np.float32(255)
FARTHEST = np.float32(11.0889)  # 3.33 sigmas, squared
_ZERO, _HALF = np.float32(0), np.float32(0.5)
_NONE = (0, -1)


@kernel(lent=True, error_model="numpy")
def cut_off(conic: Any) -> Any:
    """Square of the reach of a Gaussian, and half the sides of the box around it; a reach of 0 where it has none.

    Parameters
    ----------
    conic : ndarray, (4,), float32
        A, B, C and the opacity.
    """
    a, b, c, opacity = conic[0], conic[1], conic[2], conic[3]
    if not opacity >= LEAST_ALPHA:
        return _ZERO, _ZERO, _ZERO
    reach = min(FARTHEST, np.float32(2.0 * np.log(np.float64(opacity) * 255.0)))
    det = a * c - b * b
    if not (reach > _ZERO and det > _ZERO):
        return _ZERO, _ZERO, _ZERO
    return reach, np.sqrt(reach * (c / det)), np.sqrt(reach * (a / det))


@kernel(lent=True, inline=True)
def _covered(low: Any, high: Any, size: int, count: int) -> Any:
    """First and last tile between two coordinates on the screen."""
    side = np.float32(size)
    return max(0, to_int(np.floor(low / side))), min(count - 1, to_int(np.floor(high / side)))


@kernel(lent=True)
def tile_rows(rule: int, x: Any, y: Any, radius: int, reach: Any, tiles: Tiles) -> Any:
    """First and last row of tiles; ``reach`` is that of ``cut_off``."""
    if rule == SQUARE:
        _, _, first, end = square_tiles(x, y, radius, tiles)
        return first, end - 1
    if reach[0] == _ZERO:
        return _NONE
    middle = y + _HALF
    return _covered(middle - reach[2], middle + reach[2], tiles.tile_y, tiles.rows)


@kernel(lent=True, error_model="numpy")
def tile_columns(rule: int, row: int, x: Any, y: Any, radius: int, reach: Any, conic: Any, tiles: Tiles) -> Any:
    """First and last column of tiles in a row; the last is smaller where there are none."""
    if rule == SQUARE:
        first, end, _, _ = square_tiles(x, y, radius, tiles)
        return first, end - 1
    middle, half = x + _HALF, reach[1]
    if rule == BOX:
        return _covered(middle - half, middle + half, tiles.tile_x, tiles.columns)
    a, b, c = conic[0], conic[1], conic[2]
    top = np.float32(row * tiles.tile_y) - (y + _HALF)
    low = min(max(top, -reach[2]), reach[2])
    high = min(max(top + np.float32(tiles.tile_y), -reach[2]), reach[2])
    left_low, right_low = _chord(a, b, c, reach[0], low)
    left_high, right_high = _chord(a, b, c, reach[0], high)
    height = (-b * half) / c  # of the rightmost point
    right = half if low <= height <= high else max(right_low, right_high)
    left = -half if low <= -height <= high else min(left_low, left_high)
    return _covered(middle + left, middle + right, tiles.tile_x, tiles.columns)


@kernel(lent=True, inline=True, error_model="numpy")
def _chord(a: Any, b: Any, c: Any, reach: Any, y: Any) -> Any:
    """Left and right end of the ellipse at a height."""
    by = b * y
    root = np.sqrt(max(by * by - a * ((c * y) * y - reach), _ZERO))
    return (-by - root) / a, (-by + root) / a
