"""Triangle setup, the buffers that it reads and writes."""

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.launch import SECTOR_BYTES, Stream
from tilestamp.simulator.stages.laine2011.subtriangle import View
from tilestamp.simulator.stages.laine2011.triangle_setup_count import HEADER_BYTES, INDEX_BYTES, POSITION_BYTES
from tilestamp.simulator.stages.laine2011.triangle_setup_paths import Setup


def setup_streams(out: Setup, V: int, vertices: NDArray[np.int64], view: View) -> tuple[Stream, ...]:
    """Buffers that setup reads and writes, as L2 sees them; of ``V`` vertices it loads ``vertices``: sectors and lines.

    Lanes of a block read what they share (words of a line, vertices of neighbours) through L1 and the texture cache,
    and writes to one line meet in L2, so that each buffer passes once; vertices again for each block that asks, where
    no texture cache holds them. Records are written in sectors of 32 bytes.
    """
    F, positions = len(out.subtriangles), V * POSITION_BYTES
    sectors, lines = vertices.tolist()
    kept = int(out.subtriangles.sum(dtype=np.int64))
    headers, data = kept * HEADER_BYTES, kept * out.planes.shape[1] * 4
    if view.guard_band and not (view.depth or view.interpolate):
        data //= 2
    return (
        Stream("indices", "load", F * INDEX_BYTES, F * INDEX_BYTES),
        Stream(
            "positions",
            "load",
            positions,
            positions,
            requested_bytes=sectors * SECTOR_BYTES,
            partial_lines=lines,
        ),
        Stream("subtriangles", "store", F, F),
        Stream("headers", "store", headers, headers, partial_lines=0),
        Stream("triangle_data", "store", data, data, partial_lines=0),
    )
