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


class Samples(NamedTuple):
    """Samples of one tile while it is drawn: rows from the top."""

    depth: NDArray[np.float32]
    color: NDArray[np.uint32]
    hits: NDArray[np.int32]  # covered quads so far


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


@kernel(lent=True)
def quad_box(vertices: Any, grid: int, v: int, side: int) -> tuple[Any, Any, Any, Any]:
    """Bounding box x0, y0, x1, y1 of the quad whose first vertex is ``v``, in a grid of ``side`` vertices a side."""
    b, d = v + 1, v + side
    ax, bx, cx, dx = vertices[grid, v, 0], vertices[grid, b, 0], vertices[grid, d + 1, 0], vertices[grid, d, 0]
    ay, by, cy, dy = vertices[grid, v, 1], vertices[grid, b, 1], vertices[grid, d + 1, 1], vertices[grid, d, 1]
    x0, x1 = min(ax, bx, cx, dx), max(ax, bx, cx, dx)
    y0, y1 = min(ay, by, cy, dy), max(ay, by, cy, dy)
    return x0, y0, x1, y1


@kernel(lent=True)
def sample_span(low: Any, high: Any, origin: Any, side: int, samples: int) -> tuple[int, int]:
    """First and last sample inside low..high on an axis of ``samples`` that starts at ``origin``, ``side`` a pixel.

    Exactly the samples at ``origin + (i + 0.5) / side`` that compare as inside: float64 holds every step.
    """
    first = np.ceil((np.float64(low) - origin) * side - 0.5)
    last = np.floor((np.float64(high) - origin) * side - 0.5)
    return int(min(max(first, 0.0), samples)), int(max(min(last, samples - 1.0), -1.0))


@kernel(lent=True)
def sample_quad(
    vertices: Any,
    colors: Any,
    stored: Any,
    grid: int,
    v: int,
    span: Any,
    origin: Any,
    shape: Any,
    samples: Samples,
    row: Any,
) -> tuple[int, int, int, int]:
    """Test the samples of ``span`` (columns and rows of the tile's samples, inside one sub-tile); keep the nearest.

    Of a sample that is kept the blended colour stays, or the number of the quad's first vertex where no ``colors`` are.
    ``stored`` edge equations decide what is covered, where there are such.
    Returns the warps and lanes that cover a sample, and those that pass the z-test; 0 where ``row`` is None.
    """
    b, c, d = v + 1, v + shape.grid + 1, v + shape.grid
    ax, ay, bx, by = vertices[grid, v, 0], vertices[grid, v, 1], vertices[grid, b, 0], vertices[grid, b, 1]
    cx, cy, dx, dy = vertices[grid, c, 0], vertices[grid, c, 1], vertices[grid, d, 0], vertices[grid, d, 1]
    step = _ONE / np.float32(shape.side)
    mask = shape.tile - 1
    hits = hit_warps = passed = passed_warps = 0
    hit_warp = passed_warp = -1  # the last warp that was counted: lanes come in order
    for j in range(span[2], span[3] + 1):
        y = np.float32(origin[1]) + (np.float32(j) + _HALF) * step
        for i in range(span[0], span[1] + 1):
            x = np.float32(origin[0]) + (np.float32(i) + _HALF) * step
            e0 = edge(ax, ay, bx, by, x, y)
            e1 = edge(bx, by, cx, cy, x, y)
            e2 = edge(cx, cy, dx, dy, x, y)
            e3 = edge(dx, dy, ax, ay, x, y)
            if stored is not None:
                if not covers(stored, grid, v, x, y):
                    continue
            elif not (
                (e0 >= _ZERO and e1 >= _ZERO and e2 >= _ZERO and e3 >= _ZERO)
                or (e0 <= _ZERO and e1 <= _ZERO and e2 <= _ZERO and e3 <= _ZERO)
            ):
                continue
            if row is not None:
                samples.hits[j, i] += 1
                of_warp = ((j & mask) * shape.tile + (i & mask)) >> shape.warp_bits
                hit_warps += of_warp != hit_warp
                hits += 1
                hit_warp = of_warp
            f = edge(ax, ay, cx, cy, x, y)
            if (f <= _ZERO) == (e0 + e1 + e2 + e3 >= _ZERO):  # which side of the diagonal
                p, wa, wb, wc = b, e1, -f, e0
            else:
                p, wa, wb, wc = d, e2, f, e3
            total = wa + wb + wc
            if total == _ZERO:
                continue
            r = _ONE / total
            z = (wa * vertices[grid, v, 2] + wb * vertices[grid, p, 2] + wc * vertices[grid, c, 2]) * r
            if z < samples.depth[j, i]:
                samples.depth[j, i] = z
                if colors is None:
                    samples.color[j, i] = grid * shape.grid * shape.grid + v
                else:
                    samples.color[j, i] = blend(
                        colors[grid, v], colors[grid, p], colors[grid, c], wa * r, wb * r, wc * r
                    )
                if row is not None:
                    of_warp = ((j & mask) * shape.tile + (i & mask)) >> shape.warp_bits
                    passed_warps += of_warp != passed_warp
                    passed += 1
                    passed_warp = of_warp
    return hit_warps, hits, passed_warps, passed
