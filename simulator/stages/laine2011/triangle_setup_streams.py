"""Triangle setup, the buffers that it reads and writes."""

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.launch import Stream
from tilestamp.simulator.stages.laine2011.subtriangle import View
from tilestamp.simulator.stages.laine2011.triangle_setup_count import HEADER_BYTES, INDEX_BYTES, POSITION_BYTES
from tilestamp.simulator.stages.laine2011.triangle_setup_paths import Setup

WARP = 32
POSITIONS_A_SECTOR = 2  # vertices of 16 bytes in the 32 that a cache fetches
POSITIONS_A_LINE = 8


def setup_streams(
    positions: NDArray[np.float32], triangles: NDArray[np.int32], out: Setup, view: View, block: int
) -> tuple[Stream, ...]:
    """Buffers that setup reads and writes, as L2 sees them.

    Lanes of a block read what they share (words of a line, vertices of neighbours) through L1 and the texture cache,
    and writes to one line meet in L2, so that each buffer passes once; vertices again for each block that asks, where
    no texture cache holds them. Records are written in sectors of 32 bytes.
    """
    indices, vertices = len(out.first) * INDEX_BYTES, len(positions) * POSITION_BYTES
    asked = _vertex_bytes(triangles, block)
    kept = int(out.subtriangles.sum(dtype=np.int64))
    headers, data = kept * HEADER_BYTES, kept * out.planes.shape[1] * 4
    if view.guard_band and not (view.depth or view.interpolate):
        data //= 2
    return (
        Stream("indices", "load", indices, indices),
        Stream(
            "positions",
            "load",
            vertices,
            vertices,
            requested_bytes=asked,
            partial_lines=_vertex_lines(triangles),
        ),
        Stream("subtriangles", "store", len(out.first), len(out.first)),
        Stream("headers", "store", headers, headers, partial_lines=0),
        Stream("triangle_data", "store", data, data, partial_lines=0),
    )


def _vertex_bytes(triangles: NDArray[np.int32], block: int) -> int:
    """Bytes of vertices that the blocks ask for, in sectors, each once a block."""
    size = 3 * block
    padded = np.pad(triangles.ravel(), (0, -triangles.size % size), mode="edge" if triangles.size else "constant")
    sectors = np.sort((padded // POSITIONS_A_SECTOR).reshape(-1, size), axis=1)
    return POSITIONS_A_SECTOR * POSITION_BYTES * int(len(sectors) + np.count_nonzero(np.diff(sectors, axis=1)))


def _vertex_lines(triangles: NDArray[np.int32]) -> int:
    """Lines that the warps' loads of vertices touch: one corner of each of a warp's triangles at a time."""
    warps = np.pad(triangles, ((0, -len(triangles) % WARP), (0, 0)), mode="edge" if triangles.size else "constant")
    lines = np.sort((warps // POSITIONS_A_LINE).reshape(-1, WARP, 3), axis=1)
    return int(3 * len(lines) + np.count_nonzero(np.diff(lines, axis=1)))
