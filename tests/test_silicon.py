"""The mix from machine code: blocks, classes, and what each section of a kernel holds."""

import pytest

from experiments.silicon.h200 import status
from experiments.silicon.mix_from_sass import RASTER, main
from experiments.silicon.raster_sections import raster_sections
from experiments.silicon.sass import Instruction, basic_blocks, classes, cycles, read_functions

LISTING = "silicon/src/micropolygon_sm90.sass.xz"


def code(*lines, stall=1):
    return [Instruction(16 * i, text, stall, 7, 0) for i, text in enumerate(lines)]


def test_a_branch_ends_a_block_and_its_target_begins_one():
    blocks = basic_blocks(code("FADD R0, R0, R1", "@P0 BRA 0x30", "FADD R0, R0, R1", "EXIT"))
    assert [[i.address for i in block] for block in blocks] == [[0, 16], [32], [48]]


def test_predicates_and_modifiers_do_not_change_the_class_and_the_uniform_path_is_control():
    found = classes(code("@!P0 FMNMX R0, R1, R2, PT", "FFMA.FTZ R0, R1, R2, R3", "@UP0 UIADD3 UR4, UR4, 0x1, URZ"))
    assert found == {"int32": 1, "fp32": 1, "control": 1}


def test_a_stall_holds_the_next_instruction_and_a_scoreboard_whoever_waits_for_it():
    load = Instruction(0, "LDS R0, [R1]", 2, 0, 0)
    use = Instruction(16, "FADD R2, R0, R0", 4, 7, 1)
    assert cycles([load, use]) == 23 + 4
    assert cycles([load, Instruction(16, "FADD R2, R3, R3", 4, 7, 0)]) == 2 + 4


@pytest.fixture(scope="module")
def functions(shared):
    return read_functions(shared / LISTING)


@pytest.mark.shared
@pytest.mark.parametrize(("tile", "spp"), [(4, 1), (8, 1), (32, 1), (8, 4), (16, 4)])
def test_each_sub_tile_has_its_own_copy_of_the_sampling_code(functions, tile, spp):
    sections = raster_sections(functions[RASTER.format(tile=tile, spp=spp, mode=0)])
    assert sum(i.opcode == "FADD" for block in sections["BOX"] for i in block) == 16 * spp
    assert sum(i.opcode == "F2I" for block in sections["Z"] for i in block) == 3 * spp
    assert sum(i.opcode == "LDS" for block in sections["QUAD"] for i in block) == 4


@pytest.mark.shared
def test_the_mix_in_the_package_is_what_the_machine_code_says(shared):
    from simulator.mix import MIXES

    assert main(shared / LISTING) in (MIXES / "micropolygon" / "cc9.toml").read_text()


def test_a_cell_that_gave_a_number_is_fitted_and_no_other():
    assert status("teapot_512x512_bb4", "k_raster", "time") == "fitted"
    assert status("teapot_512x512_bb4", "k_raster", "instructions") == "predicted"
    assert status("bunny", "freepipe", "instructions") == "fitted"
    assert status("bunny", "freepipe_early", "load sectors") == "predicted"
    assert status("bunny", "fineRaster", "time") == "predicted"
