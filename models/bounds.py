"""Bounds: a roofline for each launch, one term for each thing that can limit it.

========  ===========================================================================================================
issue     schedulers and execution units, all SMs equally busy
shared    passes through shared memory, all SMs equally busy
l1        bytes between registers and the memory system, all SMs equally busy
balance   where the blocks are fewer than the SMs: the fullest of issue, shared and l1 on the SMs that get any
latency   Little's law: dependent chains of all units / units that are resident together
dram, l2  bytes / bandwidth, and in L2 lines moved in part; stores may be slower than loads; in DRAM lines stored with
          gaps, of which the rest is fetched before they are written
atomic    requests and conflicts / rate of all atomic units
queue     time of the fullest atomic unit: contention. Where atomics lock DRAM, a request that waits for its lock
          holds up those behind it, so that the queue adds to ``atomic``; L2 units wait side by side with the rest
start     blocks / block launch rate
launch    overhead of the kernel
========  ===========================================================================================================

time = launch + the largest of the others. The servers of the whole chip (dram, l2, atomic, queue) stand idle until the
first requests reach them and end before the last answer is back, so a unit's chain comes on top of theirs. It supposes
that the units are many and alike; ``tilestamp.models.schedule`` does not.
"""

from enum import IntEnum
from typing import Any

import numpy as np

from tilestamp.models.demand import Whole, atomic_rate
from tilestamp.models.events import MachineEvent as E
from tilestamp.models.kernel import kernel
from tilestamp.models.launch import Shape
from tilestamp.models.numbers import Number as M
from tilestamp.models.traffic import Traffic


class Term(IntEnum):
    """What can limit a launch, in the order of reports."""

    ISSUE = 0
    SHARED = 1
    L1 = 2
    BALANCE = 3
    LATENCY = 4
    DRAM = 5
    L2 = 6
    ATOMIC = 7
    QUEUE = 8
    START = 9
    LAUNCH = 10  # on top of the largest of the others


TAIL = Term.LAUNCH + 1  # what holds a schedule where no term does: the last units
TERMS = tuple(term.name.lower() for term in Term)
HOLDS = (*TERMS, "tail")


class Result(IntEnum):
    """What pricing a launch gives, behind the cycles of its terms."""

    CYCLES = 11  # of the whole launch; LOW and HIGH: ``Timing``
    LOW = 12
    HIGH = 13
    BOUND = 14  # place in ``HOLDS`` of what holds
    TAIL_CYCLES = 15  # from the start of the last unit to the end
    BUSY_SMS = 16  # that got a unit
    HELD = 17  # units that such an SM holds, in the mean over the time in which units run


COLUMNS = Result.HELD + 1  # of terms and results


class Fact(IntEnum):
    """What of a launch differs from machine to machine and is no number of either."""

    RESIDENT_BLOCKS = 0  # on an SM: ``models.occupancy``
    DRAM_BYTES = 1  # ``models.traffic``
    L2_BYTES = 2
    LOAD_MISS = 3
    WRITTEN_BYTES = 4
    READ_LINES = 5
    WRITTEN_LINES = 6
    FROM_L1 = 7
    GAP_LINES = 8
    FULLEST_NS = 9  # that the atomic unit with the most to do is busy


@kernel(lent=True)
def moved_of(facts: Any) -> Traffic:
    """Bytes of a launch, from its facts."""
    return Traffic(
        facts[Fact.DRAM_BYTES],
        facts[Fact.L2_BYTES],
        facts[Fact.LOAD_MISS],
        facts[Fact.WRITTEN_BYTES],
        facts[Fact.READ_LINES],
        facts[Fact.WRITTEN_LINES],
        facts[Fact.FROM_L1],
        facts[Fact.GAP_LINES],
    )


@kernel(lent=True)
def places_of(launch: Shape, machine: Any, facts: Any) -> tuple[int, int]:
    """Units that the machine holds together, and SMs that hold any: blocks are dealt to SMs one after another."""
    sms = int(machine[M.SM_COUNT])
    blocks = min(launch.grid, sms * int(facts[Fact.RESIDENT_BLOCKS]))
    warps = 1 if launch.block_is_unit else -(-launch.block // int(machine[M.SM_WARP_SIZE]))
    return blocks * warps, max(1, min(sms, blocks))


@kernel(lent=True)
def bound_terms(launch: Shape, units: Whole, totals: Any, machine: Any, facts: Any, terms: Any) -> None:
    """Fill in the cycles of each term.

    Parameters
    ----------
    launch : Shape
    units : Whole
    totals : ndarray, (len(MachineEvent),)
        Events of all units.
    machine : ndarray, (len(Number),)
    facts : ndarray, (len(Fact),)
    terms : ndarray, (len(Term),)
        Filled in.
    """
    terms[:] = 0.0
    places, busy = places_of(launch, machine, facts)
    sms = machine[M.SM_COUNT]
    terms[Term.ISSUE], terms[Term.SHARED], terms[Term.L1] = units.issue / sms, units.shared / sms, units.l1 / sms
    if min(busy, launch.units) < sms:
        terms[Term.BALANCE] = max(max(units.issue, units.shared), units.l1) / max(1, min(busy, launch.units))
    terms[Term.LATENCY] = units.chain / max(1, min(places, launch.units))
    if launch.units:
        _chip_terms(terms, totals, machine, facts)
    if not launch.drawn:
        terms[Term.START] = launch.grid / machine[M.LAUNCH_BLOCKS_PER_US] * machine[M.SM_CLOCK_MHZ]
    terms[Term.LAUNCH] = machine[M.LAUNCH_KERNEL_US] * machine[M.SM_CLOCK_MHZ]


@kernel(lent=True)
def _chip_terms(terms: Any, totals: Any, machine: Any, facts: Any) -> None:
    """What all units together ask of the chip."""
    clock_hz = machine[M.SM_CLOCK_MHZ] * 1e6
    dram_bytes_per_s = machine[M.MEMORY_DRAM_GB_PER_S] * 1e9 * machine[M.MEMORY_DRAM_EFFICIENCY]
    terms[Term.DRAM] = facts[Fact.DRAM_BYTES] / (dram_bytes_per_s / clock_hz)
    if machine[M.MEMORY_L2_GAP_LINES_PER_CLOCK]:
        terms[Term.DRAM] += facts[Fact.GAP_LINES] / machine[M.MEMORY_L2_GAP_LINES_PER_CLOCK]
    if machine[M.MEMORY_L2_BYTES]:
        read, written = machine[M.MEMORY_L2_BYTES_PER_CLOCK], facts[Fact.WRITTEN_BYTES]
        stores = written / (machine[M.MEMORY_L2_WRITE_BYTES_PER_CLOCK] or read)
        terms[Term.L2] = (facts[Fact.L2_BYTES] - written) / read + stores
        for lines, rate in (
            (Fact.READ_LINES, M.MEMORY_L2_READ_LINES_PER_CLOCK),
            (Fact.WRITTEN_LINES, M.MEMORY_L2_WRITE_LINES_PER_CLOCK),
        ):
            if machine[rate]:
                terms[Term.L2] += facts[lines] / machine[rate]
    terms[Term.QUEUE] = facts[Fact.FULLEST_NS] * clock_hz * 1e-9
    rate = atomic_rate(totals, machine[M.ATOMICS_REQUESTS_PER_CLOCK], machine[M.ATOMICS_UNAWAITED_PER_CLOCK])
    conflicts = totals[E.ATOMIC_CONFLICTS] * machine[M.ATOMICS_CONFLICT_NS] * clock_hz * 1e-9
    terms[Term.ATOMIC] = totals[E.ATOMIC_REQUESTS] / rate + conflicts
    if machine[M.ATOMICS_LOCKS_DRAM]:
        terms[Term.ATOMIC] += terms[Term.QUEUE]


@kernel(lent=True)
def longest(terms: Any, way: float) -> float:
    """Cycles of the term that takes longest but for ``launch``; ``way`` is that to the chip's servers and back."""
    roof = 0.0
    for term in range(Term.LAUNCH):
        trip = way if Term.DRAM <= term <= Term.QUEUE and terms[term] else 0.0
        roof = max(roof, terms[term] + trip)
    return roof


@kernel(lent=True)
def bound_launch(terms: Any, way: float, row: Any) -> None:
    """Fill in a row of ``Result`` by the roofline."""
    cycles = terms[Term.LAUNCH] + longest(terms, way)
    row[Result.CYCLES] = row[Result.LOW] = row[Result.HIGH] = cycles
    row[Result.BOUND] = np.argmax(terms)
