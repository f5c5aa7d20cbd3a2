"""The work of fine raster, from the rows of its tiles."""

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.coalescing import smallest_transaction_bytes
from tilestamp.models.launch import SECTOR_BYTES, Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.stages.laine2011.fine_raster_queue import HEADER_BYTES, PIXELS, SEGMENT, TILE, FineRasterEvent
from tilestamp.simulator.stages.laine2011.triangle_setup import Release
from tilestamp.simulator.stages.laine2011.triangle_setup_paths import Setup
from tilestamp.simulator.work import Work, column_sums

WARPS = 20  # a block
TABLE_BYTES = 6144  # edge coverage, shared
WARP_BYTES = {1: 2112, 2: 1856, 4: 1856, 8: 1856}
SHARED_BYTES = 48 << 10  # a block can have at most
WORD_BYTES = 4 * PIXELS  # of a warp, for each further word that its pixels keep
START_LOADS = 3  # of a warp that starts: whether a buffer was too small
DRAW_REQUESTS = {"1.1": 1, "nvdiffrast": 2}  # of a draw, to one sector: the counter; and the number of tiles beside it


def fine_work(
    rows: NDArray[np.int64],
    setup: Setup,
    tile_entries: NDArray[np.int32],
    width: int,
    height: int,
    simt: Simt,
    *,
    release: Release,
    samples: int,
    mode: str,
    words: int = 1,
) -> Work:
    """Work of the kernel, from the rows of all active tiles, which become its table, and the inputs of ``fine_raster``.

    With more ``words`` of colour a pixel than one there are as many warps as shared memory has room for.
    """
    each = WARP_BYTES[samples] + (words - 1) * WORD_BYTES
    warps = min(WARPS, (SHARED_BYTES - TABLE_BYTES) // each)
    _add_starts(rows, warps * simt.sms, smallest_transaction_bytes(int(simt.coalescing)))
    shared = TABLE_BYTES + warps * each + (2**samples if samples > 1 else 0)
    totals = column_sums(rows)
    queue = np.array([DRAW_REQUESTS[release] * totals[FineRasterEvent.ATOMIC]])
    return Work(
        stage="fine_raster",
        kernel="fineRaster",
        events=FineRasterEvent,
        table=rows,
        grid=simt.sms,
        block=32 * warps,
        shared_bytes=shared,
        dispatch="warp_queue",
        streams=_streams(totals, setup, len(tile_entries), width, height, samples),
        atomic_requests=queue,
        variant="" if release == "nvdiffrast" else mode if samples == 1 else f"{mode} msaa",
    )


def _add_starts(rows: NDArray[np.int64], warps: int, segment_bytes: int) -> None:
    """Add what a warp does besides its tiles to the first that it draws: it starts, and its last draw finds no tile."""
    if not len(rows):
        return
    E, starts = FineRasterEvent, np.bincount(np.arange(warps) % len(rows))
    for event in (E.WARP_STARTS, E.ATOMIC, E.ATOMIC_LANES, E.ATOMIC_REQUESTS, E.ATOMIC_DEPTH):
        rows[: len(starts), event] += starts
    loads = np.ones(len(rows), np.int64)  # with each draw, here of a tile, the number of tiles
    loads[: len(starts)] += (1 + START_LOADS) * starts
    rows[:, E.LOAD_TRANSACTIONS] += loads
    rows[:, E.LOAD_BYTES] += loads * segment_bytes


def _streams(
    totals: list[int], setup: Setup, entries: int, width: int, height: int, samples: int
) -> tuple[Stream, ...]:
    """Buffers that fine raster reads and writes; records are what is left of the loads after lists and headers.

    Tiles that share a triangle are drawn at about the same time: of headers and records what is read again is found in
    a cache, and each passes once, or once an SM that asks for it where L1 is what keeps it.
    """
    E = FineRasterEvent
    segments, lanes, loads, loaded, stored = (
        totals[event] for event in (E.SEGMENTS, E.ENTRY_LANES, E.TILE_LOADS, E.LOAD_BYTES, E.STORE_BYTES)
    )
    lists, headers, tiles = segments * 4 * SEGMENT, lanes * HEADER_BYTES, loads * 2 * 4 * PIXELS * samples
    kept = int(setup.subtriangles.sum(dtype=np.int64))
    pixels = 2 * 4 * PIXELS * samples * (-(-width // TILE) * -(-height // TILE))
    rest = max(loaded - lists - headers - tiles, 0)
    return (
        Stream("tile_queues", "load", lists, 4 * entries),
        _gathered("headers", headers, kept * HEADER_BYTES),
        _gathered("triangle_data", rest, kept * setup.planes.shape[1] * 4),
        Stream("pixels", "load", tiles, pixels if tiles else 0),
        Stream("pixels", "store", stored, pixels),
    )


def _gathered(buffer: str, requested: int, size: int) -> Stream:
    """Records that lanes read each for itself: hardly two lie in one line."""
    lines = requested // SECTOR_BYTES
    return Stream(buffer, "load", min(requested, size), size, requested_bytes=requested, partial_lines=lines)
