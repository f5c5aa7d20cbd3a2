"""Stamps of one chunk of polygons, one polygon after another: which hit, and what the warp does for it.

All samples of a stamp are tested by lanes of the warp; here only those in the polygon's box are looked at.
"""

from typing import Any, NamedTuple

from tilestamp.models.coalescing import contiguous
from tilestamp.models.kernel import kernel
from tilestamp.models.simt import Simt
from tilestamp.simulator.stages.fatahalian2009.micropolygon_cover import (
    STEP,
    STEP_BITS,
    fills,
    in_box,
    set_edges,
    snap,
    touches,
)
from tilestamp.simulator.stages.fatahalian2009.micropolygon_samples import Samples, count_hits, hit_sample, on_screen
from tilestamp.simulator.stages.fatahalian2009.stamps_events import CHUNK, StampsEvent, StampShape


class Drawing(NamedTuple):
    """What all polygons are drawn to, and by."""

    samples: Samples
    shape: StampShape
    simt: Simt
    corners: int  # of a polygon
    setup: Any  # edges, boxes, depths, snapped corners of the polygon at hand
    addresses: Any  # of the hits of a warp


@kernel(lent=True)
def draw_chunks(
    units: Any, samples: Samples, vertices: Any, shape: StampShape, simt: Simt, table: Any, setup: Any, addresses: Any
) -> None:
    """Draw some chunks, a row of work each."""
    corners = vertices.shape[1]
    edges, boxes, depths, snapped = setup
    to = Drawing(samples, shape, simt, corners, setup, addresses)
    for unit in units:
        row = table[unit]
        last = min(len(vertices), (unit + 1) * CHUNK)
        size = (last - unit * CHUNK) * corners * 12
        count, total = contiguous(unit * CHUNK * corners * 12, size, simt.coalescing)
        row[StampsEvent.LOAD_TRANSACTIONS] += count
        row[StampsEvent.LOAD_BYTES] += total
        row[StampsEvent.POLYGONS] += last - unit * CHUNK
        for p in range(unit * CHUNK, last):
            snap(vertices[p], boxes, snapped)
            box = on_screen(boxes, samples.width, samples.height)
            if box[2] < box[0] or box[3] < box[1]:
                continue
            if shape.coarse or shape.polygon or _near_sample(boxes, box, samples):  # else no test can hit
                set_edges(vertices[p], edges, boxes, depths, snapped)
            if shape.coarse:
                _two_levels(p, to, row, box)
            else:
                _one_level(p, to, row, box, box)


@kernel(lent=True)
def _near_sample(boxes: Any, box: Any, samples: Samples) -> bool:
    """Whether a sample lies in a polygon's box."""
    for y in range(box[1] >> STEP_BITS, (box[3] >> STEP_BITS) + 1):
        for x in range(box[0] >> STEP_BITS, (box[2] >> STEP_BITS) + 1):
            for s in range(len(samples.offsets)):
                if in_box(boxes, x * STEP + samples.offsets[s, 0], y * STEP + samples.offsets[s, 1]):
                    return True
    return False


@kernel(lent=True)
def _two_levels(p: int, to: Drawing, row: Any, box: Any) -> None:
    """Sort the coarse stamps of a box into culled, filled, and those to be cut into stamps."""
    edges, boxes, _, _ = to.setup
    corners, shape, side = to.corners, to.shape, to.shape.coarse * STEP
    seen = 0
    for j in range(box[1] // side, box[3] // side + 1):
        for i in range(box[0] // side, box[2] // side + 1):
            x0, y0, x1, y1 = i * side, j * side, (i + 1) * side, (j + 1) * side
            seen += 1
            if fills(edges, corners, x0, y0, x1, y1):
                _fill(p, to, row, i * shape.coarse, j * shape.coarse, shape.coarse)
            elif touches(edges, boxes, corners, x0, y0, x1, y1):
                part = (max(x0, box[0]), max(y0, box[1]), min(x1 - 1, box[2]), min(y1 - 1, box[3]))
                _one_level(p, to, row, part, box)
    row[StampsEvent.COARSE_STAMPS] += seen
    row[StampsEvent.COARSE_WARPS] += -(-seen // to.simt.warp)


@kernel(lent=True)
def _one_level(p: int, to: Drawing, row: Any, part: Any, box: Any) -> None:
    """Test the stamps of a part of the polygon's box in row order, whole stamps to a warp where they fit."""
    edges, boxes, _, _ = to.setup
    corners, shape, lanes = to.corners, to.shape, to.simt.warp
    wide, high = shape.width * STEP, shape.height * STEP
    each = shape.width * shape.height * len(to.samples.offsets)
    looked, tested, warps = 0, 0, 0
    used, hits = 0, 0  # lanes of the warp that is being filled, and those of them that hit
    for j in range(part[1] // high, part[3] // high + 1):
        for i in range(part[0] // wide, part[2] // wide + 1):
            looked += 1
            x0, y0 = i * wide, j * high
            if shape.polygon and not touches(edges, boxes, corners, x0, y0, x0 + wide, y0 + high):
                continue
            tested += 1
            if used + each > lanes:
                warps += used > 0
                hits = _end_warp(to, row, hits)
                used = 0
            hits = _test_stamp(p, to, row, i, j, box, used, hits)
            full = (used + each - 1) // lanes  # warps that the stamp's samples fill, and go on
            warps += full
            used += each - full * lanes
    _end_warp(to, row, hits)
    row[StampsEvent.TEST_WARPS] += warps + (used > 0)
    row[StampsEvent.STAMPS] += tested
    row[StampsEvent.SAMPLE_TESTS] += tested * each
    row[StampsEvent.BOX_STAMPS] += looked
    row[StampsEvent.BOX_WARPS] += -(-looked // lanes)


@kernel(lent=True)
def _test_stamp(p: int, to: Drawing, row: Any, i: int, j: int, box: Any, used: int, hits: int) -> int:
    """Test the samples of one stamp, looking only where the polygon's box is; returns the hits of the last warp."""
    edges, boxes, depths, _ = to.setup
    samples, shape, lanes = to.samples, to.shape, to.simt.warp
    spp, left, top = len(samples.offsets), i * shape.width, j * shape.height
    right, bottom = min(left + shape.width, samples.width), min(top + shape.height, samples.height)
    for y in range(top, bottom):
        for x in range(left, right):
            samples.tests[y, x] += spp
    end = lanes - used  # of the samples of the stamp in the warp that is being filled
    for y in range(max(top, box[1] >> STEP_BITS), min(bottom, (box[3] >> STEP_BITS) + 1)):
        for x in range(max(left, box[0] >> STEP_BITS), min(right, (box[2] >> STEP_BITS) + 1)):
            for s in range(spp):
                at_x, at_y = x * STEP + samples.offsets[s, 0], y * STEP + samples.offsets[s, 1]
                if not in_box(boxes, at_x, at_y):
                    continue
                address = hit_sample(edges, depths, samples, x, y, s, at_x, at_y, p)
                if address < 0:
                    continue
                at = ((y - top) * shape.width + x - left) * spp + s
                if at >= end:
                    hits = _end_warp(to, row, hits)
                    end += (at - end) // lanes * lanes + lanes
                to.addresses[hits] = address
                hits += 1
    if shape.width * shape.height * spp > end:
        hits = _end_warp(to, row, hits)
    return hits


@kernel(lent=True)
def _end_warp(to: Drawing, row: Any, hits: int) -> int:
    """Count the atomics of the hits of one warp execution of the test; returns no hits."""
    if hits > 0:
        row[StampsEvent.SAMPLE_HITS] += hits
        _count_hits(to, hits, row)
    return 0


@kernel(lent=True)
def _count_hits(to: Drawing, hits: int, row: Any) -> None:
    lanes, requests, _, depth = count_hits(to.samples, to.addresses, hits, to.simt.atomic_merge)
    row[StampsEvent.HIT_WARPS] += 1
    row[StampsEvent.ATOMIC_LANES] += lanes
    row[StampsEvent.ATOMIC_REQUESTS] += requests
    row[StampsEvent.ATOMIC_DEPTH] += depth


@kernel(lent=True)
def _fill(p: int, to: Drawing, row: Any, left: int, top: int, size: int) -> None:
    """Write every sample of a coarse stamp that one triangle fills, a warp's worth at a time."""
    edges, _, depths, _ = to.setup
    samples, used = to.samples, 0
    for y in range(top, min(top + size, samples.height)):
        for x in range(left, min(left + size, samples.width)):
            for s in range(len(samples.offsets)):
                at_x, at_y = x * STEP + samples.offsets[s, 0], y * STEP + samples.offsets[s, 1]
                to.addresses[used] = hit_sample(edges, depths, samples, x, y, s, at_x, at_y, p)
                used += 1
                if used == to.simt.warp:
                    used = _end_fill(to, row, used)
    _end_fill(to, row, used)


@kernel(lent=True)
def _end_fill(to: Drawing, row: Any, used: int) -> int:
    if used > 0:
        row[StampsEvent.FILLED_SAMPLES] += used
        row[StampsEvent.FILLED_WARPS] += 1
        _count_hits(to, used, row)
    return 0
