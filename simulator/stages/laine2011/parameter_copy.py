"""The parameter block of nvdiffrast's CudaRaster as published: a copy of it in every thread.

Triangle setup and bin raster index an array in their kernel parameters with a number known at run time only. Constant
memory does not do that, so the compiler has each thread copy the whole block to local memory when it starts: 664 bytes
that go through L1 to L2, and on large meshes nothing else matters: setup takes as long as L2 takes to write them.

A warp stores whole lines. Alone, such stores run at 2007 bytes a clock on an H200 (2384 elsewhere in global memory); in
setup, whose blocks all copy first and work then, at about 1600. So its lines count as written in two pieces: that is
fitted to the times of triangle setup as published, on the stored scenes.
"""

from dataclasses import replace

from tilestamp.models.launch import Stream
from tilestamp.simulator.work import Work

PARAMETER_BYTES = 664
VARIANT = "as published"
COPYING = {"triangleSetup": 64, "binRaster": 0}  # bytes of the pieces in which its lines are written; 0: whole


def with_parameter_copy(work: Work) -> Work:
    """Add the copies to what a kernel did: bytes stored by each block, and the variant that the mix prices.

    Parameters
    ----------
    work : Work
        Of triangle setup, a row a block, or of bin raster, where only the rows in front are blocks.

    Returns
    -------
    Work
    """
    table = work.table.copy()
    table[: work.grid, work.events["STORE_BYTES"]] += PARAMETER_BYTES * work.block
    size, piece = PARAMETER_BYTES * work.block * work.grid, COPYING[work.kernel]
    lines = size // piece if piece else 0
    streams = (*work.streams, Stream(f"{work.kernel} parameters", "store", size, size, partial_lines=lines))
    return replace(work, table=table, streams=streams, variant=VARIANT)
