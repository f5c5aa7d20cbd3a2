"""The mix from machine code: blocks, classes, and what each section of a kernel holds."""

import numpy as np
import pytest

from tilestamp.experiments.calibration import freepipe_mix
from tilestamp.experiments.calibration.cudaraster_blocks import CHAINS, LANES, RUNS, Run
from tilestamp.experiments.calibration.cudaraster_mix import FITTED, chain, instructions
from tilestamp.experiments.calibration.mix_from_sass import RASTER, main
from tilestamp.experiments.calibration.raster_sections import raster_sections
from tilestamp.experiments.calibration.sass import Instruction, basic_blocks, classes, cycles, read_functions
from tilestamp.experiments.harness.result import Cell
from tilestamp.experiments.silicon.h200 import status
from tilestamp.experiments.silicon.leave_one_out import refit
from tilestamp.models.events import EVENTS
from tilestamp.models.launch import Launch, Stream
from tilestamp.models.machine import load_machine
from tilestamp.models.traffic import traffic
from tilestamp.simulator.mix import load_mix
from tilestamp.simulator.stages.laine2011.bin_raster_events import BinRasterEvent
from tilestamp.simulator.stages.laine2011.coarse_raster_events import CoarseRasterEvent
from tilestamp.simulator.stages.laine2011.fine_raster_queue import FineRasterEvent
from tilestamp.simulator.stages.laine2011.parameter_copy import with_parameter_copy
from tilestamp.simulator.stages.laine2011.triangle_setup_count import TriangleSetupEvent
from tilestamp.simulator.work import Work

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
    from tilestamp.simulator.mix import MIXES

    assert main(shared / LISTING) in (MIXES / "micropolygon" / "cc9.toml").read_text()


def test_a_cell_that_gave_a_number_is_fitted_and_no_other():
    machine = load_machine("h200")
    kernels = [kernel for name in ("cudaraster", "freepipe") for kernel in load_mix(name, "9.0").kernels.values()]
    targets = [cell for kernel in kernels for number in kernel.fitted.values() for cell in number.fitted_to]
    targets += [cell for cells in machine.fitted_to.values() for cell in cells]

    def of(scene, kernel, quantity):
        cell = Cell(f"{scene} 512", f"{kernel} {quantity}", "", published=1.0, ours=1.0, frame=f"{scene} 512")
        return status(targets, cell)

    assert of("teapot_512x512_bb4", "k_raster", "time") == "fitted"
    assert of("teapot_512x512_bb4", "k_raster", "instructions") == "predicted"
    assert of("bunny", "freepipe", "instructions") == "fitted"
    assert of("bunny", "binRaster as published", "time") == "fitted"
    assert of("bunny", "binRaster as published", "atomic instructions") == "predicted"
    assert of("bunny", "freepipe_early", "load sectors") == "predicted"
    assert of("bunny", "fineRaster", "time") == "predicted"
    assert of("bunny_5k", "freepipe", "instructions") == "predicted"


def test_the_generators_and_the_mixes_agree_on_what_is_fitted():
    for name, chosen in (("cudaraster", FITTED), ("freepipe", freepipe_mix.FITTED)):
        kernels = load_mix(name, "9.0").kernels
        for kernel, events in chosen.items():
            found = {event: n.number for (event, column), n in kernels[kernel].fitted.items() if column == "int32"}
            assert found == {event: extra for event, (extra, _) in events.items()}


STAGES = {
    "triangleSetup": TriangleSetupEvent,
    "binRaster": BinRasterEvent,
    "coarseRaster": CoarseRasterEvent,
    "fineRaster": FineRasterEvent,
}


@pytest.mark.parametrize("kernel", STAGES)
def test_blocks_belong_to_events_that_the_stage_counts(kernel):
    named = set(LANES[kernel]) | set(LANES[kernel].values()) | set(FITTED[kernel])
    assert set(RUNS[kernel]) | set(CHAINS[kernel]) | named <= set(STAGES[kernel].__members__)


def test_a_run_by_sixteen_warps_counts_sixteen_times_and_a_class_that_the_stage_counts_not_at_all():
    blocks = {0: code("FADD R0, R0, R1", "LDG.E R2, [R4]"), 32: code("STS [R0], R1")}
    total, lanes = instructions((Run((0,), 16), Run((32,), lanes=8)), blocks, {"load"})
    assert total == {"fp32": 16, "shared": 1}
    assert lanes == pytest.approx((16 * 32 + 8) / 17)


def test_a_chain_counts_a_load_once_where_its_value_is_awaited_and_not_where_nobody_waits():
    load = Instruction(0, "LDG.E R0, [R2]", 2, 0, 0)
    use = Instruction(16, "FADD R4, R0, R0", 4, 7, 1)
    free = Instruction(16, "FADD R4, R6, R6", 4, 7, 0)
    assert chain((Run((0,)),), {0: [load, use]}, 1.0)["chain_load"] == 1
    assert "chain_load" not in chain((Run((0,)),), {0: [load, free]}, 1.0)


def test_a_cost_is_found_again_from_the_scenes_that_are_left():
    rows = [
        {"instructions": 1000.0 + 7 * n, "ours": 1000.0 + FITTED["coarseRaster"]["ROUNDS"][0] * n, "counts": counts}
        for n, counts in ((10, np.array([10.0, 0.0])), (90, np.array([90.0, 0.0])))
    ]
    assert refit("coarseRaster", rows)[0] == pytest.approx(7)


def test_each_thread_of_a_block_stores_its_copy_of_the_parameters():
    table = np.zeros((3, len(BinRasterEvent)), np.int64)
    copied = with_parameter_copy(
        Work(stage="bin_raster", kernel="binRaster", events=BinRasterEvent, table=table, grid=2, block=512)
    )
    assert copied.table[:, BinRasterEvent.STORE_BYTES].tolist() == [664 * 512, 664 * 512, 0]
    assert copied.streams[-1].bytes == 2 * 664 * 512


def _from_l2(machine, asked, footprint=32000):
    stream = Stream("vertices", "load", footprint, footprint, requested_bytes=asked)
    launch = Launch(
        stage="s",
        kernel="k",
        grid=1,
        block=64,
        registers=16,
        shared_bytes=0,
        events=np.zeros((1, EVENTS)),
        streams=(stream,),
    )
    return traffic([launch], load_machine(machine))[0].l2_bytes


def test_what_many_units_ask_for_comes_from_l2_once_an_sm_at_most():
    assert _from_l2("h200", 32000) == 32000
    assert _from_l2("h200", 2 * 32000) == pytest.approx(2 * 32000, rel=0.01)
    assert _from_l2("h200", 10**9) == 132 * 32000


def test_units_share_what_they_ask_for_where_l1_keeps_no_loads():
    assert _from_l2("gtx680", 10**9) == 32000
