"""Quads of some grids in one tile: which sub-tiles and samples their boxes touch, a quad a lane; then those samples.

Most micropolygons lie between samples: lists of boxes are scanned in vectors, and only a quad whose box holds a sample
is looked at by itself.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.eisenacher2010.tile_raster_events import BlockShape, TileRasterEvent, box_warps
from tilestamp.simulator.stages.eisenacher2010.tile_raster_samples import (
    TOGETHER,
    Samples,
    Tests,
    add_tests,
    keep_visible,
    run_tests,
)

LANES = 256  # vertices side by side: those of one grid at least
_ROW = LANES + 16  # a coordinate: the last quad has its third vertex a row of vertices further
_X, _Y, _X0, _Y0, _X1, _Y1, _LEFT, _TOP, _RIGHT, _BOTTOM = (_ROW * row for row in range(10))
_ROWS = 10 * _ROW
_HALF, _ZERO, _ONE = (np.float32(x) for x in (0.5, 0, 1))
_E = TileRasterEvent


class Quads(NamedTuple):
    """Scratch of quads side by side, by their first vertex."""

    rows: NDArray[np.float32]  # vertices, boxes, and first and last samples inside; one buffer, as in ``shading``
    quad: NDArray[np.bool_]  # (LANES,) whether a quad begins at the vertex
    grid: NDArray[np.uint8]  # (LANES,) which grid it is of
    vertex: NDArray[np.uint8]  # (LANES,) which vertex of it
    sampled: NDArray[np.bool_]  # (LANES,) whether the box holds a sample
    found: NDArray[np.int64]  # (LANES,) lanes where it does


@kernel
def new_quads(side: int) -> Quads:
    """Scratch for grids of ``side`` vertices a side."""
    lane = np.arange(LANES)
    vertex = lane % (side * side)
    quad = (vertex % side < side - 1) & (vertex < side * (side - 1))
    return Quads(
        np.zeros(_ROWS, np.float32),
        quad,
        (lane // (side * side)).astype(np.uint8),
        vertex.astype(np.uint8),
        np.zeros(LANES, np.bool_),
        np.zeros(LANES, np.int64),
    )


@kernel(lent=True)
def _set_boxes(s: Any, lanes: int, side: int) -> None:
    """Boxes of the quads that begin at each vertex."""
    b, c, d = s[1:], s[side + 1 :], s[side:]
    for n in range(lanes):
        s[_X0 + n], s[_X1 + n] = min(s[n], b[n], c[n], d[n]), max(s[n], b[n], c[n], d[n])
    for n in range(lanes):
        ay, by, cy, dy = s[_Y + n], b[_Y + n], c[_Y + n], d[_Y + n]
        s[_Y0 + n], s[_Y1 + n] = min(ay, by, cy, dy), max(ay, by, cy, dy)


@kernel(lent=True)
def _set_spans(s: Any, lanes: int, quad: Any, sampled: Any, left: Any, top: Any, side: Any, last: Any) -> None:
    """First and last column and row of the tile's samples inside each box, ``side`` a pixel.

    Exactly those at ``(i + 0.5) / side`` that compare as inside: subtracting a half rounds only what lies less than
    half a sample from zero, and never past it.
    """
    for n in range(lanes):
        i0, i1 = np.ceil(s[_X0 + n] * side - _HALF) - left, np.floor(s[_X1 + n] * side - _HALF) - left
        j0, j1 = np.ceil(s[_Y0 + n] * side - _HALF) - top, np.floor(s[_Y1 + n] * side - _HALF) - top
        i0, j0, i1, j1 = max(i0, _ZERO), max(j0, _ZERO), min(i1, last), min(j1, last)
        s[_LEFT + n], s[_TOP + n], s[_RIGHT + n], s[_BOTTOM + n] = i0, j0, i1, j1
        sampled[n] = (i0 <= i1) & (j0 <= j1) & quad[n]


@kernel(lent=True)
def _count_passes(s: Any, lanes: int, quad: Any, left: Any, top: Any, size: Any) -> Any:
    """Boxes that touch a sub-tile."""
    passes, right, bottom = np.int32(0), left + size, top + size
    for n in range(lanes):
        beside = (s[_X1 + n] < left) | (s[_X0 + n] > right) | (s[_Y1 + n] < top) | (s[_Y0 + n] > bottom)
        passes = np.int32(passes + np.int32(quad[n] & (not beside)))
    return passes


@kernel(lent=True)
def _box_quads(
    points: Any, lists: Any, first: int, grids: int, origin: Any, shape: BlockShape, q: Quads, row: Any
) -> Any:
    """Scan the boxes of some grids' quads; the number of those that hold samples, which ``q.found`` lists."""
    s, vertices, lanes = q.rows, shape.grid * shape.grid, grids * shape.grid * shape.grid
    for g in range(grids):
        grid = np.uint64(lists[first + g]) * np.uint64(vertices)
        for v in range(vertices):
            place = np.uint64(g * vertices + v)
            s[place], s[place + np.uint64(_Y)] = points[grid + np.uint64(v), 0], points[grid + np.uint64(v), 1]
    side, left, top = np.float32(shape.side), np.float32(origin[0]), np.float32(origin[1])
    _set_boxes(s, lanes, shape.grid)
    _set_spans(s, lanes, q.quad, q.sampled, left * side, top * side, side, np.float32(shape.tile * shape.side - 1))
    if row is not None:
        size = np.float32(shape.subtile)
        for sub in range(shape.side * shape.side):
            i, j = np.float32(sub & (shape.side - 1)), np.float32(sub >> shape.side_bits)
            row[_E.SUBTILE_PASS] += _count_passes(s, lanes, q.quad, left + i * size, top + j * size, size)
    found = 0
    for n in range(lanes):
        q.found[found] = n
        found += q.sampled[n]
    return found


@kernel(lent=True)
def _draw_tests(
    t: Tests, number: int, words: Any, stored: Any, origin: Any, shape: BlockShape, samples: Samples, row: Any
) -> None:
    """Test what has come together, and keep what is nearest."""
    run_tests(t, number, stored, origin, shape)
    counts = keep_visible(t, number, words, shape, samples, row)
    if row is not None:
        row[_E.BOX_LANES] += number
        row[_E.HIT_WARPS] += counts[0]
        row[_E.HIT_LANES] += counts[1]
        row[_E.Z_WARPS] += counts[2]
        row[_E.Z_LANES] += counts[3]


@kernel(lent=True)
def raster_grids(
    points: Any,
    words: Any,
    stored: Any,
    lists: Any,
    first: int,
    last: int,
    origin: Any,
    shape: BlockShape,
    samples: Samples,
    q: Quads,
    t: Tests,
    row: Any,
) -> None:
    """Grids first..last-1 of the lists in one tile: for each quad the samples in its box, sub-tile by sub-tile."""
    tile, number, together = shape.tile, 0, LANES // (shape.grid * shape.grid)
    for base in range(first, last, together):
        for k in range(_box_quads(points, lists, base, min(last - base, together), origin, shape, q, row)):
            n = q.found[k]
            vertex = np.uint64(lists[base + np.int64(q.grid[n])]) * np.uint64(shape.grid * shape.grid) + np.uint64(
                q.vertex[n]
            )
            i0, i1 = int(q.rows[_LEFT + n]), int(q.rows[_RIGHT + n])
            j0, j1 = int(q.rows[_TOP + n]), int(q.rows[_BOTTOM + n])
            for sub in range(shape.side * shape.side):
                i, j = (sub & (shape.side - 1)) * tile, (sub >> shape.side_bits) * tile
                span = (max(i0, i), min(i1, i + tile - 1), max(j0, j), min(j1, j + tile - 1))
                if span[0] > span[1] or span[2] > span[3]:
                    continue
                if row is not None:
                    row[_E.BOX_WARPS] += box_warps(span, shape)
                number = add_tests(t, number, points, vertex, np.uint64(shape.grid), span)
                if number >= TOGETHER:
                    _draw_tests(t, number, words, stored, origin, shape, samples, row)
                    number = 0
    _draw_tests(t, number, words, stored, origin, shape, samples, row)
