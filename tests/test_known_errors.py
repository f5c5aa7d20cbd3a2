"""Reports from cells whose errors are known: what is printed, written and marked is what the cells say.

Each test here fails on a report that flatters: ours replaced by the published number, errors clipped, fitted cells
called predicted, large errors left out, a page without marks.
"""

import json
import re
from dataclasses import replace
from functools import cache

import pandas as pd
import pytest

from tilestamp import simulate
from tilestamp.experiments.commands import reproduce as command
from tilestamp.experiments.eisenacher2010 import table1, table2
from tilestamp.experiments.harness.fit import run_judged
from tilestamp.experiments.harness.folder import rebuild
from tilestamp.experiments.harness.result import Cell, Outcome, Result
from tilestamp.experiments.harness.scoreboard import errors_of
from tilestamp.experiments.harness.texts import PRINTED, cell_texts
from tilestamp.experiments.harness.write import Making, write_result

KNOWN = [  # row, published, ours, status, aim; error as printed, and whether it is marked
    ("near", 10.0, 10.5, "predicted", 0.10, "+5.0 %", False),
    ("far", 10.0, 7.3, "predicted", 0.10, "-27.0 %", True),
    ("at the aim", 100.0, 110.0, "predicted", 0.10001, "+10.0 %", False),
    ("thrice", 2.0, 6.0, "predicted", 0.20, "+200.0 %", True),
    ("chosen on", 8.0, 4.0, "fitted", 0.10, "-50.0 %", False),
    ("no aim", 8.0, 12.0, "reported", None, "+50.0 %", False),
    ("alone", None, 3.25, "reported", None, "", False),
    ("order", "a < b", "b < a", "predicted", None, "differs", True),
    ("same order", "a < b", "a < b", "predicted", None, "as published", False),
]
CELLS = [Cell(row, "time", "ms", published=p, ours=o, status=status, aim=aim) for row, p, o, status, aim, *_ in KNOWN]
MADE = Result(
    experiment="paper/known", name="paper-known", title="Known errors", source="Nobody", cells=CELLS, notes=["a note"]
)
PREDICTED = "4 predicted times: mean error 60.5 %, worst 200.0 %"  # (5 + 27 + 10 + 200) / 4


@pytest.mark.parametrize("known", KNOWN, ids=lambda known: known[0])
def test_a_cell_says_its_error_and_whether_it_is_missed(known):
    row, *values, status, aim, error, missed = known
    cell = CELLS[KNOWN.index(known)]
    assert cell.missed == missed
    shown = [value if isinstance(value, str) else f"{value:.4g}" if value else "" for value in values]
    goal = "" if aim is None else f"{100 * aim:.0f} %"
    share = "" if status == "reported" else "0 %"
    assert cell_texts(cell) == (row, "time", "ms", *shown, error, status, goal, share, "")


def test_errors_of_predicted_cells_alone_are_averaged_and_none_is_left_out():
    errors = errors_of(MADE, "predicted", "time")
    assert (errors.number, errors.mean, errors.worst) == (4, pytest.approx(2.42 / 4), pytest.approx(2.0))
    assert (errors.within, errors.aimed) == (2, 4)


def test_the_printed_table_holds_every_cell(capsys):
    command._print_result(MADE)
    printed = capsys.readouterr().out
    lines = [" ".join(line.split()) for line in printed.splitlines()]
    for cell in CELLS:
        assert " ".join(" ".join(cell_texts(cell)[:PRINTED]).split()) in lines
    assert PREDICTED in lines
    assert "- a note" in lines


def test_a_printed_table_has_no_empty_column(capsys):
    command._print_result(replace(MADE, cells=[Cell("a", "size", "px", published=None, ours=3.0, status="reported")]))
    assert "row column unit ours status" in [" ".join(line.split()) for line in capsys.readouterr().out.splitlines()]


def runs(monkeypatch, *outcomes):
    """Let the command run experiments that come out so."""

    def run(names, output, *_):
        for outcome in outcomes:
            assert outcome.name in names
            if outcome.result is not None:
                write_result(outcome.result, output, Making())
            yield outcome

    monkeypatch.setattr(command, "run_experiments", run)
    monkeypatch.setattr(command, "select", lambda *_, **__: [outcome.name for outcome in outcomes])


def test_the_command_prints_every_result_and_fails_where_one_failed(tmp_path, capsys, monkeypatch):
    runs(monkeypatch, Outcome("paper/known", MADE), Outcome("paper/broken", failure="it broke"))
    assert command.reproduce("paper", output=tmp_path) == 1
    printed = capsys.readouterr()
    assert PREDICTED in printed.out
    assert "paper/broken failed: it broke" in printed.err


def test_the_json_holds_every_cell(tmp_path, capsys, monkeypatch):
    runs(monkeypatch, Outcome("paper/known", MADE))
    assert command.reproduce("paper", output=tmp_path, json_=True) == 0
    (cells,) = json.loads(capsys.readouterr().out).values()
    assert [tuple(cell.values()) for cell in cells] == [cell_texts(cell) for cell in CELLS]
    assert [cell["error"] for cell in cells] == [known[5] for known in KNOWN]


def test_the_csv_holds_every_cell_unrounded(tmp_path):
    third = Cell("third", "time", "ms", published=3.0, ours=1.0, status="predicted", aim=0.1)
    folder = write_result(
        Result(experiment="p/q", name="p-q", title="", source="", cells=[*CELLS, third]), tmp_path, Making()
    )
    table = pd.read_csv(folder / "cells.csv", keep_default_na=False).set_index("row")
    for row, published, ours, status, aim, *_ in KNOWN:
        line = table.loc[row]
        assert [line.published, line.ours] == ["" if v is None else str(v) for v in (published, ours)]
        assert (line.status, line.aim) == (status, "" if aim is None else str(aim))
    assert float(table.loc["third"].error) == 1 / 3 - 1
    assert float(table.loc["thrice"].error) == 2.0


def test_the_page_marks_what_is_missed_in_red_and_what_is_fitted_in_grey(tmp_path):
    write_result(MADE, tmp_path, Making())
    page = rebuild(tmp_path)[2].read_text()
    marked = re.findall(r'<tr id="paper-known-\d+" class="(.*?)">(.*?)</tr>', page, re.DOTALL)
    rows = [re.findall(r"<t[hd](.*?)>(.*?)</t[hd]>", cells) for _, cells in marked]
    assert [[text for _, text in cells] for cells in rows] == [
        [text.replace("<", "&lt;") for text in cell_texts(cell)] for cell in CELLS
    ]
    assert [marks.split() for marks, _ in marked] == [[known[3]] + ["missed"] * known[6] for known in KNOWN]
    assert {cells[5][0] for cells in rows} == {' class="error"'}
    assert "tr.missed td.error { color: var(--missed)" in page
    assert "tr.fitted td, tr.fitted th, tr.stand-in td, tr.stand-in th { color: var(--quiet)" in page


@cache
def small(spp=1, tile=8):
    """A small frame in place of the paper's."""
    return simulate("teapot", "micropolygon", "gtx280", width=64, height=48, spp=spp, tile=tile)


def test_table_2_has_the_published_numbers_beside_those_of_its_frames(monkeypatch):
    monkeypatch.setattr(table2, "frame", lambda *_, spp, **__: small(spp))
    cells = {(cell.row, cell.column): cell for cell in table2.run(lambda _: None).cells}
    assert len(cells) == 36
    overhead = 1.87 + (4.6 - 1.87) * 64 * 48 / (1600 * 1200)
    for spp, published in ((1, 9.1), (4, 14.4)):
        cell = cells["killeroo 512x512 BB 8", f"{spp} spp"]
        assert (cell.published, cell.status) == (published, "predicted")
        assert cell.ours == pytest.approx(small(spp).milliseconds + overhead, rel=1e-12)
    patches = cells["killeroo 512x512 BB 8", "patches"]
    assert (patches.published, patches.ours) == (38000, small().frame.facts["patches_written"])


def test_table_1_has_the_published_numbers_beside_those_of_its_frames(monkeypatch):
    monkeypatch.setattr(table1, "frame", lambda *, tile, **_: small(tile=min(tile, 16)))
    result, _ = run_judged(table1.run, lambda _: None)
    cells = {(cell.row, cell.column): cell for cell in result.cells}
    for tile, published in ((4, 2.48), (8, 2.55), (16, 2.94)):
        cell = cells[f"{tile}x{tile}", "address calculation"]
        assert cell.published == published
        assert (cell.status in {"fitted", "stand-in"}) >= (tile == 4)  # without the killeroo its stand-in is loaded
        run = small(tile=tile)
        works = zip(run.frame.works, run.timings, strict=True)
        ours = sum(timing.milliseconds for work, timing in works if work.stage == "bucket_count")
        assert cell.ours == pytest.approx(ours, rel=1e-12)
