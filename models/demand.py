"""Demands: what each unit of a launch asks of its SM and of the chip, in cycles.

A unit of work (a block, or an item drawn by a persistent block or warp) holds

issue       the schedulers of its SM, by ``[issue]``: warp instructions x cycles / schedulers; or, if longer, one
            execution unit behind them, by ``[pipe]`` (they work side by side, so the fullest one counts)
shared      the shared memory of its SM: passes x cycles, replays included
l1          the load/store path of its SM: bytes of its transactions, and the requests of atomics in L2 units, of which
            an SM sends its share of what all SMs together were measured to send
dram, l2    the chip's bandwidths: its share of the launch's bytes
atomic      the chip's atomic units together: requests, and lanes that conflict
queue       the fullest atomic unit: every unit of work brings its share of the requests that wait there. Where atomics
            lock DRAM, a request that waits for its lock holds up those behind it, so that the queue adds to
            ``atomic``; L2 units wait side by side with the rest

and cannot finish before its ``alone`` time: the round trips of its dependent ``chain``, or its own instructions when
its warps are too few for all schedulers.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.events import INSTRUCTION_CLASSES
from tilestamp.models.events import MachineEvent as E
from tilestamp.models.launch import Launch
from tilestamp.models.machine import Machine
from tilestamp.models.traffic import Traffic

Cycles = NDArray[np.float64]


@dataclass(frozen=True)
class Demand:
    """Cycles by unit of work, each array (units,), float64.

    Parameters
    ----------
    issue, shared, l1 : ndarray
        On the unit's own SM.
    dram, l2, atomic, queue : ndarray
        Of the whole chip.
    chain : ndarray
        Round trips that the unit waits for, one after another.
    alone : ndarray
        What the unit takes with the machine to itself.
    """

    issue: Cycles
    shared: Cycles
    l1: Cycles
    dram: Cycles
    l2: Cycles
    atomic: Cycles
    queue: Cycles
    chain: Cycles
    alone: Cycles


def demand(launch: Launch, machine: Machine, traffic: Traffic) -> Demand:
    """Cycles that each unit of a launch asks for.

    Parameters
    ----------
    launch : Launch
    machine : Machine
    traffic : Traffic
        Bytes of the launch.
    """
    events = launch.events
    memory = machine.memory
    groups = machine.sm.warp_size / memory.bank_lanes
    dispatch = _dispatch(events, machine)
    issue = np.maximum(dispatch, _fullest_pipe(events, machine))
    passes = (events[:, E.SHARED] + events[:, E.SHARED_ATOMIC]) * groups + events[:, E.BANK_REPLAYS]
    bytes_moved = events[:, E.LOAD_BYTES] + events[:, E.STORE_BYTES]
    share = _shares(bytes_moved)
    chain = _chain(launch, machine, traffic)
    queue = _shares(events[:, E.ATOMIC_REQUESTS]) * _fullest_queue(launch, machine)
    l2_cycles = _l2_cycles(traffic, machine)
    warps = 1 if launch.dispatch == "warp_queue" else -(-launch.block // machine.sm.warp_size)
    spread = machine.sm.schedulers / min(machine.sm.schedulers, warps)
    return Demand(
        issue=issue,
        shared=passes * memory.bank_pass_cycles,
        l1=_l1_cycles(events, machine) + _sent(events, machine),
        dram=share * (traffic.dram_bytes / machine.dram_bytes_per_cycle),
        l2=share * l2_cycles,
        atomic=_atomic(events, machine) + (queue if machine.atomics.place == "dram_lock" else 0.0),
        queue=queue,
        chain=chain,
        alone=np.maximum(chain, issue * spread),
    )


def _l1_cycles(events: Cycles, machine: Machine) -> Cycles:
    """Cycles of the SM's load and store path: stores may be slower than loads, those to local memory less so.

    Bytes stored beyond those of the transactions went to local memory.
    """
    memory = machine.memory
    write = memory.l1_write_bytes_per_clock or memory.l1_bytes_per_clock
    stored = events[:, E.STORE_BYTES]
    scattered = np.minimum(stored, events[:, E.STORE_TRANSACTIONS] * memory.l2_line_bytes)
    local = (stored - scattered) / (memory.l1_local_bytes_per_clock or write)
    cycles: Cycles = events[:, E.LOAD_BYTES] / memory.l1_bytes_per_clock + scattered / write + local
    return cycles


def _l2_cycles(traffic: Traffic, machine: Machine) -> float:
    """L2 cycles of all bytes: stores may be slower than loads."""
    memory = machine.memory
    if not memory.l2_bytes:
        return 0.0
    stores = traffic.written_bytes / (memory.l2_write_bytes_per_clock or memory.l2_bytes_per_clock)
    return (traffic.l2_bytes - traffic.written_bytes) / memory.l2_bytes_per_clock + stores


def _dispatch(events: Cycles, machine: Machine) -> Cycles:
    """SM cycles in which the schedulers are busy."""
    costs = np.array([getattr(machine.issue, event.name.lower()) for event in INSTRUCTION_CLASSES])
    cycles: Cycles = events[:, : len(INSTRUCTION_CLASSES)] @ costs
    return cycles / machine.sm.schedulers


def _fullest_pipe(events: Cycles, machine: Machine) -> Cycles:
    """SM cycles of the execution unit that is busy longest."""
    pipe = machine.pipe
    pipes = (
        events[:, E.FP32] * pipe.fp32,
        events[:, E.INT32] * pipe.int32 + events[:, E.CONTROL] * pipe.control,
        events[:, E.MUL32] * pipe.mul32,
        events[:, E.SFU] * pipe.sfu,
    )
    longest: Cycles = np.max(np.stack(pipes), axis=0)
    return longest / machine.sm.schedulers


def _chain(launch: Launch, machine: Machine, traffic: Traffic) -> Cycles:
    """Cycles of the dependent round trips of each unit; a block also waits for its own start."""
    latency = machine.latency
    near = latency.l2_cycles if machine.memory.l2_bytes else latency.dram_cycles
    load = near + (latency.dram_cycles - near) * min(1.0, traffic.load_miss)
    columns = [E.CHAIN_ALU, E.CHAIN_SHARED, E.CHAIN_LOAD, E.CHAIN_ATOMIC, E.CHAIN_BARRIER]
    cycles = [latency.alu_cycles, latency.shared_cycles, load, latency.atomic_cycles, latency.barrier_cycles]
    waited: Cycles = launch.events[:, columns] @ np.array(cycles)
    return waited + (latency.block_launch_cycles if launch.dispatch == "blocks" else 0.0)


def _atomic(events: Cycles, machine: Machine) -> Cycles:
    """Cycles of all atomic units together."""
    atomics = machine.atomics
    conflict_cycles = atomics.conflict_ns * machine.clock_hz * 1e-9
    rate = _rate(events, atomics.requests_per_clock, atomics.unawaited_per_clock)
    return events[:, E.ATOMIC_REQUESTS] / rate + events[:, E.ATOMIC_CONFLICTS] * conflict_cycles


def _sent(events: Cycles, machine: Machine) -> Cycles:
    """Cycles in which the SM of a unit sends its atomic requests."""
    atomics = machine.atomics
    awaited = atomics.sm_requests_per_clock or atomics.requests_per_clock
    sent: Cycles = events[:, E.ATOMIC_REQUESTS] / _rate(events, awaited, atomics.sm_unawaited_per_clock)
    return sent


def _rate(events: Cycles, awaited: float, unawaited: float) -> float:
    """Requests in a clock; there may be more where nobody waits for the value returned (0: there are not)."""
    return unawaited if unawaited and not events[:, E.CHAIN_ATOMIC].any() else awaited


def _fullest_queue(launch: Launch, machine: Machine) -> float:
    """Cycles for which the atomic unit with the most requests is busy."""
    if launch.atomic_requests is None or not launch.atomic_requests.any():
        return 0.0
    atomics = machine.atomics
    chunk = np.arange(len(launch.atomic_requests)) * 32
    unit = chunk // atomics.unit_bytes
    if atomics.units:
        unit %= atomics.units
    fullest = float(np.bincount(unit, weights=launch.atomic_requests).max())
    return fullest * atomics.unit_ns_per_request * machine.clock_hz * 1e-9


def _shares(amounts: Cycles) -> Cycles:
    """Each unit's share of a total; equal shares of nothing."""
    total = amounts.sum()
    return amounts / total if total > 0 else np.full(len(amounts), 1.0 / max(1, len(amounts)))
