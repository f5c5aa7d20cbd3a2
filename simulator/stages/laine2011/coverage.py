"""Coverage of one 8x8 tile by one triangle, exact in 1/16 pixel (cudaraster, fine raster).

The original looks masks up in a table of edges; the table gives exactly the integer predicate used here. A mask holds
pixel (x, y) of the tile at bit 8 * y + 7 - x, so that ascending bits are the order in which fragments are drawn.
"""

from typing import Any

import numpy as np

from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.laine2011.tile_pixels import inside

TILE = 8  # pixels
_EDGE_0, _EDGE_1, _EDGE_2 = np.int64(0), np.int64(1), np.int64(2)  # a kernel is compiled anew for each literal
SAMPLE_COLUMN = np.array([[0] * 8, [0, 1] + [0] * 6, [1, 3, 0, 2] + [0] * 4, [7, 2, 4, 0, 6, 3, 1, 5]])
"""Column of the sample in each row of the pixel, by log2 of the samples."""


@kernel(lent=True)
def _exclusive(dx: int, dy: int) -> Any:
    """1 where a sample exactly on the edge is outside (right edges, and upper horizontal ones), else 0."""
    return 1 if dy > 0 or (dy == 0 and dx <= 0) else 0


@kernel(lent=True)
def _first_value(header: Any, k: int, x: int, y: int) -> Any:
    """Edge k -> k + 1 of the triangle at (x, y), less its threshold; and the edge's direction. Negative: outside."""
    m = (k + 1) % 3
    px, py = np.int64(header[2 * k]), np.int64(header[2 * k + 1])
    dx, dy = np.int64(header[2 * m]) - px, np.int64(header[2 * m + 1]) - py
    return (px - x) * dy - (py - y) * dx - _exclusive(dx, dy), dx, dy


@kernel(lent=True)
def pixel_mask(header: Any, left: int, bottom: int) -> Any:
    """Pixels of a tile whose centre is covered.

    Parameters
    ----------
    header : array (6,), int16
        Snapped vertices, counter-clockwise, relative to the viewport's centre.
    left, bottom : int
        The tile's lower left corner in the same units, 1/16 pixel.

    Returns
    -------
    uint64
    """
    return inside(header, left + 8, bottom + 8, 0)


@kernel(lent=True)
def square_mask(header: Any, left: int, bottom: int) -> Any:
    """Pixels whose square may be touched: the conservative mask of several samples a pixel."""
    return inside(header, left + 8, bottom + 8, 8)


@kernel(lent=True)
def sample_mask(header: Any, x: int, y: int, log_samples: int) -> Any:
    """Find the samples of one pixel that are covered.

    Parameters
    ----------
    header : array (6,), int16
    x, y : int
        The pixel's centre in the header's units.
    log_samples : int

    Returns
    -------
    int
        Bit i: sample i.
    """
    samples = 1 << log_samples
    step = 3 - log_samples
    a, ax, ay = _first_value(header, _EDGE_0, x, y)
    b, bx, by = _first_value(header, _EDGE_1, x, y)
    c, cx, cy = _first_value(header, _EDGE_2, x, y)
    mask = 0
    for i in range(samples):
        sx = (2 * SAMPLE_COLUMN[log_samples, i] + 1 - samples) << step
        sy = (2 * i + 1 - samples) << step
        ea = a - sx * ay + sy * ax
        eb = b - sx * by + sy * bx
        ec = c - sx * cy + sy * cx
        mask |= ((~(ea | eb | ec) >> 63) & 1) << i
    return mask


@kernel(lent=True)
def centroid_sample(mask: Any, log_samples: int) -> Any:
    """Covered sample nearest to the centre; -1, the centre itself, where all or none are covered."""
    samples = 1 << log_samples
    best, nearest = -1, 1 << 30
    if mask in (0, (1 << samples) - 1):
        return best
    for i in range(samples):
        distance = (2 * SAMPLE_COLUMN[log_samples, i] + 1 - samples) ** 2 + (2 * i + 1 - samples) ** 2
        if (mask >> i) & 1 and distance < nearest:
            best, nearest = i, distance
    return best


def shown_sample(samples: int) -> int:
    """Sample nearest to the pixel's centre."""
    rows = np.arange(samples)
    columns = SAMPLE_COLUMN[samples.bit_length() - 1, :samples]
    return int(np.argmin((2 * columns + 1 - samples) ** 2 + (2 * rows + 1 - samples) ** 2))
