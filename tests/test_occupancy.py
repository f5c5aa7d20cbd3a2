"""How many blocks an SM holds: textbook cases by compute capability."""

import pytest

from tests.naive_occupancy import LIMITS, K, resident_blocks
from tilestamp.models.errors import TilestampError
from tilestamp.models.machine import altered, list_machines, load_machine
from tilestamp.models.occupancy import residency


@pytest.mark.parametrize(("tile", "blocks", "share"), [(4, 16, 0.25), (8, 16, 0.5), (16, 4, 0.5), (32, 1, 0.5)])
def test_tile_sizes_on_a_gt_750m_with_63_registers(tile, blocks, share):
    """Ru 2016: 25, 50, 50, 50 % as Nsight showed them."""
    held = residency(load_machine("gt750m"), tile * tile, 63, 0)
    assert (held.blocks, held.occupancy) == (blocks, share)


def test_63_registers_limit_large_tiles_on_kepler():
    assert residency(load_machine("gt750m"), 256, 63, 0).limit == "registers"


def test_eight_by_eight_tiles_fill_half_of_gt200_because_it_takes_eight_blocks():
    held = residency(load_machine("gtx280"), 64, 16, 1024)
    assert (held.blocks, held.warps, held.occupancy, held.limit) == (8, 16, 0.5, "blocks")


def test_four_by_four_tiles_leave_three_quarters_of_gt200_empty():
    assert residency(load_machine("gtx280"), 16, 16, 0).occupancy == 0.25


def test_registers_are_allotted_to_the_block_on_gt200():
    """256 threads x 17 registers = 4352, rounded to 4608: three blocks in 16384, where 4096 would give four."""
    assert residency(load_machine("gtx280"), 256, 17, 0).blocks == 3
    assert residency(load_machine("gtx280"), 256, 16, 0).blocks == 4


def test_a_single_warp_is_charged_for_two_on_gt200():
    """32 threads x 124 registers: 7936 for two warps, so two blocks and not four."""
    assert residency(load_machine("gtx280"), 32, 124, 0).blocks == 2


def test_shared_memory_comes_in_512_bytes_on_gt200():
    assert residency(load_machine("gtx280"), 64, 10, 4096 - 16).blocks == 4
    assert residency(load_machine("gtx280"), 64, 10, 4096).blocks == 3


def test_fine_raster_of_cudaraster_has_one_block_on_fermi():
    held = residency(load_machine("gtx480"), 640, 48, 48384)
    assert (held.blocks, held.warps) == (1, 20)


def test_registers_are_allotted_by_warp_on_fermi():
    """21 registers: 672 a warp, rounded to 704; 32768 / 704 = 46 warps: five blocks of eight warps."""
    assert residency(load_machine("gtx480"), 256, 21, 0).blocks == 5
    assert residency(load_machine("gtx480"), 256, 20, 0).blocks == 6


def test_hopper_holds_32_blocks_of_one_warp():
    held = residency(load_machine("h200"), 16, 32, 0)
    assert (held.blocks, held.occupancy, held.limit) == (32, 0.5, "blocks")


def test_the_system_takes_a_kilobyte_of_every_block_on_hopper():
    assert residency(load_machine("h200"), 1024, 32, 232448).blocks == 1
    assert residency(load_machine("h200"), 32, 32, 113 * 1024).blocks == 2
    assert residency(load_machine("h200"), 32, 32, 114 * 1024).blocks == 1


@pytest.mark.parametrize(
    ("block", "registers", "shared_bytes", "word"),
    [(1024, 10, 0, "threads"), (512, 125, 0, "registers"), (64, 10, 20000, "shared memory"), (512, 60, 0, "registers")],
)
def test_a_block_that_cannot_launch_is_refused_by_name(block, registers, shared_bytes, word):
    with pytest.raises(TilestampError, match=word):
        residency(load_machine("gtx280"), block, registers, shared_bytes)


def test_a_smaller_register_file_never_holds_more():
    machine = load_machine("h200")
    half = altered(machine, {"sm.registers": 32768}, "assumed", "test")
    assert residency(half, 256, 40, 0).blocks <= residency(machine, 256, 40, 0).blocks


THREADS = (1, 32, 33, 64, 96, 128, 160, 192, 224, 256, 320, 384, 480, 512, 544, 640, 672, 704, 768, 896, 1000, 1024)
REGISTERS = (1, 8, 10, 16, 17, 20, 21, 24, 31, 32, 33, 40, 46, 48, 56, 63, 64, 72, 80, 88, 96, 104, 124, 128, 160, 255)
SHARED = tuple(
    int(kilobytes * K)
    for kilobytes in (0, 1 / K, 0.5, 1, 3, 4, 6, 8, 12, 15.9, 16, 24, 32.1, 48, 49, 64, 96, 99, 100, 112, 163, 227, 228)
)


def described(name):
    """A machine with the published limits of a compute capability."""
    limits = LIMITS[name]
    numbers = {
        "max_warps": limits.warps,
        "max_threads": limits.warps * 32,
        "max_blocks": limits.blocks,
        "max_threads_per_block": limits.block_threads,
        "registers": limits.registers,
        "registers_per_block": limits.block_registers,
        "register_unit": limits.register_unit,
        "register_allocation": "block" if name.startswith("1.") else "warp",
        "warp_granularity": limits.parts,
        "block_warp_granularity": limits.block_parts,
        "max_registers_per_thread": limits.thread_registers,
        "shared_bytes": limits.shared,
        "shared_bytes_per_block": limits.block_shared,
        "shared_unit_bytes": limits.shared_unit,
        "reserved_shared_bytes": limits.reserved,
    }
    changed = {f"sm.{key}": value for key, value in numbers.items()}
    return altered(load_machine("h200"), changed, "published", "CUDA guide")


def blocks_or_none(machine, *launch):
    try:
        return residency(machine, *launch).blocks
    except TilestampError:
        return 0


@pytest.mark.parametrize("name", list(LIMITS))
def test_blocks_of_a_compute_capability_are_the_published_ones(name):
    machine = described(name)
    wrong = [
        (threads, registers, shared)
        for threads in THREADS
        for registers in REGISTERS
        for shared in SHARED
        if blocks_or_none(machine, threads, registers, shared) != resident_blocks(name, threads, registers, shared)
    ]
    assert not wrong


@pytest.mark.parametrize("name", [name for name in list_machines() if load_machine(name).sm.warp_size == 32])
def test_a_machine_file_has_the_limits_of_its_compute_capability(name):
    machine = load_machine(name)
    of_its_kind = described(machine.compute_capability)
    launches = [
        (threads, registers, shared) for threads in THREADS for registers in REGISTERS for shared in SHARED[::3]
    ]
    assert [blocks_or_none(machine, *launch) for launch in launches] == [
        blocks_or_none(of_its_kind, *launch) for launch in launches
    ]


def test_a_block_on_maxwell_gets_half_of_the_shared_memory_that_an_sm_has():
    assert residency(described("5.2"), 32, 16, 48 * K).blocks == 2
    with pytest.raises(TilestampError, match="at most 49152 bytes of shared memory"):
        residency(described("5.2"), 32, 16, 48 * K + 1)


def test_a_block_on_gk210_gets_half_of_the_registers_that_an_sm_has():
    assert residency(described("3.7"), 512, 128, 0).blocks == 2
    with pytest.raises(TilestampError, match="at most 65536 registers"):
        residency(described("3.7"), 544, 128, 0)
