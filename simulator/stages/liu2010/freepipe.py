"""FreePipe: one thread a triangle, straight to the frame buffer in DRAM by atomics (Liu et al. 2010).

Two ways to pack a fragment:

"64"  depth and payload in one 64-bit atomicMin. The payload here is the triangle's number.
"32"  the original's, for GPUs without that: 24 bits of colour in halves, each below the same 20 bits of depth, in two
      32-bit atomicMin. Two fragments of equal depth can each win one half: a colour that no triangle has.

``early`` reads the pixel and leaves the atomic out where it cannot win. How many are left out depends on timing; the
model is that warps run one after another in the order of their triangles, and that all lanes read before any writes.
A real machine runs thousands of warps at once, reads older values and leaves out fewer.

The picture does not depend on the order of atomics, for a minimum has none. But it does not keep the order of input
either: where several triangles share the least depth of a pixel, the least payload wins, and not the first triangle.
"""

from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.atomics import CHUNK_BYTES
from tilestamp.models.errors import TilestampError
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Coalescing, Simt
from tilestamp.simulator.parallel import for_parts
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.liu2010.freepipe_events import FreePipeEvent
from tilestamp.simulator.stages.liu2010.freepipe_lanes import WARP, FrameShape
from tilestamp.simulator.stages.liu2010.freepipe_triangle import (
    SUBPIXEL_BITS,
    Pieces,
    fixed_depth,
    make_pieces,
    start_edges,
)
from tilestamp.simulator.stages.liu2010.freepipe_warp import draw_blocks
from tilestamp.simulator.work import Work

Packing = Literal["64", "32"]
BLOCK = 256  # threads
UNROLLED_LOG2 = 2  # of 4 pixels in a turn of the inner loop, as nvcc 13 compiles it for machines that load by sectors
WORKERS = 4  # shares of the blocks, and strips of the frame, that run side by side
EMPTY = 2**64 - 1  # a pixel that nothing was drawn to
MAX_SIDE = 16384  # pixels: beyond, edge functions leave the range of the original's integers by far


class FreePipeFrame(NamedTuple):
    """What is left in the frame buffer; row 0 is the bottom row."""

    ids: NDArray[np.int32]  # (H, W) input triangle of the nearest fragment, -1 where there is none
    depth: NDArray[np.uint32]  # (H, W) fixed point, 2**32 - 1 where there is none; of packing "32" the upper 20 bits
    colors: NDArray[np.uint32] | None  # (H, W) 24 bits, packing "32" only
    tied: NDArray[np.bool_]  # (H, W) another fragment has the same packed depth but another payload
    mixed: NDArray[np.bool_]  # (H, W) the halves of the colour come from two fragments


@kernel
def _draw_strip(part: int, parts: int, pieces: Pieces, colors: Any, frame: Any, halves: Any, tied: Any) -> None:
    """Draw all triangles to a share of the rows, in input order.

    ``frame`` holds the least of depth and payload; ``halves`` (None for packing "64") the two words of packing "32".
    """
    rows = frame.shape[0]
    first_row, end_row = rows * part // parts, rows * (part + 1) // parts
    edge = np.empty(9, np.int64)
    pixel = np.empty(3, np.int64)
    sixteen = np.float32(16)
    for t in range(pieces.kind.size):
        for p in range(pieces.first[t], pieces.first[t + 1]):
            box = pieces.box[p]
            if box[1] < box[0] or box[3] < first_row or box[2] >= end_row:
                continue
            start_edges(pieces.corner[p], SUBPIXEL_BITS, box[0], box[2], edge)
            row_depth = pieces.depth[p, 0]
            for y in range(box[2], min(np.int64(box[3]) + 1, end_row)):
                if y >= first_row:
                    depth = row_depth
                    for k in range(3):
                        pixel[k] = edge[k]
                    for x in range(box[0], box[1] + 1):
                        if pixel[0] | pixel[1] | pixel[2] >= 0:
                            fixed = fixed_depth(depth)
                            if halves is not None:
                                _keep_halves(frame, halves, tied, y, x, np.uint64(fixed >> 12), t, colors)
                            else:
                                _keep_least(frame, tied, y, x, np.uint64(fixed), np.uint64(t + 1))
                        for k in range(3):
                            pixel[k] -= edge[4 + 2 * k]
                        depth += pieces.depth[p, 1] * sixteen
                for k in range(3):
                    edge[k] += edge[3 + 2 * k]
                row_depth += pieces.depth[p, 2] * sixteen


@kernel(lent=True)
def _keep_least(frame: Any, tied: Any, y: int, x: int, depth: Any, payload: Any) -> None:
    value = (depth << np.uint64(32)) | payload
    old = frame[y, x, 0]
    if depth <= old >> np.uint64(32):
        tied[y, x] = depth == old >> np.uint64(32) and payload != old & np.uint64(0xFFFFFFFF)
        if value < old:
            frame[y, x, 0] = value


@kernel(lent=True)
def _keep_halves(frame: Any, halves: Any, tied: Any, y: int, x: int, depth: Any, t: int, colors: Any) -> None:
    """Both words, and beside them the least of depth, colour and triangle: what one wide word would hold."""
    color = np.uint64(colors[t])
    old = frame[y, x, 0]
    wide = (depth << np.uint64(24)) | color
    if depth <= old >> np.uint64(24):
        same = depth == old >> np.uint64(24)
        tied[y, x] = same and (tied[y, x] or color != old & np.uint64(0xFFFFFF))
        if wide < old:
            frame[y, x, 0], frame[y, x, 1] = wide, np.uint64(t + 1)
    high = np.uint32((depth << np.uint64(12)) | (color >> np.uint64(12)))
    low = np.uint32((depth << np.uint64(12)) | (color & np.uint64(0xFFF)))
    halves[y, x, 0] = min(halves[y, x, 0], high)
    halves[y, x, 1] = min(halves[y, x, 1], low)


def freepipe(
    positions: NDArray[np.float32],
    triangles: NDArray[np.int32],
    width: int,
    height: int,
    simt: Simt,
    *,
    packing: Packing = "64",
    early: bool = False,
    block: int = BLOCK,
    colors: NDArray[np.uint32] | None = None,
    counting: bool = True,
) -> StageResult[FreePipeFrame]:
    """Draw triangles with one thread each.

    Parameters
    ----------
    positions : ndarray, (V, 4), float32
        Clip space.
    triangles : ndarray, (F, 3), int32
    width, height : int
        Pixels.
    simt : Simt
        The machine's shape.
    packing : {"64", "32"}
        How a fragment lies in memory.
    early : bool
        Read the pixel first (packing "64" only).
    block : int
        Threads in a block, a multiple of 32 up to 1024.
    colors : ndarray, (F,), uint32, optional
        24-bit colour of each triangle: the payload of packing "32".
    counting : bool
        Fill the work table.

    Returns
    -------
    outputs : FreePipeFrame
    works : one, a row a block
    facts : dict
        ``fragments``, ``pixels_tested``, ``tied_pixels``, ``mixed_pixels``.

    Raises
    ------
    TilestampError
        For an option that does not exist, or an index out of range.
    """
    _check(width, height, simt)
    pieces = make_pieces(positions, triangles, width, height)
    if colors is None:
        colors = ((np.arange(len(triangles)) + 1) & 0xFFFFFF).astype(np.uint32)
    frame = _make_frame(pieces, width, height, packing, np.ascontiguousarray(colors, np.uint32))
    facts: dict[str, Any] = {
        "tied_pixels": int(frame.tied.sum()),
        "mixed_pixels": int(frame.mixed.sum()),
        "frame_bytes": 8 * width * height,
    }
    if not counting:
        return StageResult(frame, (), facts)
    work = _make_work(triangles, positions, pieces, width, height, simt, packing, early, block)
    facts["pixels_tested"] = work.total(FreePipeEvent.SAMPLE_TESTS)
    facts["fragments"] = work.total(FreePipeEvent.SAMPLE_HITS)
    return StageResult(frame, (work,), facts)


def _check(width: int, height: int, simt: Simt) -> None:
    if simt.warp != WARP:
        raise TilestampError(f"freepipe: warps of {simt.warp} lanes are not supported, only {WARP}")
    if not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE):
        raise TilestampError(f"size {width}x{height}: freepipe draws 1 to {MAX_SIDE} pixels in each direction")


def _make_frame(pieces: Pieces, width: int, height: int, packing: str, colors: NDArray[np.uint32]) -> FreePipeFrame:
    """Draw, in strips of rows side by side: a minimum does not ask who comes first."""
    tied = np.zeros((height, width), np.bool_)
    if packing == "64":
        words = np.full((height, width, 1), EMPTY, np.uint64)
        for_parts(_draw_strip, WORKERS, pieces, colors, words, None, tied)
        payload, depth = words.view(np.uint32).reshape(height, width, 2).transpose(2, 0, 1)
        ids = np.maximum(payload.view(np.int32) - np.int32(1), np.int32(-1))  # an empty pixel's payload is -1
        return FreePipeFrame(ids, depth.copy(), None, tied, np.zeros_like(tied))
    wide = np.full((height, width, 2), EMPTY, np.uint64)
    halves = np.full((height, width, 2), 2**32 - 1, np.uint32)
    for_parts(_draw_strip, WORKERS, pieces, colors, wide, halves, tied)
    drawn = wide[..., 0] != EMPTY
    mix = (halves[..., 0] & np.uint32(0xFFF)) << np.uint32(12) | halves[..., 1] & np.uint32(0xFFF)
    mixed = drawn & (mix != (wide[..., 0] & np.uint64(0xFFFFFF)))
    nearest = np.where(drawn, wide[..., 1].astype(np.int64) - 1, -1).astype(np.int32)
    return FreePipeFrame(nearest, halves[..., 0] >> np.uint32(12) << np.uint32(12), mix, tied, mixed)


def _make_work(
    triangles: NDArray[np.int32],
    positions: NDArray[np.float32],
    pieces: Pieces,
    width: int,
    height: int,
    simt: Simt,
    packing: str,
    early: bool,
    block: int,
) -> Work:
    """Play all warps in lockstep and count."""
    blocks, pixels = -(-len(triangles) // block), width * height
    unroll = UNROLLED_LOG2 if simt.coalescing == Coalescing.WARP_SECTORS else 0
    second = -(-4 * pixels // 256) * 256
    shape = FrameShape(width, 8, 1, 0, unroll) if packing == "64" else FrameShape(width, 4, 2, second, unroll)
    plane = max(shape.plane_bytes, shape.word_bytes * pixels)
    workers = 1 if early else WORKERS
    table = np.zeros((blocks, len(FreePipeEvent)), np.int64)
    chunks = np.zeros((workers, -(-plane // CHUNK_BYTES)), np.int32)
    words = np.full(pixels, EMPTY, np.uint64) if early else None
    for_parts(draw_blocks, workers, triangles, pieces, block, shape, simt, table, chunks, words)
    requests = np.tile(chunks.sum(axis=0, dtype=np.int64), shape.words)
    E = FreePipeEvent
    served = CHUNK_BYTES * int(table[:, E.ATOMIC_REQUESTS].sum())
    streams = (
        Stream("triangles", "load", triangles.nbytes, triangles.nbytes),
        Stream("positions", "load", 3 * 16 * len(triangles), positions.nbytes),
        Stream("frame", "atomic", served, CHUNK_BYTES * int(np.count_nonzero(requests))),
    )
    return freepipe_work(table, block, early, streams, requests)


def freepipe_work(
    table: NDArray[np.int64],
    block: int,
    early: bool,
    streams: tuple[Stream, ...] = (),
    requests: NDArray[np.int64] | None = None,
) -> Work:
    """Work of the kernel, a row a block."""
    kernel = "freepipe_early" if early else "freepipe"
    return Work("freepipe", FreePipeEvent, table, block, kernel=kernel, streams=streams, atomic_requests=requests)
