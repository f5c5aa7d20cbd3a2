"""A launch: what one kernel, or one pass through the fixed-function pipe, asks of the machine."""

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.kinds import Kinds, each_a_kind, kinds_of

SECTOR_BYTES, LINE_BYTES = 32, 128


@dataclass(frozen=True)
class Stream:
    """One buffer as one launch touches it: what caches need to know.

    Parameters
    ----------
    buffer : str
        Name of the buffer; the same name in an earlier launch of the frame means that it may still be in a cache.
    op : {"load", "store", "atomic"}
    bytes : int
        Bytes of all transactions on it.
    footprint_bytes : int
        Bytes of the distinct segments touched.
    span_bytes : int
        Bytes that the launch touches between the first and the last touch of a segment: where they fit, it is fetched
        or written once. 0: all footprints of the launch.
    requested_bytes : int
        Of a buffer that units read again: bytes that all units together ask for, each segment once a unit. Where L1
        keeps what an SM loaded, more than ``bytes`` of them come from L2, as other SMs hold them. 0: ``bytes``.
    partial_lines : int or None
        Lines of 128 bytes that its requests touch in part, counted once a request: each costs more than its bytes. Of
        ``requested_bytes``, where those are given.
        None: not counted; then loads fill their lines, and of stores each sector of 32 bytes lies in a line of its own.
    pair_bytes : int
        As ``footprint_bytes``, of the pairs of sectors touched, where they are more: DRAM may send both. 0: the same.
    gaps : bool
        Whether what is stored leaves bytes of nearly every line as they were, as records with padding do: before such
        a line goes back to DRAM, the rest of it is fetched.
    """

    buffer: str
    op: Literal["load", "store", "atomic"]
    bytes: int
    footprint_bytes: int
    span_bytes: int = 0
    requested_bytes: int = 0
    partial_lines: int | None = None
    pair_bytes: int = 0
    gaps: bool = False

    @property
    def lines_in_part(self) -> float:
        """Lines that are moved in part."""
        if self.partial_lines is None:
            return self.bytes / SECTOR_BYTES if self.op == "store" else 0.0
        return float(self.partial_lines)


class Shape(NamedTuple):
    """What a kernel sees of a launch besides its events.

    Parameters
    ----------
    units, grid, block : int
    drawn : bool
        Whether units are drawn from a queue by persistent blocks or warps.
    block_is_unit : bool
        Whether all warps of a block work on a unit together; else each warp draws its own.
    in_step, loop : bool
        As in ``Launch``.
    """

    units: int
    grid: int
    block: int
    drawn: bool
    block_is_unit: bool
    in_step: bool
    loop: bool


@dataclass(frozen=True, kw_only=True, eq=False)
class Launch:
    """One kernel launch in machine events.

    Parameters
    ----------
    stage, kernel : str
        The stage that it is reported under, and the kernel's own name.
    grid, block : int
        Blocks, and threads in a block.
    registers : int
        32-bit registers a thread.
    shared_bytes : int
        Shared memory a block.
    events : ndarray, (units, len(MachineEvent)), float64
        Machine events of each unit of work, in the order in which units start.
    dispatch : {"blocks", "block_queue", "warp_queue"}
        What a unit is: a block of the grid, or an item that a persistent block or warp draws from a queue.
    in_step : bool
        Whether all warps of a unit load, compute and store at the same time, so that its own way through the SM's load
        and store path comes on top of its chain.
    loop : bool
        Whether the warps of a unit issue all along its chain, so that residents are served in turn (``models.turns``).
    streams : tuple of Stream
        The buffers touched.
    atomic_requests : ndarray, (chunks,), int64, or None
        Requests of global atomics by 32-byte chunk of the target buffer: who queues where.
    """

    stage: str
    kernel: str
    grid: int
    block: int
    registers: int
    shared_bytes: int
    events: NDArray[np.float64]
    dispatch: Literal["blocks", "block_queue", "warp_queue"] = "blocks"
    in_step: bool = False
    loop: bool = False
    streams: tuple[Stream, ...] = ()
    atomic_requests: NDArray[np.int64] | None = field(default=None, repr=False)

    @property
    def shape(self) -> Shape:
        """What a kernel sees of it."""
        drawn, alone = self.dispatch != "blocks", self.dispatch != "warp_queue"
        return Shape(len(self.events), self.grid, self.block, drawn, alone, self.in_step, self.loop)

    @cached_property
    def columns(self) -> NDArray[np.float64]:
        """Events by column, as kernels read them, (len(MachineEvent), units)."""
        return np.ascontiguousarray(self.events.T)

    @cached_property
    def kinds(self) -> Kinds:
        """Its units by kind; of a loop, where it matters which unit follows which, each is a kind of its own."""
        return each_a_kind(self.columns) if self.loop else kinds_of(self.columns, np.flatnonzero(self.totals))

    @cached_property
    def fullest_ns(self) -> dict[Hashable, float]:
        """What is known already of its fullest atomic unit, by how a machine deals addresses (``models.batch``)."""
        return {}

    @cached_property
    def totals(self) -> NDArray[np.float64]:
        """Events of all units, (len(MachineEvent),)."""
        totals: NDArray[np.float64] = self.events.sum(axis=0)
        return totals


@dataclass(frozen=True, kw_only=True)
class PipeLaunch:
    """One pass through the fixed-function pipe.

    Parameters
    ----------
    stage, kernel : str
    items : mapping of str to float
        Items by unit, such as ``{"primitives": 2.4e6, "pixels": 1.9e6}``.
    streams : tuple of Stream
        The buffers touched.
    """

    stage: str
    kernel: str
    items: Mapping[str, float] = field(default_factory=dict)
    streams: tuple[Stream, ...] = ()
