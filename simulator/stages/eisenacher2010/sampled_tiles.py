"""What is known of tiles before anything is diced: which boxes of sub-patches they meet.

The box of a sub-patch's control points holds its diced grid. So the sub-patches that a tile needs are among those whose
box meets it, and the length of its list is nearly the number of them. How much of a box, and of the area of the
sub-patch, lies in the tile foretells the samples that are tested and hit there.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.eisenacher2010.tile_range import Tiles

MARGIN = np.float32(1 / 64)  # pixels: rounding of a diced vertex beyond the control points


class TileSizes(NamedTuple):
    """What is known of each tile, and of each sub-patch."""

    boxes: NDArray[np.float64]  # (tiles,) boxes that meet it
    area: NDArray[np.float64]  # (tiles,) of sub-patches, pixels
    box_area: NDArray[np.float64]  # (tiles,) of boxes, pixels
    meets: NDArray[np.uint8]  # (N,) tiles that each box meets


@kernel
def _range(box: Any, tiles: Any) -> Any:
    """First and last tile column and row that a box meets."""
    size = np.float32(tiles.size)
    x0 = max(np.int64(np.floor((box[0] - MARGIN) / size)), 0)
    y0 = max(np.int64(np.floor((box[1] - MARGIN) / size)), 0)
    x1 = min(np.int64(np.floor((box[2] + MARGIN) / size)), tiles.columns - 1)
    y1 = min(np.int64(np.floor((box[3] + MARGIN) / size)), tiles.rows - 1)
    return x0, y0, x1, y1


@kernel
def _spread(boxes: Any, tiles: Any, number: Any, area: Any, box_area: Any, meets: Any) -> None:
    """Deal each box to the tiles that it meets."""
    for k in range(boxes.shape[0]):
        box = boxes[k]
        x0, y0, x1, y1 = _range(box, tiles)
        wide, high = max(box[2] - box[0], np.float32(1e-6)), max(box[3] - box[1], np.float32(1e-6))
        dense = box[4] / (wide * high)
        meets[k] = min(max(x1 - x0 + 1, 0) * max(y1 - y0 + 1, 0), 255)
        for y in range(y0, y1 + 1):
            down = min(box[3], np.float32((y + 1) * tiles.size)) - max(box[1], np.float32(y * tiles.size))
            for x in range(x0, x1 + 1):
                along = min(box[2], np.float32((x + 1) * tiles.size)) - max(box[0], np.float32(x * tiles.size))
                inside = max(along, np.float32(0)) * max(down, np.float32(0))
                tile = y * tiles.columns + x
                number[tile] += 1
                area[tile] += inside * dense
                box_area[tile] += inside


@kernel
def _meeting(boxes: Any, tiles: Any, wanted: Any, found: Any) -> Any:
    """List the boxes that meet a wanted tile, in order."""
    n = 0
    for k in range(boxes.shape[0]):
        x0, y0, x1, y1 = _range(boxes[k], tiles)
        meets = False
        for y in range(y0, y1 + 1):
            for x in range(x0, x1 + 1):
                meets |= wanted[y * tiles.columns + x]
        if meets:
            found[n] = k
            n += 1
    return n


def tile_sizes(boxes: NDArray[np.float32], tiles: Tiles) -> TileSizes:
    """Foretell the tiles.

    Parameters
    ----------
    boxes : ndarray, (N, 5), float32
        Box and area of each sub-patch, from ``bound_and_split``.
    tiles : Tiles
    """
    sizes = TileSizes(
        np.zeros(tiles.total), np.zeros(tiles.total), np.zeros(tiles.total), np.zeros(len(boxes), np.uint8)
    )
    _spread(boxes, tiles, *sizes)
    return sizes


def meeting(boxes: NDArray[np.float32], tiles: Tiles, units: NDArray[np.int64]) -> NDArray[np.int64]:
    """Sub-patches that the tiles ``units`` may need, in the order of the queue."""
    wanted = np.zeros(tiles.total, np.bool_)
    wanted[units] = True
    found = np.empty(len(boxes), np.int64)
    return found[: _meeting(boxes, tiles, wanted, found)]
