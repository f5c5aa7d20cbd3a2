"""Kernels of micropolygons whose warps, four in a block, draw their work from a queue."""

from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.launch import Stream
from tilestamp.models.simt import Simt
from tilestamp.simulator.stages.fatahalian2009.micropolygon_samples import Samples, blocks
from tilestamp.simulator.work import Work

WARPS = 4  # in a block
CHUNK_BYTES = 32  # of an atomic request


def warp_queue(
    stage: str, events: type[IntEnum], table: NDArray[np.int64], simt: Simt, *, shared_bytes: int = 0, **more: Any
) -> Work:
    """Work of a kernel, a row of the table a unit that a warp drew; ``shared_bytes`` are a warp's."""
    grid, shared = blocks(simt, WARPS), WARPS * shared_bytes
    return Work(stage, events, table, WARPS * simt.warp, grid=grid, shared_bytes=shared, dispatch="warp_queue", **more)


def sample_streams(
    footprint: int, samples: Samples, events: type[IntEnum], table: NDArray[np.int64], *more: Stream
) -> tuple[Stream, ...]:
    """Buffers of a raster: micropolygons of so many bytes are loaded, and ``more``; samples written by atomics."""
    loaded, requests = (int(table[:, events[name]].sum()) for name in ("LOAD_BYTES", "ATOMIC_REQUESTS"))
    touched = CHUNK_BYTES * int(np.count_nonzero(samples.requests))
    return (
        Stream("micropolygons", "load", loaded - sum(stream.bytes for stream in more), footprint),
        *more,
        Stream("samples", "atomic", CHUNK_BYTES * requests, touched),
    )
