"""Results: cells, what is averaged, what is written."""

import json
from dataclasses import replace

import pandas as pd
import pytest

from tilestamp.experiments.harness.folder import rebuild
from tilestamp.experiments.harness.registry import describe, experiment_names, is_slow, process_of, select
from tilestamp.experiments.harness.result import Cell, Result
from tilestamp.experiments.harness.scoreboard import errors_of
from tilestamp.experiments.harness.texts import averages, cell_texts
from tilestamp.experiments.harness.write import Making, write_result
from tilestamp.experiments.stability.boundary import Boundary, atlas_result
from tilestamp.models.errors import TilestampError


def cell(published: float | str | None = 10.0, ours: float | str = 11.0, **more) -> Cell:
    settings = {"row": "row", "column": "column", "unit": "ms", "aim": 0.05} | more
    return Cell(published=published, ours=ours, **settings)


def result(*cells: Cell) -> Result:
    return Result(
        name="paper-table",
        experiment="paper/table",
        title="A table",
        source="A paper",
        cells=list(cells),
        tables={"more": pd.DataFrame({"a": [1]})},
    )


def page_of(folder, *results: Result) -> str:
    """The page over some results."""
    for one in results:
        write_result(one, folder, Making())
    return rebuild(folder)[2].read_text()


def test_the_error_is_relative():
    assert cell().error == pytest.approx(0.1)


def test_a_predicted_cell_outside_its_aim_is_missed():
    assert cell().missed
    assert not cell(ours=10.2).missed


def test_a_fitted_cell_is_never_missed_and_never_averaged():
    fitted = cell(status="fitted")
    assert not fitted.missed
    assert [c.error for c in result(fitted, cell()).compared("predicted", "time")] == [pytest.approx(0.1)]


@pytest.mark.parametrize("status", ["partly fitted", "reproduced"])
def test_what_is_not_fitted_can_be_missed_but_is_not_averaged(status):
    assert cell(status=status).missed
    assert result(cell(status=status)).compared("predicted", "time") == []


@pytest.mark.parametrize("ours", [float("nan"), float("inf"), "no time"])
def test_what_is_no_number_is_missed_and_has_no_error(ours):
    assert cell(ours=ours).missed
    assert cell(ours=ours, aim=None).missed
    assert cell(ours=ours).error is None


def test_where_nothing_is_published_nothing_is_missed():
    assert not cell(None, 3.0).missed
    assert not cell(float("nan"), 3.0).missed
    assert not cell(None, float("nan")).missed


def test_a_published_zero_is_missed_by_anything_else():
    assert cell(0.0, 1e-3).missed
    assert not cell(0.0, 0.0).missed
    assert not cell(0.0, 1e-3, aim=None).missed


def test_times_and_counts_are_averaged_apart():
    both = result(cell(), cell(ours=12.0, unit="", column="count"))
    assert errors_of(both, "predicted", "time").mean == pytest.approx(0.1)
    assert errors_of(both, "predicted", "count").mean == pytest.approx(0.2)
    assert averages(both) == ["1 predicted time: error 10.0 %; 1 predicted count: error 20.0 %"]


@pytest.mark.parametrize("unit", ["ms", "us", "ns/triangle", "ns/triangle, gtx680"])
def test_units_of_time(unit):
    assert cell(unit=unit).kind == "time"


@pytest.mark.parametrize("unit", ["", "%", "1/s", "MB", "samples"])
def test_units_of_something_else(unit):
    assert cell(unit=unit).kind == "count"


def test_a_cell_made_of_averaged_ones_is_not_averaged_again():
    total = cell(ours=15.0, column="total", of=(("row", "column"),))
    assert errors_of(result(cell(), total), "predicted", "time").worst == pytest.approx(0.1)
    assert errors_of(result(cell(status="fitted"), total), "predicted", "time").worst == pytest.approx(0.5)


def test_partly_fitted_cells_have_an_average_of_their_own():
    assert averages(result(cell(), cell(ours=13.0, status="partly fitted"))) == [
        "1 predicted time: error 10.0 %",
        "1 partly fitted time: error 30.0 %",
    ]


def test_an_order_that_differs_is_missed():
    assert cell("a < b", "b < a").missed
    assert not cell("a < b", "a < b").missed
    assert cell("a < b", "b < a").error is None


def test_a_cell_is_predicted_unless_it_says_so():
    assert Cell("row", "column", "ms", published=1.0, ours=2.0).status == "predicted"


def test_texts_show_error_and_status():
    assert "+10.0 %" in cell_texts(cell())
    assert "fitted" in cell_texts(cell(status="fitted"))


def test_texts_name_the_fitted_numbers_and_their_share():
    texts = cell_texts(cell(status="partly fitted", share=0.5, fitted_by=(("gpu: clock", 0.3), ("mix: alu", 0.2))))
    assert texts[-3:] == ("5 %", "50 %", "gpu: clock 30 %; mix: alu 20 %")


def test_the_page_and_the_table_of_cells_name_the_fitted_numbers(tmp_path):
    partly = result(cell(status="partly fitted", share=0.5, fitted_by=(("gpu: clock", 0.5),)))
    assert "gpu: clock 50 %" in page_of(tmp_path, partly)
    table = pd.read_csv(write_result(partly, tmp_path, Making()) / "cells.csv")
    assert table[["status", "share", "fitted by"]].iloc[0].tolist() == ["partly fitted", 0.5, "gpu: clock 50 %"]


def test_the_page_has_the_averages(tmp_path):
    assert "1 predicted time: error 10.0 %" in page_of(tmp_path, result(cell()))


def test_a_missed_cell_is_red_on_the_page(tmp_path):
    assert 'class="predicted missed"' in page_of(tmp_path, result(cell()))


def test_a_result_is_written_as_csv_and_manifest(tmp_path):
    folder = write_result(result(cell()), tmp_path, Making())
    assert pd.read_csv(folder / "cells.csv")["ours"].tolist() == [11.0]
    assert (folder / "more.csv").exists()
    assert json.loads((folder / "manifest.json").read_text())["source_digest"]


def test_a_result_replaces_the_one_before(tmp_path):
    (write_result(result(cell()), tmp_path, Making()) / "stale.csv").write_text("old")
    assert not (write_result(result(cell()), tmp_path, Making()) / "stale.csv").exists()


def test_the_page_holds_every_cell(tmp_path):
    text = page_of(tmp_path, result(cell(ours=12.5)))
    assert "12.5" in text
    assert "A table" in text


def test_an_experiment_is_found_by_paper_and_by_table():
    name = experiment_names()[0]
    assert name in select((name.split("/")[0],))
    assert name in select((name.split("/")[1],))
    assert select((name,)) == [name]


def test_the_beginning_of_a_paper_is_all_of_it_beside_a_table_of_that_name():
    assert {"ste/eisenacher", "eisenacher2010/table3"} <= set(select(("eisenacher",)))


def test_nothing_named_is_what_is_quick():
    assert select(()) == [name for name in experiment_names() if not is_slow(name)]
    assert select((), everything=True) == experiment_names()


def test_experiments_that_share_frames_share_a_process():
    assert process_of("eisenacher2010/table1") == process_of("eisenacher2010/table2") == "eisenacher2010"
    assert process_of("silicon/h200") == "silicon/h200"


def test_an_unknown_experiment_is_refused():
    with pytest.raises(TilestampError, match="nothing-such"):
        select(("nothing-such",))


@pytest.mark.parametrize("name", experiment_names())
def test_every_experiment_says_what_it_is(name):
    assert describe(name).endswith(".")


def broken(name, method, holds, breaks):
    boundary = Boundary(method, "layers", "", holds, breaks, "it shows")
    return replace(atlas_result(f"stability/{name}", name, [boundary]), experiment=f"stability/{name}")


def test_all_boundaries_of_a_folder_are_one_table(tmp_path):
    page_of(tmp_path, broken("races", "per-primitive", 1, 2), result(cell()), broken("layers", "tiled", 64, None))
    table = pd.read_csv(tmp_path / "stability.csv")
    assert table.columns[0] == "experiment"
    assert table.experiment.tolist() == ["stability/races", "stability/layers"]
    assert table.holds.tolist() == [1, 64]


def test_results_without_boundaries_leave_no_such_table(tmp_path):
    page_of(tmp_path, result(cell()))
    assert sorted(path.suffix for path in tmp_path.iterdir() if path.is_file()) == [".csv", ".html", ".json"]
