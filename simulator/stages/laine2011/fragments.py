"""Fragments of a draw without depth test, as fine raster distributes them: by tile, and in input order within it.

They are what its rounds of 32 take, one after another: fragment i of a tile is lane i % 32 of round i // 32.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.bits import lowest_bit
from tilestamp.models.kernel import kernel
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stages.borrow import borrow
from tilestamp.simulator.stages.laine2011.coverage import pixel_mask
from tilestamp.simulator.stages.laine2011.fine_raster_queue import TILE, Draw, corner
from tilestamp.simulator.stages.laine2011.fine_raster_shade import shade
from tilestamp.simulator.stages.laine2011.triangle_setup_paths import Setup

_LOW = 0xFFFFFFFF


class Fragments(NamedTuple):
    """All fragments of a frame; those of the i-th active tile are first[i] to first[i + 1]."""

    first: NDArray[np.int64]  # (tiles + 1,)
    pixel: NDArray[np.int64]  # of the tile, 8 * y + 7 - x
    color: NDArray[np.int64]  # RGBA from the low byte up
    depth: NDArray[np.int64]  # fixed point
    slot: NDArray[np.int64]  # of the sub-triangle


@kernel
def _list_part(
    part: int, parts: int, active: Any, starts: Any, entries: Any, setup: Setup, colors: Any, draw: Draw, out: Any
) -> None:
    """List the fragments of a share of the active tiles."""
    first, last = active.size * part // parts, active.size * (part + 1) // parts
    lists = borrow(active), borrow(starts), borrow(entries)
    _list_tiles(first, last, lists, borrow(setup), borrow(colors), draw, borrow(out))


@kernel(lent=True)
def _list_tiles(first: int, last: int, lists: Any, setup: Setup, colors: Any, draw: Draw, out: Fragments) -> None:
    active, starts, entries = lists
    for a in range(first, last):
        t, n = active[a], out.first[a]
        left, bottom = corner(t, draw)
        column, line = t % draw.tiles_x * TILE, t // draw.tiles_x * TILE
        for k in range(starts[t], starts[t + 1]):
            slot = np.int64(entries[k])
            record, mask = np.int64(setup.records[slot]), pixel_mask(setup.headers[slot], left, bottom)
            plane = setup.planes[record]
            while mask != np.uint64(0):
                p = lowest_bit(mask)
                mask &= mask - np.uint64(1)
                x, y = column + 7 - (p & 7), line + (p >> 3)
                depth = np.int64(plane[0]) * x + np.int64(plane[1]) * y + np.int64(plane[2])
                out.pixel[n], out.depth[n], out.slot[n] = p, depth & _LOW, slot
                out.color[n] = shade(setup.planes, record, colors, x, y, -1, draw)
                n += 1


def list_fragments(
    setup: Setup,
    tile_starts: NDArray[np.int64],
    tile_entries: NDArray[np.int32],
    active_tiles: NDArray[np.int32],
    counts: NDArray[np.int64],
    colors: NDArray[np.float32],
    draw: Draw,
) -> Fragments:
    """List all fragments.

    Parameters
    ----------
    setup, tile_starts, tile_entries, active_tiles, colors
        As fine raster takes them; the setup with planes of depth as well as of colour.
    counts : ndarray, (tiles,), int64
        Fragments of each active tile.
    draw : Draw
        One sample a pixel.
    """
    first = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    out = Fragments(first, *(np.empty(int(first[-1]), np.int64) for _ in range(4)))
    parts = parts_of(len(counts), 32)
    with np.errstate(all="ignore"):
        for_parts(_list_part, parts, active_tiles, tile_starts, tile_entries, setup, colors, draw, out)
    return out
