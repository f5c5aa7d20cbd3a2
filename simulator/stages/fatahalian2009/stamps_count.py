"""Sample tests and hits of stamps, counted without making the tests: closed form a box, for millions of polygons.

A polygon's tests are its stamps times a stamp's samples; its hits do not depend on the stamp, so only the samples of
its own box are looked at. The counts are those that ``stamps`` counts by executing.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kernel import kernel
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stages.fatahalian2009.micropolygon_cover import (
    STEP,
    covering_triangle,
    in_box,
    new_setup,
    set_edges,
    snap,
    touches,
)
from tilestamp.simulator.stages.fatahalian2009.micropolygon_samples import pixel_box
from tilestamp.simulator.stages.fatahalian2009.micropolygons import Micropolygons
from tilestamp.simulator.stages.fatahalian2009.stamps_events import StampShape

SMALLEST_PART = 1024  # polygons


class SampleCount(NamedTuple):
    """Sample tests and hits of a set of polygons."""

    tests: int
    hits: int

    @property
    def ste(self) -> float:
        """Sample test efficiency."""
        return self.hits / self.tests if self.tests else float("nan")


def count_tests(
    polygons: Micropolygons, width: int, height: int, offsets: NDArray[np.int64], shape: StampShape
) -> SampleCount:
    """Count the sample tests of one-level stamps, and their hits.

    Parameters
    ----------
    polygons : Micropolygons
    width, height : int
        Pixels.
    offsets : ndarray, (spp, 2), int64
        See ``sample_positions``.
    shape : StampShape
        One level.
    """
    parts = parts_of(len(polygons.vertices), SMALLEST_PART)
    counts = np.zeros((parts, 2), np.int64)
    for_parts(_count, parts, polygons.vertices, width, height, offsets, shape, counts)
    tests, hits = counts.sum(axis=0).tolist()
    return SampleCount(tests, hits)


@kernel
def _count(
    part: int, parts: int, vertices: Any, width: int, height: int, offsets: Any, shape: StampShape, counts: Any
) -> None:
    """Count the polygons of one part; edges are set up only where a sample lies in the box, or stamps are chosen."""
    edges, boxes, depths, snapped = new_setup()
    stamps = 0
    hits = 0
    for p in range(part * len(vertices) // parts, (part + 1) * len(vertices) // parts):
        snap(vertices[p], boxes, snapped)
        x0, y0, x1, y1 = pixel_box(boxes, width, height)
        if x1 < x0 or y1 < y0:
            continue
        i0, j0 = x0 // shape.width, y0 // shape.height
        i1, j1 = x1 // shape.width, y1 // shape.height
        ready = False
        if shape.polygon:
            set_edges(vertices[p], edges, boxes, depths, snapped)
            ready = True
            stamps += _touched(edges, boxes, vertices.shape[1], shape, i0, j0, i1, j1)
        else:
            stamps += (i1 - i0 + 1) * (j1 - j0 + 1)
        for y in range(y0, y1 + 1):
            for x in range(x0, x1 + 1):
                for s in range(len(offsets)):
                    at_x, at_y = x * STEP + offsets[s, 0], y * STEP + offsets[s, 1]
                    if not in_box(boxes, at_x, at_y):
                        continue
                    if not ready:
                        set_edges(vertices[p], edges, boxes, depths, snapped)
                        ready = True
                    hits += covering_triangle(edges, at_x, at_y) >= 0
    counts[part, 0] = stamps * shape.width * shape.height * len(offsets)
    counts[part, 1] = hits


@kernel
def _touched(edges: Any, boxes: Any, corners: Any, shape: StampShape, i0: int, j0: int, i1: int, j1: int) -> int:
    """Stamps of a box that the polygon reaches; one that holds all of a polygon with an area certainly is."""
    wide, high = shape.width * STEP, shape.height * STEP
    if i0 == i1 and j0 == j1 and boxes[0, 0] >= i0 * wide and boxes[0, 1] >= j0 * high and edges[0, 0] != 0:
        return 1
    count = 0
    for j in range(j0, j1 + 1):
        for i in range(i0, i1 + 1):
            count += touches(edges, boxes, corners, i * wide, j * high, (i + 1) * wide, (j + 1) * high)
    return count
