"""Study files and the command: what is wrong is one sentence with its line, exit code 2, and nothing is left behind."""

import sqlite3

import pandas as pd
import pytest

from tilestamp import read_study, simulate
from tilestamp.experiments.command_line import BAD_INPUT, INTERRUPTED, run_command
from tilestamp.experiments.studies import cells
from tilestamp.experiments.studies.places import line_of

SCENE = '[fixed]\nscene = "teapot"\nsize = "64x48"\n'  # three lines


@pytest.mark.parametrize(
    ("text", "line", "sentence"),
    [
        (SCENE + '[grid]\nmachine = ["gtx280",\n"gtx481"]', 5, "did you mean 'gtx480'?"),
        (SCENE + "[grid]\ntlie = [4]", 5, "did you mean 'tile'?"),
        (SCENE + "tile = 5", 4, "tile takes 4, 8, 16 or 32, not 5"),
        (SCENE + "tile = [4, 8]", 4, "several values make an axis"),
        (SCENE + '"sm.cout" = 3', 4, "did you mean 'sm.count'?"),
        (SCENE + '"sm.clock_mhz" = -1', 4, "no machine has that"),
        (SCENE + '[grid]\n"times.sm.clock_mhz" = ["x"]', 5, "'x' is none"),
        (SCENE + '[grid]\npipeline = ["micropolygon", "cudaraster"]\ntile = [4]', 6, "no option of the pipeline cuda"),
        (SCENE + '[grid]\npipeline = ["raytracer"]', 5, "no pipeline is called raytracer"),
        (SCENE + "[grid]\nzoom = { from = 1, to = 4 }", 5, "a range needs points"),
        (SCENE + "[grid]\nzoom = { from = 1, to = 4, points = 0 }", 5, "points"),
        (SCENE + '[grid]\nzoom = { from = 0, to = 4, points = 2, scale = "log" }', 5, "above 0"),
        (SCENE + "[grid]\nzoom = [1, 0]", 5, "zoom must be above 0"),
        (SCENE + "[grid]\n\ntile = []", 6, "a value at least"),
        (SCENE + "[grid]\nmethod = { a = 4 }", 5, "the parameters of each"),
        (SCENE + "[grid]\nmethod = {}", 5, "a value at least"),
        (SCENE + "[grid]\nzoom = { from = 1, to = 2, points = 2000000 }", 5, "scale: points: expected int <= 1000000"),
        (SCENE + "[grid]\ntile = [4]\norbit = [inf]", 6, "orbit takes a number"),
        (SCENE + "[zip]\ntile = [4, 8]\nspp = [1]", 4, "tile has 2, spp has 1"),
        (SCENE + "[grid]\ntile = [4]\n[zip]\ntile = [8]", 6, "tile is set by grid.tile too"),
        (SCENE + "[sample]\npoints = 0\naxes.zoom = { from = 1, to = 2 }", 5, "int >= 1"),
        (SCENE + "[sample]\npoints = 2", 4, "axes"),
        (SCENE + "[sample]\npoints = 2\naxes.zoom = { from = 1, to = 2, points = 3 }", 6, "takes no points"),
        (SCENE + 'camera = "frnt"', 4, "no such view"),
        (SCENE + "[grdi]\ntile = [4]", 4, "did you mean 'grid'?"),
        ('record = "milliseconds"\n' + SCENE, 1, "array"),
        ('[fixed]\nsize = "64x48"\nscene = "teapto"', 3, "did you mean 'teapot'?"),
        ('[fixed]\nscene = "teapot"\nsize = "big"', 3, "WIDTHxHEIGHT"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_with_its_line(text, line, sentence, tmp_path, capsys):
    (tmp_path / "a.toml").write_text(text)
    assert run_command(["study", str(tmp_path / "a.toml")]) == BAD_INPUT
    said = capsys.readouterr().err.strip().splitlines()[-1]
    assert f"a.toml:{line}: " in said
    assert sentence in said
    assert [path.name for path in tmp_path.iterdir()] == ["a.toml"]


@pytest.mark.parametrize(
    ("text", "sentence"),
    [("[grid]\ntile = [4]", "needs a scene"), ("[grid", "is not a TOML file"), (None, "there is no study file")],
)
def test_what_has_no_line_is_a_sentence_too(text, sentence, tmp_path, capsys):
    if text:
        (tmp_path / "a.toml").write_text(text)
    assert run_command(["study", str(tmp_path / "a.toml")]) == BAD_INPUT
    assert sentence in capsys.readouterr().err


def test_the_line_is_that_of_the_nearest_key_around():
    text = 'error = 1\n[grid]\ntile = [\n 4]\n[sample.axes]\n"sm.count" = [1]\nzoom = [2]\n'
    assert line_of(text, ("grid", "tile")) == 3
    assert line_of(text, ("sample", "axes", "sm.count")) == 6
    assert line_of(text, ("sample", "axes", "orbit")) == 5
    assert line_of(text, ("nothing",)) == 1


HUGE = SCENE + "".join(
    f"{line} = {{ from = 1, to = 1000, points = 1000 }}\n"
    for line in ('[grid]\n"sm.clock_mhz"', '"memory.dram_gb_per_s"', '"sm.count"')
)  # fmt: skip


def test_a_grid_of_a_thousand_million_cells_asks_with_the_number(tmp_path, capsys, monkeypatch):
    (tmp_path / "a.toml").write_text(HUGE)
    command = ["study", str(tmp_path / "a.toml")]
    assert run_command(command) == BAD_INPUT  # no terminal
    assert "1,000,000,000 cells: say --yes" in capsys.readouterr().err
    monkeypatch.setattr("sys.stdin", Typed("n\n"))
    assert run_command(command) == BAD_INPUT
    assert "1,000,000,000 cells. Run it? [y/N]" in capsys.readouterr().out
    assert run_command([*command, "--dry-run"]) == 0
    assert "1,000,000,000 cells" in capsys.readouterr().out
    assert [path.name for path in tmp_path.iterdir()] == ["a.toml"]


class Typed:
    """A terminal at which somebody answers."""

    def __init__(self, line):
        self.readline = lambda: line
        self.isatty = lambda: True


def test_a_dry_run_says_what_a_run_then_does_and_leaves_nothing(tmp_path, capsys):
    (tmp_path / "a.toml").write_text(SCENE + '[grid]\ntile = [4, 8]\n"sm.count" = [10, 20]')
    assert run_command(["study", str(tmp_path / "a.toml"), "--dry-run"]) == 0
    assert "4 cells; to be run: 4, by 2 executions; about" in capsys.readouterr().out
    assert [path.name for path in tmp_path.iterdir()] == ["a.toml"]
    assert run_command(["study", str(tmp_path / "a.toml"), "-o", str(tmp_path / "a.csv")]) == 0
    printed = capsys.readouterr().out
    assert "4 cells: 4 run by 2 executions" in printed
    assert "repricing saved 2 executions" in printed
    assert printed.splitlines()[2].startswith("a")  # no title: the file's name
    table = pd.read_csv(tmp_path / "a.csv")
    assert (
        table["milliseconds"].tolist()
        == read_study(tmp_path / "a.toml", tmp_path / "a.sqlite").table()["milliseconds"].tolist()
    )
    assert run_command(["study", str(tmp_path / "a.toml"), "--dry-run"]) == 0
    assert "4 cells, all stored" in capsys.readouterr().out


@pytest.mark.parametrize("output", ["a.xls", "nowhere/a.csv"])
def test_an_output_that_cannot_be_is_refused_before_anything_is_run(output, tmp_path, capsys):
    (tmp_path / "a.toml").write_text(SCENE)
    assert run_command(["study", str(tmp_path / "a.toml"), "-o", str(tmp_path / output)]) == BAD_INPUT
    assert "-o" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["a.toml"]


def test_ctrl_c_keeps_what_was_stored(tmp_path, monkeypatch):
    (tmp_path / "a.toml").write_text(SCENE + "[grid]\nzoom = [1, 2, 3]")
    made = []

    def interrupted(*arguments, **keywords):
        if made:
            raise KeyboardInterrupt
        made.append(1)
        return simulate(*arguments, **keywords)

    monkeypatch.setattr("tilestamp.experiments.studies.work.simulate", interrupted)
    monkeypatch.setattr("tilestamp.experiments.studies.work._runs", {})
    assert run_command(["study", str(tmp_path / "a.toml"), "-j", "1"]) == INTERRUPTED
    assert sqlite3.connect(tmp_path / "a.sqlite").execute("SELECT count(*) FROM cells").fetchone() == (1,)


def test_a_fault_of_ours_is_named_with_exit_code_1_and_the_other_cells_go_on(tmp_path, monkeypatch, capsys):
    (tmp_path / "a.toml").write_text(SCENE + "[grid]\ntile = [4, 8]")

    def faulty(*arguments, **keywords):
        return 1 / 0 if keywords["tile"] == 4 else simulate(*arguments, **keywords)

    monkeypatch.setattr("tilestamp.experiments.studies.work.simulate", faulty)
    monkeypatch.setattr("tilestamp.experiments.studies.work._runs", {})
    assert run_command(["study", str(tmp_path / "a.toml"), "-j", "1"]) == 1
    assert "failed: ZeroDivisionError: division by zero" in capsys.readouterr().out
    assert len(read_study(tmp_path / "a.toml", tmp_path / "a.sqlite").table()) == 1


def test_a_name_that_no_cell_has_is_said_with_its_line(tmp_path, capsys):
    (tmp_path / "a.toml").write_text("title = 'a'\nrecord = ['millisecond']\n" + SCENE)
    assert run_command(["study", str(tmp_path / "a.toml"), "-j", "1"]) == BAD_INPUT
    said = capsys.readouterr().err.strip().splitlines()[-1]
    assert "a.toml:2: record: no cell has millisecond (did you mean" in said


def test_a_cell_without_a_time_saved_no_execution_and_the_table_of_one_column_is_printed(tmp_path, capsys):
    (tmp_path / "a.toml").write_text(SCENE + '"sm.registers" = 1\n')
    assert run_command(["study", str(tmp_path / "a.toml"), "-j", "1"]) == 0
    said = capsys.readouterr().out
    assert "1 cell: 1 run by " in said
    assert "saved" not in said
    assert "contradicts itself" in said


def test_a_command_resolves_each_cell_once(tmp_path, monkeypatch):
    walks = []
    walk = cells.walk
    monkeypatch.setattr(cells, "walk", lambda *of: walks.append(1) or (yield from walk(*of)))
    (tmp_path / "a.toml").write_text(SCENE + "[grid]\ntile = [4, 8]\n")
    assert run_command(["study", str(tmp_path / "a.toml"), "-j", "1"]) == 0
    assert len(walks) == 1
