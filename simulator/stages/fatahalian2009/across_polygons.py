"""Parallelism across polygons: one lane a micropolygon, each walking its own box (Fatahalian et al. 2009).

A warp draws 256 polygons from a queue. Its lanes take one each and step through their boxes together, so that the warp
runs as long as its longest lane: the share of tests that hit (STE) and the share of lanes at work (SIMD efficiency) are
two different numbers. Three ways to hand polygons to lanes:

in-order    the next 32 when all lanes are done
sorted      as before, after the warp has sorted its 256 polygons by the samples in their boxes (a bitonic sort)
repacked    lanes that are done take further polygons as soon as half of the lanes are idle (Luong 2010, REPACK)
"""

from enum import IntEnum
from typing import Any, Literal, get_args

import numpy as np

from tilestamp.models.coalescing import contiguous
from tilestamp.models.counters import shown
from tilestamp.models.kernel import kernel
from tilestamp.models.simt import Simt
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.fatahalian2009.micropolygon_cover import STEP, set_up
from tilestamp.simulator.stages.fatahalian2009.micropolygon_samples import (
    Samples,
    count_hit_warp,
    draw_in_parts,
    hit_columns,
    hit_sample,
    pixel_box,
    units_of,
)
from tilestamp.simulator.stages.fatahalian2009.micropolygons import Micropolygons
from tilestamp.simulator.stages.fatahalian2009.warp_queue import sample_streams, warp_queue
from tilestamp.simulator.stages.sample_tests import SAMPLE_COUNTERS

Packing = Literal["in-order", "sorted", "repacked"]
PACKINGS: tuple[Packing, ...] = get_args(Packing)
CHUNK = 256  # polygons that a warp draws from the queue
SORT_STEPS = 36  # compare-exchange steps of a bitonic sort of 256 keys: 8 * 9 / 2
BOX = 5  # columns of a lane's walk: x0, y0, x1, y1, and samples done


@shown(*SAMPLE_COUNTERS)
class AcrossPolygonsEvent(IntEnum):
    """Events of one chunk of polygons."""

    POLYGONS = 0  # set up, a lane each
    SETUP_WARPS = 1  # warp executions of that
    TEST_WARPS = 2  # warp executions of the sample test
    SAMPLE_TESTS = 3  # lanes active in them
    SAMPLE_HITS = 4
    HIT_WARPS = 5  # warp executions of depth and atomic
    SORT_WARPS = 6  # compare-exchange steps of the sort, 32 keys each
    ATOMIC_LANES = 7
    ATOMIC_REQUESTS = 8
    ATOMIC_CONFLICTS = 9
    ATOMIC_DEPTH = 10
    LOAD_TRANSACTIONS = 11
    LOAD_BYTES = 12


HITS = hit_columns(AcrossPolygonsEvent)


def across_polygons(polygons: Micropolygons, samples: Samples, packing: Packing, simt: Simt) -> StageResult[Samples]:
    """Draw ``polygons`` into ``samples``.

    Parameters
    ----------
    polygons : Micropolygons
    samples : Samples
        Written.
    packing : {"in-order", "sorted", "repacked"}
    simt : Simt

    Returns
    -------
    outputs : Samples
    works : one, a row for each chunk of 256 polygons
    """
    simt = Simt(*map(int, simt))
    table = np.zeros((-(-len(polygons.patch) // CHUNK), len(AcrossPolygonsEvent)), np.int64)
    idle_to_refill = simt.warp // 2 if packing == "repacked" else simt.warp
    sort = packing == "sorted"
    draw_in_parts(_across_polygons, len(table), samples, polygons.vertices, sort, idle_to_refill, simt, table)
    events = AcrossPolygonsEvent
    shared = CHUNK * 4 if packing == "sorted" else 0  # a key and an index of 16 bits each
    streams = sample_streams(polygons.vertices.nbytes, samples, events, table)
    work = warp_queue(
        "across_polygons", events, table, simt, shared_bytes=shared, streams=streams, atomic_requests=samples.requests
    )
    return StageResult(samples, (work,))


@kernel
def _across_polygons(
    part: int, parts: int, samples: Samples, vertices: Any, sort: bool, idle_to_refill: int, simt: Simt, table: Any
) -> None:
    lanes = (
        np.zeros((simt.warp, 6, 4), np.int64),  # edges
        np.zeros((simt.warp, 3, 4), np.int64),  # boxes
        np.zeros((simt.warp, 2, 3)),  # depths
        np.zeros((4, 2), np.int64),
        np.zeros((simt.warp, BOX), np.int64),
        np.full(simt.warp, -1, np.int64),  # polygon of each lane, -1: idle
    )
    sizes = np.empty(CHUNK, np.int64)
    addresses = np.empty(simt.warp, np.int64)
    for unit in units_of(part, parts, len(table)):
        row = table[unit]
        first = unit * CHUNK
        last = min(len(vertices), first + CHUNK)
        stride = vertices.shape[1] * 12
        count, total = contiguous(first * stride, (last - first) * stride, simt.coalescing)
        row[AcrossPolygonsEvent.LOAD_TRANSACTIONS] += count
        row[AcrossPolygonsEvent.LOAD_BYTES] += total
        order = np.arange(first, last)
        if sort:
            _box_sizes(vertices, first, last, samples, lanes, sizes)
            order = first + np.argsort(sizes[: last - first], kind="mergesort")
            row[AcrossPolygonsEvent.SORT_WARPS] += SORT_STEPS * (-(-(last - first) // simt.warp))
        _draw_chunk(vertices, order, samples, lanes, idle_to_refill, simt, row, addresses)


@kernel(lent=True)
def _draw_chunk(
    vertices: Any, order: Any, samples: Samples, lanes: Any, idle_to_refill: int, simt: Simt, row: Any, addresses: Any
) -> None:
    """Hand the polygons of a chunk to lanes, in an order, and step through their boxes."""
    taken = 0
    while True:
        idle = 0
        for lane in range(simt.warp):
            idle += lanes[5][lane] < 0
        if idle >= idle_to_refill and taken < len(order):
            taken = _refill(vertices, order, taken, samples, lanes, row)
        elif idle == simt.warp:
            break
        _step(samples, lanes, simt, row, addresses)


@kernel(lent=True)
def _box_sizes(vertices: Any, first: int, last: int, samples: Samples, lanes: Any, sizes: Any) -> None:
    """Count the samples in the box of each polygon: the keys of the sort."""
    for p in range(first, last):
        set_up(vertices[p], lanes[0][0], lanes[1][0], lanes[2][0], lanes[3])
        x0, y0, x1, y1 = pixel_box(lanes[1][0], samples.width, samples.height)
        sizes[p - first] = max(x1 - x0 + 1, 0) * max(y1 - y0 + 1, 0)


@kernel(lent=True)
def _refill(vertices: Any, order: Any, taken: int, samples: Samples, lanes: Any, row: Any) -> int:
    """Give each idle lane the next polygon and set it up; returns how many have been taken."""
    edges, boxes, depths, snapped, walk, polygon = lanes
    row[AcrossPolygonsEvent.SETUP_WARPS] += 1
    for lane in range(len(polygon)):
        if polygon[lane] >= 0 or taken == len(order):
            continue
        p = order[taken]
        taken += 1
        row[AcrossPolygonsEvent.POLYGONS] += 1
        set_up(vertices[p], edges[lane], boxes[lane], depths[lane], snapped)
        x0, y0, x1, y1 = pixel_box(boxes[lane], samples.width, samples.height)
        if x1 >= x0 and y1 >= y0:
            polygon[lane] = p
            walk[lane, 0], walk[lane, 1], walk[lane, 2], walk[lane, 3], walk[lane, 4] = x0, y0, x1, y1, 0
    return taken


@kernel(lent=True)
def _step(samples: Samples, lanes: Any, simt: Simt, row: Any, addresses: Any) -> None:
    """Each lane that has a polygon tests the next sample of its box."""
    edges, _, depths, _, walk, polygon = lanes
    spp = len(samples.offsets)
    active = 0
    hits = 0
    for lane in range(simt.warp):
        if polygon[lane] < 0:
            continue
        active += 1
        wide = walk[lane, 2] - walk[lane, 0] + 1
        s, pixel = walk[lane, 4] % spp, walk[lane, 4] // spp
        x, y = walk[lane, 0] + pixel % wide, walk[lane, 1] + pixel // wide
        samples.tests[y, x] += 1
        at_x, at_y = x * STEP + samples.offsets[s, 0], y * STEP + samples.offsets[s, 1]
        addresses[hits] = hit_sample(edges[lane], depths[lane], samples, x, y, s, at_x, at_y, polygon[lane])
        hits += addresses[hits] >= 0
        walk[lane, 4] += 1
        if walk[lane, 4] == wide * (walk[lane, 3] - walk[lane, 1] + 1) * spp:
            polygon[lane] = -1
    if active:
        row[AcrossPolygonsEvent.TEST_WARPS] += 1
        row[AcrossPolygonsEvent.SAMPLE_TESTS] += active
    count_hit_warp(samples, addresses, hits, simt, row, HITS)
