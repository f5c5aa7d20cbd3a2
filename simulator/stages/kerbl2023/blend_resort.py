"""Blend in the order of each pixel: a small window that each thread keeps sorted (StopThePop, Radl et al. 2024).

The list of a tile is nearly in order. A thread sorts what it sees at its pixel into a window by the depth at which the
Gaussian is densest along the ray of that pixel, and blends the nearest once the window is full; at the end it empties
the window. This is the simplest of the published modes, a k-buffer a pixel over tile lists; the hierarchy of windows
is not modelled. The window lies in registers: every insertion goes through all of its places. Colours are read when a
Gaussian is blended, which may be another one in each lane.

Threads that load an entry also make the matrix of its rays. Its numbers are rounded from float64 here.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.scenes.pinhole import Pinhole
from tilestamp.simulator.scenes.splats import Splats
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.kerbl2023.blend import SHARED_BYTES, load_entries, reach_all
from tilestamp.simulator.stages.kerbl2023.blend_block import (
    CONIC_BYTES,
    INDEX_BYTES,
    POSITION_BYTES,
    Block,
    Room,
    block_of,
    gather_sectors,
)
from tilestamp.simulator.stages.kerbl2023.blend_pixels import COLOURS, PLANES, Pixels, new_pixels, store
from tilestamp.simulator.stages.kerbl2023.blend_step import (
    ENTRY,
    ENTRY_RED,
    LANES,
    ROWS,
)
from tilestamp.simulator.stages.kerbl2023.blend_walk import BOX, REACH
from tilestamp.simulator.stages.kerbl2023.events import BlendEvent, ResortEvent
from tilestamp.simulator.stages.kerbl2023.project import Projected
from tilestamp.simulator.stages.kerbl2023.rays import ray_rows
from tilestamp.simulator.stages.kerbl2023.resort_window import Rays, Windows, walk_in_order
from tilestamp.simulator.stages.kerbl2023.tiles import Tiles
from tilestamp.simulator.work import Work

RAY_WORDS = 12  # of an entry: matrix and centre
RAY_BYTES = (12, 12, 16)  # what they are made of: mean, scales, rotation
SLOT_WEIGHT = 0.1  # of a step: a place of the window, where warps are compared
_PART, _PART_GAUSSIANS = 8, 1 << 14
_E, _B = ResortEvent, BlendEvent
_COUNTED = len(BlendEvent)


@kernel(lent=True)
def _tile(
    tile: int, tiles: Tiles, block: Block, first: int, count: int, listed: Any, colours: Any, rays: Rays, places: int,
    background: Any, windows: Windows, room: Room, red: Any, pixels: Pixels, stored: Any, row: Any,
) -> None:  # fmt: skip
    """Blend the list of one tile and count it."""
    longest, worst = 0, -1.0
    for warp in range(block.warps):
        begin, end = warp * block.warp, min((warp + 1) * block.warp, block.threads)
        steps, inserts, blends = walk_in_order(
            begin, end, tile, tiles, block, first, count, listed, colours, rays, places, windows, room, red, row
        )  # fmt: skip
        store(tile, tiles, begin, end, block.segment, background, room, pixels, stored)
        row[_E.STEPS] += steps
        row[_E.INSERT_STEPS] += inserts
        row[_E.BLEND_STEPS] += blends
        row[_E.WARP_BATCHES] += (steps + block.threads - 1) // block.threads
        longest = max(longest, steps)
        weight = steps + 2.0 * blends + SLOT_WEIGHT * places * inserts
        if weight > worst:
            worst = weight
            row[_E.SLOWEST_STEPS], row[_E.SLOWEST_SLOTS] = steps, places * inserts
            row[_E.SLOWEST_BLEND_STEPS] = blends
    row[_E.SLOTS], row[_E.SLOT_LANES] = places * row[_E.INSERT_STEPS], places * row[_E.INSERTED]
    row[_E.BATCHES] = (longest + block.threads - 1) // block.threads
    row[_E.ENTRIES] = min(count, row[_E.BATCHES] * block.threads)
    for size in range(0, row[_E.ENTRIES], block.threads):
        row[_E.GATHER_WARPS] += (min(block.threads, row[_E.ENTRIES] - size) + block.warp - 1) // block.warp
    row[_E.WARPS], row[_E.THREADS], row[_E.LIST], row[_E.BLOCKS] = block.warps, block.threads, count, 1
    row[_E.IDLE_LANES] = row[_E.STEPS] * block.warp - row[_E.EVALUATIONS]


@kernel(lent=True)
def _loads(first: int, listed: Any, block: Block, room: Room, row: Any) -> None:
    """Count what a block loads beside colours; what rays are made of by itself for each Gaussian."""
    row[_E.LOAD_TRANSACTIONS] += gather_sectors(first, row[_E.ENTRIES], listed, block, room) + block.warps
    row[_E.LOAD_TRANSACTIONS] += COLOURS * row[_E.PIXEL_WARPS]
    for k in range(first, first + row[_E.ENTRIES]):
        i = np.int64(listed[k])
        for size in RAY_BYTES:
            row[_E.LOAD_TRANSACTIONS] += ((i + 1) * size - 1) // block.segment - i * size // block.segment + 1
    row[_E.LOAD_BYTES] = row[_E.LOAD_TRANSACTIONS] * block.segment
    row[_E.STORE_BYTES] = row[_E.STORE_TRANSACTIONS] * block.segment


@kernel
def _blend_resort(
    part: int, parts: int, starts: Any, listed: Any, out: Projected, colours: Any, reaches: Any, rays: Rays,
    places: int, tiles: Tiles, block: Block, background: Any, pixels: Pixels, table: Any,
) -> None:  # fmt: skip
    """Blend a part of the tiles; row i of the table is that of tile i."""
    total = len(starts) - 1
    begin, end = total * part // parts, total * (part + 1) // parts
    longest = 1
    for tile in range(begin, end):
        longest = max(longest, starts[tile + 1] - starts[tile])
    lanes, none = block.parts * LANES, np.empty((0, 0), np.int64)
    room = Room(
        np.empty((longest, ENTRY), np.float32), np.empty((longest, BOX), np.int32), np.empty((ROWS, lanes), np.float32),
        np.empty(block.parts, np.uint32), np.empty((0, 0, 0, 0), np.int64), np.empty((0, 0, 0), np.int64),
        np.empty(0, np.uint32), none, np.zeros((2, len(out.radii) * CONIC_BYTES // block.segment + 1), np.int64),
    )  # fmt: skip
    windows = Windows(
        np.empty((lanes, places + 1), np.float32), np.empty((lanes, places + 1), np.float32),
        np.empty((lanes, places + 1), np.int64), np.empty(lanes, np.int64), np.empty(lanes, np.float32),
        np.empty(lanes, np.float32), np.empty(lanes, np.int64),
    )  # fmt: skip
    red, stored = np.zeros((ROWS, LANES), np.float32), np.empty(_COUNTED, np.int64)
    for tile in range(begin, end):
        first, count, row = starts[tile], starts[tile + 1] - starts[tile], table[tile]
        load_entries(first, count, listed, out, colours, reaches, room)
        room.entries[:count, ENTRY_RED] = 1  # what is added to red is alpha
        stored[:] = 0
        _tile(
            tile, tiles, block, first, count, listed, colours, rays, places, background, windows, room, red, pixels,
            stored, row,
        )  # fmt: skip
        row[_E.PIXELS], row[_E.PIXEL_WARPS] = stored[_B.PIXELS], stored[_B.PIXEL_WARPS]
        row[_E.STORE_TRANSACTIONS] = stored[_B.STORE_TRANSACTIONS]
        _loads(first, listed, block, room, row)


def blend_resort(
    starts: NDArray[np.int64],
    listed: NDArray[np.uint32],
    projected: Projected,
    colours: NDArray[np.float32],
    splats: Splats,
    camera: Pinhole,
    tiles: Tiles,
    simt: Simt,
    *,
    window: int,
) -> StageResult[Pixels]:
    """Blend the lists of all tiles over black, each pixel in its own order.

    Parameters
    ----------
    starts, listed, projected, colours, tiles, simt
        As of ``blend``; a block has a thread a pixel.
    splats : Splats
    camera : Pinhole
    window : int
        Gaussians that a pixel keeps sorted.

    Returns
    -------
    outputs : Pixels
        ``reached`` is the last in its list of the Gaussians that were blended.
    works : one, a row a tile
    """
    pixels = new_pixels(tiles)
    matrices, centres = ray_rows(splats, camera)
    rays = Rays(
        np.concatenate([matrices.reshape(-1, 9), centres], axis=1).astype(np.float32), camera.tan_x, camera.tan_y
    )
    block, over = block_of(tiles, tiles.pixels, simt), np.zeros(COLOURS, np.float32)
    table, reaches = np.zeros((tiles.total, len(_E)), np.int64), np.empty((len(colours), REACH), np.float32)
    for_parts(reach_all, parts_of(len(colours), _PART_GAUSSIANS), projected, reaches)
    inputs = (starts, listed, projected, colours, reaches, rays, window, tiles, block, over, pixels, table)
    for_parts(_blend_resort, parts_of(tiles.total, _PART), *inputs)
    return StageResult(pixels, (resort_work(table, tiles, window, len(colours)),))


def resort_work(table: NDArray[np.int64], tiles: Tiles, window: int, count: int = 0) -> Work:
    """Work of the kernel, from the rows of all tiles."""
    total = dict(zip(_E, table.sum(axis=0).tolist(), strict=True))
    entries, used = total[_E.ENTRIES], min(count, total[_E.ENTRIES])
    span = (POSITION_BYTES + CONIC_BYTES + 4 * COLOURS + sum(RAY_BYTES)) * used
    streams = (
        Stream("values", "load", INDEX_BYTES * entries, INDEX_BYTES * entries),
        Stream("positions", "load", 32 * entries, POSITION_BYTES * used, span_bytes=span),
        Stream("conics", "load", 32 * entries, CONIC_BYTES * used, span_bytes=span),
        Stream("rays", "load", 32 * len(RAY_BYTES) * entries, sum(RAY_BYTES) * used, span_bytes=span),
        Stream("colours", "load", 32 * COLOURS * total[_E.BLENDED], 4 * COLOURS * used, span_bytes=span),
        Stream("framebuffer", "store", total[_E.STORE_BYTES], 4 * PLANES * total[_E.PIXELS]),
    )
    shared = (SHARED_BYTES + 4 * RAY_WORDS) * tiles.pixels
    variant = f"window {window}"
    return Work(
        "blend", _E, table, tiles.pixels, kernel="blend_resort", shared_bytes=shared, variant=variant, streams=streams
    )
