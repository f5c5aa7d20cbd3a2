"""What is known of tiles before fine raster draws them: the area of the triangles in their lists.

A list's length foretells how many masks are computed, and the area how many fragments they hold. A triangle's area is
dealt to the tile in the proportion in which its box lies there.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kernel import kernel
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stages.laine2011.fine_raster_queue import TILE
from tilestamp.simulator.stages.laine2011.triangle_setup_paths import Setup

UNITS = 16  # of headers, a pixel
_PART_TILES = 256  # that one call of the worker takes, at least


@kernel
def _deal(part: int, parts: int, headers: Any, starts: Any, entries: Any, size: Any, area: Any) -> None:
    """Areas of one part of the tiles, in pixels; ``size`` is tiles along x, half width and half height in units."""
    side = UNITS * TILE
    for t in range(area.size * part // parts, area.size * (part + 1) // parts):
        left, bottom = (t % size[0]) * side - size[1], (t // size[0]) * side - size[2]
        total = 0.0
        for k in range(starts[t], starts[t + 1]):
            h = headers[entries[k]]
            ax, ay, bx, by, cx, cy = (
                np.int64(h[0]), np.int64(h[1]), np.int64(h[2]), np.int64(h[3]), np.int64(h[4]), np.int64(h[5]),
            )  # fmt: skip
            x0, x1, y0, y1 = min(ax, bx, cx), max(ax, bx, cx), min(ay, by, cy), max(ay, by, cy)
            along = max(min(x1, left + side) - max(x0, left), 0)
            up = max(min(y1, bottom + side) - max(y0, bottom), 0)
            twice = abs((bx - ax) * (cy - ay) - (cx - ax) * (by - ay))
            total += twice * (along * up / max((x1 - x0) * (y1 - y0), 1))
        area[t] = total / (2 * UNITS * UNITS)


def tile_areas(
    setup: Setup, starts: NDArray[np.int64], entries: NDArray[np.int32], width: int, height: int
) -> NDArray[np.float64]:
    """Area of the triangles in each tile, pixels, (tiles,) float64; parameters as of ``fine_raster``."""
    area = np.zeros(len(starts) - 1)
    size = np.array([-(-width // TILE), UNITS // 2 * width, UNITS // 2 * height], np.int64)
    for_parts(_deal, parts_of(len(area), _PART_TILES), setup.headers, starts, entries, size, area)
    return area
