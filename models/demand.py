"""Demands: what each unit of a launch asks of its SM, in cycles.

A unit of work (a block, or an item drawn by a persistent block or warp) holds

issue       the schedulers of its SM, by ``[issue]``: warp instructions x cycles / schedulers; or, if longer, one
            execution unit behind them, by ``[pipe]`` (they work side by side, so the fullest one counts)
shared      the shared memory of its SM: passes x cycles, replays included
l1          the load/store path of its SM: bytes of its transactions, and the requests of atomics in L2 units, of which
            an SM sends its share of what all SMs together were measured to send

and cannot finish before its ``alone`` time: the round trips of its dependent ``chain``, of a lone warp, and what that
warp waits for others of its block on the same scheduler (half of what both want), with its own ``l1`` on top where the
block's warps go in step; or its own instructions when its warps are too few for all schedulers. A loop issues all along
its chain, and takes what ``models.turns`` says. What all units together ask of the chip is ``models.bounds``'s.

All but a few maxima are sums of machine events times cycles: ``rates`` makes the matrix, and ``demands`` sees of a
machine nothing else, so that two machines with the same matrix have the same demands.
"""

from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.models.events import EVENTS, INSTRUCTION_CLASSES
from tilestamp.models.events import MachineEvent as E
from tilestamp.models.kernel import kernel
from tilestamp.models.kinds import Kinds, each_a_kind
from tilestamp.models.launch import Launch, Shape
from tilestamp.models.machine import Machine
from tilestamp.models.numbers import Number as M
from tilestamp.models.numbers import numbers_of
from tilestamp.models.sums import TOGETHER, sum_up
from tilestamp.models.traffic import Traffic
from tilestamp.models.turns import both

Cycles = NDArray[np.float64]
CLASSES = len(INSTRUCTION_CLASSES)
IN_THE_WAY = 0.5  # of what two want at the same time: each goes first as often as the other
SUMS = 9  # rows of the matrix of rates
UNKNOWN = Traffic(0.0, 0.0, 1.0)  # of a launch whose buffers nobody named: every load waits for DRAM


class Sum(IntEnum):
    """Rows of the matrix of rates: sums of machine events."""

    DISPATCH = 0  # cycles of the schedulers
    PIPE_FP32 = 1  # cycles of an execution unit
    PIPE_INT32 = 2
    PIPE_MUL32 = 3
    PIPE_SFU = 4
    SHARED = 5  # cycles of shared memory
    L1 = 6  # cycles of the load and store path
    CHAIN = 7  # cycles of round trips, one after another
    OTHERS = 8  # no sum: ``Other``


class Other(IntEnum):
    """What else demands depend on, in the last row of the matrix."""

    START = 0  # cycles that a block waits for its own start
    SPREAD = 1  # schedulers / those that a unit's warps can use
    BESIDE = 2  # share of its issue that the warp of a block's chain waits for others on its scheduler
    IN_STEP = 3  # 1 where a unit's own way through the load and store path comes on top of its chain, else 0
    LOOP = 4  # 1 where its warps issue all along its chain, else 0


class Demand(NamedTuple):
    """Cycles by unit of work, each array (units,), float64.

    Parameters
    ----------
    issue, shared, l1 : ndarray
        On the unit's own SM.
    chain : ndarray
        Round trips that the unit waits for, one after another.
    scheduler : ndarray
        Of the schedulers that the unit has a warp on.
    alone : ndarray
        What the unit takes with the machine to itself.
    """

    issue: Cycles
    shared: Cycles
    l1: Cycles
    chain: Cycles
    scheduler: Cycles
    alone: Cycles


class Whole(NamedTuple):
    """Cycles of all units together.

    Parameters
    ----------
    issue, shared, l1, chain : float
        Sums, in the order of the units.
    way : float
        The shortest way to memory and back: of a unit's start and chain, a share a round trip; 0 where there is none.
    """

    issue: float
    shared: float
    l1: float
    chain: float
    way: float


def demand(launch: Launch, machine: Machine, moved: Traffic) -> Demand:
    """Cycles that each unit of a launch asks for.

    Parameters
    ----------
    launch : Launch
    machine : Machine
    moved : Traffic
        Its bytes.
    """
    matrix = np.empty((SUMS, EVENTS))
    rates(launch.shape, numbers_of([machine])[0], Traffic(*map(float, moved)), launch.totals, matrix)
    found: Demand = demand_of(len(launch.events))
    demands(each_a_kind(launch.columns), matrix, np.empty((SUMS, TOGETHER)), found)
    return found


@kernel
def demand_of(kinds: int) -> Any:
    """Room for the demands of so many kinds of units."""
    table = np.empty((6, kinds))
    return Demand(table[0], table[1], table[2], table[3], table[4], table[5])


@kernel(lent=True)
def rates(launch: Shape, machine: Any, moved: Traffic, totals: Any, matrix: Any) -> None:
    """Fill in the cycles of each machine event: 0 where the launch has none of it.

    Parameters
    ----------
    launch : Shape
    machine : ndarray, (len(Number),)
    moved : Traffic
    totals : ndarray, (EVENTS,)
        Events of all units.
    matrix : ndarray, (SUMS, EVENTS)
        Filled in.
    """
    matrix[:] = 0.0
    _issue_rates(matrix, machine)
    passes = machine[M.MEMORY_BANK_PASS_CYCLES]
    groups = machine[M.SM_WARP_SIZE] / machine[M.MEMORY_BANK_LANES]
    matrix[Sum.SHARED, E.SHARED] = matrix[Sum.SHARED, E.SHARED_ATOMIC] = groups * passes
    matrix[Sum.SHARED, E.BANK_REPLAYS] = passes
    _l1_rates(matrix[Sum.L1], machine, moved, totals)
    awaited = machine[M.ATOMICS_SM_REQUESTS_PER_CLOCK] or machine[M.ATOMICS_REQUESTS_PER_CLOCK]
    matrix[Sum.L1, E.ATOMIC_REQUESTS] = 1.0 / atomic_rate(totals, awaited, machine[M.ATOMICS_SM_UNAWAITED_PER_CLOCK])
    _chain_rates(matrix, machine, moved)
    for column in range(EVENTS):
        if totals[column] == 0:
            matrix[:, column] = 0.0
    _other_rates(matrix[Sum.OTHERS], launch, machine)


@kernel(lent=True)
def _issue_rates(matrix: Any, machine: Any) -> None:
    """SM cycles of the schedulers, and of the execution units behind them, which work side by side."""
    schedulers = machine[M.SM_SCHEDULERS]
    for column in range(CLASSES):
        matrix[Sum.DISPATCH, column] = machine[M.ISSUE_FP32 + column] / schedulers
    matrix[Sum.DISPATCH, E.ISSUE_STALLS] = 1.0 / schedulers
    matrix[Sum.PIPE_FP32, E.FP32] = machine[M.PIPE_FP32] / schedulers
    matrix[Sum.PIPE_INT32, E.INT32] = machine[M.PIPE_INT32] / schedulers
    matrix[Sum.PIPE_INT32, E.CONTROL] = machine[M.PIPE_CONTROL] / schedulers
    matrix[Sum.PIPE_MUL32, E.MUL32] = machine[M.PIPE_MUL32] / schedulers
    matrix[Sum.PIPE_SFU, E.SFU] = machine[M.PIPE_SFU] / schedulers


@kernel(lent=True)
def _l1_rates(l1: Any, machine: Any, moved: Traffic, totals: Any) -> None:
    """SM cycles of a byte: stores may be slower than loads, and lines moved in part come on top."""
    lines = machine[M.MEMORY_L1_LINE_CYCLES]
    l1[E.LOAD_BYTES] = 1.0 / machine[M.MEMORY_L1_BYTES_PER_CLOCK]
    l1[E.STORE_BYTES] = 1.0 / (machine[M.MEMORY_L1_WRITE_BYTES_PER_CLOCK] or machine[M.MEMORY_L1_BYTES_PER_CLOCK])
    l1[E.LOAD_BYTES] += lines * moved.read_lines / max(1.0, totals[E.LOAD_BYTES])
    l1[E.STORE_BYTES] += lines * moved.written_lines / max(1.0, totals[E.STORE_BYTES])


@kernel(lent=True)
def _chain_rates(matrix: Any, machine: Any, moved: Traffic) -> None:
    """Cycles of the dependent round trips; a load waits for where its data lies."""
    far = machine[M.LATENCY_DRAM_CYCLES]
    near = machine[M.LATENCY_L2_CYCLES] if machine[M.MEMORY_L2_BYTES] else far
    matrix[Sum.CHAIN, E.CHAIN_ALU] = machine[M.LATENCY_ALU_CYCLES]
    matrix[Sum.CHAIN, E.CHAIN_SHARED] = machine[M.LATENCY_SHARED_CYCLES]
    beyond = near + (far - near) * min(1.0, moved.load_miss)
    l1 = machine[M.LATENCY_L1_CYCLES] or near
    matrix[Sum.CHAIN, E.CHAIN_LOAD] = moved.from_l1 * l1 + (1.0 - moved.from_l1) * beyond
    matrix[Sum.CHAIN, E.CHAIN_ATOMIC] = machine[M.LATENCY_ATOMIC_CYCLES]
    matrix[Sum.CHAIN, E.CHAIN_BARRIER] = machine[M.LATENCY_BARRIER_CYCLES]


@kernel(lent=True)
def _other_rates(others: Any, launch: Shape, machine: Any) -> None:
    """Rates that are of no event."""
    schedulers = machine[M.SM_SCHEDULERS]
    warps = -(-launch.block // machine[M.SM_WARP_SIZE]) if launch.block_is_unit else 1.0
    others[Other.START] = 0.0 if launch.drawn else machine[M.LATENCY_BLOCK_LAUNCH_CYCLES]
    others[Other.SPREAD] = schedulers / min(schedulers, warps)
    others[Other.IN_STEP], others[Other.LOOP] = launch.in_step, launch.loop
    if warps > schedulers:
        others[Other.BESIDE] = IN_THE_WAY * min(1.0, warps / schedulers - 1.0) * schedulers / warps


@kernel(lent=True)
def atomic_rate(totals: Any, awaited: float, unawaited: float) -> float:
    """Requests in a clock; there may be more where nobody waits for the value returned (0: there are not)."""
    return unawaited if unawaited and not totals[E.CHAIN_ATOMIC] else awaited


@kernel(lent=True)
def demands(units: Kinds, matrix: Any, sums: Any, found: Demand) -> Whole:
    """Fill in what each kind of unit asks for, and sum up over all units.

    Parameters
    ----------
    units : Kinds
    matrix : ndarray, (SUMS, EVENTS)
        From ``rates``.
    sums : ndarray, (SUMS, TOGETHER)
        Room to work in.
    found : Demand
        Filled in.
    """
    events, others = units.events, matrix[Sum.OTHERS]
    kinds = events.shape[1]
    way = np.inf if kinds else 0.0
    for first in range(0, kinds, TOGETHER):
        last = min(kinds, first + TOGETHER)
        sum_up(matrix[: Sum.OTHERS], events, first, last, sums, 0)
        for i in range(last - first):
            row, kind = sums[:, i], first + i
            pipe = max(max(row[Sum.PIPE_FP32], row[Sum.PIPE_INT32]), max(row[Sum.PIPE_MUL32], row[Sum.PIPE_SFU]))
            issue = max(row[Sum.DISPATCH], pipe)
            shared, l1, chain = row[Sum.SHARED], row[Sum.L1], row[Sum.CHAIN] + others[Other.START]
            found.issue[kind], found.shared[kind], found.l1[kind], found.chain[kind] = issue, shared, l1, chain
            found.scheduler[kind] = issue * others[Other.SPREAD]
            if others[Other.LOOP]:
                found.alone[kind] = both(chain, found.scheduler[kind])
            else:
                waited = issue * others[Other.BESIDE] + l1 * others[Other.IN_STEP]
                found.alone[kind] = max(chain + waited, found.scheduler[kind])
            trips = max(1.0, events[E.CHAIN_LOAD, kind] + events[E.CHAIN_ATOMIC, kind])
            way = min(way, others[Other.START] + row[Sum.CHAIN] / trips)
    issue, shared, l1, chain = _together(found, units.which)
    return Whole(issue, shared, l1, chain, way)


@kernel(lent=True)
def _together(each: Demand, which: Any) -> tuple[float, float, float, float]:
    """Issue, shared, l1 and chain of all units."""
    issue = shared = l1 = chain = 0.0
    for i in range(len(which)):
        kind = which[i]
        issue += each.issue[kind]
        shared += each.shared[kind]
        l1 += each.l1[kind]
        chain += each.chain[kind]
    return issue, shared, l1, chain
