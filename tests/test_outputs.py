"""Where output cannot go: one sentence, the right exit code, nothing half-written; and JSON that is JSON."""

import errno
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tilestamp.experiments.command_line import BAD_INPUT, INTERRUPTED, run_command
from tilestamp.experiments.commands.examples import EXAMPLES
from tilestamp.experiments.commands.outputs import check_file, write_json, writing
from tilestamp.models.errors import TilestampError
from tilestamp.simulator import simulation

MAIN = [sys.executable, "-c", "from tilestamp.experiments.command_line import main; main()"]
SMALL = ["render", "teapot", "--size", "64x48"]


def run(*arguments, **keywords):
    return subprocess.run([*MAIN, *arguments], stderr=subprocess.PIPE, check=False, **keywords)  # noqa: S603 - it is our own command


@pytest.fixture
def full(monkeypatch):
    """A disk without room for the last step of a file."""

    def no_room(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "replace", no_room)


@pytest.mark.parametrize(
    "flags", [["-o", "a.png"], ["-o", "a.png", "--map", "tests"], ["--timeline", "a.png"], ["--trace", "a.json.gz"]]
)
def test_a_full_disk_is_one_sentence_and_leaves_nothing(flags, full, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert run_command([*SMALL, *flags]) == BAD_INPUT
    assert "cannot be written (No space left on device)" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_a_file_that_cannot_be_made_leaves_the_one_before(full, tmp_path):
    (tmp_path / "a.csv").write_text("before")
    with pytest.raises(TilestampError), writing(tmp_path / "a.csv") as partial:
        partial.write_text("after")
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [("a.csv", "before")]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
@pytest.mark.parametrize("arguments", [["list", "machines"], ["list", "numbers", "h200"], SMALL, ["--help"]])
def test_standard_output_without_room_is_one_sentence(arguments):
    with Path("/dev/full").open("w") as output:
        ended = run(*arguments, stdout=output)
    assert ended.returncode == BAD_INPUT
    assert ended.stderr.decode().splitlines()[-1].startswith("tilestamp: the output cannot be written")


@pytest.mark.parametrize("arguments", [["list", "numbers", "h200"], ["--help"], ["list", "machines", "--json"]])
def test_a_reader_that_ends_early_is_no_error(arguments):
    read, write = os.pipe()
    os.close(read)
    ended = run(*arguments, stdout=write)
    os.close(write)
    assert (ended.returncode, ended.stderr) == (0, b"")


def test_a_terminal_without_the_letters_of_a_name_shows_them_escaped(tmp_path):
    (tmp_path / "t\u00ebst.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    ascii_only = os.environ | {"PYTHONIOENCODING": "ascii"}
    ended = run("list", "views", str(tmp_path / "t\u00ebst.obj"), stdout=subprocess.PIPE, env=ascii_only)
    assert ended.returncode == 0
    ended = run("render", str(tmp_path / "t\u00ebst.obj"), "--size", "64x48", stdout=subprocess.PIPE, env=ascii_only)
    assert (ended.returncode, ended.stdout[:7]) == (0, b"t\\xebst")


def test_an_interrupt_is_one_line(monkeypatch, capsys):
    def interrupted(*_, **__):
        raise KeyboardInterrupt  # what SIGINT raises, where whoever started the tests does not ignore it

    monkeypatch.setattr(simulation, "simulate", interrupted)
    assert run_command(SMALL) == INTERRUPTED
    assert capsys.readouterr().err == "tilestamp: interrupted; nothing was half-written\n"


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["study", "tiles.toml", "-o", "taken.csv"], "taken.csv: is a folder"),
        (["study", "tiles.toml", "-o", "a.txt"], "should end in .csv or .parquet"),
        (["validate", "-o", "nowhere/a.csv"], "there is no folder nowhere"),
        (["measure-machine", "-o", "a.txt"], "should end in .toml"),
        (["reproduce", "laine2011/memory", "-o", "taken.csv/file"], "cannot be made (File exists)"),
    ],
)
def test_where_output_cannot_go_is_said_before_anything_is_computed(arguments, says, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "taken.csv").mkdir()
    (tmp_path / "taken.csv" / "file").touch()
    assert run_command(arguments) == BAD_INPUT
    assert says in capsys.readouterr().err


def test_a_folder_that_cannot_be_written_to_is_said_before_anything_is_computed(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(os, "access", lambda *_: False)
    with pytest.raises(TilestampError, match="cannot be written to"):
        check_file(tmp_path / "a.png", "-o", ".png")
    assert run_command(["reproduce", "laine2011/memory", "-o", str(tmp_path)]) == BAD_INPUT
    assert "cannot be written to" in capsys.readouterr().err


def test_json_has_null_for_what_is_no_finite_number(capsys):
    write_json({"a": [np.float64("nan"), float("inf"), np.int64(3), (np.bool_(True),)], 1: np.array([0.5, -np.inf])})
    assert capsys.readouterr().out == '{"a": [null, null, 3, [true]], "1": [0.5, null]}\n'


@pytest.mark.parametrize("flags", [[], ["--fidelity", "counts"], ["--fidelity", "bounds"], ["--why"]])
def test_json_of_a_run_is_json(flags, capsys):
    def refused(constant):
        pytest.fail(f"{constant} is no JSON")

    assert run_command([*SMALL, "--json", *flags]) == 0
    assert json.loads(capsys.readouterr().out, parse_constant=refused)["stages"]


@pytest.mark.parametrize("kind", [["maps", "tiled"], ["numbers", "gtx280"], ["views", "spot"], ["options", "stamps"]])
def test_what_belongs_to_one_thing_is_listed_with_what_it_is(kind, capsys):
    assert run_command(["list", *kind, "--json"]) == 0
    table = json.loads(capsys.readouterr().out)
    assert table
    assert all(text not in (None, "") for row in table.values() for text in row.values())


def test_numbers_of_a_machine_come_with_provenance_and_source(capsys):
    assert run_command(["list", "numbers", "gtx280", "--json"]) == 0
    count = json.loads(capsys.readouterr().out)["sm.count"]
    assert (count["value"], count["provenance"]) == (30, "published")
    assert "data sheets" in count["source"]


@pytest.mark.parametrize(
    ("kind", "says"), [(["maps"], "list maps PIPELINE"), (["scenes", "teapot"], "list scenes"), (["views"], "SCENE")]
)
def test_list_says_what_it_needs(kind, says, capsys):
    assert run_command(["list", *kind]) == BAD_INPUT
    assert says in capsys.readouterr().err


@pytest.mark.parametrize("command", EXAMPLES)
def test_help_of_every_command_has_examples(command, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    assert run_command([*command.split(), "--help"]) == 0
    said = capsys.readouterr().out
    assert all(f"tilestamp {typed}" in said for typed, _ in EXAMPLES[command])


def test_every_command_has_examples():
    from tilestamp.experiments.command_line import COMMANDS

    assert {*EXAMPLES} == {"", *COMMANDS}


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_is_written_for_a_shell(shell, tmp_path):
    home = os.environ | {"HOME": str(tmp_path), "XDG_DATA_HOME": str(tmp_path), "XDG_CONFIG_HOME": str(tmp_path)}
    ended = run("--install-completion", "--shell", shell, stdout=subprocess.PIPE, env=home)
    assert ended.returncode == 0, ended.stderr
    assert any("reproduce" in path.read_text() for path in tmp_path.rglob("*tilestamp*") if path.is_file())
