"""Occupancy: how many blocks of a launch live on one SM together, and what keeps out one more.

A block takes a place, warps, threads, registers and shared memory of its SM, each in the allocation units of its
compute capability (CUDA 4.2 guide, section 4.2; the rules of ``cuda_occupancy.h``, CUDA 7.0 to 13). Registers come in
one piece for the block on 1.x (``ceil(ceil(warps, granularity) * 32 * registers, unit)``) and by warp from 2.0 on:
``ceil(32 * registers, unit)`` for each warp. An SM has as many parts as the granularity, with as many warps in each as
fit, and a launch is refused where the block, its warps rounded up to all parts, exceeds the registers of a block.

On 3.7, 5.3 and 6.2, where an SM has more registers than a block may have, the older spreadsheet deals an SM in shares
of a block's size and allows fewer blocks; this follows the header, which is what the driver answers.
"""

from dataclasses import dataclass
from functools import lru_cache

from msgspec.structs import replace

from tilestamp.models.errors import TilestampError
from tilestamp.models.machine import Machine
from tilestamp.models.machine_parts import Sm


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
    held = _residency(holding_of(machine), block, registers, shared_bytes)
    if isinstance(held, str):
        raise TilestampError(held.format(machine=machine.name))
    return held


def holding_of(machine: Machine) -> Sm:
    """All of a machine that residency depends on: its SM, but for how many there are and how fast they are."""
    return replace(machine.sm, count=1, schedulers=1, clock_mhz=1.0)


@lru_cache(1 << 14)
def _residency(sm: Sm, block: int, registers: int, shared_bytes: int) -> Residency | str:
    """Blocks of one kind that an SM holds, or why no machine that has it can launch them."""
    if refusal := _refusal(sm, block, registers, shared_bytes):
        return refusal
    warps = _warps(sm, block)
    shared = _round_up(shared_bytes + sm.reserved_shared_bytes, sm.shared_unit_bytes)
    limits = {
        "blocks": sm.max_blocks,
        "warps": sm.max_warps // warps,
        "threads": sm.max_threads // (warps * sm.warp_size),
        "registers": _blocks_by_registers(sm, warps, registers),
        "shared memory": sm.shared_bytes // shared if shared else sm.max_blocks,
    }
    limit = min(limits, key=lambda name: limits[name])
    blocks = limits[limit]
    if blocks == 0:
        return (
            f"a block of {block} threads with {registers} registers each and {shared_bytes} bytes of shared memory "
            f"does not fit an SM of {{machine}}: not enough {limit}"
        )
    return Residency(blocks, blocks * warps, blocks * warps / sm.max_warps, limit)


def _refusal(sm: Sm, block: int, registers: int, shared_bytes: int) -> str:
    """Say what no launch may ask for; nothing where it may."""
    if block < 1:
        return f"a block needs at least one thread, not {block}"
    if block > sm.max_threads_per_block:
        return f"{{machine}} launches at most {sm.max_threads_per_block} threads a block, not {block}"
    if registers > sm.max_registers_per_thread:
        return f"{{machine}} has at most {sm.max_registers_per_thread} registers a thread, not {registers}"
    warps = _round_up(_warps(sm, block), sm.block_warp_granularity or sm.warp_granularity)
    most = sm.registers_per_block or sm.registers
    if sm.register_allocation == "warp" and warps * _of_a_warp(sm, registers) > most:
        return f"{{machine}} gives a block at most {most} registers, too few for {block} threads with {registers} each"
    most = sm.shared_bytes - sm.reserved_shared_bytes
    most = min(most, sm.shared_bytes_per_block or most)
    if shared_bytes > most:
        return f"{{machine}} gives a block at most {most} bytes of shared memory, not {shared_bytes}"
    return ""


def _blocks_by_registers(sm: Sm, warps: int, registers: int) -> int:
    """Blocks that the register file holds."""
    if registers == 0:
        return sm.max_blocks
    if sm.register_allocation == "block":
        granted = _round_up(warps, sm.warp_granularity)
        return sm.registers // _round_up(granted * sm.warp_size * registers, sm.register_unit)
    allotted = sm.registers // sm.warp_granularity // _of_a_warp(sm, registers) * sm.warp_granularity
    return allotted // warps


def _warps(sm: Sm, block: int) -> int:
    return -(-block // sm.warp_size)


def _of_a_warp(sm: Sm, registers: int) -> int:
    """Registers that a warp is allotted, from 2.0 on."""
    return _round_up(sm.warp_size * registers, sm.register_unit)


def _round_up(value: int, unit: int) -> int:
    return -(-value // unit) * unit
