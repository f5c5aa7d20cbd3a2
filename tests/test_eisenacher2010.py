"""The experiments on Eisenacher & Loop 2010, on the teapot in small frames: cells, their status, what is said."""

from dataclasses import replace
from functools import cache

import pytest

from tilestamp import load_scene
from tilestamp.experiments.eisenacher2010 import claims, figure4, frames, table1, table2, table3
from tilestamp.experiments.harness.result import Result
from tilestamp.simulator.run import Run

EXPERIMENTS = (claims, figure4, table1, table2, table3)
NOTE = "the teapot, because the tests are small"
WIDTH, HEIGHT = 80, 60


@cache
def tiny(name: str = "killeroo", width: int = 0, height: int = 0, **options: object) -> Run:
    """The frame asked for, smaller; ``frames.model`` gives the scene."""
    assert name
    assert (width == 0) == (height == 0)
    return frames.frame.__wrapped__(name, WIDTH, HEIGHT, **options)


def small(name: str) -> Result:
    """Run one experiment on the teapot in small frames."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(frames, "model", cache(lambda _: replace(load_scene("teapot"), note=NOTE)))
        module = next(m for m in EXPERIMENTS if m.__name__.endswith(name))
        patch.setattr(module, "frame", tiny)
        return module.run(lambda _: None)


@pytest.fixture(scope="module", params=[m.__name__.rpartition(".")[2] for m in EXPERIMENTS])
def result(request: pytest.FixtureRequest) -> Result:
    return small(request.param)


def test_every_number_of_ours_is_positive(result):
    assert all(cell.ours > 0 for cell in result.cells if not isinstance(cell.ours, str))


def test_a_stand_in_is_named_above_the_table(result):
    assert any(NOTE in warning for warning in result.warnings)


def test_a_cell_with_an_aim_has_a_published_value(result):
    assert all(cell.published is not None for cell in result.cells if cell.aim is not None)


def test_figures_are_drawn(result, tmp_path):
    for figure in result.figures:
        figure.draw(tmp_path / f"{figure.name}.png")
        assert (tmp_path / f"{figure.name}.png").stat().st_size > 0


def statuses(result: Result) -> dict[tuple[str, str], str]:
    return {(cell.row, cell.column): cell.status for cell in result.cells}


def test_table_1_fits_two_atomic_parameters_on_two_cells():
    fitted = [
        row
        for (row, column), s in statuses(small("table1")).items()
        if (column, s) == ("address calculation", "fitted")
    ]
    assert fitted == ["4x4", "32x32"]


def test_table_1_predicts_every_bucket_write():
    cells = statuses(small("table1"))
    assert {cells[f"{n}x{n}", "bucket write"] for n in (4, 8, 16, 32)} == {"predicted"}


def test_table_1_leaves_out_the_tile_raster_that_a_gtx_280_cannot_launch():
    run = table1.bucketing(tiny(tile=32, fidelity="counts"))
    assert "tile_raster" not in run.stages.index
    assert run.milliseconds > 0


def test_table_2_fits_one_patch_count_a_model_and_no_time():
    cells = statuses(small("table2"))
    fitted = [(row.split()[0], column) for (row, column), status in cells.items() if status == "fitted"]
    assert sorted(fitted) == [("bigguy", "patches"), ("killeroo", "patches"), ("teapot", "patches")]


def test_table_3_marks_one_fitted_cell_a_number_that_was_chosen():
    cells = statuses(small("table3"))
    fitted = {key for key, status in cells.items() if status == "fitted"}
    assert {("bound and split", "1 spp"), ("setup", "1 spp"), ("sampling", "16 spp"), ("sampling", "hybrid")} <= fitted
    assert cells["sampling", "4 spp"] == cells["total", "1 spp"] == "predicted"


def test_table_3_divides_the_tile_raster_into_setup_and_sampling():
    run = tiny(spp=4)
    stages = table3._software_stages(run)
    assert 0 < stages["setup"] < frames.stage_ms(run, "tile_raster")
    assert sum(stages.values()) == pytest.approx(run.milliseconds + frames.overhead_ms(run))


def test_figure_4_names_an_order_of_its_three_tiles_at_each_zoom():
    orders = [cell.ours for cell in small("figure4").cells if cell.column == "order in time"]
    assert len(orders) == len(figure4.ZOOMS)
    assert all(sorted(order.split(" < ")) == ["16x16", "4x4", "8x8"] for order in orders)


def test_claims_average_no_cell_that_was_fitted():
    result = small("claims")
    assert result.predicted_errors == []
    assert "fitted" in {cell.status for cell in result.cells}
