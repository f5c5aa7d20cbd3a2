"""The sample buffer that all micropolygon rasterizers write: nearest depth and its polygon, 64 bits a sample.

A hit is one atomic minimum of depth and polygon in one 64-bit word; ties go to the lower polygon number, so that the
picture does not depend on the order of arrival.
"""

from collections.abc import Callable
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numba import get_num_threads
from numpy.typing import NDArray

from tilestamp.models.atomics import add_requests, count_atomics
from tilestamp.models.kernel import kernel
from tilestamp.models.simt import Simt
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stages.fatahalian2009.micropolygon_cover import STEP, STEP_BITS, covering_triangle, depth_at
from tilestamp.simulator.stages.fatahalian2009.micropolygons import Micropolygons

WORD_BYTES = 8  # depth and polygon
BACKGROUND = 255
MOST_COPIES = 8  # of the sample buffers, one for each part that draws beside others
UNITS = 16  # of work, one after another, that a part draws before it leaves as many to each other part


class Samples(NamedTuple):
    """Sample buffers of one frame.

    Parameters
    ----------
    width, height : int
        Pixels.
    offsets : ndarray, (spp, 2), int64
        Positions in the pixel, sub-pixel steps.
    depth : ndarray, (H * W * spp,), float32
    polygon : ndarray, (H * W * spp,), int32
        Nearest polygon, -1 where nothing was drawn.
    tests : ndarray, (H, W), int32
        Sample tests made in each pixel.
    requests : ndarray, (chunks,), int64
        Atomic requests by 32-byte chunk.
    """

    width: int
    height: int
    offsets: NDArray[np.int64]
    depth: NDArray[np.float32]
    polygon: NDArray[np.int32]
    tests: NDArray[np.int32]
    requests: NDArray[np.int64]


def new_samples(width: int, height: int, offsets: NDArray[np.int64]) -> Samples:
    """Empty buffers."""
    count = width * height * len(offsets)
    return Samples(
        width,
        height,
        offsets,
        np.full(count, np.inf, np.float32),
        np.full(count, -1, np.int32),
        np.zeros((height, width), np.int32),
        np.zeros(-(-count * WORD_BYTES // 32), np.int64),
    )


class HitColumns(NamedTuple):
    """Columns of a work table that count the hits of a warp and their atomics, by the names of its events."""

    sample_hits: int
    hit_warps: int
    atomic_lanes: int
    atomic_requests: int
    atomic_conflicts: int
    atomic_depth: int


def hit_columns(events: type[IntEnum]) -> HitColumns:
    """Columns of a table of these events."""
    return HitColumns(*(int(events[name.upper()]) for name in HitColumns._fields))


def draw_in_parts(draw: Callable[..., Any], units: int, samples: Samples, *args: Any) -> None:
    """Call ``draw(part, parts, samples, *args)`` side by side, for its share of the units (``units_of``).

    Each part draws into sample buffers of its own. The nearest of all stays in ``samples``, tests and requests are
    added up: the order of polygons makes no difference to either.
    """
    parts = max(1, min(-(-units // UNITS), get_num_threads(), MOST_COPIES))
    copies = [samples, *(new_samples(samples.width, samples.height, samples.offsets) for _ in range(parts - 1))]
    for_parts(lambda part, parts: draw(part, parts, copies[part], *args), parts)
    for copy in copies[1:]:
        for_parts(_merge, parts_of(samples.height, 16), copy, samples)


@kernel
def units_of(part: int, parts: int, units: int) -> Any:
    """Units that a part draws: all parts have some of every region."""
    every = np.arange(units)
    return every[every // UNITS % parts == part]


@kernel
def _merge(part: int, parts: int, copy: Samples, samples: Samples) -> None:
    """Take into a share of the samples what a copy of them has."""
    rows, wide = samples.height, samples.width * len(samples.offsets)
    for at in range(rows * part // parts * wide, rows * (part + 1) // parts * wide):
        depth, polygon = copy.depth[at], copy.polygon[at]
        if depth < samples.depth[at] or (depth == samples.depth[at] and polygon < samples.polygon[at]):
            samples.depth[at], samples.polygon[at] = depth, polygon
    for y in range(rows * part // parts, rows * (part + 1) // parts):
        samples.tests[y] += copy.tests[y]
    chunks = len(samples.requests)
    for i in range(chunks * part // parts, chunks * (part + 1) // parts):
        samples.requests[i] += copy.requests[i]


@kernel(lent=True)
def keep_nearest(samples: Samples, x: int, y: int, s: int, depth: Any, polygon: int) -> Any:
    """Atomic minimum of one hit; returns the byte address it went to."""
    at = (y * samples.width + x) * len(samples.offsets) + s
    if depth < samples.depth[at] or (depth == samples.depth[at] and polygon < samples.polygon[at]):
        samples.depth[at] = depth
        samples.polygon[at] = polygon
    return at * WORD_BYTES


@kernel(lent=True)
def count_hits(samples: Samples, addresses: Any, hits: int, merge: int) -> Any:
    """Count one warp's atomic instruction: lanes, requests, conflicts, depth.

    ``addresses`` begins with those of the ``hits`` lanes that hit, in lane order.
    """
    counts = count_atomics(addresses, hits, merge)
    add_requests(addresses, hits, merge, 0, samples.requests)
    return counts


@kernel(lent=True)
def hit_sample(
    edges: Any, depths: Any, samples: Samples, x: int, y: int, s: int, at_x: Any, at_y: Any, polygon: int
) -> Any:
    """Test a sample of the polygon that is set up; returns the byte address of a hit's atomic, -1 for none."""
    triangle = covering_triangle(edges, at_x, at_y)
    if triangle < 0:
        return -1
    return keep_nearest(samples, x, y, s, depth_at(edges, depths, triangle, at_x, at_y), polygon)


@kernel(lent=True)
def count_hit_warp(samples: Samples, addresses: Any, hits: int, simt: Simt, row: Any, columns: HitColumns) -> None:
    """Count one warp execution of depth and atomic, if it has hits."""
    if hits:
        lanes, requests, conflicts, depth = count_hits(samples, addresses, hits, simt.atomic_merge)
        row[columns.sample_hits] += hits
        row[columns.hit_warps] += 1
        row[columns.atomic_lanes] += lanes
        row[columns.atomic_requests] += requests
        row[columns.atomic_conflicts] += conflicts
        row[columns.atomic_depth] += depth


@kernel(lent=True)
def on_screen(boxes: Any, width: int, height: int) -> tuple[int, int, int, int]:
    """Clip a polygon's box to the screen: x0, y0, x1, y1 in sub-pixel steps; x1 < x0 or y1 < y0 if nothing is left."""
    return (
        max(boxes[0, 0], 0),
        max(boxes[0, 1], 0),
        min(boxes[0, 2], width * STEP - 1),
        min(boxes[0, 3], height * STEP - 1),
    )


@kernel(lent=True)
def pixel_box(boxes: Any, width: int, height: int) -> tuple[int, int, int, int]:
    """First and last pixel (x0, y0, x1, y1) of a polygon's box, on screen; empty if x1 < x0 or y1 < y0."""
    x0, y0, x1, y1 = on_screen(boxes, width, height)
    return x0 >> STEP_BITS, y0 >> STEP_BITS, x1 >> STEP_BITS, y1 >> STEP_BITS


def picture(samples: Samples, polygons: Micropolygons) -> NDArray[np.uint8]:
    """Mean over the samples of each pixel, (H, W, 3) uint8, on white."""
    grey = np.append(polygons.shade, np.uint8(BACKGROUND))[samples.polygon]
    mean = grey.reshape(samples.height, samples.width, -1).mean(axis=2)
    return np.repeat(np.round(mean)[:, :, None], 3, axis=2).astype(np.uint8)


def visible(samples: Samples, values: NDArray[np.int32] | None = None) -> NDArray[np.int32]:
    """Polygon at the first sample of each pixel, (H, W) int32, -1 where none; or its entry in ``values``."""
    first = samples.polygon.reshape(samples.height, samples.width, -1)[:, :, 0]
    if values is None:
        return first
    return np.where(first >= 0, np.append(values, np.int32(-1))[first], np.int32(-1)).astype(np.int32)


def blocks(simt: Simt, warps: int) -> int:
    """Count the persistent blocks of ``warps`` warps: 32 warps on every SM."""
    return simt.sms * max(1, 32 // warps)
