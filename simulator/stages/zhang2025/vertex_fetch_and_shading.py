"""VertexFetchAndShading: transform vertices to clip space (Zhang 2025, stage 1). One thread a vertex, 256 a block."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.simt import Simt
from tilestamp.simulator.scenes.textured_mesh import Geometry
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.ru2016.vertex_shading import eye_space
from tilestamp.simulator.stages.thread_per_item import Access, thread_per_item

BLOCK = 256  # threads
VERTEX_BYTES = 36  # position 16, normal 12, texture coordinate 8; in and out
VARYINGS = 9  # normal 3, texture coordinate 2, colour 4 (colours are ours: the original draws one texture)


class ShadedVertices(NamedTuple):
    """The vertex buffer after shading.

    Parameters
    ----------
    clip : ndarray, (V, 4), float32
    varyings : ndarray, (V, 9), float32
        Normal in eye space, texture coordinate, colour.
    """

    clip: NDArray[np.float32]
    varyings: NDArray[np.float32]


def vertex_fetch_and_shading(mesh: Geometry, matrix: NDArray[Any], simt: Simt) -> StageResult[ShadedVertices]:
    """Transform all vertices.

    Parameters
    ----------
    mesh : Geometry
    matrix : ndarray, (4, 4)
        Model to clip.
    simt : Simt

    Returns
    -------
    outputs : ShadedVertices
    works : one
    """
    clip = mesh.positions @ np.asarray(matrix, np.float32).T
    normals = mesh.normals @ eye_space(matrix).axes.T
    varyings = np.concatenate([normals, mesh.uvs, mesh.colors], axis=1, dtype=np.float32)
    count = len(clip)
    loads = (Access("vertices_in", VERTEX_BYTES, VERTEX_BYTES // 4),)
    stores = (Access("vertices_out", VERTEX_BYTES, VERTEX_BYTES // 4),)
    stage = "VertexFetchAndShading"
    work = thread_per_item(stage, stage, count, BLOCK, simt, loads, stores)
    return StageResult(ShadedVertices(clip, varyings), (work,))
