"""Fine raster: one warp a tile of 8x8 pixels, in shared memory (Laine & Karras 2011, section 6).

A warp reads the tile's list 32 entries at a time, drops those behind the tile's largest depth, finds the coverage of
the others, and draws their fragments 32 at a time, in input order: depth test, shading, conflict-free writes.
"""

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kernel import kernel
from tilestamp.models.simt import Simt
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.borrow import borrow, row_of
from tilestamp.simulator.stages.laine2011.fine_raster_multi import draw_tile_multi
from tilestamp.simulator.stages.laine2011.fine_raster_queue import (
    TILE,
    Draw,
    FineRasterEvent,
    Tile,
    corner,
    new_tile,
    start_tile,
)
from tilestamp.simulator.stages.laine2011.fine_raster_single import draw_tile_single
from tilestamp.simulator.stages.laine2011.fine_raster_work import fine_work
from tilestamp.simulator.stages.laine2011.frame_buffers import (
    FrameBuffers,
    clear_depth_value,
    count_tile,
    load_layer,
    load_tile,
    new_buffers,
    store_tile,
)
from tilestamp.simulator.stages.laine2011.triangle_setup import Release
from tilestamp.simulator.stages.laine2011.triangle_setup_paths import Setup

Mode = Literal["depth", "blend", "depth-only", "color"]
Lists = tuple[NDArray[np.int64], NDArray[np.int32], NDArray[np.int32]]  # starts, entries, active tiles

MODES: dict[str, tuple[bool, bool, bool, bool]] = {  # depth, blend, write colour, interpolate
    "depth": (True, False, True, True),
    "blend": (False, True, True, True),
    "depth-only": (True, False, False, False),
    "color": (False, False, True, False),
}
_PART_TILES = 32  # tiles that one call of the worker takes, at least


@kernel
def _draw_part(
    part: int,
    parts: int,
    active: Any,
    starts: Any,
    entries: Any,
    setup: Setup,
    colors: Any,
    draw: Draw,
    buffers: Any,
    behind: Any,
    several: Any,
    table: Any,
) -> None:
    """Draw a share of the active tiles, through arrays without reference counts."""
    first, last = active.size * part // parts, active.size * (part + 1) // parts
    tile = new_tile(1 << draw.log_samples)
    every = np.zeros(0 if table is None else table.shape[1], np.int64)
    if table is not None:
        count_tile(draw, every)
    lists = borrow(starts), borrow(entries)
    lent = borrow(tile), borrow(setup), borrow(colors), borrow(buffers)
    _draw_tiles(first, last, active, lists, *lent, draw, behind, several, borrow(table), borrow(every))
    tile.state[0] = 0  # the owner lives to here


@kernel
def _draw_tiles(
    first: int,
    last: int,
    active: Any,
    lists: Any,
    tile: Tile,
    setup: Setup,
    colors: Any,
    buffers: Any,
    draw: Draw,
    behind: Any,
    several: Any,
    table: Any,
    every: Any,
) -> None:
    starts, entries = lists
    for a in range(first, last):
        t = active[a]
        left, bottom = corner(t, draw)
        x, y = (t % draw.tiles_x) * TILE, (t // draw.tiles_x) * TILE
        load_tile(buffers, draw, tile, x, y)
        if behind is not None:
            load_layer(behind, tile, x, y)
        start_tile(tile, starts[t], starts[t + 1])
        row = row_of(table, a)
        if table is not None:
            for event in range(every.size):  # what every tile counts; until now the row is as memory was
                row[event] = every[event]
        draw_tile(setup, entries, colors, draw, tile, left, bottom, several, row)
        store_tile(buffers, setup, colors, draw, tile, x, y)


@kernel(lent=True)
def draw_tile(
    setup: Setup, entries: Any, colors: Any, draw: Draw, tile: Tile, left: int, bottom: int, several: Any, row: Any
) -> None:
    """Draw the list of one tile; without ``several`` samples a pixel (None) their code is not compiled."""
    if several is None:
        draw_tile_single(setup, entries, colors, draw, tile, left, bottom, row)
    else:
        draw_tile_multi(setup, entries, colors, draw, tile, left, bottom, row)


def draw_of(
    width: int,
    height: int,
    simt: Simt,
    *,
    release: Release,
    mode: Mode,
    samples: int = 1,
    clear: bool = True,
    clear_color: int = 0,
    clear_depth: float = 1.0,
) -> Draw:
    """Switches of a draw as the kernels take them; parameters as of ``fine_raster``."""
    depth, blend, write_color, interpolate = MODES[mode]
    return Draw(
        log_samples=samples.bit_length() - 1,
        later_wins=release == "nvdiffrast",
        depth=depth,
        blend=blend,
        write_color=write_color,
        interpolate=interpolate,
        shade_late=write_color and not blend and samples == 1 and release == "1.1",
        clear=clear,
        clear_color=clear_color,
        clear_depth=clear_depth_value(clear_depth),
        half_width=8 * width,
        half_height=8 * height,
        tiles_x=-(-width // TILE),
        coalescing=int(simt.coalescing),
    )


def fine_raster(
    setup: Setup,
    tile_starts: NDArray[np.int64],
    tile_entries: NDArray[np.int32],
    active_tiles: NDArray[np.int32],
    width: int,
    height: int,
    simt: Simt,
    *,
    release: Release,
    samples: int = 1,
    mode: Mode = "depth",
    colors: NDArray[np.float32] | None = None,
    buffers: FrameBuffers | None = None,
    behind: NDArray[np.uint32] | None = None,
    clear_color: int = 0,
    clear_depth: float = 1.0,
    counting: bool = True,
) -> StageResult[FrameBuffers]:
    """Draw the queued triangles of all active tiles.

    Parameters
    ----------
    setup : Setup
        From triangle setup, with planes for the same mode.
    tile_starts : ndarray, (tiles + 1,), int64
        Where each tile's list starts; tile = column + row * columns, row 0 the lowest.
    tile_entries : ndarray, int32
        Slots, in input order within a tile.
    active_tiles : ndarray, int32
        Tiles to draw, in the order in which warps draw them.
    width, height : int
        Viewport, pixels.
    simt : Simt
    release : {"1.1", "nvdiffrast"}
    samples : int
    mode : {"depth", "blend", "depth-only", "color"}
        Depth test and interpolation; no depth, interpolation, blending; depth alone; neither depth nor interpolation.
    colors : ndarray, (V, 4), float32, or None
        Linear RGBA of the vertices; None: white.
    buffers : FrameBuffers or None
        Pixels of earlier draws, drawn over in place; None: tiles start from the clear values.
    behind : ndarray, (height, width), uint32, optional
        Depths of the layer before (depth peeling, uncounted): only fragments behind them are drawn.
    clear_color : int
        RGBA from the low byte up.
    clear_depth : float
        0 to 1; release nvdiffrast always clears to 1.
    counting : bool

    Returns
    -------
    outputs : FrameBuffers
    works : one, a row an active tile
    """
    draw = draw_of(
        width, height, simt, release=release, mode=mode, samples=samples, clear=buffers is None,
        clear_color=clear_color, clear_depth=clear_depth,
    )._replace(peel=behind is not None)  # fmt: skip
    if colors is None:
        colors = np.ones((int(setup.planes[:, 13:].max(initial=0)) + 1 if draw.write_color else 1, 4), np.float32)
    if buffers is None:
        buffers = new_buffers(width, height, samples, cleared=len(active_tiles) < len(tile_starts) - 1)
    lists = tile_starts, tile_entries, active_tiles
    rows = draw_rows(setup, lists, draw, colors, buffers, behind, counting=counting)
    if rows is None:
        return StageResult(buffers)
    work = fine_work(rows, setup, tile_entries, width, height, simt, release=release, samples=samples, mode=mode)
    return StageResult(buffers, (work,))


def draw_rows(
    setup: Setup,
    lists: Lists,
    draw: Draw,
    colors: NDArray[np.float32],
    buffers: FrameBuffers,
    behind: NDArray[np.uint32] | None = None,
    *,
    counting: bool = True,
) -> NDArray[np.int64] | None:
    """Draw into the buffers; a row of events an active tile."""
    starts, entries, active = lists
    rows = np.empty((len(active), len(FineRasterEvent)), np.int64) if counting else None
    several = True if draw.log_samples else None
    with np.errstate(all="ignore"):
        parts = parts_of(len(active), _PART_TILES)
        for_parts(_draw_part, parts, active, starts, entries, setup, colors, draw, buffers, behind, several, rows)
    return rows
