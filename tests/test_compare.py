"""``tilestamp compare`` and ``render --why``: what is printed is what the runs say, on narrow terminals too."""

import json
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest
from PIL import Image
from rich.console import Console

from tilestamp import altered, load_machine, simulate
from tilestamp.experiments.command_line import BAD_INPUT, run_command
from tilestamp.experiments.commands.compared import saved

SMALL = ["--size", "64x48"]
SIZE = {"width": 64, "height": 48, "picture": False}


def compared(capsys, *arguments):
    """The answer of ``compare ... --json``."""
    assert run_command(["compare", *arguments, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_two_machines_have_the_times_of_two_simulations(capsys):
    found = compared(capsys, "teapot", *SMALL, "--machine", "gtx280", "--machine", "h200")
    assert [run["name"] for run in found] == ["gtx280", "h200"]
    for run in found:
        whole = simulate("teapot", machine=run["name"], **SIZE)
        assert run["times"]["frame"] == pytest.approx(whole.milliseconds)
        assert run["bounds"] == whole.stages["bound"].to_dict()
        assert run["terms"]["dice"]["issue"] == pytest.approx(whole.stages.loc["dice", "issue_ms"])


def test_all_combinations_are_compared(capsys):
    found = compared(
        capsys, "teapot", *SMALL, "-O", "tile=8", "-O", "tile=16", "--set", "sm.count=30", "--set", "sm.count=60"
    )
    assert [run["name"] for run in found] == [f"tile={tile}, sm.count={sms}" for tile in (8, 16) for sms in (30, 60)]
    other = simulate("teapot", machine=altered(load_machine("gtx280"), {"sm.count": 60}), tile=16, **SIZE)
    assert found[3]["times"]["frame"] == pytest.approx(other.milliseconds)


def test_a_saved_run_is_the_run(tmp_path, capsys):
    assert run_command(["render", "teapot", *SMALL, "--json"]) == 0
    (tmp_path / "before.json").write_text(capsys.readouterr().out)
    run = simulate("teapot", **SIZE)
    found = saved(tmp_path / "before.json")
    assert found.name == "before"
    assert found.times["frame"] == pytest.approx(run.milliseconds)
    assert found.terms["dice"]["issue"] == pytest.approx(run.stages.loc["dice", "issue_ms"])


def test_the_table_has_times_shares_ratios_and_the_term_that_changed(capsys):
    assert run_command(["compare", "teapot", *SMALL, "--set", "issue.fp32=4.0", "--set", "issue.fp32=40.0"]) == 0
    first, second = (
        simulate("teapot", machine=altered(load_machine("gtx280"), {"issue.fp32": value}), **SIZE)
        for value in (4.0, 40.0)
    )
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    times, change = (next(line for line in lines[k:] if line[:1] == ["dice"]) for k in (0, len(lines) - 8))
    before, after = (run.stages.loc["dice", "milliseconds"] for run in (first, second))
    assert times[1] == f"{before:.4g}"
    assert times[2] == f"{100 * before / first.milliseconds:.1f}"
    assert times[-1] == f"{after / before:.4g}"
    term = change[4]
    terms = [run.stages.loc["dice", f"{term}_ms"] for run in (first, second)]
    assert change[5:8] == [f"{terms[0]:.4g}", f"{terms[1]:.4g}", f"{terms[1] / terms[0]:.4g}"]


def test_where_what_holds_did_not_change_the_term_that_did_is_named(capsys):
    dram = ["--set", "memory.dram_gb_per_s=140.0", "--set", "memory.dram_gb_per_s=14.0"]
    assert run_command(["compare", "teapot", *SMALL, *dram]) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    change = [line for line in lines if line[:1] == ["bound_and_split"]][1]
    assert change[2:5] == ["balance", "balance", "dram"]
    assert float(change[-1]) == pytest.approx(10.0, rel=0.2)  # a kernel's own bytes are a tenth as fast


def test_pipelines_of_other_stages_are_compared_by_the_frame(capsys, tmp_path):
    plot = tmp_path / "plot.png"
    arguments = ["compare", "spot", *SMALL, "--machine", "gtx480", "-o", str(plot)]
    assert run_command([*arguments, "--pipeline", "cudaraster", "--pipeline", "freepipe"]) == 0
    out = capsys.readouterr().out
    assert "fine_raster" in out
    assert out.count("freepipe") > 2
    assert Image.open(plot).size[0] > 100


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["teapot"], "needs two runs"),
        (["no-such-scene", "--machine", "gtx280", "--machine", "h200"], "no-such-scene"),
        (["teapot", "--machine", "gtx280", "--machine", "gtx28"], "gtx280"),
        (["missing.json", "teapot"], "missing.json"),
        (["empty.json", "teapot"], "empty.json holds no run"),
        (["counts.json", "teapot"], "counts.json holds no run"),
        (["teapot", "-O", "tile=8", "-O", "tile=9"], "tile takes"),
        (["teapot", "-O", "tile"], "NAME=VALUE"),
        (["teapot", *(part for n in range(13) for part in ("--set", f"sm.count={20 + n}"))], "13 combinations"),
        (["teapot", "-o", "plot.txt", "--machine", "gtx280", "--machine", "h200"], "plot.txt"),
    ],
)
def test_bad_input_is_one_sentence(arguments, says, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty.json").write_text("{}")
    run = {
        "scene": "s",
        "pipeline": "p",
        "machine": "m",
        "width": 1,
        "height": 1,
        "stages": {"dice": {"bound": "none", "milliseconds": None}},
    }
    (tmp_path / "counts.json").write_text(json.dumps(run))
    assert run_command(["compare", *arguments, *SMALL]) == BAD_INPUT
    error = capsys.readouterr().err.strip().splitlines()[-1]
    assert error.startswith("tilestamp: ")
    assert says in error


@pytest.fixture
def narrow(monkeypatch):
    """A terminal of 80 columns."""
    monkeypatch.setattr("rich.console.Console", partial(Console, force_terminal=True, width=80, color_system=None))


def test_why_has_a_sentence_a_stage_and_no_line_over_80_columns(narrow, capsys):
    assert run_command(["render", "teapot", *SMALL, "--why"]) == 0
    lines = capsys.readouterr().out.splitlines()
    tables = lines[next(i for i, line in enumerate(lines) if line.startswith("Milliseconds")) :]
    assert max(len(line) for line in tables) <= 80
    assert sum("held by" in line for line in lines) >= 5
    assert "blocks start one after another" in " ".join(lines)
    quiet = next(line.split() for line in lines if line.startswith("quiet"))
    assert (
        0 < int(quiet[1]) < len(load_machine("gtx280").provenance) - len(lines[-1].split()) - 10
    )  # at least ten are said


def test_why_in_json_has_every_number(capsys):
    assert run_command(["render", "teapot", *SMALL, "--why", "--json"]) == 0
    why = json.loads(capsys.readouterr().out)["why"]
    run = simulate("teapot", **SIZE)
    assert why["free"]["frame"]["now"] == pytest.approx(run.milliseconds)
    assert {row["number"] for row in why["numbers"]} >= {"sm.count", "issue.fp32"}
    assert set(why["sentences"]) == set(run.stages.index)


def test_render_writes_what_explains_a_run(tmp_path, capsys):
    files = {"--tornado": "t.png", "--timeline": "l.png", "--trace": "s.json.gz"}
    flags = [part for flag, name in files.items() for part in (flag, str(tmp_path / name))]
    assert run_command(["render", "teapot", *SMALL, *flags]) == 0
    out = capsys.readouterr().out
    for name in files.values():
        assert (tmp_path / name).stat().st_size > 100
        assert str(tmp_path / name) in out


@pytest.mark.parametrize(
    ("flags", "says"),
    [
        (["--trace", "s.json"], ".json.gz"),
        (["--timeline", "nowhere/l.png"], "no folder"),
        (["--tornado", "t.gif"], ".png"),
        (["--why", "--fidelity", "counts"], "explain times: --fidelity counts has none"),
        (["--trace", "s.json.gz", "--no-counting", "-o", "out.png"], "explain times: --no-counting has none"),
        (["--no-counting"], "give -o FILE.png"),
    ],
)
def test_what_cannot_be_explained_is_refused_before_anything_is_drawn(flags, says, capsys):
    assert run_command(["render", "no-such-scene", *flags]) == BAD_INPUT
    assert says in capsys.readouterr().err


def test_what_is_wrong_with_the_last_run_is_said_before_the_first_is_drawn(capsys):
    assert run_command(["compare", "teapot", *SMALL, "--machine", "gtx280", "--machine", "gtx28"]) == BAD_INPUT
    assert len(capsys.readouterr().err.splitlines()) == 1


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full: a device that is always full")
def test_a_full_disk_is_one_sentence():
    with Path("/dev/full").open("w") as full:
        command = [sys.executable, "-m", "tilestamp", "list", "machines"]
        said = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)  # noqa: S603 - our own
    assert said.returncode == BAD_INPUT
    assert said.stderr == "tilestamp: the output cannot be written (No space left on device)\n"
