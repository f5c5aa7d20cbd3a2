"""The table of stages that ``tilestamp render`` prints."""

import pytest

from tilestamp import simulate
from tilestamp.experiments.command_line import BAD_INPUT, run_command
from tilestamp.experiments.commands.render_table import LEADING, stage_texts

SMALL = ["render", "teapot", "--size", "64x48"]


@pytest.fixture
def header(capsys, monkeypatch):
    """Names of the columns that a terminal of some width shows, of each part of the table."""

    def shown(width, *arguments):
        monkeypatch.setenv("COLUMNS", str(width))
        assert run_command([*SMALL, *arguments]) == 0
        return [line.split() for line in capsys.readouterr().out.splitlines() if line.startswith("stage ")]

    return shown


@pytest.mark.parametrize("width", [60, 80, 120, 200])
def test_time_share_bound_and_ste_come_first_on_every_terminal(header, width):
    assert header(width)[0][:5] == ["stage", *LEADING]


@pytest.mark.parametrize("width", [60, 80, 120, 200])
def test_no_line_of_the_table_is_longer_than_the_terminal(capsys, monkeypatch, width):
    monkeypatch.setenv("COLUMNS", str(width))
    assert run_command([*SMALL, "--columns", "all"]) == 0
    table = capsys.readouterr().out.split("expect ")[0].splitlines()[1:]
    assert max(map(len, table)) <= width


def test_a_wider_terminal_has_further_columns(header):
    assert len(header(120)[0]) > len(header(60)[0])


def test_all_columns_stand_below_each_other_on_a_narrow_terminal(header):
    printed = [name for part in header(60, "--columns", "all") for name in part[1:]]
    run = simulate("teapot", width=64, height=48)
    empty = [name for name in run.stages if not any(stage_texts(run).get(name, ""))]
    assert sorted([*printed, *empty]) == sorted([*run.stages, "share"])


def test_columns_can_be_named(header):
    assert header(80, "--columns", "warps,ste") == [["stage", "warps", "ste"]]


def test_a_column_that_is_misspelt_is_said_to_be_another_one(capsys):
    assert run_command([*SMALL, "--columns", "wraps"]) == BAD_INPUT
    assert "did you mean 'warps'?" in capsys.readouterr().err


def test_shares_are_of_the_frame():
    shares = [float(text.removesuffix(" %")) for text in stage_texts(simulate("teapot", width=64, height=48))["share"]]
    assert sum(shares) == pytest.approx(100.0, abs=0.5)


def test_a_run_without_times_has_no_column_of_times():
    texts = stage_texts(simulate("teapot", width=64, height=48, fidelity="counts"))
    assert not {"milliseconds", "share", "bound"} & texts.keys()
    assert "ste" in texts
