"""What a stage did: a work table, a row a unit of work, a column an event of its own; or items of a fixed pipe."""

from dataclasses import KW_ONLY, dataclass, field
from enum import IntEnum
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.counters import Counter, counters_of
from tilestamp.models.launch import PipeLaunch, Stream


def column_sums(table: NDArray[np.int64]) -> list[int]:
    """Sum of each column, all in one pass over a table of many rows."""
    sums: list[int] = np.einsum("ij->j", table).tolist()
    return sums


A_UNIT = -1  # of a grid: a block for each unit


@dataclass(frozen=True, eq=False)
class Work:
    """What one kernel of a stage did.

    Parameters
    ----------
    stage : str
        The paper's word for it.
    events : type of IntEnum
        The stage's own events: the columns of ``table``. An event that bears the name of a ``MachineEvent``
        (LOAD_TRANSACTIONS, ATOMIC_REQUESTS, BANK_REPLAYS, ...) passes through the mix as it is. What reports show of
        them is declared beside them (``tilestamp.models.counters``).
    table : ndarray, (units, len(events)), int64
        Row i is unit i: a block of the grid, or the item that a persistent block or warp drew from its queue.
    block : int
        Threads in a block.
    kernel : str
        The kernel's name inside the stage; the stage's own if not given.
    grid : int
        Blocks; one a unit if not given.
    shared_bytes : int
        Shared memory a block, where the stage fixes it (a mix may add its own).
    dispatch : {"blocks", "block_queue", "warp_queue"}
        What a unit is.
    streams : tuple of Stream
        Buffers touched.
    atomic_requests : ndarray, (chunks,), int64, or None
        Global atomic requests by 32-byte chunk of the target buffer.
    variant : str
        How the kernel was compiled, where that changes its code (``"tile 8 spp 4"``): a mix may price it by itself.
    grid_by_sms : bool
        Whether the grid is a number of blocks for each SM, though no queue hands out their work.
    """

    stage: str
    events: type[IntEnum]
    table: NDArray[np.int64]
    block: int
    _: KW_ONLY
    kernel: str = ""
    grid: int = A_UNIT
    shared_bytes: int = 0
    dispatch: Literal["blocks", "block_queue", "warp_queue"] = "blocks"
    streams: tuple[Stream, ...] = ()
    atomic_requests: NDArray[np.int64] | None = field(default=None, repr=False)
    variant: str = ""
    grid_by_sms: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "kernel", self.kernel or self.stage)
        object.__setattr__(self, "grid", len(self.table) if self.grid == A_UNIT else self.grid)

    @property
    def persistent(self) -> bool:
        """Whether what was counted depends on the number of SMs."""
        return self.grid_by_sms or self.dispatch != "blocks"

    @property
    def counters(self) -> tuple[Counter, ...]:
        """What reports show of the events."""
        return counters_of(self.events)

    def units(self, event: str) -> list[NDArray[np.int64]]:
        """An event in each unit, where the stage counts it."""
        return [self.table[:, self.events[event]]] if event in self.events.__members__ else []

    @cached_property
    def totals(self) -> list[int]:
        """Sum of each event over all units."""
        return column_sums(self.table)

    def total(self, event: IntEnum) -> int:
        """Sum of one event over all units."""
        return self.totals[event]

    def counts(self) -> dict[str, int]:
        """Every event by name, summed over all units."""
        return {event.name: self.totals[event] for event in self.events}


@dataclass(frozen=True, kw_only=True)
class FixedFunctionWork:
    """What passed through the units of a fixed-function pipe.

    Parameters
    ----------
    stage, kernel : str
    items : dict of str to int
        By the name of the unit in a machine file: ``primitives``, ``pixels``...
    events : dict of str to int
        Further counts that no unit prices (SAMPLE_HITS...).
    streams : tuple of Stream
        Buffers touched.
    counters : tuple of Counter
        What reports show of the counts.
    """

    stage: str
    kernel: str
    items: dict[str, int]
    events: dict[str, int] = field(default_factory=dict)
    streams: tuple[Stream, ...] = ()
    counters: tuple[Counter, ...] = ()

    def units(self, event: str) -> list[NDArray[np.int64]]:  # noqa: ARG002 - as those of Work
        """An event in each unit: a fixed pipe has none."""
        return []

    def counts(self) -> dict[str, int]:
        """Items by unit, in capitals, and the further counts."""
        return {name.upper(): count for name, count in self.items.items()} | self.events

    def launch(self) -> PipeLaunch:
        """The pass, as the machine prices it."""
        return PipeLaunch(stage=self.stage, kernel=self.kernel, items=dict(self.items), streams=self.streams)
