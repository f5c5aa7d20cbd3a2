"""Quad shading: visible fragments by quads of 2x2 pixels, merged in a buffer or not (Fatahalian et al. 2010).

Derivatives are differences between the pixels of a quad, so that a polygon which covers a sample of one pixel is shaded
at all four; of polygons of a pixel's size most of that is waste. Polygons come in input order; samples are tested for
depth before their quads reach the buffer. A warp has a batch of consecutive polygons and a buffer of its own, whose
entries its lanes compare with a quad 32 at a time; quads that leave it are shaded eight at a time, a lane a pixel.
"""

from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.coalescing import contiguous
from tilestamp.models.counters import count, ratio, shown
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.fatahalian2009.micropolygon_cover import (
    STEP,
    STEP_BITS,
    covering_triangle,
    new_setup,
    set_up,
)
from tilestamp.simulator.stages.fatahalian2009.micropolygon_samples import Samples, hit_sample, on_screen
from tilestamp.simulator.stages.fatahalian2009.micropolygons import Micropolygons
from tilestamp.simulator.stages.fatahalian2009.warp_queue import warp_queue
from tilestamp.simulator.stages.fatahalian2010.merge_buffer import PIXELS, MergeBuffer, find, join, new_buffer, start
from tilestamp.simulator.work import Work

BATCH = 1024  # polygons that a warp takes from the queue together
QUAD_BYTES = 16  # polygon, place, covered samples: written by the rasterizer, read here; both are counted here
COLOR_BYTES = 4
ENTRY_BYTES = 48  # of the buffer in shared memory: place and facing, samples, polygon at each pixel, and vertices


@shown(
    count("QUADS", "quads rasterized"),
    count("SHADED_QUADS", "quads shaded"),
    ratio("helpers", "HELPERS", "SHADE_LANES", "shaded pixels without a sample, share"),
)
class QuadEvent(IntEnum):
    """Events of one batch of polygons."""

    BATCHES = 0  # 1: a warp that takes its batch
    QUADS = 1  # with a visible sample, in input order
    COMPARE_WARPS = 2  # comparisons of a quad with up to 32 entries
    COMPARE_LANES = 3  # entries compared
    MERGED_QUADS = 4  # that joined an entry
    SHADED_QUADS = 5  # that left the buffer
    SHADE_WARPS = 6  # of eight quads
    SHADE_LANES = 7  # pixels shaded
    HELPERS = 8  # of them, those without a sample of their own
    SAMPLE_HITS = 9  # samples that passed the depth test
    LOAD_TRANSACTIONS = 10
    LOAD_BYTES = 11
    STORE_TRANSACTIONS = 12
    STORE_BYTES = 13


class ShadedQuads(NamedTuple):
    """What was shaded.

    Parameters
    ----------
    seen : ndarray, (H * W * spp,), int32
        Polygon whose colour each sample has, -1 for none: without merging the visible one.
    shades : ndarray, (ceil(H / 2), ceil(W / 2)), int32
        How often the quad at each place was shaded.
    """

    seen: NDArray[np.int32]
    shades: NDArray[np.int32]


def corner_numbers(polygons: Micropolygons) -> NDArray[np.int64]:
    """Number of each vertex, (M, 3 or 4): the same where polygons have the same one."""
    _, number = np.unique(polygons.vertices.reshape(-1, 3), axis=0, return_inverse=True)
    return number.reshape(polygons.vertices.shape[:2]).astype(np.int64)


def quad_shading(
    polygons: Micropolygons, samples: Samples, entries: int, simt: Simt, shared: int = 1
) -> StageResult[ShadedQuads]:
    """Gather the visible quads of polygons in order, merge them, and say which polygon each sample is shaded by.

    Parameters
    ----------
    polygons : Micropolygons
    samples : Samples
        Empty buffers; filled as any rasterizer fills them.
    entries : int
        Of the merge buffer; 0: every quad is shaded as it comes.
    simt : Simt
    shared : int
        Vertices that adjacent polygons share, at least: 2 an edge, 1 a corner, 0 none.

    Returns
    -------
    outputs : ShadedQuads
    works : one, a row for each batch of 1024 polygons
    """
    table = np.zeros((-(-len(polygons.patch) // BATCH), len(QuadEvent)), np.int64)
    shades = np.zeros(((samples.height + 1) // 2, (samples.width + 1) // 2), np.int32)
    shaded = ShadedQuads(np.full(len(samples.polygon), -1, np.int32), shades)
    _quad_shading(
        polygons.vertices, corner_numbers(polygons), samples, entries, shared, shaded, Simt(*map(int, simt)), table
    )
    total = table.sum(axis=0)
    quads = int(total[QuadEvent.QUADS]) * QUAD_BYTES
    colors = int(total[QuadEvent.STORE_BYTES]) - quads
    streams = (
        Stream("quads", "load", quads, quads),
        Stream("quads", "store", quads, quads),
        Stream("colors", "store", colors, min(colors, COLOR_BYTES * len(shaded.seen))),
    )
    return StageResult(shaded, (quad_work(table, entries, simt, streams),))


def quad_work(table: NDArray[np.int64], entries: int, simt: Simt, streams: tuple[Stream, ...] = ()) -> Work:
    """A warp a batch; its quads wait in shared memory until they are merged."""
    return warp_queue("quad_shading", QuadEvent, table, simt, shared_bytes=ENTRY_BYTES * entries, streams=streams)


@kernel
def _quad_shading(
    vertices: Any,
    corners: Any,
    samples: Samples,
    entries: int,
    shared: int,
    shaded: ShadedQuads,
    simt: Simt,
    table: Any,
) -> None:
    setup, buffer = new_setup(), new_buffer(max(entries, 1))
    covers = np.zeros(PIXELS, np.bool_)
    for batch in range(len(table)):
        row = table[batch]
        row[QuadEvent.BATCHES] = 1
        for p in range(batch * BATCH, min(len(vertices), (batch + 1) * BATCH)):
            area = set_up(vertices[p], setup[0], setup[1], setup[2], setup[3])
            facing = 1 if area > 0 else -1
            x0, y0, x1, y1 = on_screen(setup[1], samples.width, samples.height)
            for j in range(y0 >> (STEP_BITS + 1), (y1 >> (STEP_BITS + 1)) + 1):
                for i in range(x0 >> (STEP_BITS + 1), (x1 >> (STEP_BITS + 1)) + 1):
                    mask = _visible(p, setup, samples, i, j, covers, row)
                    if mask != np.uint64(0):
                        _offer(p, facing, i, j, mask, covers, corners, shared, samples, entries, buffer, shaded, row)
        while buffer.span[0] < buffer.span[1]:
            _shade(buffer, samples, shaded, row)
        _count_batch(entries, simt, row)


@kernel
def _visible(p: int, setup: Any, samples: Samples, i: int, j: int, covers: Any, row: Any) -> Any:
    """Samples of a quad that a polygon covers and that pass the depth test; ``covers``: centres that it lies over."""
    spp, mask = len(samples.offsets), np.uint64(0)
    for k in range(PIXELS):
        x, y = 2 * i + (k & 1), 2 * j + (k >> 1)
        covers[k] = covering_triangle(setup[0], x * STEP + STEP // 2, y * STEP + STEP // 2) >= 0
        if x >= samples.width or y >= samples.height:
            continue
        for s in range(spp):
            at_x, at_y = x * STEP + samples.offsets[s, 0], y * STEP + samples.offsets[s, 1]
            hit = hit_sample(setup[0], setup[2], samples, x, y, s, at_x, at_y, p) >= 0
            if hit and samples.polygon[(y * samples.width + x) * spp + s] == p:
                mask |= np.uint64(1) << np.uint64(k * spp + s)
                row[QuadEvent.SAMPLE_HITS] += 1
    return mask


@kernel
def _offer(
    p: int, facing: int, i: int, j: int, mask: Any, covers: Any, corners: Any, shared: int, samples: Samples,
    entries: int, buffer: MergeBuffer, shaded: ShadedQuads, row: Any,
) -> None:  # fmt: skip
    """Put one quad into the buffer, the oldest entry making room where it joins none of a full one."""
    spp, place = len(samples.offsets), j * ((samples.width + 1) >> 1) + i
    row[QuadEvent.QUADS] += 1
    row[QuadEvent.COMPARE_LANES] += buffer.span[1] - buffer.span[0] if entries else 0
    entry = find(buffer, buffer.span[1], place, facing, mask, p, corners, shared) if entries else -1
    if entry >= 0:
        row[QuadEvent.MERGED_QUADS] += 1
    else:
        if buffer.span[1] - buffer.span[0] == len(buffer.place):
            _shade(buffer, samples, shaded, row)
        entry = start(buffer, place, facing)
    join(buffer, entry, p, mask, covers, spp)


@kernel
def _shade(buffer: MergeBuffer, samples: Samples, shaded: ShadedQuads, row: Any) -> None:
    """Shade the oldest entry and let it go; of samples that a later quad has taken since, that one writes later."""
    i, spp, wide = buffer.span[0], len(samples.offsets), (samples.width + 1) >> 1
    e = i % len(buffer.place)
    buffer.span[0] += 1
    row[QuadEvent.SHADED_QUADS] += 1
    shaded.shades[buffer.place[e] // wide, buffer.place[e] % wide] += 1
    left, top = 2 * (buffer.place[e] % wide), 2 * (buffer.place[e] // wide)
    for k in range(PIXELS):
        row[QuadEvent.HELPERS] += buffer.seen[e, k] < 0
        at = ((top + (k >> 1)) * samples.width + left + (k & 1)) * spp
        for s in range(spp):
            if (buffer.mask[e] >> np.uint64(k * spp + s)) & np.uint64(1):
                shaded.seen[at + s] = buffer.seen[e, k]


@kernel
def _count_batch(entries: int, simt: Simt, row: Any) -> None:
    """Count what follows from a batch's quads: comparisons, warps that shade, quads and colours in memory."""
    quads, shaded = row[QuadEvent.QUADS], row[QuadEvent.SHADED_QUADS]
    row[QuadEvent.COMPARE_WARPS] = quads * ((entries + simt.warp - 1) // simt.warp)
    row[QuadEvent.SHADE_LANES] = PIXELS * shaded
    row[QuadEvent.SHADE_WARPS] = (PIXELS * shaded + simt.warp - 1) // simt.warp
    number, size = contiguous(0, quads * QUAD_BYTES, simt.coalescing)
    row[QuadEvent.LOAD_TRANSACTIONS] += number
    row[QuadEvent.LOAD_BYTES] += size
    row[QuadEvent.STORE_TRANSACTIONS] += number + shaded * PIXELS // 2  # two pixels of a row lie in one segment
    row[QuadEvent.STORE_BYTES] += size + row[QuadEvent.SAMPLE_HITS] * COLOR_BYTES
