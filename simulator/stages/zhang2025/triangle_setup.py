"""TriangleSetup: edge, depth and interpolation equations, boxes (Zhang 2025, stage 4). One thread a primitive.

Everything is a plane a*x + b*y + c over the screen in float32, in the original's order of operations: c is formed from
screen coordinates, so it is large and loses bits. The original's one-pixel holes come from such rounding.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kernel import kernel
from tilestamp.models.simt import Simt
from tilestamp.simulator.parallel import for_parts, parts_of
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.thread_per_item import Access, thread_per_item
from tilestamp.simulator.stages.zhang2025.primitive_assembly import PRIMITIVE_BYTES, Primitives
from tilestamp.simulator.stages.zhang2025.vertex_fetch_and_shading import VARYINGS

BLOCK = 256  # threads
SETUP_BYTES = 140
MOST_COMPACTED = 2048  # primitives that blocks are launched for at least
SMALLEST_PART = 4096  # primitives of a thread's part
DEPTH, ONE_OVER_W, NORMAL, UV, COLOR = 0, 1, 2, 5, 7  # rows of ``planes``
PLANES = 2 + VARYINGS
_ONE = np.float32(1.0)


class TriangleSetupData(NamedTuple):
    """Equations of every primitive.

    Parameters
    ----------
    edges : ndarray, (P, 3, 3), float32
        Not negative inside.
    planes : ndarray, (P, 11, 3), float32
        Depth, 1/w, then the varyings over w: normal, texture coordinate, colour.
    boxes : ndarray, (P, 4), float32
        Left, bottom, right, top.
    ids : ndarray, (P,), int32
    """

    edges: NDArray[np.float32]
    planes: NDArray[np.float32]
    boxes: NDArray[np.float32]
    ids: NDArray[np.int32]


@kernel(error_model="numpy", lent=True)
def _setup(screen: Any, varyings: Any, edges: Any, planes: Any, box: Any) -> None:
    for k in range(3):
        p, q = screen[(k + 1) % 3], screen[(k + 2) % 3]
        edges[k, 0] = p[1] - q[1]
        edges[k, 1] = q[0] - p[0]
        edges[k, 2] = p[0] * q[1] - q[0] * p[1]
    scale = edges[0, 2] + edges[1, 2] + edges[2, 2]
    for n in range(PLANES):
        for d in range(3):
            total = np.float32(0.0)
            for k in range(3):
                if n == DEPTH:
                    value = screen[k, 2]
                elif n == ONE_OVER_W:
                    value = _ONE / screen[k, 3]
                else:
                    value = varyings[k, n - 2] / screen[k, 3]
                total += edges[k, d] * value
            planes[n, d] = total / scale
    for d in range(2):
        box[d] = min(screen[0, d], screen[1, d], screen[2, d])
        box[2 + d] = max(screen[0, d], screen[1, d], screen[2, d])


@kernel(error_model="numpy", lent=True)
def _triangle_setup(part: int, parts: int, screen: Any, varyings: Any, edges: Any, planes: Any, boxes: Any) -> None:
    for p in range(part * len(screen) // parts, (part + 1) * len(screen) // parts):
        _setup(screen[p], varyings[p], edges[p], planes[p], boxes[p])


@kernel(error_model="numpy", lent=True)
def evaluate(plane: Any, x: Any, y: Any) -> Any:
    """Value of a plane (device function)."""
    return plane[0] * x + plane[1] * y + plane[2]


def triangle_setup(primitives: Primitives, simt: Simt, *, triangles: int = 0) -> StageResult[TriangleSetupData]:
    """Set up all primitives.

    Parameters
    ----------
    primitives : Primitives
        Compacted.
    simt : Simt
    triangles : int
        Triangles of the model: the original launches blocks for twice as many primitives, and for 2,048 at least.

    Returns
    -------
    outputs : TriangleSetupData
    works : one
    """
    count = len(primitives.ids)
    data = TriangleSetupData(
        np.empty((count, 3, 3), np.float32),
        np.empty((count, PLANES, 3), np.float32),
        np.empty((count, 4), np.float32),
        primitives.ids,
    )
    for_parts(_triangle_setup, parts_of(count, SMALLEST_PART), primitives.screen, primitives.varyings, *data[:3])
    loads = (Access("compacted", PRIMITIVE_BYTES, PRIMITIVE_BYTES // 4),)
    stores = (Access("setup", SETUP_BYTES, SETUP_BYTES // 4, scattered=True),)
    idle = max(0, launched_blocks(triangles) - max(1, -(-count // BLOCK)))
    stage = "TriangleSetup"
    work = thread_per_item(stage, stage, count, BLOCK, simt, loads, stores, idle_blocks=idle)
    return StageResult(data, (work,))


def launched_blocks(triangles: int) -> int:
    """Blocks that the original launches for TriangleSetup and PrimitiveBinning, not knowing what compaction left."""
    return -(-max(2 * triangles, MOST_COMPACTED) // BLOCK)
