"""PrimitiveAssembly: triangles, frustum clipping, backface culling (Zhang 2025, stage 2): one thread a triangle.

A triangle that stays whole keeps its own slot of the primitive buffer; the pieces of a clipped one go behind all slots,
by one global atomicAdd a clipped triangle. Culled slots are marked and left to PrimitiveCompaction. The original drops
every triangle with a vertex behind the eye before it clips, which leaves holes; here those are clipped as well.
Rows count from the bottom of the picture up to StreamingToFrameBuffer, as in the original.
"""

from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.atomics import count_atomics
from tilestamp.models.coalescing import SEGMENT_BYTES, smallest_transaction_bytes, transactions
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.scenes.textured_mesh import Geometry
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.zhang2025.clip_polygon import MOST_VERTICES, clip_polygon, outcode
from tilestamp.simulator.stages.zhang2025.vertex_fetch_and_shading import BLOCK, VARYINGS, VERTEX_BYTES, ShadedVertices
from tilestamp.simulator.work import Work

PRIMITIVE_BYTES = 112  # three vertices and an identifier
MOST_PIECES = MOST_VERTICES - 2
_HALF = np.float32(0.5)
_ONE = np.float32(1.0)
_ZERO = np.float32(0.0)


class PrimitiveAssemblyEvent(IntEnum):
    """Events of one block."""

    WARPS = 0
    WARP_LANES = 1
    CLIPPED = 2  # lanes whose triangle is cut into pieces, which need slots beyond its own
    CULLED = 3  # lanes whose triangle is outside or faces away
    PIECES = 4  # primitives written
    ATOMIC = 5
    ATOMIC_LANES = 6
    ATOMIC_REQUESTS = 7
    ATOMIC_CONFLICTS = 8
    ATOMIC_DEPTH = 9
    LOAD_TRANSACTIONS = 10
    LOAD_BYTES = 11
    STORE_TRANSACTIONS = 12
    STORE_BYTES = 13
    CLIP_WARPS = 14  # warps with a clipped triangle


class Primitives(NamedTuple):
    """The primitive buffer.

    Parameters
    ----------
    screen : ndarray, (P, 3, 4), float32
        Pixels right and up, depth in [0, 1], w.
    varyings : ndarray, (P, 3, 9), float32
    ids : ndarray, (P,), int32
        Triangle in API order, -1 where culled.
    """

    screen: NDArray[np.float32]
    varyings: NDArray[np.float32]
    ids: NDArray[np.int32]


@kernel(error_model="numpy", lent=True)
def _put(
    vertices: Any, a: int, b: int, c: int, width: Any, height: Any, culling: bool, screen: Any, varyings: Any
) -> bool:
    """Divide by w, map to the screen, store one piece; False where it faces away."""
    for k in range(3):
        v = a if k == 0 else b if k == 1 else c
        w = vertices[v, 3]
        screen[k, 0] = (vertices[v, 0] / w + _ONE) * _HALF * width
        screen[k, 1] = (vertices[v, 1] / w + _ONE) * _HALF * height
        screen[k, 2] = (vertices[v, 2] / w + _ONE) * _HALF
        screen[k, 3] = w
    ux, uy = screen[1, 0] - screen[0, 0], screen[1, 1] - screen[0, 1]
    vx, vy = screen[2, 0] - screen[0, 0], screen[2, 1] - screen[0, 1]
    area = ux * vy - uy * vx
    if not (area > _ZERO or (area < _ZERO and not culling)):
        return False
    if area < _ZERO:  # the edge functions want counter-clockwise corners
        for n in range(4):
            screen[1, n], screen[2, n] = screen[2, n], screen[1, n]
        b, c = c, b
    for k in range(3):
        v = a if k == 0 else b if k == 1 else c
        for n in range(VARYINGS):
            varyings[k, n] = vertices[v, 4 + n]
    return True


@kernel(error_model="numpy", lent=True)
def _primitive_assembly(
    vertices: Any, triangles: Any, width: Any, height: Any, culling: bool, polygon: Any, scratch: Any,
    screen: Any, varyings: Any, ids: Any, clipped: Any, events: Any,
) -> int:  # fmt: skip
    """Assemble all triangles, and mark those that are cut into pieces; returns the slots in use."""
    used = len(triangles)
    for t in range(len(triangles)):
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        codes = outcode(vertices[a]), outcode(vertices[b]), outcode(vertices[c])
        count = pieces = 0
        ids[t] = -1
        if codes[0] | codes[1] | codes[2] == 0:
            count = 3
            pieces = int(_put(vertices, a, b, c, width, height, culling, screen[t], varyings[t]))
            ids[t] = t if pieces else -1
        elif codes[0] & codes[1] & codes[2] == 0:
            for k in range(3):
                for n in range(vertices.shape[1]):
                    polygon[k, n] = vertices[triangles[t, k], n]
            count = clip_polygon(polygon, scratch, 3)
            for j in range(1, count - 1):
                slot = t if count == 3 else used
                front = _put(polygon, 0, j, j + 1, width, height, culling, screen[slot], varyings[slot])
                ids[slot] = t if front else -1
                pieces += front
                used += count > 3
        clipped[t] = count > 3
        row = events[t // BLOCK]
        row[PrimitiveAssemblyEvent.WARP_LANES] += 1
        row[PrimitiveAssemblyEvent.CLIPPED] += count > 3
        row[PrimitiveAssemblyEvent.CULLED] += pieces == 0
        row[PrimitiveAssemblyEvent.PIECES] += max(1, count - 2)
    return used


@kernel(error_model="numpy")
def _count_memory(triangles: Any, clipped: Any, warp: int, rule: int, merge: int, events: Any) -> None:
    """Indices, the vertices that they fetch, and the atomics of the clipped lanes, warp by warp."""
    addresses, indices = np.empty(warp, np.int64), np.empty((3, 2), np.int64)
    for first in range(0, len(triangles), warp):
        row = events[first // BLOCK]
        row[PrimitiveAssemblyEvent.WARPS] += 1
        for k in range(3):
            for lane in range(warp):
                addresses[lane] = triangles[first + lane, k] * VERTEX_BYTES if first + lane < len(triangles) else -1
            count, size = transactions(addresses, warp, 4, rule)
            row[PrimitiveAssemblyEvent.LOAD_TRANSACTIONS] += count * (VERTEX_BYTES // 4)
            row[PrimitiveAssemblyEvent.LOAD_BYTES] += size * (VERTEX_BYTES // 4)
            if first == 0 or first + warp > len(triangles) or 12 * warp % SEGMENT_BYTES:  # or in lines as the first's
                for lane in range(warp):
                    addresses[lane] = (3 * (first + lane) + k) * 4 if first + lane < len(triangles) else -1
                indices[k, 0], indices[k, 1] = transactions(addresses, warp, 4, rule)
            count, size = indices[k]
            row[PrimitiveAssemblyEvent.LOAD_TRANSACTIONS] += count
            row[PrimitiveAssemblyEvent.LOAD_BYTES] += size
        for lane in range(warp):
            addresses[lane] = 0 if first + lane < len(triangles) and clipped[first + lane] else -1
        lanes, merged, conflicts, depth = count_atomics(addresses, warp, merge)
        row[PrimitiveAssemblyEvent.CLIP_WARPS] += lanes > 0
        row[PrimitiveAssemblyEvent.ATOMIC] += lanes > 0
        row[PrimitiveAssemblyEvent.ATOMIC_LANES] += lanes
        row[PrimitiveAssemblyEvent.ATOMIC_REQUESTS] += merged
        row[PrimitiveAssemblyEvent.ATOMIC_CONFLICTS] += conflicts
        row[PrimitiveAssemblyEvent.ATOMIC_DEPTH] += depth


def primitive_assembly(
    mesh: Geometry, vertices: ShadedVertices, width: int, height: int, simt: Simt, *, culling: bool = True
) -> StageResult[Primitives]:
    """Assemble, clip and cull.

    Parameters
    ----------
    mesh : Geometry
    vertices : ShadedVertices
    width, height : int
        Pixels.
    simt : Simt
    culling : bool
        Cull triangles that face away; the original always does.

    Returns
    -------
    outputs : Primitives
        All slots in use, culled ones included.
    works : one
    """
    count = len(mesh.triangles)
    x, y, z, w = vertices.clip.T
    beyond = (np.abs(x) > w) | (np.abs(y) > w) | (np.abs(z) > w)
    crossing = np.count_nonzero(np.logical_or.reduce([beyond[mesh.triangles[:, k]] for k in range(3)]))
    slots = count + MOST_PIECES * int(crossing)
    out = Primitives(
        np.empty((slots, 3, 4), np.float32), np.empty((slots, 3, VARYINGS), np.float32), np.full(slots, -1, np.int32)
    )
    blocks = max(1, -(-count // BLOCK))
    events = np.zeros((blocks, len(PrimitiveAssemblyEvent)), np.int64)
    clipped = np.zeros(count, np.bool_)
    size = np.float32(width), np.float32(height)
    whole = np.concatenate(vertices, axis=1)
    polygons = np.empty((2, MOST_VERTICES, whole.shape[1]), np.float32)
    used = _primitive_assembly(whole, mesh.triangles, *size, culling, *polygons, *out, clipped, events)
    _count_memory(mesh.triangles, clipped, simt.warp, int(simt.coalescing), int(simt.atomic_merge), events)
    segment = smallest_transaction_bytes(int(simt.coalescing))
    stores = events[:, PrimitiveAssemblyEvent.PIECES] * (PRIMITIVE_BYTES // 4)  # a lane's words lie 112 bytes apart
    events[:, PrimitiveAssemblyEvent.STORE_TRANSACTIONS] = stores
    events[:, PrimitiveAssemblyEvent.STORE_BYTES] = stores * segment
    streams = (
        Stream("indices", "load", 12 * count, 12 * count),
        Stream("vertices_out", "load", 3 * VERTEX_BYTES * count, len(whole) * VERTEX_BYTES),
        Stream("primitives", "store", int(stores.sum()) * segment, used * PRIMITIVE_BYTES),
    )
    stage = "PrimitiveAssembly"
    work = Work(stage, PrimitiveAssemblyEvent, events, BLOCK, grid=blocks, streams=streams)
    return StageResult(Primitives(out.screen[:used], out.varyings[:used], out.ids[:used]), (work,))
