"""Fine raster: one warp a tile of 8x8 pixels, in shared memory (Laine & Karras 2011, section 6).

A warp reads the tile's list 32 entries at a time, drops those behind the tile's largest depth, finds the coverage of
the others, and draws their fragments 32 at a time, in input order: depth test, shading, conflict-free writes.
"""

from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.coalescing import smallest_transaction_bytes
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stage import Known, divisible
from tilestamp.simulator.stages.borrow import borrow, row_of
from tilestamp.simulator.stages.laine2011.fine_raster_multi import draw_tile_multi
from tilestamp.simulator.stages.laine2011.fine_raster_queue import (
    HEADER_BYTES,
    PIXELS,
    SEGMENT,
    TILE,
    Draw,
    FineRasterEvent,
    Tile,
    corner,
    new_tile,
    start_tile,
)
from tilestamp.simulator.stages.laine2011.fine_raster_single import draw_tile_single
from tilestamp.simulator.stages.laine2011.subtriangle import DEPTH_MAX, DEPTH_MIN
from tilestamp.simulator.stages.laine2011.tile_areas import tile_areas
from tilestamp.simulator.stages.laine2011.triangle_setup import Release
from tilestamp.simulator.stages.laine2011.triangle_setup_paths import Setup
from tilestamp.simulator.work import Work

Mode = Literal["depth", "blend", "depth-only", "color"]

WARPS = 20  # a block
TABLE_BYTES = 6144  # edge coverage, shared
WARP_BYTES = {1: 2112, 2: 1856, 4: 1856, 8: 1856}
MODES: dict[str, tuple[bool, bool, bool, bool]] = {  # depth, blend, write colour, interpolate
    "depth": (True, False, True, True),
    "blend": (False, True, True, True),
    "depth-only": (True, False, False, False),
    "color": (False, False, True, False),
}
START_LOADS = 3  # of a warp that starts: whether a buffer was too small
DRAW_REQUESTS = 2  # of a warp that draws a tile, to one sector: the counter, and beside it the number of tiles
SAMPLE_SECONDS, ENTRY_SECONDS = 50e-9, 1e-6  # CPU time of a sample, and of an entry of a tile's list
_PART_TILES = 32  # tiles that one call of the worker takes, at least


class FrameBuffers(NamedTuple):
    """Pixels of a frame, whole tiles, row 0 the lowest row; samples first."""

    color: NDArray[np.uint32]  # (samples, height, width) RGBA from the low byte up
    depth: NDArray[np.uint32]  # fixed point, smaller is nearer
    ids: NDArray[np.int32]  # input triangle, -1 where nothing was drawn


@kernel
def _load_tile(buffers: Any, draw: Draw, tile: Tile, x: int, y: int) -> None:
    for sample in range(1 << draw.log_samples):
        for p in range(PIXELS):
            at, i, j = p + PIXELS * sample, x + 7 - (p & 7), y + (p >> 3)
            if draw.clear:
                tile.color[at], tile.depth[at], tile.ids[at] = draw.clear_color, draw.clear_depth, -1
            else:
                tile.color[at] = buffers.color[sample, j, i]
                tile.depth[at] = buffers.depth[sample, j, i]
                tile.ids[at] = buffers.ids[sample, j, i]


@kernel
def _store_tile(buffers: Any, draw: Draw, tile: Tile, x: int, y: int) -> None:
    for sample in range(1 << draw.log_samples):
        for p in range(PIXELS):
            at, i, j = p + PIXELS * sample, x + 7 - (p & 7), y + (p >> 3)
            buffers.color[sample, j, i] = tile.color[at]
            buffers.depth[sample, j, i] = tile.depth[at]
            buffers.ids[sample, j, i] = tile.ids[at]


@kernel
def _count_tile(draw: Draw, row: Any) -> None:
    """Count what every tile costs: its draw from the counter, and its pixels read and written, 8 rows of 32 bytes.

    Surfaces are laid out in two dimensions, so that a row of a tile is one 32-byte segment on every machine. Samples
    stay in memory: with several of them the clear writes the tile, and nothing else here does.
    """
    row[FineRasterEvent.ATOMIC] += 1
    row[FineRasterEvent.ATOMIC_LANES] += 1
    row[FineRasterEvent.ATOMIC_REQUESTS] += 1
    row[FineRasterEvent.ATOMIC_DEPTH] += 1
    row[FineRasterEvent.LOAD_TRANSACTIONS] += 2  # the tile's number and its first segment
    row[FineRasterEvent.LOAD_BYTES] += 2 * smallest_transaction_bytes(draw.coalescing)
    surfaces = (1 if draw.write_color or draw.later_wins else 0) + 1
    rows = surfaces * TILE << draw.log_samples
    if not draw.clear and draw.log_samples == 0:
        row[FineRasterEvent.TILE_LOADS] += 1
        row[FineRasterEvent.LOAD_TRANSACTIONS] += rows
        row[FineRasterEvent.LOAD_BYTES] += 32 * rows
    if draw.clear or draw.log_samples == 0:
        row[FineRasterEvent.TILE_STORES] += 1
        row[FineRasterEvent.STORE_TRANSACTIONS] += rows
        row[FineRasterEvent.STORE_BYTES] += 32 * rows


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
    several: Any,
    table: Any,
) -> None:
    """Draw a share of the active tiles, through arrays without reference counts."""
    first, last = active.size * part // parts, active.size * (part + 1) // parts
    tile = new_tile(1 << draw.log_samples)
    lists = borrow(starts), borrow(entries)
    lent = borrow(tile), borrow(setup), borrow(colors), borrow(buffers)
    _draw_tiles(first, last, active, lists, *lent, draw, several, borrow(table))
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
    several: Any,
    table: Any,
) -> None:
    starts, entries = lists
    for a in range(first, last):
        t = active[a]
        left, bottom = corner(t, draw)
        x, y = (t % draw.tiles_x) * TILE, (t // draw.tiles_x) * TILE
        _load_tile(buffers, draw, tile, x, y)
        start_tile(tile, starts[t], starts[t + 1])
        row = row_of(table, a)
        draw_tile(setup, entries, colors, draw, tile, left, bottom, several, row)
        if table is not None:
            _count_tile(draw, row)
        _store_tile(buffers, draw, tile, x, y)


@kernel
def draw_tile(
    setup: Setup, entries: Any, colors: Any, draw: Draw, tile: Tile, left: int, bottom: int, several: Any, row: Any
) -> None:
    """Draw the list of one tile; without ``several`` samples a pixel (None) their code is not compiled."""
    if several is None:
        draw_tile_single(setup, entries, colors, draw, tile, left, bottom, row)
    else:
        draw_tile_multi(setup, entries, colors, draw, tile, left, bottom, row)


def new_buffers(width: int, height: int, samples: int = 1) -> FrameBuffers:
    """Allocate the pixels of a frame, whole tiles, cleared to black and far."""
    shape = (samples, -(-height // TILE) * TILE, -(-width // TILE) * TILE)
    return FrameBuffers(np.zeros(shape, np.uint32), np.full(shape, DEPTH_MAX, np.uint32), np.full(shape, -1, np.int32))


def clear_depth_value(depth: float) -> int:
    """Fixed-point depth that a clear to ``depth`` in 0..1 writes; 1 is the far plane."""
    whole = min(int(depth * 2**32), 2**32 - 1)
    return int(whole / (2**32 - 1) * (DEPTH_MAX - DEPTH_MIN) + DEPTH_MIN)


def _tile_sizes(
    setup: Setup,
    tile_starts: NDArray[np.int64],
    tile_entries: NDArray[np.int32],
    active_tiles: NDArray[np.int32],
    width: int,
    height: int,
    samples: int,
    **_: Any,
) -> Known:
    """Length of the list of each active tile, and the area of the triangles in it; inputs of ``fine_raster``."""
    E, entries = FineRasterEvent, np.diff(tile_starts)[active_tiles]
    area = tile_areas(setup, tile_starts, tile_entries, width, height)[active_tiles]
    segments, partial = -(-entries // SEGMENT), (entries % SEGMENT > 0).astype(np.int64)
    listed: dict[int, NDArray[Any]] = {
        E.SEGMENTS: segments,
        E.LIST_WARPS: segments,
        E.PARTIAL_SEGMENTS: partial,
        E.ENTRY_LANES: entries,
    }
    seconds = SAMPLE_SECONDS * len(entries) * PIXELS * samples + ENTRY_SECONDS * int(entries.sum())
    return Known(seconds, entries, (area,), listed)


def _work(
    rows: NDArray[np.int64],
    setup: Setup,
    tile_entries: NDArray[np.int32],
    width: int,
    height: int,
    simt: Simt,
    *,
    release: Release,
    samples: int,
    mode: Mode,
    **_: Any,
) -> Work:
    """Work of the kernel, from the rows of all active tiles and the inputs of ``fine_raster``."""
    table = _with_starts(rows, WARPS * simt.sms, smallest_transaction_bytes(int(simt.coalescing)))
    shared = TABLE_BYTES + WARPS * WARP_BYTES[samples] + (2**samples if samples > 1 else 0)
    queue = None
    if release == "nvdiffrast":  # a mix for 1.1 has this wait in the chain of a draw
        queue = np.array([DRAW_REQUESTS * table[:, FineRasterEvent.ATOMIC].sum()])
    return Work(
        stage="fine_raster",
        kernel="fineRaster",
        events=FineRasterEvent,
        table=table,
        grid=simt.sms,
        block=32 * WARPS,
        shared_bytes=shared,
        dispatch="warp_queue",
        streams=_streams(table, setup, len(tile_entries), width, height, samples),
        atomic_requests=queue,
        variant="" if release == "nvdiffrast" else mode if samples == 1 else f"{mode} msaa",
    )


def _with_starts(rows: NDArray[np.int64], warps: int, segment_bytes: int) -> NDArray[np.int64]:
    """Add what a warp does besides its tiles to the first that it draws: it starts, and its last draw finds no tile."""
    E, table = FineRasterEvent, rows.copy()
    if len(table):
        starts = np.bincount(np.arange(warps) % len(table), minlength=len(table))
        for event in (E.WARP_STARTS, E.ATOMIC, E.ATOMIC_LANES, E.ATOMIC_REQUESTS, E.ATOMIC_DEPTH):
            table[:, event] += starts
        loads = START_LOADS * starts + table[:, E.ATOMIC]  # and with each draw the number of tiles
        table[:, E.LOAD_TRANSACTIONS] += loads
        table[:, E.LOAD_BYTES] += loads * segment_bytes
    return table


def _streams(
    table: NDArray[np.int64], setup: Setup, entries: int, width: int, height: int, samples: int
) -> tuple[Stream, ...]:
    """Buffers that fine raster reads and writes; records are what is left of the loads after lists and headers.

    Tiles that share a triangle are drawn at about the same time: of headers and records what is read again is found in
    a cache, and each passes once, or once an SM that asks for it where L1 is what keeps it.
    """
    E = FineRasterEvent
    total = table.sum(axis=0)
    lists = int(total[E.SEGMENTS]) * 4 * SEGMENT
    headers = int(total[E.ENTRY_LANES]) * HEADER_BYTES
    kept = int(setup.subtriangles.sum(dtype=np.int64))
    pixels = 2 * 4 * PIXELS * samples * (-(-width // TILE) * -(-height // TILE))
    tiles = int(total[E.TILE_LOADS]) * 2 * 4 * PIXELS * samples
    rest = max(int(total[E.LOAD_BYTES]) - lists - headers - tiles, 0)
    records = kept * setup.planes.shape[1] * 4
    return (
        Stream("tile_queues", "load", lists, 4 * entries),
        Stream("headers", "load", min(headers, kept * HEADER_BYTES), kept * HEADER_BYTES, asked_bytes=headers),
        Stream("triangle_data", "load", min(rest, records), records, asked_bytes=rest),
        Stream("pixels", "load", tiles, pixels if tiles else 0),
        Stream("pixels", "store", int(total[E.STORE_BYTES]), pixels),
    )


@divisible(known=_tile_sizes, work=_work)
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
    clear_color: int = 0,
    clear_depth: float = 1.0,
    counting: bool = True,
    units: NDArray[np.int64] | None = None,
) -> tuple[FrameBuffers, NDArray[np.int64] | None]:
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
    clear_color : int
        RGBA from the low byte up.
    clear_depth : float
        0 to 1; release nvdiffrast always clears to 1.
    counting : bool
    units : ndarray, int64, optional
        Places in ``active_tiles`` of those to draw, where not all.

    Returns
    -------
    outputs : FrameBuffers
    works : one, a row an active tile

    """
    depth, blend, write_color, interpolate = MODES[mode]
    draw = Draw(
        log_samples=samples.bit_length() - 1,
        later_wins=release == "nvdiffrast",
        depth=depth,
        blend=blend,
        write_color=write_color,
        interpolate=interpolate,
        clear=buffers is None,
        clear_color=clear_color,
        clear_depth=clear_depth_value(clear_depth),
        half_width=8 * width,
        half_height=8 * height,
        tiles_x=-(-width // TILE),
        coalescing=int(simt.coalescing),
    )
    buffers = new_buffers(width, height, samples) if buffers is None else buffers
    if colors is None:
        colors = np.ones((int(setup.planes[:, 13:].max(initial=0)) + 1, 4), np.float32)
    drawn = active_tiles if units is None else active_tiles[units]
    table = np.zeros((len(drawn), len(FineRasterEvent)), np.int64) if counting else None
    with np.errstate(all="ignore"):
        for_parts(
            _draw_part, parts_of(len(drawn), _PART_TILES),
            drawn, tile_starts, tile_entries, setup, colors, draw, buffers, True if samples > 1 else None, table,
        )  # fmt: skip
    return buffers, table
