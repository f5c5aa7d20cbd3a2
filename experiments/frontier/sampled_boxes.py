"""The least that numbers alone could cost: one pass over the vertices, one over the boxes of all triangles.

That is what a sampler has to do before it can say which triangles meet the tiles that it draws: project every vertex,
find every triangle's box, and add one to the list of each tile in it. Nothing of the pipeline is counted.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kernel import kernel
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.scenes.scene import Mesh

TILE, UNITS = 8, 16  # pixels on a side; sub-pixel positions, as in cudaraster
_PART = 4096  # vertices or triangles that one call of a worker takes, at least


@kernel(error_model="numpy")
def _project(part: int, parts: int, positions: Any, matrix: Any, half: Any, places: Any) -> None:
    """Vertices of one part in sub-pixel positions from the middle of the screen."""
    m = matrix
    for v in range(positions.shape[0] * part // parts, positions.shape[0] * (part + 1) // parts):
        a, b, c, d = positions[v, 0], positions[v, 1], positions[v, 2], positions[v, 3]
        inverse = np.float32(1) / (m[3, 0] * a + m[3, 1] * b + m[3, 2] * c + m[3, 3] * d)
        places[v, 0] = np.int32((m[0, 0] * a + m[0, 1] * b + m[0, 2] * c + m[0, 3] * d) * inverse * half[0])
        places[v, 1] = np.int32((m[1, 0] * a + m[1, 1] * b + m[1, 2] * c + m[1, 3] * d) * inverse * half[1])


@kernel
def _list(part: int, parts: int, places: Any, triangles: Any, size: Any, chosen: Any, lengths: Any, met: Any) -> None:
    """Triangles of one part that face the eye: lengths of the lists, and whether a chosen tile is in the box."""
    half_x, half_y, columns, rows = size
    for t in range(triangles.shape[0] * part // parts, triangles.shape[0] * (part + 1) // parts):
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        ax, ay, bx, by, cx, cy = places[i, 0], places[i, 1], places[j, 0], places[j, 1], places[k, 0], places[k, 1]
        if (bx - ax) * (cy - ay) - (by - ay) * (cx - ax) <= 0:
            continue
        x0, x1 = (min(ax, bx, cx) + half_x + 7) >> 4, (max(ax, bx, cx) + half_x - 8) >> 4
        y0, y1 = (min(ay, by, cy) + half_y + 7) >> 4, (max(ay, by, cy) + half_y - 8) >> 4
        if x1 < x0 or y1 < y0:  # between the samples
            continue
        for y in range(max(y0 >> 3, 0), min(y1 >> 3, rows - 1) + 1):
            for x in range(max(x0 >> 3, 0), min(x1 >> 3, columns - 1) + 1):
                lengths[part, y * columns + x] += 1
                met[t] |= chosen[y * columns + x]


def boxes(mesh: Mesh, matrix: NDArray[np.float64], width: int, height: int, share: float) -> tuple[int, int]:
    """Make both passes; entries of the lists of all tiles, and triangles that meet a share of the tiles."""
    columns, rows = -(-width // TILE), -(-height // TILE)
    half = np.array([UNITS // 2 * width, UNITS // 2 * height], np.float32)
    chosen = np.random.default_rng(0).random(columns * rows) < share
    places, met = np.empty((len(mesh.positions), 2), np.int32), np.zeros(len(mesh.triangles), np.bool_)
    for_parts(_project, parts_of(len(places), _PART), mesh.positions, matrix.astype(np.float32), half, places)
    parts = parts_of(len(met), _PART)
    lengths = np.zeros((parts, columns * rows), np.int32)
    size = (int(half[0]), int(half[1]), columns, rows)
    for_parts(_list, parts, places, mesh.triangles, size, chosen, lengths, met)
    return int(lengths.sum()), int(met.sum())
