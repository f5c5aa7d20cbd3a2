"""Sampling of one micropolygon quad: edge functions, z and colour (Eisenacher & Loop 2010, section 3.3).

float32 throughout, each operation rounded by itself. The paper asks for four edge functions and a sign test; how the
quad is interpolated is ours: as two triangles, split by the diagonal from the first vertex to the third.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.bits import lowest_bit
from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.eisenacher2010.edge_equations import covers
from tilestamp.simulator.stages.vectors import COUNT, bits, gather, load, select, store

GRID_SIDE = 4  # vertices
QUADS = 9  # a grid
BACKGROUND = np.uint32(0xFF402020)  # red in the low byte
FAR = np.float32(1)
_ALL = np.uint64(0xFFFF)  # lanes
_NEXT, _COLOR, _FOUR = np.uint64(1), np.uint64(3), np.uint64(4)
_ZERO = np.float32(0)
_ONE = np.float32(1)
_HALF = np.float32(0.5)
_NOWHERE = np.float32(np.inf)


class Samples(NamedTuple):
    """Samples of one tile while it is drawn: rows from the top."""

    depth: NDArray[np.float32]
    color: NDArray[np.uint32]
    hits: NDArray[np.int32]  # covered quads so far


TOGETHER = 256  # tests that are run together, at least
MOST_TESTS = TOGETHER + 32 * 32 + COUNT  # those of one more quad, and the last lanes of a vector
COLUMN, _ROW, _COVERED, _DEPTH, _WA, _WB, _WC, _SECOND = (MOST_TESTS * row for row in range(8))


class Tests(NamedTuple):
    """Scratch: samples in the boxes of quads, in the order in which they are drawn, and what is found about each."""

    rows: NDArray[np.float32]  # place, and what is found
    vertex: NDArray[np.uint64]  # (MOST_TESTS,) first vertex of the quad, of those of all grids
    group: NDArray[np.int64]  # (MOST_TESTS,) alike for the samples of a quad in a sub-tile
    covered: NDArray[np.uint64]  # a bit a test, those of a vector together


@kernel
def new_tests() -> Tests:
    """Scratch for tests."""
    return Tests(
        np.zeros(8 * MOST_TESTS, np.float32),
        np.zeros(MOST_TESTS, np.uint64),
        np.zeros(MOST_TESTS, np.int64),
        np.zeros(MOST_TESTS // COUNT, np.uint64),
    )


@kernel(lent=True, inline=True)
def add_tests(t: Tests, number: Any, vertex: Any, span: Any) -> Any:
    """Add the samples of ``span`` (first and last column, first and last row) in one quad; the number of tests then."""
    columns, rows, group = t.rows[COLUMN:], t.rows[_ROW:], np.int64(number)
    for row in range(span[2], span[3] + 1):
        for column in range(span[0], span[1] + 1):
            t.vertex[number], t.group[number], columns[number], rows[number] = vertex, group, column, row
            number += _NEXT
    return number


@kernel(lent=True, inline=True)
def edge(ax: Any, ay: Any, bx: Any, by: Any, x: Any, y: Any) -> Any:
    """Evaluate the edge function of a to b: twice the area of a, b and the sample."""
    return (bx - ax) * (y - ay) - (by - ay) * (x - ax)


@kernel(lent=True)
def blend(a: Any, b: Any, c: Any, u: Any, v: Any, w: Any) -> Any:
    """Interpolate three packed colours; weights add up to one."""
    packed = BACKGROUND & np.uint32(0xFF000000)
    for shift in (0, 8, 16):
        channel = u * np.float32((a >> shift) & 255) + v * np.float32((b >> shift) & 255)
        channel = channel + w * np.float32((c >> shift) & 255) + _HALF
        packed |= np.uint32(np.uint32(max(channel, _ZERO)) << shift)
    return packed


@kernel(lent=True)
def _cover(t: Tests, number: int, stored: Any, origin: Any, shape: Any) -> None:
    """Ask stored edge equations about each test."""
    vertices, step = shape.grid * shape.grid, _ONE / np.float32(shape.side)
    left, top = np.float32(origin[0]), np.float32(origin[1])
    for k in range(number):
        grid = np.int64(t.vertex[k]) // vertices
        x, y = left + (t.rows[COLUMN + k] + _HALF) * step, top + (t.rows[_ROW + k] + _HALF) * step
        t.rows[_COVERED + k] = covers(stored, grid, np.int64(t.vertex[k]) - grid * vertices, x, y)


@kernel(error_model="numpy", lent=True)
def run_tests(t: Tests, number: int, points: Any, stored: Any, origin: Any, shape: Any) -> None:
    """Coverage, z and weights of all tests, a vector at once; ``stored`` edge equations decide where there are such."""
    s, below = t.rows, 4 * shape.grid
    left, top, step = np.float32(origin[0]), np.float32(origin[1]), _ONE / np.float32(shape.side)
    if stored is not None:
        _cover(t, number, stored, origin, shape)
    for k in range(0, number, COUNT):
        ax, ay, az = gather(points, t.vertex, k, 0), gather(points, t.vertex, k, 1), gather(points, t.vertex, k, 2)
        bx, by, bz = gather(points, t.vertex, k, 4), gather(points, t.vertex, k, 5), gather(points, t.vertex, k, 6)
        dx, dy = gather(points, t.vertex, k, below), gather(points, t.vertex, k, below + 1)
        cx, cy = gather(points, t.vertex, k, below + 4), gather(points, t.vertex, k, below + 5)
        dz, cz = gather(points, t.vertex, k, below + 2), gather(points, t.vertex, k, below + 6)
        x, y = left + (load(s, COLUMN + k) + _HALF) * step, top + (load(s, _ROW + k) + _HALF) * step
        e0, e1 = edge(ax, ay, bx, by, x, y), edge(bx, by, cx, cy, x, y)
        e2, e3 = edge(cx, cy, dx, dy, x, y), edge(dx, dy, ax, ay, x, y)
        if stored is None:
            above = (e0 >= _ZERO) & (e1 >= _ZERO) & (e2 >= _ZERO) & (e3 >= _ZERO)
            covered = above | ((e0 <= _ZERO) & (e1 <= _ZERO) & (e2 <= _ZERO) & (e3 <= _ZERO))
        else:
            covered = load(s, _COVERED + k) > _ZERO
        t.covered[k // COUNT] = bits(covered) & (_ALL >> np.uint64(max(0, k + COUNT - number)))
        f = edge(ax, ay, cx, cy, x, y)
        first = (f <= _ZERO) == (e0 + e1 + e2 + e3 >= _ZERO)  # which side of the diagonal
        u, v, w = select(first, e1, e2), select(first, -f, f), select(first, e0, e3)
        total = u + v + w
        r = _ONE / total
        z = (u * az + v * select(first, bz, dz) + w * cz) * r
        store(s, _DEPTH + k, select(total != _ZERO, z, _NOWHERE))
        store(s, _WA + k, u * r)
        store(s, _WB + k, v * r)
        store(s, _WC + k, w * r)
        store(s, _SECOND + k, select(first, _ZERO, _ONE))


@kernel(lent=True)
def color_of(t: Tests, k: Any, words: Any, below: Any) -> Any:
    """Blend the colours, in the bits ``words`` of the vertices, at a sample that is covered."""
    at, second = _FOUR * t.vertex[k] + _COLOR, t.rows[_SECOND:][k] > _ZERO
    across, down = at + _FOUR, at + _FOUR * below
    u, v, w = t.rows[_WA:][k], t.rows[_WB:][k], t.rows[_WC:][k]
    return blend(words[at], words[down if second else across], words[down + _FOUR], u, v, w)


@kernel(lent=True)
def keep_visible(t: Tests, number: int, words: Any, shape: Any, samples: Samples, row: Any) -> Any:
    """Keep what is nearest at each sample, test by test: the colour, or where no ``words`` are, the first vertex.

    Returns the warps and lanes that cover a sample, and those that pass the z-test; 0 where ``row`` is None.
    """
    mask, columns, rows, depths = shape.tile - 1, t.rows[COLUMN:], t.rows[_ROW:], t.rows[_DEPTH:]
    hits = hit_warps = passed = passed_warps = warp = 0
    hit_warp = passed_warp = -1  # the last that was counted: lanes come in order
    for base in range(0, number, COUNT):
        left = t.covered[base // COUNT]
        while left != np.uint64(0):
            k = np.uint64(base + lowest_bit(left))
            left &= left - _NEXT
            i, j = np.uint64(columns[k]), np.uint64(rows[k])
            if row is not None:
                samples.hits[j, i] += 1
                warp = (
                    t.group[k] << 6 | ((int(rows[k]) & mask) * shape.tile + (int(columns[k]) & mask)) >> shape.warp_bits
                )
                hits += 1
                hit_warps += warp != hit_warp
                hit_warp = warp
            z = depths[k]
            if z < samples.depth[j, i]:
                samples.depth[j, i] = z
                samples.color[j, i] = t.vertex[k] if words is None else color_of(t, k, words, np.uint64(shape.grid))
                if row is not None:
                    passed += 1
                    passed_warps += warp != passed_warp
                    passed_warp = warp
    return hit_warps, hits, passed_warps, passed
