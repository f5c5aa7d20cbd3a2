"""Two scales: lists of macro tiles of 8x4 tiles, blended by tiles in batches (HiGS, Pajak et al. 2026).

A block has a batch of at most 1024 entries of a macro tile. Each warp loads 32 at a time, and a lane finds which of the
32 tiles its Gaussian reaches: a mask. Turned around, masks say which entries a tile has. Then warps draw tiles from a
queue in shared memory; one walks along the entries of its tile, 64 between two looks at whether all pixels are done,
and stores their colour and transmittance: a partial result, that begins as if nothing were in front.

Source: arXiv 2606.00352, and gsplat/experimental (Apache-2.0). HiGS has all this in half precision. Here floats and the
steps of a pixel are those of the published blending loop.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.coalescing import smallest_transaction_bytes
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.kerbl2023.blend_block import CONIC_BYTES, INDEX_BYTES, POSITION_BYTES, Room
from tilestamp.simulator.stages.kerbl2023.blend_step import ENTRY, LANES, ROWS
from tilestamp.simulator.stages.kerbl2023.blend_walk import BOX, PER_ROUND, REACH, TOTALS
from tilestamp.simulator.stages.kerbl2023.project import Projected
from tilestamp.simulator.stages.kerbl2023.tile_rules import BOUNDS
from tilestamp.simulator.stages.kerbl2023.tiles import Tiles
from tilestamp.simulator.stages.kerbl2023.two_scale_batch import (
    COLUMNS,
    DRAIN,
    LINES,
    MACRO,
    MINI,
    PARTIAL,
    WARPS,
    Scratch,
    blend_tile,
    count_batch,
    count_tile,
    gather_sectors,
    load,
    tile_mask,
)
from tilestamp.simulator.stages.kerbl2023.two_scale_events import BatchEvent
from tilestamp.simulator.work import Work

BATCH, RING = 1024, 128  # entries of a block, and of the ring of a warp
COLOUR_BYTES = 16  # three floats, and one that pads
SHARED_BYTES = BATCH * (POSITION_BYTES + CONIC_BYTES + COLOUR_BYTES) + 4 * BATCH + WARPS * RING * 2 + 4 * (MACRO + 3)
_PART = 4  # batches of one call, at least
_E = BatchEvent


class Partials(NamedTuple):
    """What each batch shows of each tile of its macro tile.

    Parameters
    ----------
    firsts : ndarray, (macro tiles + 1,), int64
        First batch of each.
    masks : ndarray, (batches,), uint32
        Tiles that have an entry, a bit each.
    values : ndarray, (batches, 32, pixels, 4), float32
        Colour, and transmittance: negative where the pixel is done.
    lasts : ndarray, (batches, 32, pixels), int32
        Place of the last entry that was blended in the list of the macro tile, from 1; 0 where there is none.
    """

    firsts: NDArray[np.int64]
    masks: NDArray[np.uint32]
    values: NDArray[np.float32]
    lasts: NDArray[np.int32]


@kernel
def _batches(
    part: int, parts: int, starts: Any, listed: Any, out: Projected, colours: Any, rule: int, macro: Tiles,
    tiles: Tiles, batch: int, warp: int, segment: int, partials: Partials, table: Any,
) -> None:  # fmt: skip
    """Blend a part of the batches; row i of the table is that of batch i."""
    pixels, total = tiles.tile_x * tiles.tile_y, len(partials.masks)
    slots = max(1, pixels // warp)
    room = Room(
        np.empty((batch, ENTRY), np.float32), np.empty((batch, BOX), np.int32), np.empty((ROWS, pixels), np.float32),
        np.empty(pixels // LANES, np.uint32), np.zeros((1, 1, batch // DRAIN + 1, PER_ROUND), np.int64),
        np.zeros((1, 1, TOTALS), np.int64), np.zeros(batch, np.uint32), np.zeros((batch, 2), np.int64),
        np.zeros((2, len(out.radii) * CONIC_BYTES // segment + 1), np.int64),
    )  # fmt: skip
    own = Scratch(
        np.empty((batch, ENTRY), np.float32), np.empty((batch, BOX), np.int32), np.empty(batch, np.int64),
        np.empty(pixels // LANES, np.uint32), np.empty(batch, np.int64), np.empty(REACH, np.float32),
        np.empty((WARPS, 4), np.int64),
    )  # fmt: skip
    for b in range(total * part // parts, total * (part + 1) // parts):
        at = np.searchsorted(partials.firsts, b, side="right") - 1
        before = (b - partials.firsts[at]) * batch
        first, count = starts[at] + before, min(batch, starts[at + 1] - starts[at] - before)
        left, top = at % macro.columns * COLUMNS, at // macro.columns * LINES
        own.warps[:] = 0
        load(first, count, listed, out, colours, own.reach, room)
        active = np.uint32(0)
        for k in range(count):
            own.masks[k] = tile_mask(listed[first + k], out, rule, left, top, tiles)
            active |= np.uint32(own.masks[k])
        partials.masks[b] = active
        for t in range(MACRO):
            bits = 0
            for k in range(count):
                if own.masks[k] >> t & 1:
                    own.order[bits] = k
                    bits += 1
            if bits:
                tile = (top + t // COLUMNS) * tiles.columns + left + t % COLUMNS
                done = blend_tile(tiles, tile, bits, before, room, own, partials.values[b, t], partials.lasts[b, t])
                if table is not None:
                    table[b, _E.MASK_BITS] += bits
                    count_tile(bits, (count + MINI - 1) // MINI, done, slots, room, own, table[b])
        if table is not None:
            sectors = gather_sectors(first, count, listed, warp, segment, room.stamps)
            count_batch(count, slots, max(pixels, warp), sectors, segment, own, table[b])


def blend_batches(
    starts: NDArray[np.int64], listed: NDArray[np.uint32], projected: Projected, colours: NDArray[np.float32],
    macro: Tiles, tiles: Tiles, simt: Simt, *, bound: str, batch: int = BATCH, counting: bool = True,
) -> StageResult[Partials]:  # fmt: skip
    """Blend the lists of all macro tiles, batch by batch.

    Parameters
    ----------
    starts : ndarray, (macro tiles + 1,), int64
        Macro tile i has the entries ``listed[starts[i] : starts[i + 1]]``.
    listed : ndarray, (P,), uint32
        Gaussians, from near to far in each.
    projected : Projected
    colours : ndarray, (N, 3), float32
    macro, tiles : Tiles
        The screen cut into macro tiles, and into tiles.
    simt : Simt
    bound : {"square", "box", "ellipse"}
        Which tiles list a Gaussian.
    batch : int
        Entries of a block.
    counting : bool

    Returns
    -------
    outputs : Partials
    works : one, a row a batch; none where there is none
    """
    firsts = np.concatenate([[0], np.cumsum(-(-np.diff(starts) // batch))])
    shape = (int(firsts[-1]), MACRO, tiles.pixels)
    partials = Partials(
        firsts, np.zeros(shape[0], np.uint32), np.empty((*shape, PARTIAL), np.float32), np.empty(shape, np.int32)
    )
    table = np.zeros((shape[0], len(_E)), np.int64) if counting and shape[0] else None
    inputs = (starts, listed, projected, colours, BOUNDS[bound], macro, tiles, batch)
    segment = smallest_transaction_bytes(int(simt.coalescing))
    for_parts(_batches, parts_of(shape[0], _PART), *inputs, simt.warp, segment, partials, table)
    return StageResult(partials, () if table is None else (_work(table, tiles, len(colours), simt.warp),))


def by_macro_tile(partials: Partials, works: tuple[Work, ...]) -> NDArray[np.int64]:
    """Evaluations and blends by macro tile, (macro tiles, 2)."""
    found = np.zeros((len(partials.firsts) - 1, 2), np.int64)
    for work in works:
        at = np.repeat(np.arange(len(found)), np.diff(partials.firsts))
        np.add.at(found, at, work.table[:, [_E.EVALUATIONS, _E.BLENDED]])
    return found


def _work(table: NDArray[np.int64], tiles: Tiles, count: int, warp: int) -> Work:
    """Work of the kernel, from the rows of its batches."""
    entries, written = int(table[:, _E.ENTRIES].sum()), int(table[:, _E.PARTIAL_BYTES].sum())
    used = min(count, entries)
    span = (POSITION_BYTES + CONIC_BYTES + COLOUR_BYTES) * used  # neighbouring macro tiles list the same Gaussians
    sizes = (("positions", POSITION_BYTES), ("conics", CONIC_BYTES), ("colours", COLOUR_BYTES))
    streams = (
        Stream("values", "load", 2 * INDEX_BYTES * entries, INDEX_BYTES * entries),
        *(Stream(name, "load", 32 * entries, size * used, span_bytes=span) for name, size in sizes),
        Stream("partials", "store", int(table[:, _E.STORE_BYTES].sum()), written),
    )
    block = WARPS * warp
    variant = f"tile {tiles.tile_x}x{tiles.tile_y}"
    return Work(
        "blend", _E, table, block, kernel="blend_batches", shared_bytes=SHARED_BYTES, variant=variant, streams=streams
    )
