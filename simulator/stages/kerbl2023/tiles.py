"""Tiles of a screen, and which of them the published rule gives a Gaussian: those of a square of three sigmas."""

from typing import Any, NamedTuple

import numpy as np

from tilestamp.models.kernel import kernel

_ONE = np.float32(1)
_LEAST, _LARGEST = -(2.0**31), 2.0**31 - 1.0


class Tiles(NamedTuple):
    """A screen cut into tiles, as kernels take it."""

    width: int  # pixels
    height: int
    tile_x: int  # pixels of a tile, a power of two
    tile_y: int
    columns: int
    rows: int

    @property
    def total(self) -> int:
        """Tiles."""
        return self.columns * self.rows

    @property
    def pixels(self) -> int:
        """Pixels of a tile."""
        return self.tile_x * self.tile_y


def tiles_of(width: int, height: int, tile_x: int, tile_y: int) -> Tiles:
    """Cut a screen into tiles; those at the right and at the bottom may hang over."""
    return Tiles(width, height, tile_x, tile_y, -(-width // tile_x), -(-height // tile_y))


@kernel(lent=True, inline=True)
def to_int(value: Any) -> Any:
    """Float to int32 as CUDA does: towards zero, saturating, NaN to 0."""
    if not value == value:  # noqa: PLR0124, SIM201 - NaN, and nothing else, differs from itself
        return np.int64(0)
    return np.int64(min(max(np.float64(value), _LEAST), _LARGEST))


@kernel(lent=True, inline=True)
def square_tiles(x: Any, y: Any, radius: int, tiles: Tiles) -> Any:
    """First and last but one column and row of the tiles that the square around (x, y) touches."""
    r, tx, ty = np.float32(radius), np.float32(tiles.tile_x), np.float32(tiles.tile_y)
    per_x, per_y = _ONE / tx, _ONE / ty
    first_column = min(max(to_int((x - r) * per_x), 0), tiles.columns)
    first_row = min(max(to_int((y - r) * per_y), 0), tiles.rows)
    end_column = min(max(to_int((((x + r) + tx) - _ONE) * per_x), 0), tiles.columns)
    end_row = min(max(to_int((((y + r) + ty) - _ONE) * per_y), 0), tiles.rows)
    return first_column, end_column, first_row, end_row
