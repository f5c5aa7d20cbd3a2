"""What is known of tiles before they are drawn: their lists, and how much of the grids in them lies in the tile.

A list's length foretells the quads that are looked at, and the share of a grid's box, and of its area, that lies in
the tile the samples that are tested and hit there.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kernel import kernel
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stages.eisenacher2010.tile_range import Tiles

_PART_TILES = 256  # that one call of the worker takes, at least


@kernel
def _add_grids(
    part: Any, parts: Any, vertices: Any, count: Any, start: Any, lists: Any, tiles: Any, known: Any
) -> None:
    """Pixels of boxes and of grids in each tile of one part; a grid's area is that of its two triangles."""
    for t in range(count.size * part // parts, count.size * (part + 1) // parts):
        left, top = np.float32(t % tiles.columns * tiles.size), np.float32(t // tiles.columns * tiles.size)
        for k in range(np.int64(start[t]), np.int64(start[t]) + np.int64(count[t])):
            v = vertices[lists[k]]
            ax, ay, bx, by, cx, cy, dx, dy = v[0, 0], v[0, 1], v[3, 0], v[3, 1], v[12, 0], v[12, 1], v[15, 0], v[15, 1]
            x0, x1 = min(ax, bx, cx, dx), max(ax, bx, cx, dx)
            y0, y1 = min(ay, by, cy, dy), max(ay, by, cy, dy)
            along = max(min(x1, left + tiles.size) - max(x0, left), np.float32(0))
            down = max(min(y1, top + tiles.size) - max(y0, top), np.float32(0))
            twice = abs((bx - ax) * (cy - ay) - (cx - ax) * (by - ay))
            twice += abs((bx - dx) * (cy - dy) - (cx - dx) * (by - dy))
            known[0, t] += along * down
            known[1, t] += along * down * twice / max(2 * (x1 - x0) * (y1 - y0), np.float32(1e-6))


def tile_sizes(
    vertices: NDArray[np.float32],
    count: NDArray[np.uint32],
    start: NDArray[np.uint32],
    lists: NDArray[np.uint32],
    tiles: Tiles,
    **_: Any,
) -> tuple[NDArray[Any], ...]:
    """Length of the list of each tile, and the pixels of its grids and of their boxes; inputs of ``tile_raster``."""
    known = np.zeros((2, tiles.total))
    for_parts(_add_grids, parts_of(tiles.total, _PART_TILES), vertices, count, start, lists, tiles, known)
    return count, known[1], known[0]
