"""How many blocks an SM holds: textbook cases by compute capability."""

import pytest

from tilestamp.models.errors import TilestampError
from tilestamp.models.machine import altered, load_machine
from tilestamp.models.occupancy import residency


@pytest.mark.parametrize(
    ("tile", "blocks", "share"),
    [(4, 16, 0.25), (8, 16, 0.5), (16, 4, 0.5), (32, 1, 0.5)],
)
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
