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


class Pricing(NamedTuple):
    """A launch on a machine, and all that its time follows from."""

    launch: Launch
    machine: Machine
    traffic: Traffic
    residency: Residency
    units: Demand
    terms: dict[str, float]


def pricing_of(launch: Launch, machine: Machine, traffic: Traffic) -> Pricing:
    """Demands of the units and cycles of the terms.

    Parameters
    ----------
    launch : Launch
    machine : Machine
    traffic : Traffic
        Its bytes, from ``tilestamp.models.traffic``.

    Raises
    ------
    TilestampError
        A block that the machine cannot launch.
    """
    resident = residency(machine, launch.block, launch.registers, launch.shared_bytes)
    units = demand(launch, machine, traffic)
    return Pricing(launch, machine, traffic, resident, units, bound_terms(launch, machine, units, resident))


def bounds(launch: Launch, machine: Machine, traffic: Traffic) -> Timing:
    """Price one launch by its largest term; parameters as of ``pricing_of``."""
    return roofline(pricing_of(launch, machine, traffic))


def roofline(pricing: Pricing) -> Timing:
    """Take the largest term."""
    terms = pricing.terms
    bound = max(terms, key=lambda name: terms[name])
    return timing(pricing, terms["launch"] + longest(terms, pricing.units), bound, "bounds")


def bound_terms(launch: Launch, machine: Machine, units: Demand, resident: Residency) -> dict[str, float]:
    """Cycles of each term."""
    sms = machine.sm.count
    count = len(units.alone)
    places = slots(launch, machine, resident)
    together = max(1, min(count, int(places.sum())))
    busy = max(1, min(count, int(np.count_nonzero(places))))
    blocks = launch.grid if launch.dispatch == "blocks" else 0
    local = {"issue": units.issue.sum(), "shared": units.shared.sum(), "l1": units.l1.sum()}
    return {
        **{name: float(cycles) / sms for name, cycles in local.items()},
        "balance": float(max(local.values())) / busy if busy < sms else 0.0,
        "latency": float(units.chain.sum()) / together,
        "dram": float(units.dram.sum()),
        "l2": float(units.l2.sum()),
        "atomic": float(units.atomic.sum()),
        "queue": float(units.queue.sum()),
        "start": blocks / machine.launch.blocks_per_us * machine.sm.clock_mhz,
        "launch": machine.launch.kernel_us * machine.sm.clock_mhz,
    }


def longest(terms: dict[str, float], units: Demand) -> float:
    """Cycles of the term that takes longest, the way to the chip's servers and back included."""
    way = float(units.chain.min()) if len(units.chain) else 0.0
    return max(value + (way if name in SERVERS and value else 0.0) for name, value in terms.items() if name != "launch")


def slots(launch: Launch, machine: Machine, resident: Residency) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """Units that each SM can hold: blocks dealt to the SMs one after another, warps where each warp draws its own."""
    sms = machine.sm.count
    blocks = min(launch.grid, sms * resident.blocks)
    dealt = np.full(sms, blocks // sms, np.int64)
    dealt[: blocks % sms] += 1
    return dealt * (-(-launch.block // machine.sm.warp_size) if launch.dispatch == "warp_queue" else 1)


def timing(
    pricing: Pricing,
    cycles: float,
    bound: str,
    fidelity: str,
    spread: tuple[float, float] | None = None,
    **details: float,
) -> Timing:
    """Put a result together; ``spread`` is the lowest and the highest that ``cycles`` may be."""
    low, high = (edge / pricing.machine.clock_hz * 1e3 for edge in spread or (cycles, cycles))
    return Timing(
        stage=pricing.launch.stage,
        kernel=pricing.launch.kernel,
        term_cycles=pricing.terms,
        cycles=cycles,
        milliseconds=cycles / pricing.machine.clock_hz * 1e3,
        bound=bound,
        occupancy=pricing.residency.occupancy,
        dram_bytes=pricing.traffic.dram_bytes,
        l2_bytes=pricing.traffic.l2_bytes,
        details={"resident_blocks": float(pricing.residency.blocks)} | details,
        fidelity=fidelity,
        low=low,
        high=high,
        residency=_steps(pricing),
    )


def _steps(pricing: Pricing) -> str:
    """Say where a time may step: blocks that an SM holds, and the rounds in which all SMs take the grid."""
    held = f"{pricing.residency.blocks} an SM by {pricing.residency.limit}"
    if pricing.launch.dispatch != "blocks":
        return held
    return f"{held}, {pricing.launch.grid / (pricing.residency.blocks * pricing.machine.sm.count):.2f} rounds"
