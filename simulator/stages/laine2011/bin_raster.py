"""Bin raster: triangles to queues by bin of 128 x 128 pixels, in input order (Laine & Karras 2011, section 4).

16 blocks of 512 threads draw batches of input triangles from an atomic counter. A block compacts the batch's
sub-triangles into a ring, takes 512 of them a round, and appends each to its own stream of every bin that it
touches. A stream is a list of segments of 512 entries; segments are closed at the end of each batch, so that coarse
raster can merge the streams into exact input order.

Which block draws which batch is decided by the machine; here batch b goes to block b mod 16. Nothing but the
``stream_totals`` depends on it.
"""

from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.parallel import for_parts
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.borrow import row_of
from tilestamp.simulator.stages.laine2011.bin_raster_batch import BinInput, play_batch
from tilestamp.simulator.stages.laine2011.bin_raster_count import BIN_SEGMENT, BLOCK, ENTRY_BYTES
from tilestamp.simulator.stages.laine2011.bin_raster_cover import HEADER_BYTES, place_pairs, transaction_bytes
from tilestamp.simulator.stages.laine2011.bin_raster_events import BinRasterEvent
from tilestamp.simulator.stages.laine2011.triangle_setup_paths import Setup
from tilestamp.simulator.work import Work

STREAMS = 16  # blocks, and streams of a bin
MAX_BATCH = 32  # rounds of 512 input triangles
MAX_BINS = 16  # in each axis
BIN_PIXELS = 128
MAX_SIDE = MAX_BINS * BIN_PIXELS  # pixels: the original cannot draw wider or higher
SEGMENT_BYTES = BIN_SEGMENT * ENTRY_BYTES + 8  # entries, next and count
SHARED_BYTES = 44304
WARPS = BLOCK // 32


class BinQueues(NamedTuple):
    """The queues of all bins, as coarse raster merges them."""

    starts: NDArray[np.int64]  # (bins + 1,) where a bin's entries start, bin = column + row * bins_x from the bottom
    entries: NDArray[np.int32]  # (pairs,) triangle * 8 + 7, or + k for its k-th sub-triangle of several; input order
    batch_counts: NDArray[np.int64]  # (batches, bins) entries of each batch: the shape of the segments
    stream_totals: NDArray[np.int64]  # (bins, 16) entries by stream
    bins_x: int
    bins_y: int


@kernel
def _play_part(part: int, _parts: int, given: Any, batch: int, counts: Any, events: Any) -> Any:
    """Play one batch, with its own rows: see ``play_batch``."""
    return play_batch(given, part, batch, counts[part], row_of(events, part))


def bin_raster(
    setup: Setup,
    width: int,
    height: int,
    simt: Simt,
    *,
    release: Literal["1.1", "nvdiffrast"] = "1.1",  # noqa: ARG001 - all four stages are called alike
    counting: bool = True,
    capacity: int | None = None,
) -> StageResult[BinQueues]:
    """Queue every sub-triangle in the bins that it touches.

    Parameters
    ----------
    setup : Setup
        What triangle setup made: ``subtriangles``, ``headers``, ``misc``.
    width, height : int
        Viewport in pixels, at most 2048 each.
    simt : Simt
        The machine's shape.
    release : {"1.1", "nvdiffrast"}
        Both queue the same; they differ in what a mix asks for the vote of single warps.
    counting : bool
        Fill the work table.
    capacity : int, optional
        Bin segments that the buffer holds; without it there is always room.

    Returns
    -------
    outputs : BinQueues
    works : one
        The first 16 rows are what a block does besides its batches (its start, and its last draw, which finds the
        queue empty); then one row a batch.
    facts : dict
        ``counters`` by the authors' names as (N, D), ``num_bin_segments``, ``bytes``, ``overflow``.

    Raises
    ------
    TilestampError
        For a viewport or a machine that the original cannot use.
    """
    check_viewport(width, height)
    segment_bytes = transaction_bytes(simt, "bin_raster")
    bins_x, bins_y = -(-width // BIN_PIXELS), -(-height // BIN_PIXELS)
    given = BinInput(
        setup.subtriangles,
        setup.headers,
        setup.misc,
        8 * width,
        8 * height,
        bins_x,
        bins_y,
        segment_bytes,
        segment_bytes.bit_length() - 1,
    )
    triangles = len(setup.subtriangles)
    batch = batch_size(triangles)
    batches = -(-triangles // batch)
    counts = np.zeros((batches, bins_x * bins_y), np.int64)
    events = np.zeros((batches, len(BinRasterEvent)), np.int64) if counting else None
    pairs = for_parts(_play_part, batches, given, batch, counts, events)
    starts = np.concatenate([[0], np.cumsum(counts.sum(axis=0))])
    cursors = starts[:-1] + np.cumsum(counts, axis=0) - counts
    entries = np.empty(starts[-1], np.int32)
    for_parts(lambda b, _: place_pairs(pairs[b], cursors[b], entries), batches)
    queues = BinQueues(starts, entries, counts, _stream_totals(counts), bins_x, bins_y)
    segments = int((-(-counts // BIN_SEGMENT)).sum())
    works = () if events is None else (_work(events, setup, len(entries), segments, segment_bytes, counts.shape[1]),)
    overflow = capacity is not None and segments > capacity
    facts: dict[str, Any] = {
        "num_bin_segments": segments,
        "bytes": segments * SEGMENT_BYTES,
        "overflow": overflow,
        "counters": _counters(works[0]) if works else {},
    }
    return StageResult(queues, works, facts)


def batch_size(triangles: int) -> int:
    """Input triangles of a batch: a multiple of 512 that gives each of the 16 blocks two batches or more."""
    return min(max(triangles // (BLOCK * 32), 1), MAX_BATCH) * BLOCK


def check_viewport(width: int, height: int) -> None:
    """Refuse what the original cannot draw.

    Raises
    ------
    TilestampError
        For a side below 1 or above 2048 pixels.
    """
    if not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE):
        raise TilestampError(f"size {width}x{height}: cudaraster draws 1 to {MAX_SIDE} pixels in each direction")


def initial_capacity(triangles: int, width: int, height: int) -> int:
    """Bin segments that the original makes room for before the first attempt (section 7)."""
    bins = -(-width // BIN_PIXELS) * -(-height // BIN_PIXELS)
    return max(STREAMS * bins, -(-triangles // BIN_SEGMENT)) + 256


def _stream_totals(counts: NDArray[np.int64]) -> NDArray[np.int64]:
    totals = np.zeros((counts.shape[1], STREAMS), np.int64)
    for stream in range(STREAMS):
        totals[:, stream] = counts[stream::STREAMS].sum(axis=0)
    return totals


def _work(events: NDArray[np.int64], setup: Setup, pairs: int, segments: int, segment_bytes: int, bins: int) -> Work:
    """Put the blocks' own rows in front, and name the buffers."""
    rest = np.zeros((STREAMS, len(BinRasterEvent)), np.int64)
    E = BinRasterEvent
    rest[:, [E.CTA_STARTS, E.ATOMIC, E.ATOMIC_LANES, E.ATOMIC_REQUESTS, E.ATOMIC_DEPTH]] = 1
    rest[:, [E.LOAD, E.LOAD_TRANSACTIONS]] = WARPS  # each warp reads the number of triangles
    rest[:, E.LOAD_BYTES] = WARPS * segment_bytes
    rest[:, E.CTA_BIN_WARPS] = -(-bins // 32)
    table_lines = 2 * -(-bins * STREAMS * ENTRY_BYTES // max(segment_bytes, STREAMS * ENTRY_BYTES))
    rest[:, E.STORE_TRANSACTIONS] = table_lines  # its first segment and its total in every bin
    rest[:, E.STORE_BYTES] = table_lines * segment_bytes
    table = np.vstack([rest, events])
    visible = int(np.sum(setup.subtriangles, dtype=np.int64))
    reads = int(table[:, BinRasterEvent.LOAD_BYTES].sum())
    writes = int(table[:, BinRasterEvent.STORE_BYTES].sum())
    counts = len(setup.subtriangles)
    streams = (
        Stream("subtriangles", "load", counts, counts),
        Stream("headers", "load", max(reads - counts, 0), visible * HEADER_BYTES),
        Stream("bin_queues", "store", writes, min(pairs * ENTRY_BYTES, segments * SEGMENT_BYTES)),
    )
    return Work(
        stage="bin_raster",
        kernel="binRaster",
        events=BinRasterEvent,
        table=table,
        grid=STREAMS,
        block=BLOCK,
        shared_bytes=SHARED_BYTES,
        dispatch="block_queue",
        streams=streams,
    )


def _counters(work: Work) -> dict[str, tuple[int, int]]:
    """Return the profiler's counters, by the authors' names: N and D, whose ratio they print (D = 0: N itself)."""
    E = BinRasterEvent
    rounds, binned = work.total(E.ROUNDS), work.total(E.TRIANGLES)
    return {
        "BinRaster / Input overflows": (work.total(E.OVERFLOWS), 0),
        "BinRaster / Avg. triangles/round": (binned, rounds),
        "BinRaster / Avg. tri bb size": (work.total(E.BOX_BINS), binned),
        "BinRaster / Coverage single path": (100 * work.total(E.SINGLE_LANES), binned),
        "BinRaster / Coverage fast path": (100 * work.total(E.FAST_LANES), binned),
        "BinRaster / Coverage slow path": (100 * work.total(E.SLOW_LANES), binned),
        "BinRaster / Segment allocs/round": (work.total(E.SEGMENTS), rounds),
    }
