"""Fine raster at one sample a pixel: rounds of 32 fragments, depth test, ROP in input order (cudaraster, section 6)."""

from typing import Any

import numpy as np

from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.laine2011.fine_raster_queue import (
    END,
    FRAGMENTS,
    HEAD,
    NEXT,
    PIXELS,
    TAIL,
    UPDATE,
    ZMAX,
    Draw,
    FineRasterEvent,
    Tile,
    count_gather,
    refill,
    take,
    update_zmax,
)
from tilestamp.simulator.stages.laine2011.fine_raster_shade import blend_over, shade
from tilestamp.simulator.stages.laine2011.triangle_setup_paths import Setup

_LOW = 0xFFFFFFFF
_DATA_BYTES = 4  # a word of the data record


@kernel
def _write(setup: Setup, colors: Any, draw: Draw, tile: Tile, lane: int, x: int, y: int) -> None:
    """Put one fragment's colour and triangle into the tile."""
    p, slot = tile.pixel[lane], tile.slot[lane]
    tile.ids[p] = setup.inputs[slot]
    if draw.later_wins or not draw.write_color:
        return
    color = shade(setup.planes[slot], colors, x, y, -1, draw)
    tile.color[p] = blend_over(color, tile.color[p]) if draw.blend else color


@kernel
def _depth_test(setup: Setup, draw: Draw, tile: Tile, n: int, column: int, line: int) -> Any:
    """Test n fragments against the depths before the round; survivors move to the front, depths to ``tile.mask``."""
    kept = 0
    state = tile.state
    for lane in range(n):
        p, slot = tile.pixel[lane], tile.slot[lane]
        record = setup.planes[slot]
        x, y = column + 7 - (p & 7), line + (p >> 3)
        depth = (np.int64(record[0]) * x + np.int64(record[1]) * y + np.int64(record[2])) & _LOW
        old = tile.depth[p]
        if depth > old or (depth == old and not draw.later_wins):
            continue
        if old == state[ZMAX]:
            state[UPDATE] = 1
        tile.pixel[kept], tile.slot[kept], tile.mask[kept] = p, slot, depth
        kept += 1
    return kept


@kernel
def _rop(setup: Setup, colors: Any, draw: Draw, tile: Tile, kept: int, column: int, line: int) -> Any:
    """Write survivors in order; returns the writes, and the most that one pixel had."""
    writes = longest = 0
    for lane in range(kept):
        p = tile.pixel[lane]
        if draw.depth:
            depth, old = tile.mask[lane], tile.depth[p]
            if depth > old or (depth == old and not draw.later_wins):
                continue
            tile.depth[p] = depth
        _write(setup, colors, draw, tile, lane, column + 7 - (p & 7), line + (p >> 3))
        tile.chain[p] += 1
        writes += 1
        longest = max(longest, tile.chain[p])
    for lane in range(kept):
        tile.chain[tile.pixel[lane]] = 0
    if draw.later_wins or not (draw.depth or draw.blend):
        longest = min(longest, 1)  # one write each; the last lane wins
    return writes, longest


@kernel
def _conflicts(tile: Tile, kept: int) -> Any:
    """Most survivors at one pixel, less one: the passes that a shared atomic takes again."""
    most = 0
    for lane in range(kept):
        tile.chain[tile.pixel[lane]] += 1
        most = max(most, tile.chain[tile.pixel[lane]])
    for lane in range(kept):
        tile.chain[tile.pixel[lane]] = 0
    return max(most - 1, 0)


@kernel
def count_reads(setup: Setup, draw: Draw, tile: Tile, n: int, words: int, row: Any) -> None:
    """Count 16-byte reads of data records by n lanes, one for each of the ``words`` (bit k: bytes 16 * k on)."""
    for part in range(4):
        if (words >> part) & 1:
            for lane in range(n):
                tile.addresses[lane] = tile.slot[lane] * setup.planes.shape[1] * _DATA_BYTES + 16 * part
            count_gather(tile, n, 16, draw, row)


@kernel
def _count_round(setup: Setup, draw: Draw, tile: Tile, n: int, kept: int, writes: int, longest: Any, row: Any) -> None:
    row[FineRasterEvent.FRAGMENT_ROUNDS] += 1
    row[FineRasterEvent.FRAGMENT_LANES] += n
    row[FineRasterEvent.Z_KILLS] += n - kept
    row[FineRasterEvent.SAMPLE_HITS] += n
    if kept == 0:
        return
    row[FineRasterEvent.SHADE_ROUNDS] += 1
    row[FineRasterEvent.SHADE_LANES] += kept
    row[FineRasterEvent.ROP_STEPS] += longest
    row[FineRasterEvent.ROP_LANES] += writes
    row[FineRasterEvent.BLEND_LANES] += kept
    row[FineRasterEvent.BLEND_ROUND_LANES] += kept * longest
    if draw.later_wins:
        row[FineRasterEvent.SHARED_ATOMIC] += 2
        row[FineRasterEvent.BANK_REPLAYS] += 2 * _conflicts(tile, kept)
    else:
        count_reads(setup, draw, tile, kept, np.int64(0b1110 if draw.interpolate else 0b1000), row)


@kernel
def draw_tile_single(
    setup: Setup, entries: Any, colors: Any, draw: Draw, tile: Tile, left: int, bottom: int, row: Any
) -> None:
    """Draw the list of one tile into ``tile``; ``row`` holds its counters or is None."""
    state = tile.state
    column, line = (left + draw.half_width) >> 4, (bottom + draw.half_height) >> 4
    state[UPDATE] = 1 if tile.depth[:PIXELS].min() < state[ZMAX] else 0
    while True:
        if state[FRAGMENTS] < 32 and state[NEXT] < state[END]:
            if draw.depth:
                update_zmax(tile.depth, state, row)
            refill(setup, entries, draw, tile, left, bottom, row)
        if state[FRAGMENTS] == 0:
            return
        queued = min(state[TAIL] - state[HEAD], 32)
        n = take(tile)
        if row is not None and draw.depth:
            count_reads(setup, draw, tile, n, np.int64(0b0001), row)
        kept = _depth_test(setup, draw, tile, n, column, line) if draw.depth else n
        writes, longest = _rop(setup, colors, draw, tile, kept, column, line)
        if row is not None:
            row[FineRasterEvent.TAG_WARPS] += 1
            row[FineRasterEvent.TAG_LANES] += queued
            _count_round(setup, draw, tile, n, kept, writes, longest, row)
