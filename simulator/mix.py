"""Instruction mixes: what one event of a stage costs in warp instructions, by pipeline and compute capability.

A mix file (``simulator/mixes/PIPELINE/ccN.toml``) has a table for each kernel, and in it a table for each event::

    [tile_raster]
    registers = 20
    provenance = "assumed"
    source = "where the numbers come from"

    [tile_raster.BOX_WARPS]      # one warp runs the edge code once
    fp32 = 28
    shared = 4
    chain_alu = 12               # dependent instructions on a unit's critical warp
    lanes = "BOX_LANES"          # the event that counts the lanes active meanwhile; absent: whole warps

What was fitted to measured cells says which of its columns were (``fitted = ["chain_alu"]``, or ``{ int32 = 2.09 }``
where only so much of one was) and to which cells (``fitted_to``: ``tilestamp.models.fitted``, or the name of a list in
the table ``fits`` of the file). Without ``fitted`` all columns of a table of provenance ``fitted`` were.

``load_bytes`` and ``store_bytes`` are local memory: a thread's arrays, 128 bytes for a word of each lane of a warp. L1
holds it; with ``uncached_local = true`` in the kernel's table (compute capability 1.x) it is a buffer as others are.

A file may leave the kernels that it has no table for to the file of an older family (``older = "cc8"``).

An event that bears the name of a machine event needs no table: it passes through. A table may be of one compiled
variant alone, ``["tile_raster: tile 8 spp 4"]`` (``Work.variant``); the others take the kernel's own. What it has in
common with a table before it need not be said again: ``like = "tile_raster"``; of that, events that the kernel has not
are left out: ``without = ["RESOLVE_WARPS"]``.
"""

import hashlib
import tomllib
from dataclasses import dataclass, field, replace
from enum import IntEnum
from functools import cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.errors import TilestampError
from tilestamp.models.events import EVENTS, INSTRUCTION_CLASSES, MachineEvent
from tilestamp.models.fitted import Fitted
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Launch, Stream
from tilestamp.models.sums import TOGETHER, sum_up
from tilestamp.models.used import note
from tilestamp.simulator.work import Work

MIXES = Path(__file__).parent / "mixes"
PROVENANCES = ("published", "measured", "disassembled", "derived", "fitted", "assumed")
_ABOUT = {"provenance", "source", "lanes", "fitted", "fitted_to"}
_SWITCHES = {"uncached": "uncached_local", "in_step": "in_step", "loop": "loop"}  # of a kernel, and its key in a file
_COLUMNS = {event.name.lower(): event for event in MachineEvent}


@dataclass(frozen=True, eq=False)
class KernelMix:
    """Prices of one kernel's events.

    Parameters
    ----------
    registers, shared_bytes : int
        A thread, and a block (added to what the stage itself declares).
    prices : dict
        By event name: warp instructions and chain steps by machine event name, and ``lanes``.
    provenance : dict
        By event name ("" for the kernel): (kind, source).
    fitted : dict
        By event and column: what was fitted of a price.
    uncached : bool
        Whether local memory passes L1 by.
    in_step, loop : bool
        As in ``Launch``.
    """

    kernel: str
    registers: int
    shared_bytes: int
    prices: dict[str, dict[str, Any]]
    provenance: dict[str, tuple[str, str]]
    fitted: dict[tuple[str, str], Fitted] = field(default_factory=dict)
    uncached: bool = False
    in_step: bool = False
    loop: bool = False

    @property
    def as_moved(self) -> "KernelMix":
        """The kernel with the number that is moved now."""
        moves = {place: number.value - number.number for place, number in self.fitted.items()}
        prices = dict(self.prices)
        for (event, column), change in moves.items():
            if change:
                prices[event] = prices[event] | {column: prices[event][column] + change}
        return replace(self, prices=prices) if any(moves.values()) else self

    @cache  # noqa: B019 - mixes are read once and kept
    def matrix(self, events: type[IntEnum], warp: int) -> NDArray[np.float64]:
        """Prices as a matrix, (len(events), len(MachineEvent)): ``machine_events = work @ matrix``."""
        matrix = np.zeros((len(events), EVENTS))
        names = {event.name for event in events}
        for event in events:
            if event.name in MachineEvent.__members__:
                matrix[event, MachineEvent[event.name]] = 1.0
            for column, price in self.prices.get(event.name, {}).items():
                if column not in _ABOUT:
                    matrix[event, _COLUMNS[column]] += price
        for name, price in self.prices.items():
            if name not in names:
                raise TilestampError(f"the mix of {self.kernel} prices {name}, which the stage does not count")
            self._add_lanes(matrix, events, events[name], price, warp)
        return matrix

    def _add_lanes(
        self, matrix: NDArray[np.float64], events: type[IntEnum], event: IntEnum, price: dict[str, Any], warp: int
    ) -> None:
        """Active lane instructions: each instruction of the event, times the lanes that run it."""
        issued = sum(price.get(c.name.lower(), 0.0) for c in INSTRUCTION_CLASSES)
        if event.name in MachineEvent.__members__ and MachineEvent[event.name] in INSTRUCTION_CLASSES:
            issued += 1.0
        lanes = price.get("lanes", warp)
        if isinstance(lanes, str):
            if lanes not in events.__members__:
                raise TilestampError(f"the mix of {self.kernel} counts lanes of {event.name} by {lanes}: no such event")
            matrix[events[lanes], MachineEvent.LANES] += issued
        else:
            matrix[event, MachineEvent.LANES] += issued * lanes


@dataclass(frozen=True)
class Mix:
    """All kernels of one pipeline for one family of compute capability."""

    name: str
    kernels: dict[str, KernelMix]
    digest: str  # of the file

    def launch(self, work: Work, warp: int) -> Launch:
        """Price a work table in machine events.

        Parameters
        ----------
        work : Work
        warp : int
            Lanes in a warp of the machine.
        """
        note("mixes", self.name, self.digest)
        kernel = self.kernels.get(f"{work.kernel}: {work.variant}") or self.kernels.get(work.kernel)
        if kernel is None:
            raise TilestampError(f"the mix {self.name} has no kernel {work.kernel}")
        kernel = kernel.as_moved
        return Launch(
            stage=work.stage,
            kernel=work.kernel,
            grid=work.grid,
            block=work.block,
            registers=kernel.registers,
            shared_bytes=work.shared_bytes + kernel.shared_bytes,
            events=_machine_events(kernel.matrix(work.events, warp), work.table),
            dispatch=work.dispatch,
            in_step=kernel.in_step,
            loop=kernel.loop,
            streams=(*work.streams, *_local_memory(kernel, work)),
            atomic_requests=work.atomic_requests,
        )


def _machine_events(matrix: NDArray[np.float64], table: NDArray[np.generic]) -> NDArray[np.float64]:
    """Product of a work table and a mix, by column, as it is read."""
    events = np.empty((EVENTS, len(table)))
    _add_up(np.ascontiguousarray(matrix.T), table, events)
    return events.T


@kernel
def _add_up(matrix: Any, table: Any, events: Any) -> None:
    columns, units = table.shape[1], len(table)
    block = np.empty((columns, TOGETHER))
    for first in range(0, units, TOGETHER):
        count = min(TOGETHER, units - first)
        for i in range(count):
            for column in range(columns):
                block[column, i] = table[first + i, column]
        sum_up(matrix, block, 0, count, events, first)


def _local_memory(kernel: KernelMix, work: Work) -> list[Stream]:
    """Local memory beside the buffers of the stage, where L1 does not hold it; a work without buffers needs no more."""
    if not (kernel.uncached and work.streams):
        return []
    moved: dict[Literal["load", "store"], float] = {"store": 0.0, "load": 0.0}
    for op in moved:
        for event, price in kernel.prices.items():
            if f"{op}_bytes" in price:
                moved[op] += price[f"{op}_bytes"] * float(work.table[:, work.events[event]].sum())
    return [Stream(f"{work.kernel} local", op, round(size), round(size)) for op, size in moved.items() if size]


@cache
def load_mix(pipeline: str, compute_capability: str) -> Mix:
    """Read the mix of ``pipeline`` for the newest family that is not newer than ``compute_capability``.

    Raises
    ------
    TilestampError
        No mix, an unknown column, or a number without provenance.
    """
    path = _path_for(pipeline, int(float(compute_capability)))
    kernels, text = _read(path)
    return Mix(f"{pipeline}/{path.stem}", kernels, hashlib.sha256(text.encode()).hexdigest()[:16])


def _read(path: Path) -> tuple[dict[str, KernelMix], str]:
    """Kernels of a mix file, those that it leaves to an ``older`` one among them; and the text of both."""
    text = path.read_text("utf-8")
    tables = tomllib.loads(text)
    fits, older = tables.pop("fits", {}), tables.pop("older", "")
    kernels, before = _read(path.with_stem(older)) if older else ({}, "")
    mix = f"{path.parent.name}/{path.stem}"
    completed: dict[str, dict[str, Any]] = {}
    for name, table in tables.items():
        completed[name] = _completed(mix, completed, table)
    kernels |= {name: _kernel_mix(mix, name, table, fits) for name, table in completed.items()}
    return kernels, before + text


def _path_for(pipeline: str, major: int) -> Path:
    """The mix file of the newest family up to ``major``, else the oldest."""
    families = sorted((int(path.stem.removeprefix("cc")), path) for path in (MIXES / pipeline).glob("cc*.toml"))
    if not families:
        raise TilestampError(f"no instruction mix for the pipeline {pipeline} in simulator/mixes")
    return max([f for f in families if f[0] <= major] or families[:1])[1]


def _completed(mix: str, tables: dict[str, dict[str, Any]], table: dict[str, Any]) -> dict[str, Any]:
    """A table with what it leaves to the one that it is like, which stands before it."""
    like = table.get("like")
    if like is None:
        return table
    if like not in tables:
        raise TilestampError(f"the mix {mix} has a table like {like}, which it does not have")
    return {event: price for event, price in tables[like].items() if event not in table.get("without", ())} | table


def _kernel_mix(mix: str, kernel: str, table: dict[str, Any], fits: dict[str, list[str]]) -> KernelMix:
    """Check one kernel's table and take it apart."""
    prices = {event: price for event, price in table.items() if isinstance(price, dict)}
    about = {"": (str(table.get("provenance", "")), str(table.get("source", "")))}
    for event, price in prices.items():
        about[event] = (str(price.get("provenance", about[""][0])), str(price.get("source", about[""][1])))
        for column in price.keys() - _ABOUT:
            if column not in _COLUMNS:
                raise TilestampError(f"the mix {mix} prices {kernel}.{event} in {column}: no such machine event")
    for event, (kind, _) in about.items():
        if kind not in PROVENANCES:
            raise TilestampError(f"the mix {mix} does not say where {kernel}.{event or 'registers'} comes from")
    fitted = {
        (event, column): Fitted(f"{mix}: {kernel}.{event}.{column}", part, _cells(mix, kernel, price, table, fits))
        for event, price in prices.items()
        for column, part in _fitted_parts(price, about[event][0]).items()
    }
    registers, shared_bytes = int(table.get("registers", 16)), int(table.get("shared_bytes", 0))
    switches = {name: bool(table.get(key)) for name, key in _SWITCHES.items()}
    return KernelMix(kernel, registers, shared_bytes, prices, about, fitted, **switches)


def _fitted_parts(price: dict[str, Any], kind: str) -> dict[str, float]:
    """What was fitted of each column of an event."""
    parts = price.get("fitted", sorted(price.keys() - _ABOUT) if kind == "fitted" else [])
    return dict(parts) if isinstance(parts, dict) else {column: float(price[column]) for column in parts}


def _cells(
    mix: str, kernel: str, price: dict[str, Any], table: dict[str, Any], fits: dict[str, list[str]]
) -> tuple[str, ...]:
    """The cells that an event was fitted to."""
    cells = price.get("fitted_to", table.get("fitted_to", ()))
    found = fits.get(cells) if isinstance(cells, str) else cells
    if not found:
        raise TilestampError(f"the mix {mix} does not say what {kernel} was fitted_to, by cells or by a list in fits")
    return tuple(map(str, found))
