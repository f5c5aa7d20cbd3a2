"""Occupancy as the CUDA guides and ``cuda_occupancy.h`` publish it: blocks are put on an SM until one does not fit.

Facts by compute capability: CUDA guides 4.2, 8.0, 11 and 13 (technical specifications), the CUDA occupancy calculator,
``cuda_occupancy.h`` of CUDA 7.0 to 13, and NVIDIA's ``cuda::arch_traits`` (10.x to 12.x).
"""

from typing import NamedTuple

K = 1024


class Limits(NamedTuple):
    """Of one SM and one block."""

    warps: int
    blocks: int
    block_threads: int
    registers: int
    block_registers: int
    thread_registers: int
    register_unit: int
    parts: int  # that hold registers and warps, each by itself; on 1.x the unit of a block's warps
    shared: int
    block_shared: int
    shared_unit: int
    reserved: int = 0
    block_parts: int = 0  # to which a block's warps are rounded when it is launched, where not ``parts``


_KEPLER = Limits(64, 16, 1024, 64 * K, 64 * K, 255, 256, 4, 48 * K, 48 * K, 256)
_MAXWELL = Limits(64, 32, 1024, 64 * K, 64 * K, 255, 256, 4, 64 * K, 48 * K, 256)
_AMPERE = Limits(64, 32, 1024, 64 * K, 64 * K, 255, 256, 4, 164 * K, 163 * K, 128, K)
_GA10X = _AMPERE._replace(warps=48, blocks=16, shared=100 * K, block_shared=99 * K)
_HOPPER = _AMPERE._replace(shared=228 * K, block_shared=227 * K)
_GT200 = Limits(32, 8, 512, 16 * K, 16 * K, 124, 512, 2, 16 * K, 16 * K - 16, 512, 16)  # 16: block and grid indices
_G80 = _GT200._replace(warps=24, registers=8 * K, block_registers=8 * K, register_unit=256)
_FERMI = Limits(48, 8, 1024, 32 * K, 32 * K, 63, 64, 2, 48 * K, 48 * K, 128)

LIMITS = {
    "1.0": _G80,
    "1.1": _G80,
    "1.2": _GT200,
    "1.3": _GT200,
    "2.0": _FERMI,
    "2.1": _FERMI,
    "3.0": _KEPLER._replace(thread_registers=63),
    "3.2": _KEPLER._replace(block_registers=32 * K),
    "3.5": _KEPLER,
    "3.7": _KEPLER._replace(registers=128 * K, shared=112 * K),
    "5.0": _MAXWELL,
    "5.2": _MAXWELL._replace(shared=96 * K),
    "5.3": _MAXWELL._replace(block_registers=32 * K),
    "6.0": _MAXWELL._replace(parts=2, block_parts=4),  # nothing that no other Pascal could run
    "6.1": _MAXWELL._replace(shared=96 * K),
    "6.2": _MAXWELL._replace(block_registers=32 * K),
    "7.0": _MAXWELL._replace(shared=96 * K, block_shared=96 * K),
    "7.2": _MAXWELL._replace(shared=96 * K, block_shared=96 * K),
    "7.5": _MAXWELL._replace(warps=32, blocks=16, block_shared=64 * K),
    "8.0": _AMPERE,
    "8.6": _GA10X,
    "8.7": _AMPERE._replace(warps=48, blocks=16),
    "8.9": _GA10X._replace(blocks=24),
    "9.0": _HOPPER,
    "10.0": _HOPPER,
    "10.3": _HOPPER,
    "11.0": _HOPPER._replace(warps=48, blocks=24),
    "12.0": _GA10X._replace(blocks=24),
    "12.1": _GA10X._replace(blocks=24),
}


def rounded(value, unit):
    while value % unit:
        value += 1
    return value


def resident_blocks(compute_capability, threads, registers, shared):
    """Blocks that one SM holds; 0 where the launch is refused."""
    sm = LIMITS[compute_capability]
    warps = (threads + 31) // 32
    if threads > sm.block_threads or registers > sm.thread_registers or shared > sm.block_shared:
        return 0
    shared = rounded(shared + sm.reserved, sm.shared_unit)
    if compute_capability.startswith("1."):
        need = rounded(rounded(warps, sm.parts) * 32 * registers, sm.register_unit)
        free = sm.registers
    else:
        of_a_warp = rounded(32 * registers, sm.register_unit)
        if rounded(warps, sm.block_parts or sm.parts) * of_a_warp > sm.block_registers:
            return 0
        need, free = warps, sm.parts * (sm.registers // sm.parts // of_a_warp)
    blocks = 0
    while (
        blocks < sm.blocks
        and (blocks + 1) * warps <= sm.warps
        and (blocks + 1) * need <= free
        and (blocks + 1) * shared <= sm.shared
    ):
        blocks += 1
    return blocks
