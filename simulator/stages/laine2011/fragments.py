"""Fine raster up to its ROP, for ROPs of other kinds: its events, and the fragments that it distributes, by tile.

Without a depth test all fragments of a tile come in input order, and rounds of 32 take them one after another: fragment
i of a tile is lane i % 32 of round i // 32.
"""

from enum import IntEnum
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.bits import lowest_bit
from tilestamp.models.counters import counters_of, shown
from tilestamp.models.kernel import kernel
from tilestamp.models.simt import Simt
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stages.borrow import borrow
from tilestamp.simulator.stages.laine2011.coverage import pixel_mask
from tilestamp.simulator.stages.laine2011.fine_raster import Lists, draw_of, draw_rows
from tilestamp.simulator.stages.laine2011.fine_raster_queue import TILE, WARP, Draw, FineRasterEvent, corner
from tilestamp.simulator.stages.laine2011.fine_raster_shade import shade
from tilestamp.simulator.stages.laine2011.fine_raster_single import count_reads
from tilestamp.simulator.stages.laine2011.frame_buffers import FrameBuffers, new_buffers
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


@kernel
def _count_depth_reads(fragments: Fragments, setup: Setup, draw: Draw, table: Any) -> None:
    """Count the read of each fragment's depth plane, which fine raster without depth test leaves out."""
    addresses = np.empty(WARP, np.int64)
    for a in range(table.shape[0]):
        for i in range(fragments.first[a], fragments.first[a + 1], WARP):
            n = min(WARP, fragments.first[a + 1] - i)
            count_reads(setup, draw, fragments.slot[i : i + n], addresses, n, 1, table[a])


class Front(NamedTuple):
    """What fine raster hands to a ROP."""

    draw: Draw
    buffers: FrameBuffers  # pixels as blending over leaves them
    fragments: Fragments
    rows: NDArray[np.int64]  # events of each active tile, those of blending over among them


def front(
    setup: Setup, lists: Lists, width: int, height: int, simt: Simt, colors: NDArray[np.float32], *, depth: bool
) -> Front:
    """Run fine raster up to its ROP, release 1.1, one sample a pixel, mode blend; ``depth``: a ROP that reads it."""
    draw = draw_of(width, height, simt, release="1.1", mode="blend")
    buffers = new_buffers(width, height)
    rows = draw_rows(setup, lists, draw, colors, buffers)
    assert rows is not None  # noqa: S101 - it counts
    fragments = list_fragments(setup, *lists, rows[:, FineRasterEvent.FRAGMENT_LANES], colors, draw)
    if depth:
        _count_depth_reads(fragments, setup, draw, rows)
    return Front(draw, buffers, fragments, rows)


def events_with(name: str, module: str, more: tuple[str, ...]) -> type[IntEnum]:
    """Events of fine raster, and more behind them."""
    made = cast("type[IntEnum]", IntEnum(name, [*FineRasterEvent.__members__, *more], start=0, module=module))
    shown(*counters_of(FineRasterEvent))(made)
    return made
