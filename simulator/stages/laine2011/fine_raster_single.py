"""Fine raster at one sample a pixel: rounds of 32 fragments, depth test, ROP in input order (cudaraster, section 6)."""

from typing import Any

import numpy as np

from tilestamp.models.bits import lowest_bit
from tilestamp.models.coalescing import transactions
from tilestamp.models.kernel import kernel
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
from tilestamp.simulator.stages.laine2011.triangle_setup_paths import Setup

_LOW = 0xFFFFFFFF
_DATA_BYTES = 4  # a word of the data record


@kernel(lent=True)
def count_reads(setup: Setup, draw: Draw, slots: Any, addresses: Any, n: int, parts: int, row: Any) -> None:
    """Count reads of ``parts`` parts of 16 bytes of the records of n lanes: each touches as many segments."""
    for lane in range(n):
        addresses[lane] = slots[lane] * setup.planes.shape[1] * _DATA_BYTES
    count, size = transactions(addresses, n, 16, draw.coalescing)
    row[FineRasterEvent.LOAD_TRANSACTIONS] += parts * count
    row[FineRasterEvent.LOAD_BYTES] += parts * size


@kernel(lent=True)
def draw_fragment(
    setup: Setup, colors: Any, draw: Draw, tile: Tile, record: int, p: int, depth: int, x: int, y: int
) -> Any:
    """Depth test and write of one fragment, after all before it; True where it is written."""
    if draw.depth:
        if draw.peel and depth <= tile.zmax[p]:
            return False
        old = tile.depth[p]
        if depth >= old + draw.later_wins:
            return False
        if old == tile.state[ZMAX]:
            tile.state[UPDATE] = 1
        tile.depth[p] = depth
    tile.owner[p] = record
    if draw.blend:
        tile.color[p] = blend_over(shade(setup.planes, record, colors, x, y, -1, draw), tile.color[p])
    return True


@kernel(lent=True)
def _draw_round(setup: Setup, colors: Any, draw: Draw, tile: Tile, column: int, line: int, row: Any) -> None:
    """Take up to 32 fragments in order.

    The original first tests all against the depths before the round, and then those that pass against each other; one
    test in order writes the same.
    """
    state, n, kept, writes, longest, hit = tile.state, 0, 0, 0, 0, np.uint64(0)
    head, tail, planes = state[HEAD], state[TAIL], setup.planes
    queued = min(tail - head, WARP)
    while n < WARP and head < tail:
        slot, mask = tile.slots[head], tile.masks[head]
        record = np.int64(setup.records[slot])
        zx, zy, zb = np.int64(planes[record, 0]), np.int64(planes[record, 1]), np.int64(planes[record, 2])
        while n < WARP and mask != np.uint64(0):
            p = lowest_bit(mask)
            bit = mask & (~mask + np.uint64(1))
            mask ^= bit
            x, y = column + 7 - (p & 7), line + (p >> 3)
            depth = (zx * x + zy * y + zb) & _LOW
            if row is not None:
                tile.slot[n] = slot
                if hit & bit == np.uint64(0):
                    tile.before[p], tile.chain[p] = tile.depth[p], 0
                    hit |= bit
                passes = not draw.depth or depth < tile.before[p] + draw.later_wins
                tile.pixel[kept] = slot
                kept += passes
            n += 1
            written = draw_fragment(setup, colors, draw, tile, record, p, depth, x, y)
            if row is not None:
                writes += written
                tile.chain[p] += passes if draw.later_wins else written
                longest = max(longest, tile.chain[p])
        tile.masks[head] = mask
        head += mask == np.uint64(0)
    state[FRAGMENTS] -= n
    state[HEAD] = head
    if row is not None:
        row[FineRasterEvent.TAG_LANES] += queued
        _count_round(setup, draw, tile, n, kept, writes, longest, row)


@kernel(lent=True)
def _count_round(setup: Setup, draw: Draw, tile: Tile, n: int, kept: int, writes: int, longest: Any, row: Any) -> None:
    """Count a round of n fragments; ``tile.slot`` holds their slots, ``tile.pixel`` those of the ``kept``.

    ``longest`` is the most writes of a pixel, or, where later ones win by atomics, the most fragments that try.
    """
    if draw.depth:
        count_reads(setup, draw, tile.slot, tile.addresses, n, 1, row)
    row[FineRasterEvent.TAG_WARPS] += 1
    row[FineRasterEvent.FRAGMENT_ROUNDS] += 1
    row[FineRasterEvent.FRAGMENT_LANES] += n
    row[FineRasterEvent.Z_KILLS] += n - kept
    row[FineRasterEvent.SAMPLE_HITS] += n
    if kept == 0:
        return
    steps = longest if draw.depth or draw.blend else min(longest, 1)
    if draw.later_wins:
        steps = min(writes, 1)  # one write each; the last lane wins
        row[FineRasterEvent.SHARED_ATOMIC] += 2
        row[FineRasterEvent.BANK_REPLAYS] += 2 * (longest - 1)
    else:
        count_reads(setup, draw, tile.pixel, tile.addresses, kept, 3 if draw.interpolate else 1, row)
    row[FineRasterEvent.SHADE_ROUNDS] += 1
    row[FineRasterEvent.SHADE_LANES] += kept
    row[FineRasterEvent.ROP_STEPS] += steps
    row[FineRasterEvent.ROP_LANES] += writes
    row[FineRasterEvent.BLEND_LANES] += kept
    row[FineRasterEvent.BLEND_ROUND_LANES] += kept * steps


@kernel(lent=True)
def draw_tile_single(
    setup: Setup, entries: Any, colors: Any, draw: Draw, tile: Tile, left: int, bottom: int, row: Any
) -> None:
    """Draw the list of one tile into ``tile``; ``row`` holds its counters or is None."""
    state = tile.state
    column, line = (left + draw.half_width) >> 4, (bottom + draw.half_height) >> 4
    for p in range(PIXELS):
        state[UPDATE] |= tile.depth[p] < state[ZMAX]
    while True:
        if state[FRAGMENTS] < 32 and state[NEXT] < state[END]:
            if draw.depth:
                update_zmax(tile.depth, state, row)
            refill(setup, entries, draw, tile, left, bottom, row)
        if state[FRAGMENTS] == 0:
            return
        _draw_round(setup, colors, draw, tile, column, line, row)
