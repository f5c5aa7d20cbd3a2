"""Coarse raster: the queues of bins to queues by tile of 8 x 8 pixels, in input order (Laine & Karras 2011, section 5).

As many blocks of 512 threads as the machine has SMs draw bins from an atomic counter, the fullest bin first. A block
merges the bin's 16 streams, takes 512 entries a round, finds the tiles that each touches, and appends them to the
tiles' lists of segments of 32 entries.

Which block draws which bin, and so the order of tiles among those of other bins, is decided by the machine; here
bins complete in the order in which they are drawn. No picture depends on it.
"""

from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.coalescing import SECTOR_BYTES
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.parallel import for_parts
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.borrow import row_of
from tilestamp.simulator.stages.laine2011.bin_raster import STREAMS, BinQueues, check_viewport
from tilestamp.simulator.stages.laine2011.bin_raster_cover import HEADER_BYTES, WARP, place_pairs, transaction_bytes
from tilestamp.simulator.stages.laine2011.coarse_raster_bin import play_bin
from tilestamp.simulator.stages.laine2011.coarse_raster_count import (
    BIN_TILES,
    BLOCK,
    ENTRY_BYTES,
    TILE_SEGMENT,
    TILES,
    CoarseInput,
)
from tilestamp.simulator.stages.laine2011.coarse_raster_events import CoarseRasterEvent
from tilestamp.simulator.stages.laine2011.triangle_setup_paths import Setup
from tilestamp.simulator.work import Work

TILE_PIXELS = 8
SEGMENT_BYTES = TILE_SEGMENT * ENTRY_BYTES + 8  # entries, next and count
SHARED_BYTES = 44320
WARPS = BLOCK // WARP
SORT_TOTAL = (1 << 24) - 1  # bins are sorted by the low 24 bits of their total


class TileQueues(NamedTuple):
    """The queues of all tiles, as fine raster reads them."""

    starts: NDArray[
        np.int64
    ]  # (tiles + 1,) where a tile's entries start, tile = column + row * tiles_x from the bottom
    entries: NDArray[np.int32]  # (emits,) slot of header and data, in exact input order
    active: NDArray[np.int32]  # (active,) tiles in the order in which fine raster draws them
    tiles_x: int
    tiles_y: int


@kernel
def _play_part(part: int, _parts: int, given: Any, order: Any, counts: Any, events: Any) -> Any:
    """Play one bin, with its own rows: see ``play_bin``."""
    return play_bin(given, order[part], counts[order[part]], row_of(events, part))


def coarse_raster(
    bin_queues: BinQueues,
    setup: Setup,
    width: int,
    height: int,
    simt: Simt,
    *,
    release: Literal["1.1", "nvdiffrast"] = "1.1",  # noqa: ARG001 - all four stages are called alike
    deferred_clear: bool = True,
    counting: bool = True,
    capacity: int | None = None,
) -> StageResult[TileQueues]:
    """Queue every sub-triangle in the tiles that it touches.

    Parameters
    ----------
    bin_queues : BinQueues
        What bin raster made.
    setup : Setup
        What triangle setup made: ``headers``, ``misc``.
    width, height : int
        Viewport in pixels, at most 2048 each.
    simt : Simt
        The machine's shape; one block an SM.
    release : {"1.1", "nvdiffrast"}
        Both queue and count the same.
    deferred_clear : bool
        A clear is pending: empty bins and tiles are handed on too.
    counting : bool
        Fill the work table.
    capacity : int, optional
        Tile segments that the buffer holds; without it there is always room.

    Returns
    -------
    outputs : TileQueues
    works : one
        The first rows, one a block, are its start and its last draw, which finds no bin; then one row a bin, in the
        order in which they are drawn.
    facts : dict
        ``counters`` by the authors' names as (N, D), ``num_tile_segments``, ``bytes``, ``overflow``.

    Raises
    ------
    TilestampError
        For a viewport or a machine that the original cannot use.
    """
    check_viewport(width, height)
    given = _input(bin_queues, setup, width, height, simt)
    order = bin_order(np.diff(bin_queues.starts), deferred_clear)
    bins = len(bin_queues.starts) - 1
    counts = np.zeros((bins, TILES), np.int64)
    events = np.zeros((len(order), len(CoarseRasterEvent)), np.int64) if counting else None
    bin_tiles = _bin_tiles(given, bins)
    in_frame = bin_tiles >= 0
    pairs = for_parts(_play_part, len(order), given, order, counts, events)
    starts = np.zeros(given.tiles_x * given.tiles_y + 1, np.int64)
    starts[bin_tiles[in_frame] + 1] = counts[in_frame]
    np.cumsum(starts, out=starts)
    entries = np.empty(starts[-1], np.int32)
    cursors = np.where(in_frame, starts[bin_tiles], 0)[order]
    for_parts(lambda i, _: place_pairs(pairs[i], cursors[i], entries), len(order))
    used = in_frame[order] & (deferred_clear | (counts[order] > 0))
    active = bin_tiles[order][used].astype(np.int32)
    segments = int((-(-counts // TILE_SEGMENT)).sum())
    empty = used & (counts[order] == 0)
    works = () if events is None else (_work(events, used, empty, simt, given, segments),)
    facts: dict[str, Any] = {
        "num_tile_segments": segments,
        "bytes": segments * SEGMENT_BYTES,
        "overflow": capacity is not None and segments > capacity,
        "counters": _counters(works[0]) if works else {},
    }
    return StageResult(TileQueues(starts, entries, active, given.tiles_x, given.tiles_y), works, facts)


def bin_order(totals: NDArray[np.int64], deferred_clear: bool) -> NDArray[np.int64]:
    """Bins in the order in which blocks draw them: the fullest first, equal ones by index; empty ones only to clear."""
    keys = (~totals & SORT_TOTAL) << 8 | np.arange(len(totals))
    order = np.argsort(keys)
    return order if deferred_clear else order[totals[order] > 0]


def initial_capacity(triangles: int, width: int, height: int) -> int:
    """Tile segments that the original makes room for before the first attempt (section 7)."""
    tiles = -(-width // TILE_PIXELS) * -(-height // TILE_PIXELS)
    return max(tiles, -(-triangles // TILE_SEGMENT)) + 4096


def _input(queues: BinQueues, setup: Setup, width: int, height: int, simt: Simt) -> CoarseInput:
    segment_bytes = transaction_bytes(simt, "coarse_raster")
    return CoarseInput(
        queues.starts,
        queues.entries,
        queues.batch_counts,
        setup.headers,
        setup.misc,
        8 * width,
        8 * height,
        queues.bins_x,
        -(-width // TILE_PIXELS),
        -(-height // TILE_PIXELS),
        segment_bytes,
        segment_bytes.bit_length() - 1,
    )


def _bin_tiles(given: CoarseInput, bins: int) -> NDArray[np.int64]:
    """Index in the frame of each bin's tiles, (bins, 256); -1 outside the frame."""
    b, tile = np.arange(bins)[:, None], np.arange(TILES)[None]
    x = b % given.bins_x * BIN_TILES + tile % BIN_TILES
    y = b // given.bins_x * BIN_TILES + tile // BIN_TILES
    return np.where((x < given.tiles_x) & (y < given.tiles_y), x + y * given.tiles_x, -1)


def _work(
    events: NDArray[np.int64],
    active: NDArray[np.bool_],
    empty: NDArray[np.bool_],
    simt: Simt,
    given: CoarseInput,
    segments: int,
) -> Work:
    """Put the blocks' own rows in front, and name the buffers."""
    E = CoarseRasterEvent
    rest = np.zeros((simt.sms, len(E)), np.int64)
    rest[:, [E.CTA_STARTS, E.ATOMIC, E.ATOMIC_LANES, E.ATOMIC_REQUESTS, E.ATOMIC_DEPTH]] = 1
    rest[:, [E.LOAD, E.LOAD_TRANSACTIONS, E.LOAD_BYTES]] = _sort_loads(len(given.starts) - 1, given.segment_bytes)
    _count_ends(events, active, empty, given.segment_bytes)
    _count_sort(rest, len(given.starts) - 1)
    table = np.vstack([rest, events])
    entries = len(given.entries) * ENTRY_BYTES
    again = _totals_again(len(given.starts) - 1, given.segment_bytes) * simt.sms
    streams = (
        Stream("bin_queues", "load", entries, entries),
        Stream(
            "headers",
            "load",
            max(int(table[:, E.LOAD_BYTES].sum()) - entries - again, 0),
            len(given.headers) * HEADER_BYTES,
        ),
        Stream("tile_queues", "store", int(table[:, E.STORE_BYTES].sum()), segments * SEGMENT_BYTES),
    )
    return Work(
        stage="coarse_raster",
        kernel="coarseRaster",
        events=E,
        table=table,
        grid=simt.sms,
        block=BLOCK,
        shared_bytes=SHARED_BYTES,
        dispatch="block_queue",
        streams=streams,
    )


def _count_sort(events: NDArray[np.int64], bins: int) -> None:
    """Count what each block does to sort the bins: runs of 16, then merges of runs twice as long each time."""
    E = CoarseRasterEvent
    warps = -(-bins // WARP)
    merges = max(-(-bins // 16) - 1, 0).bit_length()
    events[:, E.BIN_WARPS] = warps
    events[:, E.SORT_WARPS] = -(-max(bins // 2, 1) // WARP)
    events[:, E.SORT_MERGES] = merges
    events[:, E.SORT_STEPS] = warps * sum(4 + i for i in range(merges))


def _count_ends(
    events: NDArray[np.int64], active: NDArray[np.bool_], empty: NDArray[np.bool_], segment_bytes: int
) -> None:
    """Count what ends a bin: the numbers of its active tiles, and the mark of those that are empty."""
    E = CoarseRasterEvent
    words = segment_bytes // ENTRY_BYTES
    of_warp = active.reshape(len(active), TILES // WARP, WARP).sum(axis=2)
    row = min(words, BIN_TILES)
    marks = empty.reshape(len(empty), TILES // row, row).any(axis=2).sum(axis=1)
    events[:, E.ACTIVE_TILES] = active.sum(axis=1)
    events[:, E.ACTIVE_WARPS] = (of_warp > 0).sum(axis=1)
    stores = (-(-of_warp // words)).sum(axis=1) + marks
    events[:, E.STORE_TRANSACTIONS] += stores
    events[:, E.STORE_BYTES] += stores * segment_bytes


def _sort_loads(bins: int, segment_bytes: int) -> tuple[int, int, int]:
    """Count loads, transactions and bytes of a block that sorts the bins: two a warp, and 16 totals of each bin."""
    loads = 2 * WARPS + STREAMS * -(-bins // WARP)
    lines = (
        STREAMS * -(-bins * STREAMS * ENTRY_BYTES // segment_bytes) // max(STREAMS * ENTRY_BYTES // segment_bytes, 1)
    )
    return loads, 2 * WARPS + lines, (2 * WARPS + lines) * segment_bytes


def _totals_again(bins: int, segment_bytes: int) -> int:
    """Bytes of a block's loads of totals that its L1 holds: a lane reads the 16 words of its bin one after another.

    Machines that load by lines keep them: chains of their mixes were fitted with these loads in.
    """
    if segment_bytes != SECTOR_BYTES:
        return 0
    row = STREAMS * ENTRY_BYTES
    loaded = _sort_loads(bins, segment_bytes)[2] - 2 * WARPS * segment_bytes
    return loaded - -(-bins * row // segment_bytes) * segment_bytes


def _counters(work: Work) -> dict[str, tuple[int, int]]:
    """Return the profiler's counters, by the authors' names: N and D, whose ratio they print (D = 0: N itself)."""
    E = CoarseRasterEvent
    rounds, bins, warps = work.total(E.ROUNDS), work.total(E.BINS), work.total(E.ROUND_WARPS)
    return {
        "CoarseRaster / Bins": (bins, 0),
        "CoarseRaster / Rounds / Bin": (rounds, bins),
        "CoarseRaster / Merge / Round": (work.total(E.MERGES), rounds),
        "CoarseRaster / Triangles / Round": (work.total(E.TRIANGLES), rounds),
        "CoarseRaster / Tiles / Round": (work.total(E.TILES_TOUCHED), rounds),
        "CoarseRaster / Emits / Round": (work.total(E.EMITS), rounds),
        "CoarseRaster / Allocs / Round": (work.total(E.SEGMENTS), rounds),
        "CoarseRaster / Emits / Triangle": (work.total(E.EMITS), work.total(E.TRIANGLES)),
        "CoarseRaster / Case A": (100 * work.total(E.CASE_A_WARPS), warps),
        "CoarseRaster / Case B": (100 * work.total(E.CASE_B_WARPS), warps),
        "CoarseRaster / Case C": (100 * work.total(E.CASE_C_WARPS), warps),
    }
