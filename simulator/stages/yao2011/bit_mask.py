"""Bit masks: samples that a patch has hit are not tested again by its later micropolygons (Yao et al. 2012, section 2).

One mask a patch, a bit for each sample of the patch's box, and one warp a patch. Its lanes take consecutive
micropolygons; each lane reads the words of its box, row by row, and tests the samples whose bits are clear. Hits are
written to the mask (an atomic or) at the end of the step, so lanes in flight together do not see each other's: with
``lanes=1`` the patch is processed in sequence, as the paper's Figure 2 draws it.

The mask supposes that a patch covers no sample twice. ``plain`` is the paper's and errs where it does; two variants:

facing      a mask for each facing: patches that turn over or show their back stay right, folds of one facing do not
depth       a set bit filters only if what the patch has at that sample lies in front of the whole micropolygon: exact,
            for a read of the depth at each set bit
"""

from enum import IntEnum
from typing import Any, Literal, get_args

import numpy as np

from tilestamp.models.atomics import count_atomics
from tilestamp.models.coalescing import contiguous
from tilestamp.models.counters import shown
from tilestamp.models.errors import TilestampError
from tilestamp.models.kernel import kernel
from tilestamp.models.simt import Simt
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.fatahalian2009.micropolygon_cover import STEP, covering_triangle, depth_at, set_up
from tilestamp.simulator.stages.fatahalian2009.micropolygon_samples import (
    Samples,
    count_hit_warp,
    draw_in_parts,
    hit_columns,
    keep_nearest,
    pixel_box,
    units_of,
)
from tilestamp.simulator.stages.fatahalian2009.micropolygons import Micropolygons
from tilestamp.simulator.stages.fatahalian2009.warp_queue import sample_streams, warp_queue
from tilestamp.simulator.stages.sample_tests import SAMPLE_COUNTERS
from tilestamp.simulator.stages.yao2011.bit_mask_words import new_mask, next_word, patch_box

MaskKind = Literal["plain", "facing", "depth"]
KINDS: tuple[MaskKind, ...] = get_args(MaskKind)
SHARED_WORDS = 512  # mask words of a warp in shared memory; larger masks lie in global memory
LANE = 8  # columns of a lane's walk: x0, y0, x1, y1 in pixels, row, next word, pending bits, mask layer


@shown(*SAMPLE_COUNTERS)
class BitMaskEvent(IntEnum):
    """Events of one patch."""

    POLYGONS = 0  # set up, a lane each
    SETUP_WARPS = 1
    MASK_READS = 2  # words read, a lane each
    MASK_READ_WARPS = 3  # warp executions of that, mask in shared memory
    GLOBAL_READ_WARPS = 4  # the same, mask in global memory
    DEPTH_READS = 5  # samples whose depth is looked up (depth mask)
    TEST_WARPS = 6
    SAMPLE_TESTS = 7
    SAMPLE_HITS = 8  # new hits
    HIT_WARPS = 9  # warp executions of depth and atomic
    MASK_WRITES = 10  # bits set, a lane each
    MASK_WRITE_WARPS = 11  # warp executions of the atomic or, mask in shared memory
    GLOBAL_WRITE_WARPS = 12
    MASK_WRITE_CONFLICTS = 13  # lanes at a word that an earlier lane of the instruction has
    CLEAR_WARPS = 14  # warp executions that clear the mask
    BANK_REPLAYS = 15  # passes of shared atomics beyond the first
    ATOMIC_LANES = 16
    ATOMIC_REQUESTS = 17
    ATOMIC_CONFLICTS = 18
    ATOMIC_DEPTH = 19
    LOAD_TRANSACTIONS = 20
    LOAD_BYTES = 21


HITS = hit_columns(BitMaskEvent)


def bit_mask(polygons: Micropolygons, samples: Samples, kind: MaskKind, lanes: int, simt: Simt) -> StageResult[Samples]:
    """Draw ``polygons`` into ``samples`` with a mask a patch.

    Parameters
    ----------
    polygons : Micropolygons
        Those of a patch next to each other.
    samples : Samples
        Written.
    kind : {"plain", "facing", "depth"}
    lanes : int
        Micropolygons in flight in a warp, 1 to the machine's warp.
    simt : Simt

    Returns
    -------
    outputs : Samples
    works : one, a row for each patch that has polygons
    """
    simt = Simt(*map(int, simt))
    if not 1 <= lanes <= simt.warp:
        raise TilestampError(f"1 to {simt.warp} micropolygons are in flight in a warp, not {lanes}")
    starts = np.flatnonzero(np.diff(polygons.patch, prepend=-1, append=np.iinfo(np.int32).max))
    table = np.zeros((len(starts) - 1, len(BitMaskEvent)), np.int64)
    draw_in_parts(_bit_mask, len(table), samples, polygons.vertices, starts, KINDS.index(kind), lanes, simt, table)
    streams = sample_streams(polygons.vertices.nbytes, samples, BitMaskEvent, table)
    shared = SHARED_WORDS * 4
    work = warp_queue(
        "bit_mask", BitMaskEvent, table, simt, shared_bytes=shared, streams=streams, atomic_requests=samples.requests
    )
    return StageResult(samples, (work,))


@kernel
def _bit_mask(
    part: int, parts: int, samples: Samples, vertices: Any, starts: Any, kind: int, in_flight: int, simt: Simt,
    table: Any,
) -> None:  # fmt: skip
    """Draw a share of the patches, one after another; ``kind`` is 0 plain, 1 facing, 2 depth."""
    lanes = (
        np.zeros((in_flight, 6, 4), np.int64),  # edges
        np.zeros((in_flight, 3, 4), np.int64),  # boxes
        np.zeros((in_flight, 2, 3)),  # depths
        np.zeros((4, 2), np.int64),
        np.zeros((in_flight, LANE), np.int64),
        np.full(in_flight, -1, np.int64),  # polygon of each lane, -1: idle
    )
    found = np.empty((3, simt.warp), np.int64)
    stride = vertices.shape[1] * 12
    for unit in units_of(part, parts, len(table)):
        row = table[unit]
        first, last = starts[unit], starts[unit + 1]
        count, total = contiguous(first * stride, (last - first) * stride, simt.coalescing)
        row[BitMaskEvent.LOAD_TRANSACTIONS] += count
        row[BitMaskEvent.LOAD_BYTES] += total
        box = patch_box(vertices, first, last, lanes[1][0], lanes[3], samples)
        if box[2] < box[0] or box[3] < box[1]:
            row[BitMaskEvent.POLYGONS] += last - first
            row[BitMaskEvent.SETUP_WARPS] += -(-(last - first) // in_flight)
            continue
        mask, nearest = new_mask(box, len(samples.offsets), 2 if kind == 1 else 1, kind == 2)
        row[BitMaskEvent.CLEAR_WARPS] += -(-mask.size // simt.warp)
        for group in range(first, last, in_flight):
            _take(vertices, group, min(last, group + in_flight), kind, samples, lanes, row)
            while _step(box, kind, mask.size <= SHARED_WORDS, samples, mask, nearest, lanes, simt, row, found):
                pass


@kernel(lent=True)
def _take(vertices: Any, first: int, last: int, kind: int, samples: Samples, lanes: Any, row: Any) -> None:
    """Set up the next polygons, a lane each."""
    edges, boxes, depths, snapped, walk, polygon = lanes
    row[BitMaskEvent.SETUP_WARPS] += 1
    row[BitMaskEvent.POLYGONS] += last - first
    for p in range(first, last):
        lane = p - first
        area = set_up(vertices[p], edges[lane], boxes[lane], depths[lane], snapped)
        x0, y0, x1, y1 = pixel_box(boxes[lane], samples.width, samples.height)
        if x1 < x0 or y1 < y0:
            continue
        polygon[lane] = p
        walk[lane, 0], walk[lane, 1], walk[lane, 2], walk[lane, 3] = x0, y0, x1, y1
        walk[lane, 4], walk[lane, 5], walk[lane, 6] = y0, -1, 0
        walk[lane, 7] = 1 if kind == 1 and area < 0 else 0


@kernel(lent=True)
def _step(
    box: Any, kind: int, shared: Any, samples: Samples, mask: Any, nearest: Any, lanes: Any, simt: Simt, row: Any,
    found: Any,
) -> bool:  # fmt: skip
    """Every lane finds its next clear sample and tests it; returns whether any lane had one.

    ``found``: room for the addresses of hits, and their words and bits of the mask.
    """
    edges, _, depths, _, walk, polygon = lanes
    spp = len(samples.offsets)
    addresses, words, bits = found[0], found[1], found[2]
    active, hits, reads = 0, 0, 0
    for lane in range(len(polygon)):
        if polygon[lane] < 0:
            continue
        read, looked = next_word(box, spp, mask, nearest, len(polygon) == 1, walk[lane], depths[lane])
        row[BitMaskEvent.MASK_READS] += read
        row[BitMaskEvent.DEPTH_READS] += looked
        reads = max(reads, read)
        pending = walk[lane, 6]
        if pending == 0:
            polygon[lane] = -1
            continue
        active += 1
        bit = 0
        while not (pending >> bit) & 1:
            bit += 1
        walk[lane, 6] = pending & (pending - 1)
        column = 32 * walk[lane, 5] + bit
        x, y, s = box[0] + column // spp, walk[lane, 4], column % spp
        samples.tests[y, x] += 1
        at_x, at_y = x * STEP + samples.offsets[s, 0], y * STEP + samples.offsets[s, 1]
        triangle = covering_triangle(edges[lane], at_x, at_y)
        if triangle >= 0:
            depth = depth_at(edges[lane], depths[lane], triangle, at_x, at_y)
            addresses[hits] = keep_nearest(samples, x, y, s, depth, polygon[lane])
            words[hits] = 4 * ((walk[lane, 7] * mask.shape[1] + y - box[1]) * mask.shape[2] + walk[lane, 5])
            bits[hits] = bit
            hits += 1
            if kind == 2:
                nearest[y - box[1], column] = min(nearest[y - box[1], column], depth)
    row[BitMaskEvent.MASK_READ_WARPS if shared else BitMaskEvent.GLOBAL_READ_WARPS] += reads
    if active:
        row[BitMaskEvent.TEST_WARPS] += 1
        row[BitMaskEvent.SAMPLE_TESTS] += active
    count_hit_warp(samples, addresses, hits, simt, row, HITS)
    if hits:
        _write_mask(mask, words, bits, hits, shared, row)
    return active > 0


@kernel(lent=True)
def _write_mask(mask: Any, words: Any, bits: Any, hits: int, shared: Any, row: Any) -> None:
    """One atomic or of the warp."""
    flat = mask.reshape(-1)
    for hit in range(hits):
        flat[words[hit] // 4] |= np.uint32(1 << bits[hit])
    _, _, conflicts, depth = count_atomics(words, hits, 0)
    row[BitMaskEvent.MASK_WRITES] += hits
    row[BitMaskEvent.MASK_WRITE_CONFLICTS] += conflicts
    if shared:
        row[BitMaskEvent.MASK_WRITE_WARPS] += 1
        row[BitMaskEvent.BANK_REPLAYS] += depth - 1
    else:
        row[BitMaskEvent.GLOBAL_WRITE_WARPS] += 1
