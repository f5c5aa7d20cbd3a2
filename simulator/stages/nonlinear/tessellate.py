"""Tessellation until straight lines will do: edges are halved where the picture of their middle is off the chord.

Each edge is looked at by itself, so that two triangles halve their common edge alike and no crack opens.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.simt import Simt
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.nonlinear.projections import Projection, project
from tilestamp.simulator.stages.thread_per_item import Access, thread_per_item

LEVELS = 8  # halvings at most
BLOCK = 128  # threads; each has a triangle of one level
CORNER = 12  # bytes
# by the edges that are halved (bit k: from corner k to the next): corners of the parts, 3 to 5 being the middles
PARTS: dict[int, list[tuple[int, int, int]]] = {
    0: [(0, 1, 2)],
    1: [(0, 3, 2), (3, 1, 2)],
    2: [(0, 1, 4), (0, 4, 2)],
    4: [(0, 1, 5), (5, 1, 2)],
    3: [(0, 3, 2), (3, 1, 4), (3, 4, 2)],
    6: [(0, 1, 5), (5, 1, 4), (5, 4, 2)],
    5: [(0, 3, 5), (3, 1, 2), (3, 2, 5)],
    7: [(0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)],
}


class Tessellated(NamedTuple):
    """Small triangles.

    Parameters
    ----------
    corners : ndarray, (N, 3, 3), float64
        In eye space.
    parents : ndarray, (N,), int64
    """

    corners: NDArray[np.float64]
    parents: NDArray[np.int64]


def tessellate(corners: NDArray[np.float64], to: Projection, tolerance: float, simt: Simt) -> StageResult[Tessellated]:
    """Halve edges of triangles (M, 3, 3) until their middles lie within ``tolerance`` pixels of the chord.

    Returns
    -------
    outputs : Tessellated
    works : one for each level, a thread a triangle
    facts : dict
        ``torn``: triangles left out because they are still bent at the last level: on the picture's seam, or a pole.
    """
    parents, works = np.arange(len(corners)), []
    halves = _halves(corners, to, tolerance)
    for _ in range(LEVELS):
        loads, stores = (Access("triangles", 3 * CORNER, 9),), (Access("triangles", 3 * CORNER, 9),)
        works.append(thread_per_item("tessellate", "tessellate", len(corners), BLOCK, simt, loads, stores))
        if not halves.any():
            break
        points = np.concatenate([corners, (corners + np.roll(corners, -1, axis=1)) / 2], axis=1)
        made = [(points[halves == code][:, parts], parents[halves == code]) for code, parts in PARTS.items()]
        counts = [len(PARTS[code]) for code in PARTS]
        corners = np.concatenate([part.reshape(-1, 3, 3) for part, _ in made])
        parents = np.concatenate([np.repeat(whose, n) for (_, whose), n in zip(made, counts, strict=True)])
        halves = _halves(corners, to, tolerance)
    torn = halves > 0
    return StageResult(Tessellated(corners[~torn], parents[~torn]), tuple(works), {"torn": int(torn.sum())})


def _halves(corners: NDArray[np.float64], to: Projection, tolerance: float) -> NDArray[np.int64]:
    """Edges to be halved, a bit each."""
    after = np.roll(corners, -1, axis=1)
    chord = (project(to, corners) + project(to, after)) / 2
    off = np.linalg.norm(project(to, (corners + after) / 2) - chord, axis=2) > tolerance
    return np.asarray(off @ np.array([1, 2, 4]), np.int64)
