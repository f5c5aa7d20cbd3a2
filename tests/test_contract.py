"""What every pipeline keeps, whatever it draws."""

import numpy as np
import pytest
from numba import get_num_threads, set_num_threads

from tests.drawable import scene_for
from tilestamp import simulate
from tilestamp.models.errors import TilestampError
from tilestamp.models.machine import altered, load_machine
from tilestamp.simulator.pipelines import load_pipeline, options_type, pipeline_names
from tilestamp.simulator.run import Run
from tilestamp.simulator.work import Work

WIDTH, HEIGHT = 96, 72


@pytest.fixture(scope="module", params=pipeline_names())
def run(request: pytest.FixtureRequest) -> Run:
    """A small frame by each pipeline, of the teapot or of splats, on a machine that can launch them all."""
    return draw(request.param)


def draw(pipeline: str, **options: object) -> Run:
    return simulate(scene_for(pipeline), pipeline, "h200", width=WIDTH, height=HEIGHT, fidelity="bounds", **options)


def test_the_picture_is_rows_of_rgb_bytes(run):
    assert run.image.shape == (HEIGHT, WIDTH, 3)
    assert run.image.dtype == np.uint8


def test_something_is_drawn(run):
    assert (run.image != run.image[0, 0]).any()


def test_its_maps_are_declared_with_the_options(run):
    assert list(run.frame.maps) == list(options_type(run.pipeline).maps)


def test_depth_has_a_value_a_pixel(run):
    assert run.depth.shape == (HEIGHT, WIDTH)


def test_triangle_ids_are_minus_one_or_an_input_index(run):
    if run.triangle_ids is None:
        pytest.skip(f"{run.pipeline} draws no triangles")
    assert run.triangle_ids.dtype == np.int32
    assert run.triangle_ids.min() == -1
    assert run.triangle_ids.max() >= 0


def test_a_grid_that_depends_on_the_number_of_sms_is_declared_with_the_options(run):
    persistent = any(isinstance(work, Work) and work.persistent for work in run.frame.works)
    assert options_type(run.pipeline).persistent == persistent


def test_no_event_is_negative(run):
    assert min(run.counts.values()) >= 0


def test_hits_are_at_most_tests(run):
    for stage, row in run.stages.iterrows():
        assert row["sample_hits"] <= row["sample_tests"], stage


def test_active_lanes_are_at_most_the_lanes_of_the_warps(run):
    efficiency = run.stages["simd_efficiency"].dropna()
    assert ((efficiency > 0) & (efficiency <= 1 + 1e-9)).all(), efficiency


def test_every_stage_takes_time_and_names_its_bound(run):
    assert (run.stages["milliseconds"] > 0).all()
    assert run.stages["bound"].str.len().min() > 0


def test_the_frame_is_the_sum_of_its_stages(run):
    assert run.milliseconds == pytest.approx(run.stages["milliseconds"].sum())


def test_blocks_are_covered_by_the_units_of_work(run):
    for work in run.frame.works:
        if isinstance(work, Work) and work.dispatch == "blocks":
            assert len(work.table) == work.grid, work.kernel


def test_another_machine_prices_the_same_work_without_executing(run):
    other = run.on("h200", fidelity="schedule")
    assert other.frame is run.frame
    assert other.milliseconds > 0


def test_the_first_line_of_a_pipeline_says_what_it_is():
    for name in pipeline_names():
        assert (load_pipeline(name).__doc__ or "").splitlines()[0].endswith("."), name


@pytest.mark.parametrize("pipeline", pipeline_names())
def test_counting_does_not_change_the_picture(pipeline):
    counted, plain = draw(pipeline), draw(pipeline, counting=False)
    assert (counted.image == plain.image).all()
    assert (counted.depth == plain.depth).all()


@pytest.mark.parametrize("pipeline", pipeline_names())
def test_the_number_of_threads_changes_nothing(pipeline):
    threads = get_num_threads()
    wide = draw(pipeline)
    set_num_threads(1)
    try:
        narrow = draw(pipeline)
    finally:
        set_num_threads(threads)
    assert (wide.image == narrow.image).all()
    assert wide.counts == narrow.counts


def test_a_machine_of_twice_the_clock_halves_a_launch_that_is_bound_by_issue():
    slow = simulate("teapot", "micropolygon", "gtx280", width=320, height=240)
    raster = slow.stages.loc["tile_raster"]
    machine = load_machine("gtx280")
    fast = slow.on(altered(machine, {"sm.clock_mhz": 2 * machine.sm.clock_mhz}))
    assert fast.stages.loc["tile_raster", "issue_ms"] == pytest.approx(raster["issue_ms"] / 2)


def test_a_run_is_not_priced_on_a_machine_that_counts_otherwise():
    run = draw("freepipe")
    with pytest.raises(TilestampError, match=r"not counted for h200 .*\(bank_lanes 32 and 16\): simulate again on it"):
        run.on(altered(run.machine, {"memory.bank_lanes": 16}))
    with pytest.raises(TilestampError, match="coalescing 3 and 1"):
        run.on("gtx280")


def test_a_run_whose_kernels_launch_a_block_an_sm_is_not_priced_for_other_sms():
    fewer = altered(load_machine("h200"), {"sm.count": 100})
    assert draw("freepipe").on(fewer).milliseconds > 0
    with pytest.raises(TilestampError, match="sms 132 and 100"):
        draw("cudaraster").on(fewer)
