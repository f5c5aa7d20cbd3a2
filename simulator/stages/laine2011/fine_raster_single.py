"""Fine raster at one sample a pixel: rounds of 32 fragments, depth test, ROP in input order (cudaraster, section 6)."""

from typing import Any

import numpy as np

from tilestamp.models.bits import lowest_bit, lowest_bits, popcount
from tilestamp.models.coalescing import SECTOR_BYTES, WARP_SECTORS, transactions, transactions_of_runs
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
from tilestamp.simulator.stages.laine2011.lanes import LANES, below, write
from tilestamp.simulator.stages.laine2011.triangle_setup_paths import Setup
from tilestamp.simulator.stages.prefetch import prefetch

_ROW = np.uint64(0xFF)  # of a mask: eight pixels
_WORD_BYTES = 4


@kernel(lent=True)
def count_reads(setup: Setup, draw: Draw, slots: Any, addresses: Any, n: int, parts: int, row: Any) -> None:
    """Count reads of ``parts`` parts of 16 bytes of the records of n lanes: each touches as many segments."""
    for lane in range(n):
        addresses[lane] = slots[lane] * setup.planes.shape[1] * _WORD_BYTES
    count, size = transactions(addresses, n, 16, draw.coalescing)
    row[FineRasterEvent.LOAD_TRANSACTIONS] += parts * count
    row[FineRasterEvent.LOAD_BYTES] += parts * size


@kernel(lent=True)
def draw_nearer(
    draw: Draw, tile: Tile, plane: Any, record: int, mask: Any, column: int, line: int, row: Any, hit: Any
) -> Any:
    """Depth test and write of fragments of one triangle, after all before them.

    ``hit`` has the pixels that the round has written, or more: those alone have another depth than before it.

    Returns
    -------
    passed, written : uint64
        Fragments nearer than their pixel before the round, where it is counted; and those that were written.
    """
    zx, zy = np.int64(plane[0]), np.int64(plane[1])
    corner = zx * (column + LANES - 1) + zy * line + np.int64(plane[2])
    passed, written, covered, farthest = np.uint64(0), np.uint64(0), np.uint64(0), tile.state[ZMAX]
    while mask != np.uint64(0):
        at = lowest_bit(mask) & (PIXELS - LANES)  # of a row of pixels
        shift, first = np.uint64(at), corner + zy * (at >> 3)
        bits = (mask >> shift) & _ROW
        mask &= ~(_ROW << shift)
        if row is not None and (draw.peel or bits & (hit >> shift) != np.uint64(0)):
            passed |= (bits & below(first, -zx, tile.before, at, draw.later_wins)) << shift
        bits &= below(first, -zx, tile.depth, at, draw.later_wins)
        if draw.peel:
            bits &= ~below(first, -zx, tile.zmax, at, True)
        covered |= bits & below(farthest, 0, tile.depth, at, True) & ~below(farthest, 0, tile.depth, at, False)
        write(first, -zx, tile.depth, at, bits)
        write(record, 0, tile.owner, at, bits)
        written |= bits << shift
    tile.state[UPDATE] |= covered != np.uint64(0)
    return passed | written, written


@kernel(lent=True)
def _draw_over(
    setup: Setup, colors: Any, draw: Draw, tile: Tile, record: int, mask: Any, column: int, line: int
) -> None:
    """Write, or blend, fragments of one triangle without depth test."""
    while mask != np.uint64(0):
        p = lowest_bit(mask)
        mask &= mask - np.uint64(1)
        tile.owner[p] = record
        if draw.blend:
            source = shade(setup.planes, record, colors, column + 7 - (p & 7), line + (p >> 3), -1, draw)
            tile.color[p] = blend_over(source, np.int64(tile.color[p]))


@kernel(lent=True)
def remember_depths(tile: Tile) -> None:
    """Keep the depths before a round."""
    for p in range(PIXELS):
        tile.before[p] = tile.depth[p]


@kernel(lent=True)
def add_hits(more: Any, longest: int, bits: Any) -> Any:
    """Count one more hit of some pixels in the unary numbers ``more``; returns the most hits that a pixel has."""
    i = 0
    while bits != np.uint64(0):
        if i == longest:
            more[i], longest = np.uint64(0), longest + 1
        again = more[i] & bits
        more[i] |= bits
        bits, i = again, i + 1
    return longest


@kernel(lent=True)
def _draw_round(setup: Setup, colors: Any, draw: Draw, tile: Tile, column: int, line: int, row: Any) -> None:
    """Take up to 32 fragments in order.

    The original first tests all against the depths before the round, and then those that pass against each other; one
    test in order writes the same.
    """
    state, n, kept, writes, longest = tile.state, 0, 0, 0, 0
    starts, kept_starts, record_bytes = np.uint64(0), np.uint64(0), setup.planes.shape[1] * _WORD_BYTES
    hit = np.uint64(0)
    head, tail = state[HEAD], state[TAIL]
    queued = min(tail - head, WARP)
    if row is not None and draw.depth:
        remember_depths(tile)
    while n < WARP and head < tail:
        slot, record = tile.slots[head], tile.records[head]
        mask = lowest_bits(tile.masks[head], WARP - n)
        tile.masks[head] ^= mask
        head += tile.masks[head] == np.uint64(0)
        passed = written = mask
        if draw.depth:
            if draw.shade_late:
                for i in range(13, 16):
                    prefetch(colors, np.int64(setup.planes[record, i]))
            passed, written = draw_nearer(draw, tile, setup.planes[record], record, mask, column, line, row, hit)
        else:
            _draw_over(setup, colors, draw, tile, record, mask, column, line)
        if row is not None:
            starts |= np.uint64(1) << np.uint64(n)
            tile.slot[n] = slot * record_bytes
            if passed != np.uint64(0):
                kept_starts |= np.uint64(1) << np.uint64(kept)
                tile.pixel[kept] = slot * record_bytes
                kept += popcount(passed)
            writes += popcount(written)
            hits = passed if draw.later_wins else written
            again, hit = hit & hits, hit | hits
            if again != np.uint64(0):
                longest = add_hits(tile.more, longest, again)
        n += popcount(mask)
    state[FRAGMENTS] -= n
    state[HEAD] = head
    if row is not None:
        if draw.depth:
            _count_reads(draw, tile.slot, starts, n, record_bytes, 1, row)
        row[FineRasterEvent.TAG_LANES] += queued
        _count_round(draw, n, kept, writes, longest + (hit != np.uint64(0)), row)
        if kept > 0 and not draw.later_wins:
            _count_reads(draw, tile.pixel, kept_starts, kept, record_bytes, 3 if draw.interpolate else 1, row)


@kernel(lent=True)
def _count_reads(
    draw: Draw, addresses: Any, starts: Any, lanes: int, record_bytes: int, parts: int, row: Any
) -> None:  # fmt: skip
    """Count reads of ``parts`` parts of 16 bytes of records, at an address for each run of lanes."""
    if draw.coalescing == WARP_SECTORS and record_bytes >= SECTOR_BYTES:  # no two triangles share a sector
        count = popcount(starts)
        size = count * SECTOR_BYTES
    else:
        count, size = transactions_of_runs(addresses, starts, lanes, 16, draw.coalescing)
    row[FineRasterEvent.LOAD_TRANSACTIONS] += parts * count
    row[FineRasterEvent.LOAD_BYTES] += parts * size


@kernel(lent=True)
def _count_round(draw: Draw, n: int, kept: int, writes: int, longest: int, row: Any) -> None:
    """Count a round of n fragments but for its reads.

    ``longest`` is the most writes of a pixel, or, where later ones win by atomics, the most fragments that try.
    """
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
