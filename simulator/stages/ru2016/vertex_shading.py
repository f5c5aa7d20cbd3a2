"""Vertex shading and primitive assembly (Ru 2016: "Vertex assembly and vertex shader", "Primitive assembly").

One thread a vertex transforms it to the screen and to eye space; one thread an *index* then copies the whole vertex
into its primitive. Both kernels run 128 threads a block, and are launched for each part of the model by itself, the
host waiting after each (an engine of 115 parts: 230 launches). The original does not clip: a triangle with a vertex
behind the eye (w <= 0) is garbage there and is dropped here, and counted.

Samples lie at the centres of pixels here. In the original they lie at integer coordinates, y up: half a pixel left of
and below them (``samples="corners"``). Tiles there are bounded halfway between samples, so all else is as if every
vertex were half a pixel further right and up, and that is what is done: lists and coverage then are the original's.

The pipeline is given one model-to-clip matrix; its rows give the eye's axes, since for a perspective without skew
row 0 is the right axis, row 1 the up axis and row 3 the forward axis, each times a factor.
"""

from dataclasses import replace
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kernel import kernel
from tilestamp.models.simt import Coalescing, Simt
from tilestamp.simulator.scenes.textured_mesh import Geometry
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.thread_per_item import Access, ThreadEvent, record_transactions, thread_per_item
from tilestamp.simulator.work import Work

BLOCK = 128  # threads
VERTEX_BYTES = 64  # position, eye position, eye normal, texture coordinate, texture pointer and size
VERTEX_WORDS = 15  # the pointer goes as one
PLAIN_STORES = 11  # of a vertex: position, eye position, normal, size
TEXTURE_STORES = 3  # coordinate, pointer
PRIMITIVE_BYTES = 3 * VERTEX_BYTES + 8  # three vertices and a type, padded to the alignment of the pointers
INDEX_BYTES = 2
Samples = Literal["centers", "corners"]
SHIFTS = {  # of vertices on the screen, pixels right and down
    "centers": (np.float32(0.0), np.float32(0.0)),
    "corners": (np.float32(0.5), np.float32(-0.5)),
}
_HALF = np.float32(0.5)
_ONE = np.float32(1.0)


class EyeSpace(NamedTuple):
    """What the model-to-clip matrix says about the eye.

    Parameters
    ----------
    axes : ndarray, (3, 3), float32
        Right, up and backward axis in model space, unit length.
    scales : ndarray, (3,), float32
        Lengths of rows 0, 1 and 3 of the matrix: clip = scale x eye coordinate; the last is 0 without perspective.
    """

    axes: NDArray[np.float32]
    scales: NDArray[np.float32]


class ShadedVertices(NamedTuple):
    """The vertex buffer after shading.

    Parameters
    ----------
    screen : ndarray, (V, 4), float32
        Pixels right and down, depth in [0, 1], 1/w; w itself is not positive where 1/w is 0.
    normals : ndarray, (V, 3), float32
        In eye space.
    """

    screen: NDArray[np.float32]
    normals: NDArray[np.float32]


def eye_space(matrix: NDArray[Any]) -> EyeSpace:
    """Take the eye's axes out of a model-to-clip matrix, (4, 4)."""
    rows = np.asarray(matrix, np.float64)[[0, 1, 3], :3]
    scales = np.linalg.norm(rows, axis=1)
    axes = rows / np.where(scales > 0.0, scales, 1.0)[:, None]
    axes[2] = -axes[2] if scales[2] > 1e-12 else np.cross(axes[0], axes[1])
    return EyeSpace(axes.astype(np.float32), np.where(scales > 1e-12, scales, 0.0).astype(np.float32))


@kernel(error_model="numpy", lent=True)
def _vertex_shading(
    positions: Any, normals: Any, matrix: Any, axes: Any, size: Any, shift: Any, screen: Any, eye_normals: Any
) -> None:
    """Transform every vertex."""
    for v in range(len(positions)):
        x, y, z, w0 = positions[v, 0], positions[v, 1], positions[v, 2], positions[v, 3]
        cx = matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2] * z + matrix[0, 3] * w0
        cy = matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2] * z + matrix[1, 3] * w0
        cz = matrix[2, 0] * x + matrix[2, 1] * y + matrix[2, 2] * z + matrix[2, 3] * w0
        w = matrix[3, 0] * x + matrix[3, 1] * y + matrix[3, 2] * z + matrix[3, 3] * w0
        inverse = _ONE / w if w > np.float32(0.0) else np.float32(0.0)
        screen[v, 0] = (cx * inverse + _ONE) * _HALF * size[0] + shift[0]
        screen[v, 1] = (_ONE - cy * inverse) * _HALF * size[1] + shift[1]
        screen[v, 2] = (cz * inverse + _ONE) * _HALF
        screen[v, 3] = inverse
        for k in range(3):
            eye_normals[v, k] = axes[k, 0] * normals[v, 0] + axes[k, 1] * normals[v, 1] + axes[k, 2] * normals[v, 2]


def vertex_shading(
    mesh: Geometry,
    matrix: NDArray[Any],
    width: int,
    height: int,
    simt: Simt,
    parts: NDArray[np.int64] | None = None,
    *,
    samples: Samples = "centers",
) -> StageResult[ShadedVertices]:
    """Transform vertices to the screen, normals to eye space.

    Parameters
    ----------
    mesh : Geometry
    matrix : ndarray, (4, 4)
        Model to clip.
    width, height : int
        Pixels.
    simt : Simt
    parts : ndarray, (D, 2), int64, or None
        Vertices and triangles of each draw.
    samples : {"centers", "corners"}
        Where in its pixel a sample lies: at its centre, or at its lower left corner, as the original's.

    Returns
    -------
    outputs : ShadedVertices
    works : one for each part
    """
    count = len(mesh.positions)
    out = ShadedVertices(np.empty((count, 4), np.float32), np.empty((count, 3), np.float32))
    _vertex_shading(
        mesh.positions,
        mesh.normals,
        np.ascontiguousarray(matrix, np.float32),
        eye_space(matrix).axes,
        (np.float32(width), np.float32(height)),
        SHIFTS[samples],
        *out,
    )
    draws = np.array([[count, len(mesh.triangles)]]) if parts is None else parts
    ends = np.cumsum(draws[:, 1])
    textured = [bool((mesh.texture_ids[end - n : end] >= 0).any()) for n, end in zip(draws[:, 1], ends, strict=True)]
    sizes = draws[:, 0].tolist()
    return StageResult(out, tuple(_shading_work(sizes[i], i, textured[i], simt) for i in range(len(sizes))))


def _shading_work(count: int, part: int, textured: bool, simt: Simt) -> Work:
    loads = [Access(f"positions {part}", 12, 3), Access(f"normals {part}", 12, 3)]
    if textured:
        loads.append(Access(f"uvs {part}", 8, 2))
    stored = PLAIN_STORES + (TEXTURE_STORES if textured else 0)
    stores = (Access(f"vertices {part}", VERTEX_BYTES, stored),)
    return _word_by_word(
        thread_per_item("vertex_shading", "vertex_shading", count, BLOCK, simt, tuple(loads), stores), simt
    )


def primitive_assembly(
    mesh: Geometry, vertices: ShadedVertices, simt: Simt, parts: NDArray[np.int64] | None = None
) -> StageResult[NDArray[np.int32]]:
    """Copy each index's vertex into its primitive; drop what the original cannot draw.

    Returns
    -------
    outputs : ndarray, (F',), int32
        Triangles whose vertices are all before the eye, in order.
    works : one for each part
    """
    before = (vertices.screen[:, 3] > 0.0)[mesh.triangles].all(axis=1)
    sizes = [len(mesh.triangles)] if parts is None else parts[:, 1].tolist()
    ends = np.cumsum(sizes)
    works = tuple(
        _assembly_work(mesh.triangles[end - size : end].ravel(), i, simt)
        for i, (size, end) in enumerate(zip(sizes, ends, strict=True))
    )
    return StageResult(np.flatnonzero(before).astype(np.int32), works)


def shaded_primitives(
    mesh: Geometry,
    matrix: NDArray[Any],
    width: int,
    height: int,
    simt: Simt,
    parts: NDArray[np.int64] | None = None,
    *,
    samples: Samples = "centers",
) -> StageResult[tuple[ShadedVertices, NDArray[np.int32]]]:
    """Vertex shading and primitive assembly, one after the other for each draw; parameters of ``vertex_shading``."""
    vertices, shading, _ = vertex_shading(mesh, matrix, width, height, simt, parts, samples=samples)
    drawable, assembly, _ = primitive_assembly(mesh, vertices, simt, parts)
    return StageResult(
        (vertices, drawable), tuple(work for pair in zip(shading, assembly, strict=True) for work in pair)
    )


def _assembly_work(indices: NDArray[np.int32], part: int, simt: Simt) -> Work:
    """A thread an index; lanes that copy the same vertex read the same sectors."""
    vertices = Access(f"vertices {part}", VERTEX_BYTES, VERTEX_WORDS)
    loads = (Access(f"indices {part}", INDEX_BYTES, 1), vertices)
    stores = (Access("primitives", PRIMITIVE_BYTES // 3, VERTEX_WORDS),)
    work = thread_per_item("primitive_assembly", "primitive_assembly", len(indices), BLOCK, simt, loads, stores)
    count, size = record_transactions(vertices, simt)
    if len(indices):
        again = (simt.warp - _distinct(indices, simt.warp)).reshape(len(work.table), -1).sum(axis=1)
        work.table[:, ThreadEvent.LOAD_TRANSACTIONS] -= again * count // simt.warp
        work.table[:, ThreadEvent.LOAD_BYTES] -= again * size // simt.warp
    return _word_by_word(work, simt)


def _word_by_word(work: Work, simt: Simt) -> Work:
    """Let each store of a record's words leave L1 as a sector of its own, as an H200's counters have it."""
    if simt.coalescing != Coalescing.WARP_SECTORS:
        return work
    stored = work.total(ThreadEvent.STORE_BYTES)
    streams = (replace(s, bytes=stored) if s.op == "store" else s for s in work.streams)
    return replace(work, streams=tuple(streams))


def _distinct(indices: NDArray[np.int32], warp: int) -> NDArray[np.int64]:
    """Vertices that each warp reads, of all warps of all blocks; lanes and warps without an index count as another."""
    padded = -1 - np.arange(-(-len(indices) // BLOCK) * BLOCK)
    padded[: len(indices)] = indices
    ordered = np.sort(padded.reshape(-1, warp), axis=1)
    found: NDArray[np.int64] = 1 + (np.diff(ordered, axis=1) != 0).sum(axis=1)
    return found
