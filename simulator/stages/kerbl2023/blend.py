"""Blend: one block a tile walks along its list from near to far; a thread has a pixel, or several.

In rounds, as many entries as the block has threads are loaded to shared memory; then each thread evaluates each at its
pixel, blends it where alpha is 1/255 or more, and is done where the transmittance would fall below 0.0001. The block
leaves before a round in which all are done. Colours are not in shared memory: each blend reads them by the index.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.kerbl2023 import blend_walk as group
from tilestamp.simulator.stages.kerbl2023.blend_block import (
    CONIC_BYTES,
    INDEX_BYTES,
    POSITION_BYTES,
    Block,
    Room,
    block_of,
    count_rounds,
    gather_sectors,
)
from tilestamp.simulator.stages.kerbl2023.blend_pixels import COLOURS, PLANES, Pixels, new_pixels, place, store
from tilestamp.simulator.stages.kerbl2023.blend_step import (
    ENTRY,
    ENTRY_RED,
    GX,
    LANES,
    LEAST_ENTRY_POWER,
    ROWS,
    A,
)
from tilestamp.simulator.stages.kerbl2023.blend_walk import (
    BOX,
    LEAST_POWER,
    PER_ROUND,
    REACH,
    TOTALS,
    reach_box,
    visible_reach,
    walk,
)
from tilestamp.simulator.stages.kerbl2023.events import BlendEvent
from tilestamp.simulator.stages.kerbl2023.project import Projected
from tilestamp.simulator.stages.kerbl2023.tiles import Tiles
from tilestamp.simulator.work import Work

SHARED_BYTES = INDEX_BYTES + POSITION_BYTES + CONIC_BYTES  # a thread
BOX_BYTES = 8  # first and last column and row, of 16 bits
_PART, _PART_GAUSSIANS = 8, 1 << 14  # tiles and Gaussians of one call, at least
_E = BlendEvent


@kernel(lent=True)
def load_entries(first: int, count: int, listed: Any, out: Projected, colours: Any, reaches: Any, room: Room) -> None:
    """Gather the entries of a tile."""
    for k in range(count):
        i = listed[first + k]
        load_entry(i, out, colours, reaches[i], room.entries[k], room.boxes[k])


@kernel(lent=True)
def load_entry(i: int, out: Projected, colours: Any, reach: Any, entry: Any, box: Any) -> None:
    """Gather one Gaussian, which may be seen as far as ``reach`` says."""
    entry[GX], entry[GX + 1], entry[LEAST_ENTRY_POWER] = out.positions[i, 0], out.positions[i, 1], reach[LEAST_POWER]
    for j in range(4):
        entry[A + j] = out.conics[i, j]
    for j in range(COLOURS):
        entry[ENTRY_RED + j] = colours[i, j]
    reach_box(out.positions[i, 0], out.positions[i, 1], reach, box)


@kernel(lent=True)
def _tile(
    tile: int, tiles: Tiles, block: Block, count: int, background: Any, room: Room, pixels: Pixels, row: Any
) -> None:  # fmt: skip
    rounds = (count + block.threads - 1) // block.threads
    room.rounds[:, :, :rounds] = 0
    room.totals[:] = 0
    room.marks[:count] = 0
    room.uses[:count] = 0
    lasts = room.state.view(np.int32)
    for warp in range(block.warps):
        bit = np.uint32(1) << np.uint32(warp)
        for slot in range(block.pixels):
            begin = slot * block.threads + warp * block.warp
            end = min(begin + block.warp, (slot + 1) * block.threads)
            rectangle = place(tile, tiles, begin, end, room)
            totals = room.totals[warp, slot]
            walk(
                room.entries, room.boxes, count, room.state, lasts, room.alive, rectangle, block.threads,
                room.rounds[warp, slot], room.marks, room.uses, bit, totals, block.masked,
            )  # fmt: skip
            store(tile, tiles, begin, end, block.segment, background, room, pixels, row)
            if row is not None:
                row[_E.STEPS] += totals[group.TRIPS]
                row[_E.EVALUATIONS] += totals[group.EVALUATIONS]
                row[_E.EXP_STEPS] += totals[group.BOUNDED_STEPS]
                row[_E.EXP_LANES] += totals[group.EVALUATIONS] - totals[group.SKIPPED_POWER]
                row[_E.BLEND_STEPS] += totals[group.BLEND_STEPS]
                row[_E.BLENDED] += totals[group.BLENDED]
                row[_E.SKIPPED_POWER] += totals[group.SKIPPED_POWER]
                row[_E.STOPPED] += totals[group.STOPPED]


@kernel
def reach_all(part: int, parts: int, out: Projected, reaches: Any) -> None:
    """Find how far the Gaussians of a part may be seen."""
    for i in range(len(reaches) * part // parts, len(reaches) * (part + 1) // parts):
        if out.radii[i]:
            visible_reach(out.conics[i], reaches[i])


@kernel
def _blend(
    part: int, parts: int, starts: Any, listed: Any, out: Projected, colours: Any, reaches: Any,
    tiles: Tiles, block: Block, background: Any, pixels: Pixels, table: Any,
) -> None:  # fmt: skip
    """Blend a part of the tiles; row i of the table is that of tile i."""
    count = len(starts) - 1
    begin, end = count * part // parts, count * (part + 1) // parts
    longest = 1
    for tile in range(begin, end):
        longest = max(longest, starts[tile + 1] - starts[tile])
    lanes = block.parts * LANES
    room = Room(
        np.empty((longest, ENTRY), np.float32), np.empty((longest, BOX), np.int32), np.empty((ROWS, lanes), np.float32),
        np.empty(block.parts, np.uint32),
        np.empty((block.warps, block.pixels, longest // block.threads + 1, PER_ROUND), np.int64),
        np.empty((block.warps, block.pixels, TOTALS), np.int64),
        np.empty(longest, np.uint32), np.empty((longest, 2), np.int64),
        np.zeros((2, len(out.radii) * CONIC_BYTES // block.segment + 1 if table is not None else 1), np.int64),
    )  # fmt: skip
    for tile in range(begin, end):
        first, count = starts[tile], starts[tile + 1] - starts[tile]
        row = None if table is None else table[tile]
        load_entries(first, count, listed, out, colours, reaches, room)
        _tile(tile, tiles, block, count, background, room, pixels, row)
        if row is not None:
            row[_E.WARPS], row[_E.THREADS], row[_E.LIST], row[_E.BLOCKS] = block.warps, block.threads, count, 1
            count_rounds(count, block, room, row)
            pixels.uses[first : first + count] = room.uses[:count]
            row[_E.SKIPPED_ALPHA] = row[_E.EXP_LANES] - row[_E.BLENDED] - row[_E.STOPPED]
            row[_E.IDLE_LANES] = row[_E.STEPS] * block.warp - row[_E.EVALUATIONS]
            for size in range(0, row[_E.ENTRIES], block.threads):
                row[_E.GATHER_WARPS] += (min(block.threads, row[_E.ENTRIES] - size) + block.warp - 1) // block.warp
            gathers = gather_sectors(first, row[_E.ENTRIES], listed, block, room)
            once = block.warps + COLOURS * row[_E.PIXEL_WARPS]  # ends of the list, background
            row[_E.LOAD_TRANSACTIONS] = gathers + COLOURS * row[_E.BLEND_TRIPS] + once
            row[_E.LOAD_BYTES] = row[_E.LOAD_TRANSACTIONS] * block.segment
            row[_E.STORE_BYTES] = row[_E.STORE_TRANSACTIONS] * block.segment


def blend(
    starts: NDArray[np.int64],
    listed: NDArray[np.uint32],
    projected: Projected,
    colours: NDArray[np.float32],
    tiles: Tiles,
    simt: Simt,
    *,
    threads: int,
    mask: bool = False,
    background: tuple[float, float, float] = (0.0, 0.0, 0.0),
    counting: bool = True,
) -> StageResult[Pixels]:
    """Blend the lists of all tiles.

    Parameters
    ----------
    starts : ndarray, (tiles + 1,), int64
        Tile i has the entries ``listed[starts[i] : starts[i + 1]]``.
    listed : ndarray, (P,), uint32
        Gaussians, from near to far in each tile.
    projected : Projected
    colours : ndarray, (N, 3), float32
    tiles : Tiles
    simt : Simt
    threads : int
        Of a block: a divisor of the pixels of a tile.
    mask : bool
        Warps keep a bit mask of their pixels that are not done, and skip entries whose box has none of them.
    background : tuple of float
    counting : bool

    Returns
    -------
    outputs : Pixels
    works : one, a row a tile
    """
    pixels = new_pixels(tiles, len(listed) if counting else 0)
    block, over = block_of(tiles, threads, simt, mask=mask), np.array(background, np.float32)
    table = np.zeros((tiles.total, len(_E)), np.int64) if counting else None
    reaches = np.empty((len(colours), REACH), np.float32)
    for_parts(reach_all, parts_of(len(colours), _PART_GAUSSIANS), projected, reaches)
    inputs = (starts, listed, projected, colours, reaches, tiles, block, over, pixels, table)
    for_parts(_blend, parts_of(tiles.total, _PART), *inputs)
    return StageResult(pixels, () if table is None else (blend_work(table, tiles, threads, len(colours), mask=mask),))


def blend_work(table: NDArray[np.int64], tiles: Tiles, threads: int, count: int = 0, *, mask: bool = False) -> Work:
    """Work of the kernel, from the rows of all tiles."""
    total = dict(zip(_E, table.sum(axis=0).tolist(), strict=True))
    entries, pixels, fetches = total[_E.ENTRIES], total[_E.PIXELS], total[_E.COLOUR_FETCHES]  # later warps find L1
    used = min(count, entries)
    span = (POSITION_BYTES + CONIC_BYTES + 4 * COLOURS) * used  # neighbouring tiles list the same Gaussians
    several = f" threads {threads}" if threads < tiles.pixels else ""
    streams = (
        Stream("values", "load", INDEX_BYTES * entries, INDEX_BYTES * entries),
        Stream("positions", "load", 32 * entries, POSITION_BYTES * used, span_bytes=span),
        Stream("conics", "load", 32 * entries, CONIC_BYTES * used, span_bytes=span),
        Stream("colours", "load", 32 * fetches, 4 * COLOURS * used, span_bytes=span),
        Stream("framebuffer", "store", total[_E.STORE_BYTES], 4 * PLANES * pixels),
    )
    shared_bytes = (SHARED_BYTES + BOX_BYTES * mask) * threads
    variant = f"tile {tiles.tile_x}x{tiles.tile_y}{several}{' mask' if mask else ''}"
    return Work("blend", _E, table, threads, shared_bytes=shared_bytes, variant=variant, streams=streams)
