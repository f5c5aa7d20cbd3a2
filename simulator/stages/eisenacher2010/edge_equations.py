"""Edge equations in 16 bits, computed while dicing and loaded by the tile raster (not in Eisenacher & Loop 2010).

"Computing edge equations during dicing and loading edge-equations instead of grid positions seems like a promising
tradeoff to explore" (section 3.3): twelve floats a quad, 432 bytes a grid. In 16 bits that is 216. A quad's four
equations A x + B y + C are relative to the pixel of the grid's first vertex. Three ways to have them in 16 bits:

- ``half``: each term an IEEE half;
- ``fixed``: whole numbers with an exponent for A and B, and one for C, a grid;
- ``snapped``: vertices are put on a grid of a fraction of a pixel first, so coarse that all terms are exact.

In the first two an edge that grids share is rounded differently in each; in the last it is moved, and the same in both.
"""

import math
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.eisenacher2010.dice import Grids

Precision = Literal["half", "fixed"]
SIDE, QUADS = 4, 9
BITS = 15  # of a whole number with sign
_FIRST = np.array([quad + quad // (SIDE - 1) for quad in range(QUADS)])
CORNERS = np.stack([_FIRST, _FIRST + 1, _FIRST + SIDE + 1, _FIRST + SIDE], axis=1)  # of each quad, round it
_ZERO = np.float32(0)


class StoredEdges(NamedTuple):
    """Edge equations as they are read back."""

    origin: NDArray[np.float32]  # (N, 2) pixel of the first vertex
    terms: NDArray[np.float32]  # (N, 9, 4, 3) A, B, C of each edge of each quad


def stored_edges(vertices: NDArray[np.float32], precision: Precision) -> StoredEdges:
    """Equations of all grids, rounded to 16 bits.

    Parameters
    ----------
    vertices : ndarray, (N, 16, 4), float32
    precision : {"half", "fixed"}
    """
    origin = np.floor(vertices[:, 0, :2])
    local = vertices[:, :, :2].astype(np.float64) - origin[:, None]
    start = local[:, CORNERS]
    along = np.roll(start, -1, axis=2) - start
    a, b = -along[..., 1], along[..., 0]
    terms = np.stack([a, b, -(a * start[..., 0] + b * start[..., 1])], axis=-1)
    if precision == "half":
        return StoredEdges(origin, terms.astype(np.float16).astype(np.float32))
    slopes, rest = (_whole(part) for part in (terms[..., :2], terms[..., 2:]))
    return StoredEdges(origin, np.concatenate([slopes, rest], axis=-1).astype(np.float32))


def _whole(terms: NDArray[np.float64]) -> NDArray[np.float64]:
    """Whole numbers of 16 bits times a power of two, one of each grid."""
    largest = np.abs(terms).max(axis=(1, 2, 3), keepdims=True)
    step = 2.0 ** (np.floor(np.log2(np.maximum(largest, 2.0**-40))) + 1 - BITS)
    limit = 2**BITS - 1
    rounded: NDArray[np.float64] = np.clip(np.round(terms / step), -limit, limit) * step
    return rounded


def snapped_bits(bound: float) -> int:
    """Bits behind the point of a vertex such that terms are exact: C has twice as many, and is below 2 b (b + 1)."""
    return max(0, (BITS - math.ceil(math.log2(2 * bound * (bound + 1)))) // 2)


def snap_vertices(grids: Grids, bound: float) -> Grids:
    """Put vertices where 16 bits hold their edge equations.

    Parameters
    ----------
    grids : Grids
    bound : float
        Pixels that a sub-patch may be wide and high.
    """
    scale, vertices = np.float32(1 << snapped_bits(bound)), grids.vertices.copy()
    vertices[:, :, :2] = np.round(vertices[:, :, :2] * scale) / scale
    low, high = vertices[:, :, :2].min(axis=1), vertices[:, :, :2].max(axis=1)
    return Grids(vertices, np.concatenate([low, high], axis=1))


@kernel(lent=True)
def covers(stored: Any, grid: int, v: int, x: Any, y: Any) -> bool:
    """Whether the stored equations of the quad whose first vertex is ``v`` cover a sample."""
    quad = v - v // SIDE
    dx, dy = x - stored.origin[grid, 0], y - stored.origin[grid, 1]
    above = below = True
    for edge in range(4):
        terms = stored.terms[grid, quad, edge]
        value = terms[0] * dx + terms[1] * dy + terms[2]
        above, below = above and value >= _ZERO, below and value <= _ZERO
    return above or below
