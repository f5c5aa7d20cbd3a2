"""Fine raster with an alpha test, and survivors compacted before they are shaded (Laine & Karras 2011, section 8).

A fragment that passes the depth test has its alpha interpolated; below the reference it is discarded, before it writes
depth. The lanes of the others go on to the shader, and those of the discarded idle; or, compacted, survivors wait in
shared memory for a round of 32 to be full, over as many rounds of fragments as that takes, to the end of the tile.
Depth and owner of a pixel are written in input order before; a colour is written where its fragment still owns the
pixel, so that the picture is the same.
"""

from dataclasses import replace
from enum import IntEnum
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.bits import lowest_bit, lowest_bits, popcount
from tilestamp.models.counters import counters_of, ratio, shown
from tilestamp.models.kernel import kernel
from tilestamp.models.simt import Simt
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.borrow import borrow
from tilestamp.simulator.stages.laine2011.fine_raster import draw_of
from tilestamp.simulator.stages.laine2011.fine_raster_queue import (
    END,
    FRAGMENTS,
    HEAD,
    NEXT,
    TAIL,
    TILE,
    WARP,
    Draw,
    FineRasterEvent,
    Tile,
    corner,
    new_tile,
    refill,
    start_tile,
    update_zmax,
)
from tilestamp.simulator.stages.laine2011.fine_raster_shade import shade
from tilestamp.simulator.stages.laine2011.fine_raster_single import (
    add_hits,
    count_reads,
    draw_nearer,
    remember_depths,
)
from tilestamp.simulator.stages.laine2011.fine_raster_work import fine_work
from tilestamp.simulator.stages.laine2011.frame_buffers import (
    FrameBuffers,
    count_tile,
    load_tile,
    new_buffers,
    store_tile,
)
from tilestamp.simulator.stages.laine2011.triangle_setup_paths import Setup

QUEUE_WORDS = 2  # of colour: a survivor's record and pixel take a word for each of up to 64, as a pixel's colour does
RECORD_PARTS = 3  # of 16 bytes that interpolation reads
_LOW = 0xFFFFFFFF
# Events of fine raster; rounds with a fragment to test, and those; discarded; rounds with a survivor that is compacted
_NAMES = [*FineRasterEvent.__members__, "ALPHA_ROUNDS", "ALPHA_LANES", "DISCARDS", "COMPACT_ROUNDS", "COMPACT_LANES"]
AlphaEvent = cast("type[IntEnum]", IntEnum("AlphaEvent", _NAMES, start=0, module=__name__))
shown(
    *counters_of(FineRasterEvent),
    ratio("discarded", "DISCARDS", "ALPHA_LANES", "tested fragments that are discarded, share"),
    ratio("shading_lanes", "SHADE_LANES", "SHADE_ROUNDS", "lanes that shade, of the 32 of a round"),
)(AlphaEvent)
_ALPHA_ROUNDS, _ALPHA_LANES, _DISCARDS, _COMPACT_ROUNDS, _COMPACT_LANES = map(int, list(AlphaEvent)[-5:])


@kernel
def _draw_part(
    part: int, parts: int, active: Any, starts: Any, entries: Any, setup: Setup, colors: Any, draw: Draw,
    reference: int, compact: bool, buffers: Any, table: Any,
) -> None:  # fmt: skip
    """Draw a share of the active tiles, through arrays without reference counts."""
    first, last = active.size * part // parts, active.size * (part + 1) // parts
    tile, waiting = new_tile(1), np.zeros(2 * WARP, np.int64)
    lists, lent = (borrow(starts), borrow(entries)), (borrow(setup), borrow(colors), borrow(buffers))
    _draw_tiles(
        first, last, active, lists, borrow(tile), borrow(waiting), *lent, draw, reference, compact, borrow(table)
    )
    tile.state[0] = waiting[0] = 0  # the owners live to here


@kernel
def _draw_tiles(
    first: int, last: int, active: Any, lists: Any, tile: Tile, waiting: Any, setup: Setup, colors: Any, buffers: Any,
    draw: Draw, reference: int, compact: bool, table: Any,
) -> None:  # fmt: skip
    starts, entries = lists
    for a in range(first, last):
        t = active[a]
        left, bottom = corner(t, draw)
        x, y = (t % draw.tiles_x) * TILE, (t // draw.tiles_x) * TILE
        load_tile(buffers, draw, tile, x, y)
        start_tile(tile, starts[t], starts[t + 1])
        _draw_tile(setup, entries, colors, draw, tile, waiting, left, bottom, reference, compact, table[a])
        count_tile(draw, table[a])
        store_tile(buffers, setup, colors, draw, tile, x, y)


@kernel(lent=True)
def _draw_tile(
    setup: Setup, entries: Any, colors: Any, draw: Draw, tile: Tile, waiting: Any, left: int, bottom: int,
    reference: int, compact: bool, row: Any,
) -> None:  # fmt: skip
    """Draw the list of one tile; what waits at its end is shaded in a round that is not full."""
    state, pending = tile.state, 0
    column, line = (left + draw.half_width) >> 4, (bottom + draw.half_height) >> 4
    while True:
        if state[FRAGMENTS] < WARP and state[NEXT] < state[END]:
            update_zmax(tile.depth, state, row)
            refill(setup, entries, draw, tile, left, bottom, row)
        if state[FRAGMENTS] == 0:
            break
        alive = _draw_round(setup, colors, draw, tile, column, line, reference, row)
        if not compact:
            row[FineRasterEvent.SHADE_ROUNDS] += alive > 0
            row[FineRasterEvent.SHADE_LANES] += alive
            continue
        row[_COMPACT_ROUNDS] += alive > 0
        row[_COMPACT_LANES] += alive
        for lane in range(alive):
            waiting[pending + lane] = tile.mask[lane]
        pending += alive
        if pending >= WARP:
            _shade_round(setup, draw, tile, waiting, WARP, row)
            pending -= WARP
            for lane in range(pending):
                waiting[lane] = waiting[WARP + lane]
    if pending > 0:
        _shade_round(setup, draw, tile, waiting, pending, row)


@kernel(lent=True)
def _shade_round(setup: Setup, draw: Draw, tile: Tile, waiting: Any, lanes: int, row: Any) -> None:
    """Count a round of compacted fragments, whose records are read once more."""
    row[FineRasterEvent.SHADE_ROUNDS] += 1
    row[FineRasterEvent.SHADE_LANES] += lanes
    count_reads(setup, draw, waiting, tile.addresses, lanes, RECORD_PARTS, row)


@kernel(lent=True)
def _draw_round(
    setup: Setup, colors: Any, draw: Draw, tile: Tile, column: int, line: int, reference: int, row: Any
) -> Any:
    """Test and write up to 32 fragments in order; returns how many survive, their slots in ``tile.mask``."""
    state, n, kept, alive, writes, longest = tile.state, 0, 0, 0, 0, 0
    row[FineRasterEvent.TAG_LANES] += min(state[TAIL] - state[HEAD], WARP)
    remember_depths(tile)
    while n < WARP and state[HEAD] < state[TAIL]:
        slot = tile.slots[state[HEAD]]
        record, mask = np.int64(setup.records[slot]), lowest_bits(tile.masks[state[HEAD]], WARP - n)
        tile.masks[state[HEAD]] ^= mask
        state[HEAD] += tile.masks[state[HEAD]] == np.uint64(0)
        plane, opaque = setup.planes[record], np.uint64(0)
        while mask != np.uint64(0):
            p = lowest_bit(mask)
            bit = mask & (~mask + np.uint64(1))
            mask ^= bit
            x, y = column + 7 - (p & 7), line + (p >> 3)
            depth = (np.int64(plane[0]) * x + np.int64(plane[1]) * y + np.int64(plane[2])) & _LOW
            tile.slot[n] = slot
            n += 1
            if depth >= tile.before[p]:
                continue
            tile.pixel[kept] = slot
            kept += 1
            if (shade(setup.planes, record, colors, x, y, -1, draw) >> 24) & 255 < reference:
                continue
            tile.mask[alive] = slot
            alive += 1
            opaque |= bit
        _, written = draw_nearer(draw, tile, plane, record, opaque, column, line, None, np.uint64(0))
        writes += popcount(written)
        longest = add_hits(tile.more, longest, written)
    state[FRAGMENTS] -= n
    _count_round(setup, draw, tile, n, kept, alive, row)
    if alive > 0:
        row[FineRasterEvent.ROP_STEPS] += longest
        row[FineRasterEvent.ROP_LANES] += writes
        row[FineRasterEvent.BLEND_LANES] += alive
        row[FineRasterEvent.BLEND_ROUND_LANES] += alive * longest
    return alive


@kernel(lent=True)
def _count_round(setup: Setup, draw: Draw, tile: Tile, n: int, kept: int, alive: int, row: Any) -> None:
    """Count a round of n fragments, of which ``kept`` pass the depth test and ``alive`` the alpha test."""
    count_reads(setup, draw, tile.slot, tile.addresses, n, 1, row)
    row[FineRasterEvent.TAG_WARPS] += 1
    row[FineRasterEvent.FRAGMENT_ROUNDS] += 1
    row[FineRasterEvent.FRAGMENT_LANES] += n
    row[FineRasterEvent.Z_KILLS] += n - kept
    row[FineRasterEvent.SAMPLE_HITS] += n
    if kept > 0:
        count_reads(setup, draw, tile.pixel, tile.addresses, kept, RECORD_PARTS, row)
        row[_ALPHA_ROUNDS] += 1
        row[_ALPHA_LANES] += kept
        row[_DISCARDS] += kept - alive


def alpha_test(
    setup: Setup,
    tile_starts: NDArray[np.int64],
    tile_entries: NDArray[np.int32],
    active_tiles: NDArray[np.int32],
    width: int,
    height: int,
    simt: Simt,
    *,
    reference: float,
    compact: bool,
    colors: NDArray[np.float32],
) -> StageResult[FrameBuffers]:
    """Draw the queued triangles of all active tiles, cleared, with a depth test and an alpha test.

    Parameters
    ----------
    setup, tile_starts, tile_entries, active_tiles, width, height, simt, colors
        As fine raster takes them; release 1.1, one sample a pixel.
    reference : float
        Fragments whose alpha, in 8 bits, is below are discarded; 0 to 1.
    compact : bool
        Gather survivors in rounds of 32 before they are shaded.

    Returns
    -------
    outputs : FrameBuffers
    works : one, a row an active tile
    """
    draw = draw_of(width, height, simt, release="1.1", mode="depth")
    buffers = new_buffers(width, height)
    lists = active_tiles, tile_starts, tile_entries
    work = fine_work(
        _drawn(lists, setup, colors, draw, round(255 * reference), compact, buffers), setup, tile_entries, width,
        height, simt, release="1.1", samples=1, mode="depth compacted" if compact else "depth tested",
        words=QUEUE_WORDS if compact else 1,
    )  # fmt: skip
    return StageResult(buffers, (replace(work, events=AlphaEvent),))


def _drawn(
    lists: tuple[NDArray[Any], ...], setup: Setup, colors: NDArray[np.float32], draw: Draw, reference: int,
    compact: bool, buffers: FrameBuffers,
) -> NDArray[np.int64]:  # fmt: skip
    """Draw all active tiles; the events of each."""
    table = np.zeros((len(lists[0]), len(AlphaEvent)), np.int64)
    with np.errstate(all="ignore"):
        for_parts(
            _draw_part, parts_of(len(table), WARP), *lists, setup, colors, draw, reference, compact, buffers, table
        )
    return table
