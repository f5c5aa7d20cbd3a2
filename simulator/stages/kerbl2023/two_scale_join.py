"""The last kernel of two scales: a warp a tile blends what its batches show, in order, until all pixels are done.

A pixel that grew opaque within one batch shows what the published loop does. One that does so only with the batches
before it keeps the rest of that batch: at most the transmittance that the published loop leaves over.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.coalescing import smallest_transaction_bytes
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.kerbl2023.blend_pixels import COLOURS, PLANES, Pixels
from tilestamp.simulator.stages.kerbl2023.blend_step import OPAQUE
from tilestamp.simulator.stages.kerbl2023.tiles import Tiles
from tilestamp.simulator.stages.kerbl2023.two_scale import Partials
from tilestamp.simulator.stages.kerbl2023.two_scale_batch import COLUMNS, LINES, PARTIAL
from tilestamp.simulator.stages.kerbl2023.two_scale_events import PartialEvent
from tilestamp.simulator.stages.laine2011.exact import fma
from tilestamp.simulator.work import Work

BLOCK = 256  # threads
_PART = 64  # blocks of one call, at least
_E = PartialEvent


@kernel(lent=True)
def _blend(values: Any, lasts: Any, tile: int, tiles: Tiles, pixels: Pixels, done: Any) -> bool:
    """Blend one batch behind what pixels show already; gives whether all are done."""
    left, top = tile % tiles.columns * tiles.tile_x, tile // tiles.columns * tiles.tile_y
    living = 0
    for lane in range(tiles.tile_x * tiles.tile_y):
        x, y = left + lane % tiles.tile_x, top + lane // tiles.tile_x
        if x >= tiles.width or y >= tiles.height or done[lane]:
            continue
        before, through = pixels.transmittance[y, x], values[lane, COLOURS]
        for k in range(COLOURS):
            pixels.colours[y, x, k] = fma(before, values[lane, k], pixels.colours[y, x, k])
        pixels.transmittance[y, x] = before * abs(through)
        if lasts[lane]:
            pixels.reached[y, x] = lasts[lane]
        done[lane] = through < 0 or pixels.transmittance[y, x] < OPAQUE
        living += not done[lane]
    return living == 0


@kernel
def _join(
    part: int, parts: int, partials: Partials, macro: Tiles, tiles: Tiles, warp: int, pixels: Pixels, table: Any
) -> None:
    """Blend the tiles of a part of the blocks."""
    warps, total = BLOCK // warp, tiles.columns * tiles.rows
    done = np.zeros(tiles.tile_x * tiles.tile_y, np.bool_)
    blocks = (total + warps - 1) // warps
    for tile in range(blocks * part // parts * warps, min(blocks * (part + 1) // parts * warps, total)):
        column, row = tile % tiles.columns, tile // tiles.columns
        at = row // LINES * macro.columns + column // COLUMNS
        own, looked, used = row % LINES * COLUMNS + column % COLUMNS, 0, 0
        done[:] = False
        for b in range(partials.firsts[at], partials.firsts[at + 1]):
            looked += 1
            if partials.masks[b] >> np.uint32(own) & np.uint32(1):
                used += 1
                if _blend(partials.values[b, own], partials.lasts[b, own], tile, tiles, pixels, done):
                    break
        if table is not None:
            counts = table[tile // warps]
            counts[_E.WARPS] += 1
            counts[_E.BATCHES] += looked
            counts[_E.PARTIALS] += used
            if used > counts[_E.SLOWEST_PARTIALS] or looked > counts[_E.SLOWEST_BATCHES]:
                counts[_E.SLOWEST_PARTIALS], counts[_E.SLOWEST_BATCHES] = used, looked
            width = min(tiles.tile_x, tiles.width - column * tiles.tile_x)
            counts[_E.PIXELS] += width * min(tiles.tile_y, tiles.height - row * tiles.tile_y)


def blend_partials(
    partials: Partials, macro: Tiles, tiles: Tiles, simt: Simt, *, counting: bool = True
) -> StageResult[Pixels]:
    """Blend the partial results of all tiles.

    Parameters
    ----------
    partials : Partials
    macro, tiles : Tiles
        The screen cut into macro tiles, and into tiles.
    simt : Simt
    counting : bool

    Returns
    -------
    outputs : Pixels
        ``reached`` counts places in the list of the macro tile; ``uses`` is empty.
    works : one, a row a block
    """
    shape = (tiles.height, tiles.width)
    pixels = Pixels(
        np.zeros((*shape, COLOURS), np.float32), np.ones(shape, np.float32), np.zeros(shape, np.uint32),
        np.zeros((0, 2), np.int32),
    )  # fmt: skip
    blocks = -(-tiles.total // (BLOCK // simt.warp))
    table = np.zeros((blocks, len(_E)), np.int64) if counting else None
    for_parts(_join, parts_of(blocks, _PART), partials, macro, tiles, simt.warp, pixels, table)
    return StageResult(pixels, () if table is None else (_work(table, tiles, simt),))


def _work(table: NDArray[np.int64], tiles: Tiles, simt: Simt) -> Work:
    """Work of the kernel: a partial result of a tile lies in one piece, pixels in rows of their tile."""
    slots, segment = max(1, tiles.pixels // simt.warp), smallest_transaction_bytes(int(simt.coalescing))
    size = tiles.pixels * 4 * PARTIAL
    table[:, _E.BLOCKS] = 1
    table[:, _E.PARTIAL_STEPS] = table[:, _E.PARTIALS] * slots
    table[:, _E.PIXEL_STEPS] = table[:, _E.WARPS] * slots
    table[:, _E.LOAD_TRANSACTIONS] = table[:, _E.PARTIALS] * (size // segment) + table[:, _E.BATCHES]
    rows = -(-table[:, _E.PIXELS] // tiles.tile_x)  # of pixels of a tile
    table[:, _E.STORE_TRANSACTIONS] = rows * PLANES * -(-4 * tiles.tile_x // segment)
    table[:, _E.LOAD_BYTES] = table[:, _E.LOAD_TRANSACTIONS] * segment
    table[:, _E.STORE_BYTES] = table[:, _E.STORE_TRANSACTIONS] * segment
    total = dict(zip(_E, table.sum(axis=0).tolist(), strict=True))
    streams = (
        Stream("partials", "load", total[_E.LOAD_BYTES], size * total[_E.PARTIALS]),
        Stream("framebuffer", "store", total[_E.STORE_BYTES], 4 * PLANES * total[_E.PIXELS]),
    )
    return Work("blend", _E, table, BLOCK, kernel="blend_partials", streams=streams)
