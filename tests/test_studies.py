"""Studies: axes become cells, cells are executed once and priced, the store keeps them, and bad input is a sentence."""

import dataclasses

import numpy as np
import pytest

from tilestamp import LookAt, Study, TilestampError, altered, load_machine, simulate
from tilestamp.experiments.studies import work

TINY = {"scene": "teapot", "size": "64x48"}


@pytest.fixture
def executions(monkeypatch):
    """Count what is executed in this process, from nothing on."""
    work._runs.clear()
    made = []

    def counted(*arguments, **keywords):
        made.append((arguments, keywords))
        return simulate(*arguments, **keywords)

    monkeypatch.setattr(work, "simulate", counted)
    return made


def test_a_grid_has_every_combination_in_the_order_of_its_axes(executions):
    study = Study(fixed=TINY, grid={"tile": [4, 8], "machine": ["gtx280", "h200"]})
    study.run(jobs=1)
    table = study.table()
    assert table[["tile", "machine"]].to_numpy().tolist() == [[4, "gtx280"], [4, "h200"], [8, "gtx280"], [8, "h200"]]
    assert table["milliseconds"][3] == simulate("teapot", machine="h200", width=64, height=48, tile=8).milliseconds


def test_zip_walks_its_axes_together():
    study = Study(fixed=TINY, zip={"tile": [4, 8], "spp": [4, 1]}, grid={"machine": ["gtx280"]})
    assert [(c.shown["tile"], c.shown["spp"]) for c in study.factors[1]] == [(4, 4), (8, 1)]
    assert len(study) == 2


def test_variants_set_several_parameters(executions):
    methods = {"small": {"tile": 4, "spp": 4}, "hardware": {"pipeline": "hardware", "machine": "gtx480"}}
    study = Study(fixed=TINY, grid={"method": methods})
    study.run(jobs=1)
    assert study.table()["method"].tolist() == ["small", "hardware"]
    assert (
        study.table()["milliseconds"][1] == simulate("teapot", "hardware", "gtx480", width=64, height=48).milliseconds
    )


def test_a_range_has_its_points_and_a_whole_number_is_rounded():
    study = Study(
        fixed=TINY,
        grid={
            "zoom": {"from": 1, "to": 4, "points": 3, "scale": "log"},
            "sm.count": {"from": 10, "to": 15, "points": 3},
        },
    )
    assert study.axes["zoom"] == pytest.approx([1.0, 2.0, 4.0])
    assert study.axes["sm.count"] == [10, 12, 15]


@pytest.mark.parametrize("method", ["sobol", "latin"])
def test_a_sample_lies_in_its_ranges_and_comes_again_with_its_seed(method):
    pytest.importorskip("scipy")
    axes = {"sm.clock_mhz": {"from": 500, "to": 2000, "scale": "log"}, "tile": [4, 8]}
    studies = [
        Study(fixed=TINY, sample={"points": 8, "method": method, "seed": seed, "axes": axes}) for seed in (1, 1, 2)
    ]
    clocks = [[choice.shown["sm.clock_mhz"] for choice in study.factors[0]] for study in studies]
    assert clocks[0] == clocks[1] != clocks[2]
    assert 500 <= min(clocks[0]) < 1000 < max(clocks[0]) <= 2000
    assert sorted(choice.shown["tile"] for choice in studies[0].factors[0]) == [4] * 4 + [8] * 4


def test_cells_that_differ_in_numbers_of_the_machine_execute_once(executions):
    grid = {"sm.clock_mhz": [1000, 1300], "sm.count": [10, 20, 30], "tile": [4, 8]}
    study = Study(fixed=TINY, grid=grid)
    summary = study.run(jobs=1)
    assert (summary.new, summary.executions, len(executions)) == (12, 2, 2)
    changed = altered(load_machine("gtx280"), {"sm.clock_mhz": 1300, "sm.count": 20})
    alone = simulate("teapot", machine=changed, width=64, height=48, tile=4).milliseconds
    row = study.table().query("tile == 4 and `sm.clock_mhz` == 1300 and `sm.count` == 20")
    assert row["milliseconds"].tolist() == [alone]


def test_cells_of_a_sample_that_differ_in_numbers_execute_once_too(executions):
    Study(fixed=TINY, zip={"tile": [4, 8, 4, 8], "sm.count": [10, 11, 12, 13]}).run(jobs=1)
    assert len(executions) == 2


def test_a_queue_of_as_many_blocks_as_sms_is_executed_for_each_number_of_sms(executions):
    study = Study(fixed={"scene": "spot", "size": "64x48", "pipeline": "cudaraster", "machine": "gtx480"})
    study = dataclasses.replace(study, grid={"sm.count": [10, 15], "sm.clock_mhz": [1000.0, 1401.0]})
    assert study.forecast().executions == 2
    assert study.run(jobs=1).executions == len(executions) == 2


def test_a_factor_multiplies_what_the_machine_has():
    study = Study(fixed=TINY, grid={"machine": ["gtx280", "h200"], "times.memory.dram_gb_per_s": [2]})
    study.run(jobs=1)
    gtx280 = load_machine("gtx280")
    twice = altered(gtx280, {"memory.dram_gb_per_s": 2 * gtx280.memory.dram_gb_per_s})
    assert (
        study.table()["milliseconds"][0] == simulate("teapot", machine=twice, width=64, height=48, tile=8).milliseconds
    )


def test_the_forecast_is_what_is_then_done(executions):
    study = Study(fixed=TINY, grid={"machine": ["gtx280", "gtx480"], "tile": [4, 8], "sm.clock_mhz": [900, 1000, 1100]})
    expected = study.forecast()
    done = study.run(jobs=1)
    assert (expected.todo, expected.executions) == (done.new, done.executions) == (12, 4)
    assert expected.guessed
    assert not study.forecast().todo
    more = dataclasses.replace(study, grid={**study.grid, "tile": [4, 8, 16]}, store=study.kept)
    expected = more.forecast()
    assert (expected.stored, expected.todo, expected.executions, expected.guessed) == (12, 6, 2, False)
    assert more.run(jobs=1).executions == 2


def test_what_a_machine_cannot_launch_is_said_in_its_row_and_the_others_go_on(executions):
    study = Study(fixed=TINY, grid={"tile": [8, 32]})
    summary = study.run(jobs=1)
    table = study.table()
    assert summary.problems == 1
    assert (summary.executions, summary.saved_executions) == (1, 0)  # what cannot be launched saves nothing
    assert summary.sentences()[0].startswith("2 cells: 2 run by 1 execution in ")
    assert table["milliseconds"].notna().tolist() == [True, False]
    assert "512 threads" in table["problem"][1]
    assert not study.forecast().todo  # it would be no other one


def test_numbers_of_stages_counts_and_facts_are_recorded_by_name():
    names = (
        "bound",
        "*.milliseconds",
        "tile_raster.SAMPLE_TESTS",
        "tile_raster.ste",
        "facts.subpatches",
        "sample_tests",
    )
    study = Study(fixed=TINY, record=names)
    study.run(jobs=1)
    row = study.table().iloc[0]
    run = simulate("teapot", width=64, height=48)
    assert row["tile_raster.milliseconds"] == pytest.approx(run.stages["milliseconds"]["tile_raster"])
    assert row["tile_raster.SAMPLE_TESTS"] == run.counts["tile_raster.SAMPLE_TESTS"]
    assert row["tile_raster.ste"] == run.stages["ste"]["tile_raster"]
    assert row["facts.subpatches"] == run.frame.facts["subpatches"]
    assert row["sample_tests"] == run.stages["sample_tests"].sum()
    assert {f"{stage}.milliseconds" for stage in run.stages.index} <= set(row.index)


def test_a_name_that_no_cell_has_is_refused_with_the_nearest_one():
    study = Study(fixed=TINY, record=["tile_rastr.ste"])
    with pytest.raises(TilestampError, match=r"no cell has tile_rastr.ste.*did you mean 'tile_raster.ste'"):
        study.run(jobs=1)


def test_what_only_one_pipeline_has_is_missing_in_the_rows_of_the_other():
    fixed = {**TINY, "machine": "gtx480"}
    study = Study(fixed=fixed, grid={"pipeline": ["micropolygon", "hardware"]}, record=["tile_raster.ste"])
    study.run(jobs=1)
    assert study.table()["tile_raster.ste"].notna().tolist() == [True, False]


def test_points_of_a_search_are_run_in_their_order_into_the_same_store(executions):
    study = Study(fixed=TINY, grid={"tile": [8]})
    points = [{"tile": 8, "sm.count": count} for count in (20, 10)]
    table = study.at([*points, {"tile": 8}])
    assert table["sm.count"].tolist()[:2] == [20, 10]
    assert table["milliseconds"][0] < table["milliseconds"][1]
    study.run(jobs=1)
    assert len(executions) == 1
    assert study.table()["milliseconds"].tolist() == table["milliseconds"].tolist()[2:]


def test_zoom_and_orbit_move_the_camera(executions):
    camera = LookAt((0.0, -8.0, 1.5), (0.0, 0.0, 1.5), (0.0, 0.0, 1.0))
    Study(fixed={**TINY, "camera": camera, "zoom": 2, "orbit": 90}).run(jobs=1)
    ((_, keywords),) = executions
    nearer = LookAt((4.0, 0.0, 1.5), (0.0, 0.0, 1.5), (0.0, 0.0, 1.0), near=0.05)
    np.testing.assert_allclose(keywords["camera"].matrix(64, 48), nearer.matrix(64, 48), atol=1e-12)
