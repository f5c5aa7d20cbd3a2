"""Screen tiles, and the tiles that a diced patch overlaps (Eisenacher & Loop 2010, section 3.1).

At most two a side where the bound is no larger than a tile, three where it is no larger than two tiles, and so on.
"""

import math
from typing import Any, Literal, NamedTuple, get_args

import numpy as np

from tilestamp.models.kernel import kernel

TileSize = Literal[4, 8, 16, 32]  # pixels a side
TILE_SIZES: tuple[TileSize, ...] = get_args(TileSize)


class Tiles(NamedTuple):
    """The tiles of a screen, as kernels take them: integers only."""

    size: int  # pixels a side
    columns: int
    rows: int
    slots: int  # tiles a side that a patch may overlap

    @property
    def total(self) -> int:
        """Tiles of the screen."""
        return self.columns * self.rows

    @property
    def variant(self) -> str:
        """How a kernel with a thread a patch is compiled for them."""
        return f"{self.slots}x{self.slots} slots"


def screen_tiles(width: int, height: int, tile: int, bound: float) -> Tiles:
    """Cut a screen into tiles.

    Parameters
    ----------
    width, height : int
        Pixels; tiles at the right and bottom edge may be partly outside.
    tile : int
        Pixels a side: 4, 8, 16 or 32.
    bound : float
        Pixels that the box of a patch stays below, in each direction.
    """
    return Tiles(tile, -(-width // tile), -(-height // tile), max(2, math.ceil(bound / tile) + 1))


@kernel(lent=True)
def tile_range(box: Any, tiles: Any) -> tuple[Any, Any, Any, Any]:
    """First and last tile column and row that the box x0, y0, x1, y1 overlaps; last < first where it is off screen."""
    scale = np.float32(1) / np.float32(tiles.size)
    right, bottom = np.float32(tiles.columns), np.float32(tiles.rows)
    x0 = np.int64(min(max(box[0] * scale, np.float32(0)), right))
    y0 = np.int64(min(max(box[1] * scale, np.float32(0)), bottom))
    x1 = np.int64(min(max(np.floor(box[2] * scale), np.float32(-1)), right))
    y1 = np.int64(min(max(np.floor(box[3] * scale), np.float32(-1)), bottom))
    x1 = min(x1, tiles.columns - 1, x0 + tiles.slots - 1)
    y1 = min(y1, tiles.rows - 1, y0 + tiles.slots - 1)
    return x0, y0, x1, y1


@kernel(lent=True)
def slot_tiles(boxes: Any, first: int, lanes: int, tiles: Tiles, corners: Any, slots: Any) -> None:
    """List the tile of each lane of a warp in each slot, -1 where it has none: ``slots``, (slots**2, >= lanes).

    ``corners``, (4, >= lanes) int64, is scratch. Loops over lanes alone, so that compiled code takes several at once.
    """
    mine, left, top, right, bottom = boxes[first : first + lanes], corners[0], corners[1], corners[2], corners[3]
    for lane in range(lanes):
        left[lane], top[lane], right[lane], bottom[lane] = tile_range(mine[lane], tiles)
    for j in range(tiles.slots):
        for i in range(tiles.slots):
            slot = slots[j * tiles.slots + i]
            for lane in range(lanes):
                x, y = left[lane] + i, top[lane] + j
                slot[lane] = y * tiles.columns + x if x <= right[lane] and y <= bottom[lane] else -1
