"""Sampling of one micropolygon quad: edge functions, z and colour (Eisenacher & Loop 2010, section 3.3).

float32 throughout, each operation rounded by itself. The paper asks for four edge functions and a sign test; how the
quad is interpolated is ours: as two triangles, split by the diagonal from the first vertex to the third.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.eisenacher2010.edge_equations import covers

GRID_SIDE = 4  # vertices
QUADS = 9  # a grid
BACKGROUND = np.uint32(0xFF402020)  # red in the low byte
FAR = np.float32(1)
_ZERO = np.float32(0)
_ONE = np.float32(1)
_HALF = np.float32(0.5)
_TWO = np.float32(2)
_NOWHERE = np.float32(np.inf)
_NEXT = np.uint64(1)  # vertex


class Samples(NamedTuple):
    """Samples of one tile while it is drawn: rows from the top."""

    depth: NDArray[np.float32]
    color: NDArray[np.uint32]
    hits: NDArray[np.int32]  # covered quads so far


TOGETHER = 256  # tests that are run together, at least
MOST_TESTS = TOGETHER + 32 * 32  # and those of one more quad
_X, _Y, _Z = (4 * MOST_TESTS * row for row in range(3))  # of the four vertices
COLUMN, _ROW, _DEPTH, _WA, _WB, _WC, _SIDE = (MOST_TESTS * row for row in range(12, 19))


class Tests(NamedTuple):
    """Scratch: samples in the boxes of quads, in the order in which they are drawn, and what is found about each."""

    rows: NDArray[np.float32]  # vertices, place and what is found; one buffer, as in ``shading``
    vertex: NDArray[np.uint64]  # (MOST_TESTS,) first vertex of the quad, of those of all grids
    group: NDArray[np.int64]  # (MOST_TESTS,) alike for the samples of a quad in a sub-tile


@kernel
def new_tests() -> Tests:
    """Scratch for tests."""
    rows = np.zeros(19 * MOST_TESTS, np.float32)
    return Tests(rows, np.zeros(MOST_TESTS, np.uint64), np.zeros(MOST_TESTS, np.int64))


@kernel(lent=True)
def add_tests(t: Tests, number: int, points: Any, vertex: Any, below: Any, span: Any) -> int:
    """Add the samples of ``span`` (first and last column, first and last row) in one quad; the number of tests then."""
    s, group = t.rows, number
    corners = (vertex, vertex + _NEXT, vertex + below + _NEXT, vertex + below)
    for row in range(span[2], span[3] + 1):
        for column in range(span[0], span[1] + 1):
            t.vertex[number], t.group[number] = vertex, group
            s[COLUMN + number], s[_ROW + number] = column, row
            for n in range(4):
                s[_X + n * MOST_TESTS + number] = points[corners[n], 0]
                s[_Y + n * MOST_TESTS + number] = points[corners[n], 1]
                s[_Z + n * MOST_TESTS + number] = points[corners[n], 2]
            number += 1
    return number


@kernel(lent=True)
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


@kernel(error_model="numpy", lent=True)
def run_tests(t: Tests, number: int, stored: Any, origin: Any, shape: Any) -> None:
    """Coverage, z and weights of all tests, several at once; ``stored`` edge equations decide where there are such."""
    s, m = t.rows, MOST_TESTS
    left, top, step = np.float32(origin[0]), np.float32(origin[1]), _ONE / np.float32(shape.side)
    for k in range(number):
        ax, bx, cx, dx = s[_X + k], s[_X + m + k], s[_X + 2 * m + k], s[_X + 3 * m + k]
        ay, by, cy, dy = s[_Y + k], s[_Y + m + k], s[_Y + 2 * m + k], s[_Y + 3 * m + k]
        az, bz, cz, dz = s[_Z + k], s[_Z + m + k], s[_Z + 2 * m + k], s[_Z + 3 * m + k]
        x, y = left + (s[COLUMN + k] + _HALF) * step, top + (s[_ROW + k] + _HALF) * step
        e0, e1 = edge(ax, ay, bx, by, x, y), edge(bx, by, cx, cy, x, y)
        e2, e3 = edge(cx, cy, dx, dy, x, y), edge(dx, dy, ax, ay, x, y)
        if stored is None:
            above = (e0 >= _ZERO) & (e1 >= _ZERO) & (e2 >= _ZERO) & (e3 >= _ZERO)
            covered = above | ((e0 <= _ZERO) & (e1 <= _ZERO) & (e2 <= _ZERO) & (e3 <= _ZERO))
        else:
            grid = np.int64(t.vertex[k]) // (shape.grid * shape.grid)
            covered = covers(stored, grid, np.int64(t.vertex[k]) - grid * shape.grid * shape.grid, x, y)
        f = edge(ax, ay, cx, cy, x, y)
        first = (f <= _ZERO) == (e0 + e1 + e2 + e3 >= _ZERO)  # which side of the diagonal
        u, v, w = e1 if first else e2, -f if first else f, e0 if first else e3
        total = u + v + w
        r = _ONE / total
        z = (u * az + v * (bz if first else dz) + w * cz) * r
        s[_DEPTH + k] = z if total != _ZERO else _NOWHERE
        s[_WA + k], s[_WB + k], s[_WC + k] = u * r, v * r, w * r
        s[_SIDE + k] = (_ONE if first else _TWO) if covered else _ZERO


@kernel(lent=True)
def color_of(t: Tests, k: int, words: Any, below: Any) -> Any:
    """Blend the colours, in the bits ``words`` of the vertices, at a sample that is covered."""
    s, a = t.rows, t.vertex[k]
    other = a + _NEXT if s[_SIDE + k] == _ONE else a + below
    return blend(words[a, 3], words[other, 3], words[a + below + _NEXT, 3], s[_WA + k], s[_WB + k], s[_WC + k])


@kernel(lent=True)
def keep_visible(t: Tests, number: int, words: Any, shape: Any, samples: Samples, row: Any) -> Any:
    """Keep what is nearest at each sample, test by test: the colour, or where no ``words`` are, the first vertex.

    Returns the warps and lanes that cover a sample, and those that pass the z-test; 0 where ``row`` is None.
    """
    mask, below = shape.tile - 1, np.uint64(shape.grid)
    hits = hit_warps = passed = passed_warps = warp = 0
    hit_warp = passed_warp = -1  # the last that was counted: lanes come in order
    for k in range(number):
        if t.rows[_SIDE + k] == _ZERO:
            continue
        i, j = int(t.rows[COLUMN + k]), int(t.rows[_ROW + k])
        if row is not None:
            samples.hits[j, i] += 1
            warp = t.group[k] << 6 | ((j & mask) * shape.tile + (i & mask)) >> shape.warp_bits
            hits += 1
            hit_warps += warp != hit_warp
            hit_warp = warp
        z = t.rows[_DEPTH + k]
        if z < samples.depth[j, i]:
            samples.depth[j, i] = z
            if words is None:
                samples.color[j, i] = t.vertex[k]
            else:
                samples.color[j, i] = color_of(t, k, words, below)
            if row is not None:
                passed += 1
                passed_warps += warp != passed_warp
                passed_warp = warp
    return hit_warps, hits, passed_warps, passed
