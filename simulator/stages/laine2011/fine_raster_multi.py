"""Fine raster at 2, 4 or 8 samples a pixel (cudaraster 1.1): a fragment is a pixel, each sample is tested by itself.

The tile in shared memory holds the farthest depth of each pixel; depths and colours of samples stay in memory.
"""

from typing import Any

import numpy as np

from tilestamp.models.bits import lowest_bit, popcount
from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.laine2011.coverage import SAMPLE_COLUMN, centroid_sample, sample_mask
from tilestamp.simulator.stages.laine2011.fine_raster_queue import (
    END,
    FRAGMENTS,
    HEAD,
    NEXT,
    PIXELS,
    TAIL,
    UPDATE,
    WARP,
    ZMAX,
    Draw,
    FineRasterEvent,
    Tile,
    refill,
    update_zmax,
)
from tilestamp.simulator.stages.laine2011.fine_raster_shade import blend_over, shade
from tilestamp.simulator.stages.laine2011.fine_raster_single import count_reads
from tilestamp.simulator.stages.laine2011.subtriangle import DEPTH_MAX
from tilestamp.simulator.stages.laine2011.triangle_setup_paths import Setup

_LOW = 0xFFFFFFFF


@kernel(lent=True)
def _take(tile: Tile) -> Any:
    """Move up to 32 fragments in order from the queue to the lanes; returns how many."""
    state = tile.state
    n = 0
    while n < WARP and state[HEAD] < state[TAIL]:
        mask = tile.masks[state[HEAD]]
        slot = tile.slots[state[HEAD]]
        while n < WARP and mask != np.uint64(0):
            tile.pixel[n] = lowest_bit(mask)
            tile.slot[n] = slot
            mask &= mask - np.uint64(1)
            n += 1
        tile.masks[state[HEAD]] = mask
        if mask == np.uint64(0):
            state[HEAD] += 1
    state[FRAGMENTS] -= n
    return n


@kernel(lent=True)
def _hidden(record: Any, misc: Any, zmax: Any, x: int, y: int, s: int) -> Any:
    """Whether a fragment lies behind all samples of its pixel, by the nearest depth that it could have there."""
    zx, zy, zb, slope = np.int64(record[0]), np.int64(record[1]), np.int64(record[2]), np.int64(record[3])
    nearest = (((zx + zy) << (s - 1)) + ((zx * x + zy * y) << s) + zb - slope) & _LOW
    return (nearest >= zmax and nearest < ((nearest + 2 * slope) & _LOW)) or (np.int64(misc) & 0xFFFFF000) >= zmax


@kernel(lent=True)
def _cull_fragments(setup: Setup, draw: Draw, tile: Tile, n: int, left: int, bottom: int, row: Any) -> Any:
    """Depth and sample tests of n fragments; survivors move to the front, their samples to ``tile.mask``."""
    kept = killed = hits = 0
    s = draw.log_samples
    for lane in range(n):
        p, slot = tile.pixel[lane], tile.slot[lane]
        i, j = 7 - (p & 7), p >> 3
        x, y = ((left + draw.half_width) >> 4) + i, ((bottom + draw.half_height) >> 4) + j
        hidden = draw.depth and _hidden(setup.planes[setup.records[slot]], setup.misc[slot], tile.zmax[p], x, y, s)
        if hidden and row is None:
            continue
        mask = sample_mask(setup.headers[slot], left + 16 * i + 8, bottom + 16 * j + 8, s)
        hits += popcount(np.uint64(mask))
        killed += 1 if hidden else 0
        if hidden or mask == 0:
            continue
        tile.pixel[kept], tile.slot[kept], tile.mask[kept] = p, slot, mask
        kept += 1
    if row is not None:
        row[FineRasterEvent.FRAGMENT_ROUNDS] += 1
        row[FineRasterEvent.FRAGMENT_LANES] += n
        row[FineRasterEvent.Z_KILLS] += killed
        row[FineRasterEvent.MSAA_KILLS] += n - kept - killed
        row[FineRasterEvent.SAMPLE_TESTS] += n << s
        row[FineRasterEvent.SAMPLE_HITS] += hits
    return kept


@kernel(lent=True)
def _write_sample(setup: Setup, draw: Draw, tile: Tile, sample: int, lane: int, color: Any, x: int, y: int) -> Any:
    """Depth test and write of one sample of one survivor; True where it was written."""
    p, slot = tile.pixel[lane], tile.slot[lane]
    at, s = p + PIXELS * sample, draw.log_samples
    if draw.depth:
        record = setup.planes[setup.records[slot]]
        sx, sy = (x << s) + SAMPLE_COLUMN[s, sample], (y << s) + sample
        depth = (np.int64(record[0]) * sx + np.int64(record[1]) * sy + np.int64(record[2])) & _LOW
        if depth >= tile.depth[at]:
            return False
        tile.depth[at] = depth
    tile.owner[at] = setup.records[slot]
    if draw.write_color:
        tile.color[at] = blend_over(color, tile.color[at]) if draw.blend else color
    return True


@kernel(lent=True)
def _rop(
    setup: Setup, draw: Draw, tile: Tile, kept: int, sample: int, colors_of_lanes: Any, column: int, line: int
) -> Any:
    """One sample of all survivors, in order; returns the writes, and the most that one pixel had."""
    writes = longest = 0
    for lane in range(kept):
        p = tile.pixel[lane]
        if not (tile.mask[lane] >> sample) & 1:
            continue
        x, y = column + 7 - (p & 7), line + (p >> 3)
        if _write_sample(setup, draw, tile, sample, lane, colors_of_lanes[lane], x, y):
            tile.chain[p] += 1
            writes += 1
            longest = max(longest, tile.chain[p])
    for lane in range(kept):
        tile.chain[tile.pixel[lane]] = 0
    return writes, longest if draw.depth or draw.blend else min(longest, 1)


@kernel(lent=True)
def _lower_zmax(tile: Tile, kept: int, samples: int) -> None:
    """Take the farthest sample of each written pixel anew."""
    for lane in range(kept):
        p = tile.pixel[lane]
        farthest = np.int64(0)
        for sample in range(samples):
            farthest = max(farthest, tile.depth[p + PIXELS * sample])
        if farthest < tile.zmax[p]:
            if tile.zmax[p] == tile.state[ZMAX]:
                tile.state[UPDATE] = 1
            tile.zmax[p] = farthest


@kernel(lent=True)
def _shade_survivors(
    setup: Setup, colors: Any, draw: Draw, tile: Tile, kept: int, shaded: Any, column: int, line: int
) -> None:
    for lane in range(kept):
        p = tile.pixel[lane]
        x, y = column + 7 - (p & 7), line + (p >> 3)
        centroid = centroid_sample(tile.mask[lane], draw.log_samples)
        shaded[lane] = shade(setup.planes, setup.records[tile.slot[lane]], colors, x, y, centroid, draw)


@kernel(lent=True)
def _count_sample(draw: Draw, tile: Tile, kept: int, sample: int, longest: Any, row: Any) -> None:
    """Count the surface reads and writes of one sample: a row of the tile is one 32-byte segment."""
    read = written = 0
    for lane in range(kept):
        bit = 1 << (tile.pixel[lane] >> 3)
        read |= bit
        written |= bit if (tile.mask[lane] >> sample) & 1 else 0
    rows = popcount(np.uint64(read)) if draw.depth else 0
    rows += longest * popcount(np.uint64(written)) if draw.blend else 0
    row[FineRasterEvent.LOAD_TRANSACTIONS] += rows
    row[FineRasterEvent.LOAD_BYTES] += 32 * rows
    rows = longest * popcount(np.uint64(written)) if draw.write_color else 0
    rows += popcount(np.uint64(written)) if draw.depth and longest > 0 else 0
    row[FineRasterEvent.STORE_TRANSACTIONS] += rows
    row[FineRasterEvent.STORE_BYTES] += 32 * rows


@kernel(lent=True)
def draw_tile_multi(
    setup: Setup, entries: Any, colors: Any, draw: Draw, tile: Tile, left: int, bottom: int, row: Any
) -> None:
    """Draw the list of one tile into ``tile``; ``row`` holds its counters or is None."""
    state, shaded, samples = tile.state, tile.addresses, 1 << draw.log_samples
    column, line = (left + draw.half_width) >> 4, (bottom + draw.half_height) >> 4
    tile.zmax[:] = DEPTH_MAX
    while True:
        if state[FRAGMENTS] < 32 and state[NEXT] < state[END]:
            if draw.depth:
                update_zmax(tile.zmax, state, row)
            refill(setup, entries, draw, tile, left, bottom, row)
        if state[FRAGMENTS] == 0:
            return
        n = _take(tile)
        if row is not None and draw.depth:
            count_reads(setup, draw, tile.slot, tile.addresses, n, 1, row)
        kept = _cull_fragments(setup, draw, tile, n, left, bottom, row)
        if row is not None and kept > 0:
            row[FineRasterEvent.SHADE_ROUNDS] += 1
            row[FineRasterEvent.SHADE_LANES] += kept
            count_reads(setup, draw, tile.slot, tile.addresses, kept, 3 if draw.interpolate else 1, row)
        if draw.write_color:
            _shade_survivors(setup, colors, draw, tile, kept, shaded, column, line)
        for sample in range(samples):
            writes, longest = _rop(setup, draw, tile, kept, sample, shaded, column, line)
            if row is not None and writes > 0:
                row[FineRasterEvent.ROP_STEPS] += longest
                row[FineRasterEvent.ROP_LANES] += writes
                row[FineRasterEvent.BLEND_LANES] += kept
                row[FineRasterEvent.BLEND_ROUND_LANES] += kept * longest
            if row is not None and kept > 0:
                _count_sample(draw, tile, kept, sample, longest, row)
        if draw.depth:
            _lower_zmax(tile, kept, samples)
