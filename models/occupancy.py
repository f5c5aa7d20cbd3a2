"""Occupancy: how many blocks of a launch live on one SM together, and what keeps out one more.

A block takes a place, warps, threads, registers and shared memory of its SM, each in the allocation units of its
compute capability (CUDA 4.2 guide, section 4.2). Registers come in one piece for the block on 1.x
(``ceil(ceil(warps, granularity) * 32 * registers, unit)``) and by warp from 2.0 on
(``ceil(32 * registers, unit)`` for each warp, and an SM grants a multiple of the granularity).
"""

from dataclasses import dataclass

from tilestamp.models.errors import TilestampError
from tilestamp.models.machine import Machine


@dataclass(frozen=True)
class Residency:
    """What one SM holds.

    Parameters
    ----------
    blocks : int
        Blocks resident on one SM.
    warps : int
        Their warps.
    occupancy : float
        Share of the warps that the SM could hold.
    limit : {"blocks", "warps", "threads", "registers", "shared memory"}
        What keeps out one block more.
    """

    blocks: int
    warps: int
    occupancy: float
    limit: str


def residency(machine: Machine, block: int, registers: int, shared_bytes: int) -> Residency:
    """Blocks of one kind that an SM holds.

    Parameters
    ----------
    machine : Machine
    block : int
        Threads in a block.
    registers : int
        32-bit registers a thread.
    shared_bytes : int
        Shared memory that a block asks for.

    Raises
    ------
    TilestampError
        A block that the machine cannot launch, naming what exceeds.
    """
    sm = machine.sm
    warps = _round_up(block, sm.warp_size) // sm.warp_size
    _check_launch(machine, block, registers, shared_bytes)
    register_blocks = _blocks_by_registers(machine, warps, registers)
    shared = _round_up(shared_bytes + sm.reserved_shared_bytes, sm.shared_unit_bytes)
    limits = {
        "blocks": sm.max_blocks,
        "warps": sm.max_warps // warps,
        "threads": sm.max_threads // (warps * sm.warp_size),
        "registers": register_blocks,
        "shared memory": sm.shared_bytes // shared if shared else sm.max_blocks,
    }
    limit = min(limits, key=lambda name: limits[name])
    blocks = limits[limit]
    if blocks == 0:
        raise TilestampError(
            f"a block of {block} threads with {registers} registers each and {shared_bytes} bytes of shared memory "
            f"does not fit an SM of {machine.name}: not enough {limit}"
        )
    return Residency(blocks, blocks * warps, blocks * warps / sm.max_warps, limit)


def _check_launch(machine: Machine, block: int, registers: int, shared_bytes: int) -> None:
    """Refuse what no launch may ask for."""
    sm = machine.sm
    if block < 1:
        raise TilestampError(f"a block needs at least one thread, not {block}")
    if block > sm.max_threads_per_block:
        raise TilestampError(f"{machine.name} launches at most {sm.max_threads_per_block} threads a block, not {block}")
    if registers > sm.max_registers_per_thread:
        raise TilestampError(
            f"{machine.name} has at most {sm.max_registers_per_thread} registers a thread, not {registers}"
        )
    most = sm.shared_bytes - sm.reserved_shared_bytes
    if shared_bytes > most:
        raise TilestampError(f"{machine.name} gives a block at most {most} bytes of shared memory, not {shared_bytes}")


def _blocks_by_registers(machine: Machine, warps: int, registers: int) -> int:
    """Blocks that the register file holds."""
    sm = machine.sm
    if registers == 0:
        return sm.max_blocks
    if sm.register_allocation == "block":
        granted = _round_up(warps, sm.warp_granularity)
        return sm.registers // _round_up(granted * sm.warp_size * registers, sm.register_unit)
    per_warp = _round_up(sm.warp_size * registers, sm.register_unit)
    allotted = sm.registers // per_warp // sm.warp_granularity * sm.warp_granularity
    return allotted // warps


def _round_up(value: int, unit: int) -> int:
    return -(-value // unit) * unit
