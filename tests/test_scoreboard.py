"""The scoreboard: numbers by hand, and nothing cut on any terminal."""

import io
import json
import re
from dataclasses import asdict, replace

import pandas as pd
import pytest
from rich.console import Console

from tilestamp.experiments.commands import tables
from tilestamp.experiments.commands.scoreboard import print_scoreboard
from tilestamp.experiments.harness.folder import rebuild, stored
from tilestamp.experiments.harness.result import Cell, Result
from tilestamp.experiments.harness.scoreboard import Errors, Row, Words, flat, row_of, total
from tilestamp.experiments.harness.texts import disagreements, score_text
from tilestamp.experiments.harness.write import Making, write_result


def cell(row, published, ours, unit="ms", **more):
    return Cell(row, "column", unit, published=published, ours=ours, **({"aim": 0.2} | more))


CELLS = [
    cell("near", 10.0, 11.0),
    cell("far", 10.0, 15.0),
    cell("no aim", 10.0, 12.5, aim=None),
    cell("sum", 20.0, 26.0, of=(("near", "column"), ("far", "column"))),
    cell("exact", 7.0, 7.0, ""),
    cell("count", 8.0, 10.0, "", aim=0.1),
    cell("fitted", 1.0, 3.0, status="fitted"),
    cell("partly", 1.0, 3.0, status="partly fitted"),
    cell("other model", 1.0, 9.0, status="stand-in"),
    cell("computed", 1.0, 1.0, "", status="reproduced"),
    cell("alone", None, 1.0, status="reported", aim=None),
    cell("order", "a < b", "a < b", "", aim=None),
    cell("winner", "a", "b", "", aim=None, status="partly fitted"),
    cell("chosen", "a", "a", "", aim=None, status="fitted"),
    cell("said", None, "a", "", aim=None),
]
RESULT = Result(name="paper-table", experiment="paper/table", title="A table", source="A paper", cells=CELLS)
ROW = row_of(RESULT)


def test_times_are_averaged_by_themselves_and_a_sum_of_them_is_not_averaged_again():
    assert replace(ROW.times, mean=0.0) == Errors(3, 0.0, 0.5, 1, 2)
    assert ROW.times.mean == pytest.approx((0.1 + 0.5 + 0.25) / 3)


def test_counts_are_averaged_by_themselves():
    assert ROW.counts == Errors(2, 0.125, 0.25, 1, 2)


def test_orders_and_winners_that_are_not_fitted_are_right_or_wrong():
    assert ROW.orders == Words(1, 2)


@pytest.mark.parametrize(
    ("kind", "number"),
    [("fitted", 2), ("partly_fitted", 2), ("stand_ins", 1), ("reproduced", 1), ("reported", 1), ("missed", 5)],
)
def test_cells_of_each_kind_are_counted(kind, number):
    assert getattr(ROW, kind) == number


def test_the_total_weighs_each_experiment_by_its_cells():
    other = Row(times=Errors(1, 0.5, 0.5, 0, 1), orders=Words(2, 3), fitted=4, seconds=2.0)
    both = total([ROW, other])
    assert both.times.mean == pytest.approx((0.1 + 0.5 + 0.25 + 0.5) / 4)
    assert (both.times.worst, both.times.within, both.times.aimed) == (0.5, 1, 3)
    assert (both.counts, both.orders, both.fitted, both.seconds) == (ROW.counts, Words(3, 5), 6, 2.0)


def test_the_total_of_nothing_has_no_mean():
    assert total([]).times == Errors()


def test_a_row_in_words_keeps_times_and_counts_apart():
    assert score_text(ROW) == (
        "3 predicted times: mean error 28.3 %, worst 50.0 %, 1 of 2 within their aim; "
        "2 predicted counts: mean error 12.5 %, worst 25.0 %, 1 of 2 within their aim; "
        "1 of 2 orders and winners right; cells 2 fitted, 2 partly fitted, 1 of stand-ins"
    )


def test_known_disagreements_are_the_missed_cells_largest_first():
    assert disagreements(RESULT) == [
        "winner, column: b instead of a",
        "partly, column: 3 instead of 1 ms, +200.0 % (aim 20 %)",
        "far, column: 15 instead of 10 ms, +50.0 % (aim 20 %)",
        "sum, column: 26 instead of 20 ms, +30.0 % (aim 20 %)",
        "count, column: 10 instead of 8, +25.0 % (aim 10 %)",
    ]


def test_files_and_terminal_show_the_same_row(tmp_path):
    write_result(RESULT, tmp_path, Making(seconds=1.5))
    (row,), _, _ = rebuild(tmp_path)
    written = json.loads((tmp_path / "scoreboard.json").read_text())
    (line,) = pd.read_csv(tmp_path / "scoreboard.csv").to_dict("records")
    assert written["rows"] == json.loads(json.dumps([asdict(row)]))
    assert {key: value for key, value in line.items() if value == value} == {  # noqa: PLR0124 - not-a-number
        key: value for key, value in flat(row).items() if value != ""
    }
    assert (row.times, row.counts, row.seconds) == (ROW.times, ROW.counts, 1.5)


WIDTHS = (60, 80, 120, 200)
LONG = replace(
    ROW,
    experiment="studies_shipped/software_or_hardware",
    times=Errors(1234, 0.1234, 12.345, 1000, 1234),
    counts=Errors(5678, 0.2, 98.76, 4321, 5678),
    orders=Words(111, 222),
    fitted=333,
    stand_ins=444,
)
NUMBERS = ["1234", "12.3", "1234.5", "1000/1234", "5678", "20.0", "9876.0", "4321/5678", "111/222", "333", "444"]


def shown(width, *rows, advice=()):
    """What a terminal of some columns shows."""
    screen = io.StringIO()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tables, "_console", lambda: Console(file=screen, width=width, force_terminal=True))
        print_scoreboard(rows, advice)
    return re.sub(r"\x1b\[[0-9;]*m", "", screen.getvalue())


@pytest.mark.parametrize("width", WIDTHS)
def test_no_number_is_cut_on_any_terminal(width):
    text = shown(width, ROW, LONG)
    assert max(map(len, text.splitlines())) <= width
    assert all(re.search(rf"(?<![\d.]){re.escape(number)}(?![\d.])", text) for number in NUMBERS)


def test_a_terminal_of_80_columns_has_a_line_an_experiment():
    (line,) = [line for line in shown(80, ROW).splitlines() if line.startswith("  table")]
    assert line.split() == ["table", "3", "28.3", "50.0", "1/2", "2", "12.5", "25.0", "1/2", "1/2", "2", "2", "1"]


def test_an_experiment_beside_which_nothing_is_published_shows_its_answer():
    text = shown(80, Row(experiment="stability/slivers", answer="From 87 : 1.", reported=3))
    assert re.search(r"slivers +From 87 : 1\.", text)


def test_what_to_do_for_the_real_models_is_said():
    assert "put killeroo.bpt" in " ".join(shown(60, ROW, advice=["put killeroo.bpt there"]).split())


def test_a_word_of_ours_beside_which_nothing_is_published_is_a_word():
    assert cell("said", None, "8x8", "").kind == "order"


def test_the_worst_error_of_all_is_the_worst_of_any():
    assert total([Row(times=Errors(1, 0.1, 0.1)), Row(times=Errors(1, 0.9, 0.9))]).times.worst == 0.9


def test_the_record_says_which_cells_are_averaged(tmp_path):
    write_result(RESULT, tmp_path, Making())
    (record,) = stored(tmp_path)
    assert [c["row"] for c in record["cells"] if c["averaged"]] == ["near", "far", "no aim", "exact", "count"]
