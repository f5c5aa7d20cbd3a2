"""Stamps: the samples of n x n pixels tested at once (Pineda 1988; Fatahalian et al. 2009, the baseline).

Stamps are aligned to the screen. Those that touch the polygon's box are tested, or, with ``touch="polygon"``, only
those that the polygon itself reaches. With a coarse stamp (Greene 1996), a coarse stamp that the polygon does not reach
is culled, one that it fills is accepted without a sample test, and only the others are cut into stamps.

A warp draws 256 polygons from a queue and takes them one by one: its lanes sort the stamps of the box (and the coarse
ones) 32 at a time, then test the samples of as many whole stamps as fit a warp, or a warp's worth of one stamp.
"""

from enum import IntEnum
from typing import Any, Literal, NamedTuple

import numpy as np

from tilestamp.models.coalescing import contiguous
from tilestamp.models.counters import shown
from tilestamp.models.errors import TilestampError
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.fatahalian2009.micropolygon_cover import (
    STEP,
    covering_triangle,
    depth_at,
    fills,
    new_setup,
    set_up,
    touches,
)
from tilestamp.simulator.stages.fatahalian2009.micropolygon_samples import (
    Samples,
    blocks,
    count_hits,
    keep_nearest,
    on_screen,
)
from tilestamp.simulator.stages.fatahalian2009.micropolygons import Micropolygons
from tilestamp.simulator.stages.sample_tests import SAMPLE_COUNTERS
from tilestamp.simulator.work import Work

Touch = Literal["box", "polygon"]
CHUNK = 256  # polygons that a warp draws from the queue
WARPS = 4  # in a block


@shown(*SAMPLE_COUNTERS)
class StampsEvent(IntEnum):
    """Events of one chunk of polygons."""

    POLYGONS = 0  # set up, the whole warp doing the same
    COARSE_STAMPS = 1  # coarse stamps sorted into culled, filled and others
    COARSE_WARPS = 2  # warp executions of that
    BOX_STAMPS = 3  # stamps of the box, or of the coarse stamps left, that are looked at
    BOX_WARPS = 4  # warp executions of that
    STAMPS = 5  # stamps tested
    TEST_WARPS = 6  # warp executions of the sample test
    SAMPLE_TESTS = 7
    SAMPLE_HITS = 8  # hits by tests
    FILLED_SAMPLES = 9  # hits of filled coarse stamps: no test
    FILLED_WARPS = 10
    HIT_WARPS = 11  # warp executions of depth and atomic
    ATOMIC_LANES = 12
    ATOMIC_REQUESTS = 13
    ATOMIC_DEPTH = 14  # 1 each: the lanes test different samples of one polygon
    LOAD_TRANSACTIONS = 15
    LOAD_BYTES = 16


class StampShape(NamedTuple):
    """How stamps are laid and chosen: pixels, and pixels of the coarse stamp (0: one level)."""

    width: int
    height: int
    polygon: bool  # only stamps that the polygon reaches
    coarse: int


def stamp_shape(stamp: int | tuple[int, ...], touch: Touch, coarse: int = 0) -> StampShape:
    """Check the options of stamps; raises TilestampError."""
    width, height = (stamp, stamp) if isinstance(stamp, int) else stamp
    if coarse and (coarse < max(width, height) or coarse % width or coarse % height):
        raise TilestampError(f"a coarse stamp is a whole number of {width}x{height} stamps wide and high, not {coarse}")
    return StampShape(width, height, touch == "polygon", coarse)


def stamps(polygons: Micropolygons, samples: Samples, shape: StampShape, simt: Simt) -> StageResult[Samples]:
    """Draw ``polygons`` into ``samples``.

    Parameters
    ----------
    polygons : Micropolygons
    samples : Samples
        Written.
    shape : StampShape
    simt : Simt

    Returns
    -------
    outputs : Samples
    works : one, a row for each chunk of 256 polygons
    """
    units = -(-len(polygons.patch) // CHUNK)
    table = np.zeros((units, len(StampsEvent)), np.int64)
    _stamps(polygons.vertices, samples, shape, Simt(*map(int, simt)), table)
    loaded = int(table[:, StampsEvent.LOAD_BYTES].sum())
    written = int(table[:, StampsEvent.ATOMIC_REQUESTS].sum()) * 32
    streams = (
        Stream("micropolygons", "load", loaded, polygons.vertices.nbytes),
        Stream("samples", "atomic", written, int(np.count_nonzero(samples.requests)) * 32),
    )
    grid = blocks(simt, WARPS)
    work = Work(
        stage="stamps",
        kernel="stamps",
        events=StampsEvent,
        table=table,
        grid=grid,
        block=WARPS * simt.warp,
        shared_bytes=0,
        dispatch="warp_queue",
        streams=streams,
        atomic_requests=samples.requests,
    )
    return StageResult(samples, (work,))


@kernel
def _stamps(vertices: Any, samples: Samples, shape: StampShape, simt: Simt, table: Any) -> None:
    setup = new_setup()
    corners = vertices.shape[1]
    addresses = np.empty(simt.warp, np.int64)
    for unit in range(len(table)):
        row = table[unit]
        last = min(len(vertices), (unit + 1) * CHUNK)
        size = (last - unit * CHUNK) * corners * 12
        count, total = contiguous(unit * CHUNK * corners * 12, size, simt.coalescing)
        row[StampsEvent.LOAD_TRANSACTIONS] += count
        row[StampsEvent.LOAD_BYTES] += total
        for p in range(unit * CHUNK, last):
            set_up(vertices[p], setup[0], setup[1], setup[2], setup[3])
            row[StampsEvent.POLYGONS] += 1
            box = on_screen(setup[1], samples.width, samples.height)
            if box[2] < box[0] or box[3] < box[1]:
                continue
            if shape.coarse:
                _two_levels(p, corners, setup, samples, shape, simt, row, addresses, box)
            else:
                _one_level(p, corners, setup, samples, shape, simt, row, addresses, box)


@kernel
def _two_levels(
    p: int,
    corners: Any,
    setup: Any,
    samples: Samples,
    shape: StampShape,
    simt: Simt,
    row: Any,
    addresses: Any,
    box: Any,
) -> None:
    """Sort the coarse stamps of a box into culled, filled, and those to be cut into stamps."""
    edges, boxes, _, _ = setup
    side = shape.coarse * STEP
    seen = 0
    for j in range(box[1] // side, box[3] // side + 1):
        for i in range(box[0] // side, box[2] // side + 1):
            x0, y0, x1, y1 = i * side, j * side, (i + 1) * side, (j + 1) * side
            seen += 1
            if fills(edges, corners, x0, y0, x1, y1):
                _fill(p, setup, samples, simt, row, addresses, i * shape.coarse, j * shape.coarse, shape.coarse)
            elif touches(edges, boxes, corners, x0, y0, x1, y1):
                part = (max(x0, box[0]), max(y0, box[1]), min(x1 - 1, box[2]), min(y1 - 1, box[3]))
                _one_level(p, corners, setup, samples, shape, simt, row, addresses, part)
    row[StampsEvent.COARSE_STAMPS] += seen
    row[StampsEvent.COARSE_WARPS] += -(-seen // simt.warp)


@kernel
def _one_level(
    p: int,
    corners: Any,
    setup: Any,
    samples: Samples,
    shape: StampShape,
    simt: Simt,
    row: Any,
    addresses: Any,
    box: Any,
) -> None:
    """Test the stamps of a box in row order, whole stamps to a warp where they fit."""
    edges, boxes, _, _ = setup
    wide, high = shape.width * STEP, shape.height * STEP
    each = shape.width * shape.height * len(samples.offsets)
    looked = 0
    used, hits = 0, 0  # lanes of the warp that is being filled, and those of them that hit
    for j in range(box[1] // high, box[3] // high + 1):
        for i in range(box[0] // wide, box[2] // wide + 1):
            looked += 1
            x0, y0 = i * wide, j * high
            if shape.polygon and not touches(edges, boxes, corners, x0, y0, x0 + wide, y0 + high):
                continue
            row[StampsEvent.STAMPS] += 1
            row[StampsEvent.SAMPLE_TESTS] += each
            if used + each > simt.warp:
                used, hits = _end_warp(samples, simt, row, addresses, used, hits)
            used, hits = _test_stamp(p, setup, samples, shape, simt, row, addresses, i, j, used, hits)
    _end_warp(samples, simt, row, addresses, used, hits)
    row[StampsEvent.BOX_STAMPS] += looked
    row[StampsEvent.BOX_WARPS] += -(-looked // simt.warp)


@kernel
def _test_stamp(
    p: int,
    setup: Any,
    samples: Samples,
    shape: StampShape,
    simt: Simt,
    row: Any,
    addresses: Any,
    i: int,
    j: int,
    used: int,
    hits: int,
) -> tuple[int, int]:
    """Test every sample of one stamp, those off screen in vain; returns the lanes in use and their hits."""
    edges, _, depths, _ = setup
    for y in range(j * shape.height, (j + 1) * shape.height):
        for x in range(i * shape.width, (i + 1) * shape.width):
            inside = x < samples.width and y < samples.height
            if inside:
                samples.tests[y, x] += len(samples.offsets)
            for s in range(len(samples.offsets)):
                if used == simt.warp:
                    used, hits = _end_warp(samples, simt, row, addresses, used, hits)
                at_x, at_y = x * STEP + samples.offsets[s, 0], y * STEP + samples.offsets[s, 1]
                triangle = covering_triangle(edges, at_x, at_y) if inside else -1
                if triangle >= 0:
                    depth = depth_at(edges, depths, triangle, at_x, at_y)
                    addresses[hits] = keep_nearest(samples, x, y, s, depth, p)
                    hits += 1
                used += 1
    return used, hits


@kernel
def _end_warp(samples: Samples, simt: Simt, row: Any, addresses: Any, used: int, hits: int) -> tuple[int, int]:
    """Count one warp execution of the test, and the atomics of its hits; returns no lanes in use, no hits."""
    if used > 0:
        row[StampsEvent.TEST_WARPS] += 1
    if hits > 0:
        row[StampsEvent.SAMPLE_HITS] += hits
        _count_hits(samples, addresses, hits, simt.atomic_merge, row)
    return 0, 0


@kernel
def _count_hits(samples: Samples, addresses: Any, hits: int, merge: int, row: Any) -> None:
    lanes, requests, _, depth = count_hits(samples, addresses, hits, merge)
    row[StampsEvent.HIT_WARPS] += 1
    row[StampsEvent.ATOMIC_LANES] += lanes
    row[StampsEvent.ATOMIC_REQUESTS] += requests
    row[StampsEvent.ATOMIC_DEPTH] += depth


@kernel
def _fill(
    p: int, setup: Any, samples: Samples, simt: Simt, row: Any, addresses: Any, left: int, top: int, size: int
) -> None:
    """Write every sample of a coarse stamp that one triangle fills, a warp's worth at a time."""
    edges, _, depths, _ = setup
    used = 0
    for y in range(top, min(top + size, samples.height)):
        for x in range(left, min(left + size, samples.width)):
            for s in range(len(samples.offsets)):
                at_x, at_y = x * STEP + samples.offsets[s, 0], y * STEP + samples.offsets[s, 1]
                triangle = covering_triangle(edges, at_x, at_y)
                depth = depth_at(edges, depths, triangle, at_x, at_y)
                addresses[used] = keep_nearest(samples, x, y, s, depth, p)
                used += 1
                if used == simt.warp:
                    used = _end_fill(samples, simt, row, addresses, used)
    _end_fill(samples, simt, row, addresses, used)


@kernel
def _end_fill(samples: Samples, simt: Simt, row: Any, addresses: Any, used: int) -> int:
    if used > 0:
        row[StampsEvent.FILLED_SAMPLES] += used
        row[StampsEvent.FILLED_WARPS] += 1
        _count_hits(samples, addresses, used, simt.atomic_merge, row)
    return 0
