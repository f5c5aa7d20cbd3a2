"""Bounds: a roofline for each launch, one term for each thing that can limit it.

========  ===========================================================================================================
issue     schedulers and execution units, all SMs equally busy
shared    passes through shared memory, all SMs equally busy
l1        bytes between registers and the memory system, all SMs equally busy
latency   Little's law: dependent chains of all units / units that are resident together
dram, l2  bytes / bandwidth
atomic    requests and conflicts / rate of all atomic units
queue     requests at the fullest atomic unit: contention
balance   where the blocks are fewer than the SMs: the fullest of issue, shared and l1 on the SMs that get any
start     blocks / block launch rate
launch    overhead of the kernel
========  ===========================================================================================================

time = launch + the largest of the others. The servers of the whole chip (dram, l2, atomic, queue) stand idle until the
first requests reach them and end before the last answer is back, so a unit's chain comes on top of theirs. It supposes
that the units are many and alike; ``tilestamp.models.schedule`` does not.
"""

from typing import NamedTuple

import numpy as np

from tilestamp.models.demand import Demand, demand
from tilestamp.models.launch import Launch
from tilestamp.models.machine import Machine
from tilestamp.models.occupancy import Residency, residency
from tilestamp.models.timing import Timing
from tilestamp.models.traffic import Traffic

SERVERS = ("dram", "l2", "atomic", "queue")  # of the whole chip


class Asked(NamedTuple):
    """What a launch asks of a machine: all that is known before its time is."""

    launch: Launch
    machine: Machine
    moved: Traffic
    held: Residency
    units: Demand
    terms: dict[str, float]


def asked_of(launch: Launch, machine: Machine, moved: Traffic) -> Asked:
    """Demands of the units and cycles of the terms.

    Parameters
    ----------
    launch : Launch
    machine : Machine
    moved : Traffic
        Its bytes, from ``tilestamp.models.traffic``.

    Raises
    ------
    TilestampError
        A block that the machine cannot launch.
    """
    held = residency(machine, launch.block, launch.registers, launch.shared_bytes)
    units = demand(launch, machine, moved)
    return Asked(launch, machine, moved, held, units, bound_terms(launch, machine, units, held))


def bounds(launch: Launch, machine: Machine, moved: Traffic) -> Timing:
    """Price one launch by its largest term; parameters as of ``asked_of``."""
    return roofline(asked_of(launch, machine, moved))


def roofline(asked: Asked) -> Timing:
    """Take the largest term of what was asked."""
    terms = asked.terms
    bound = max(terms, key=lambda name: terms[name])
    return timing(asked, terms["launch"] + longest(terms, asked.units), bound, "bounds")


def bound_terms(launch: Launch, machine: Machine, asked: Demand, held: Residency) -> dict[str, float]:
    """Cycles of each term."""
    sms = machine.sm.count
    units = len(asked.alone)
    places = slots(launch, machine, held)
    resident = max(1, min(units, int(places.sum())))
    busy = max(1, min(units, int(np.count_nonzero(places))))
    blocks = launch.grid if launch.dispatch == "blocks" else 0
    local = {"issue": asked.issue.sum(), "shared": asked.shared.sum(), "l1": asked.l1.sum()}
    return {
        **{name: float(cycles) / sms for name, cycles in local.items()},
        "balance": float(max(local.values())) / busy if busy < sms else 0.0,
        "latency": float(asked.chain.sum()) / resident,
        "dram": float(asked.dram.sum()),
        "l2": float(asked.l2.sum()),
        "atomic": float(asked.atomic.sum()),
        "queue": float(asked.queue.sum()),
        "start": blocks / machine.launch.blocks_per_us * machine.sm.clock_mhz,
        "launch": machine.launch.kernel_us * machine.sm.clock_mhz,
    }


def longest(terms: dict[str, float], asked: Demand) -> float:
    """Cycles of the term that takes longest, the way to the chip's servers and back included."""
    way = float(asked.chain.min()) if len(asked.chain) else 0.0
    return max(value + (way if name in SERVERS and value else 0.0) for name, value in terms.items() if name != "launch")


def slots(launch: Launch, machine: Machine, held: Residency) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """Units that each SM can hold: blocks dealt to the SMs one after another, warps where each warp draws its own."""
    sms = machine.sm.count
    blocks = min(launch.grid, sms * held.blocks)
    dealt = np.full(sms, blocks // sms, np.int64)
    dealt[: blocks % sms] += 1
    return dealt * (-(-launch.block // machine.sm.warp_size) if launch.dispatch == "warp_queue" else 1)


def timing(
    asked: Asked, cycles: float, bound: str, fidelity: str, spread: tuple[float, float] | None = None, **details: float
) -> Timing:
    """Put a result together; ``spread`` is the lowest and the highest that ``cycles`` may be."""
    low, high = (edge / asked.machine.clock_hz * 1e3 for edge in spread or (cycles, cycles))
    return Timing(
        stage=asked.launch.stage,
        kernel=asked.launch.kernel,
        term_cycles=asked.terms,
        cycles=cycles,
        milliseconds=cycles / asked.machine.clock_hz * 1e3,
        bound=bound,
        occupancy=asked.held.occupancy,
        dram_bytes=asked.moved.dram_bytes,
        l2_bytes=asked.moved.l2_bytes,
        details={"resident_blocks": float(asked.held.blocks)} | details,
        fidelity=fidelity,
        low=low,
        high=high,
        residency=_steps(asked),
    )


def _steps(asked: Asked) -> str:
    """Say where a time may step: blocks that an SM holds, and the rounds in which all SMs take the grid."""
    held = f"{asked.held.blocks} an SM by {asked.held.limit}"
    if asked.launch.dispatch != "blocks":
        return held
    return f"{held}, {asked.launch.grid / (asked.held.blocks * asked.machine.sm.count):.2f} rounds"
