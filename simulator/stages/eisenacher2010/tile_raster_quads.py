"""Quads of some grids in one tile: which sub-tiles and samples their boxes touch, a quad a lane; then those samples.

Most micropolygons lie between samples: lists of boxes are scanned in vectors, and only a quad whose box holds a sample
is looked at by itself.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.bits import lowest_bit, popcount
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
from tilestamp.simulator.stages.prefetch import prefetch
from tilestamp.simulator.stages.vectors import COUNT, bits, ceil, floor, larger, load, load_vertices, smaller, store

LANES = 256  # vertices side by side: those of one grid at least
_ROW = LANES + 2 * COUNT  # a coordinate: the last quad has its third vertex a row of vertices further
_X, _Y, _LEFT, _TOP, _RIGHT, _BOTTOM = (_ROW * row for row in range(6))
_HALF, _ZERO = np.float32(0.5), np.float32(0)
_ALL = np.uint64(0xFFFF)  # lanes
_AHEAD, _LINE = 8, 16  # grids; numbers in a line of the cache
_E = TileRasterEvent


class Quads(NamedTuple):
    """Scratch of quads side by side, by their first vertex."""

    rows: NDArray[np.float32]  # vertices, and first and last samples inside
    quad: NDArray[np.uint64]  # bits of the lanes of each vector at which a quad begins
    grid: NDArray[np.uint8]  # (LANES,) which grid it is of
    vertex: NDArray[np.uint8]  # (LANES,) which vertex of it


@kernel
def new_quads(side: int) -> Quads:
    """Scratch for grids of ``side`` vertices a side."""
    vertices, quad = side * side, np.zeros(LANES // COUNT, np.uint64)
    vertex = np.arange(LANES) % vertices
    for lane in range(LANES):
        if vertex[lane] % side < side - 1 and vertex[lane] < vertices - side:
            quad[lane // COUNT] |= np.uint64(1) << np.uint64(lane % COUNT)
    return Quads(
        np.zeros(6 * _ROW, np.float32), quad, (np.arange(LANES) // vertices).astype(np.uint8), vertex.astype(np.uint8)
    )


@kernel(lent=True)
def _take(points: Any, lists: Any, first: int, grids: int, vertices: int, s: Any) -> None:
    """Lay the vertices of some grids side by side; those some grids further in the list are fetched meanwhile."""
    for g in range(grids):
        ahead = 4 * np.int64(lists[min(first + g + _AHEAD, lists.size - 1)]) * vertices
        for line in range(0, 4 * vertices, _LINE):
            prefetch(points, ahead + line)
        at, place = np.int64(lists[first + g]) * vertices, g * vertices
        for v in range(0, vertices - COUNT + 1, COUNT):
            x, y, _, _ = load_vertices(points, 4 * (at + v))
            store(s, _X + place + v, x)
            store(s, _Y + place + v, y)
        for v in range(vertices - vertices % COUNT, vertices):
            s[_X + place + v], s[_Y + place + v] = points[4 * (at + v)], points[4 * (at + v) + 1]


@kernel(lent=True, inline=True)
def _box(s: Any, n: int, side: int) -> Any:
    """Least and greatest coordinate of the quads that begin at sixteen vertices."""
    a, b, c, d = load(s, n), load(s, n + 1), load(s, n + side + 1), load(s, n + side)
    return smaller(smaller(smaller(a, b), c), d), larger(larger(larger(a, b), c), d)


@kernel(lent=True, inline=True)
def _span(low: Any, high: Any, side: Any, first: Any, last: Any) -> Any:
    """First and last of a tile's samples between two coordinates, ``side`` a pixel.

    Exactly those at ``(i + 0.5) / side`` that compare as inside: subtracting a half rounds only what lies less than
    half a sample from zero, and never past it.
    """
    return larger(ceil(low * side - _HALF) - first, _ZERO), smaller(floor(high * side - _HALF) - first, last)


@kernel(lent=True, inline=True)
def _count_passes(x: Any, y: Any, quads: Any, left: Any, top: Any, shape: BlockShape) -> Any:
    """Pairs of a box and a sub-tile that it touches."""
    passes, size = 0, np.float32(shape.subtile)
    for sub in range(shape.side * shape.side):
        i = left + np.float32(sub & (shape.side - 1)) * size
        j = top + np.float32(sub >> shape.side_bits) * size
        beside = (x[1] < i) | (x[0] > i + size) | (y[1] < j) | (y[0] > j + size)
        passes += popcount(quads & ~bits(beside))
    return passes


@kernel(lent=True)
def _draw_tests(
    t: Tests,
    number: int,
    points: Any,
    words: Any,
    stored: Any,
    origin: Any,
    shape: BlockShape,
    samples: Samples,
    row: Any,
) -> None:
    """Test what has come together, and keep what is nearest."""
    run_tests(t, number, points, stored, origin, shape)
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
    tile, vertices, s, number = shape.tile, shape.grid * shape.grid, q.rows, np.uint64(0)
    lefts, rights, tops, bottoms = s[_LEFT:], s[_RIGHT:], s[_TOP:], s[_BOTTOM:]
    side, left, top = np.float32(shape.side), np.float32(origin[0]), np.float32(origin[1])
    most, together = np.float32(tile * shape.side - 1), LANES // vertices
    for base in range(first, last, together):
        grids = min(last - base, together)
        _take(points, lists, base, grids, vertices, s)
        for n in range(0, grids * vertices, COUNT):
            x, y, quads = _box(s, _X + n, shape.grid), _box(s, _Y + n, shape.grid), q.quad[n // COUNT]
            quads &= _ALL >> np.uint64(max(0, n + COUNT - grids * vertices))
            (i0, i1), (j0, j1) = _span(*x, side, left * side, most), _span(*y, side, top * side, most)
            if row is not None:
                row[_E.SUBTILE_PASS] += _count_passes(x, y, quads, left, top, shape)
            quads &= bits((i0 <= i1) & (j0 <= j1))
            if quads == np.uint64(0):
                continue
            store(s, _LEFT + n, i0)
            store(s, _RIGHT + n, i1)
            store(s, _TOP + n, j0)
            store(s, _BOTTOM + n, j1)
            while quads != np.uint64(0):
                k = np.uint64(n + lowest_bit(quads))
                quads &= quads - np.uint64(1)
                vertex = np.uint64(lists[base + np.int64(q.grid[k])]) * np.uint64(vertices) + np.uint64(q.vertex[k])
                box = (int(lefts[k]), int(rights[k]), int(tops[k]), int(bottoms[k]))
                for sub in range(shape.side * shape.side):
                    i, j = (sub & (shape.side - 1)) * tile, (sub >> shape.side_bits) * tile
                    span = (max(box[0], i), min(box[1], i + tile - 1), max(box[2], j), min(box[3], j + tile - 1))
                    if span[0] > span[1] or span[2] > span[3]:
                        continue
                    if row is not None:
                        row[_E.BOX_WARPS] += box_warps(span, shape)
                    number = add_tests(t, number, vertex, span)
                    if number >= TOGETHER:
                        _draw_tests(t, np.int64(number), points, words, stored, origin, shape, samples, row)
                        number = np.uint64(0)
    _draw_tests(t, np.int64(number), points, words, stored, origin, shape, samples, row)
