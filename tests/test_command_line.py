"""The command line: what a user types, what comes out, and what is said of bad input."""

import json

import pytest
from PIL import Image

from tilestamp.experiments.command_line import BAD_INPUT, run_command

SMALL = ["--size", "64x48"]


@pytest.fixture(scope="module")
def rendered(tmp_path_factory: pytest.TempPathFactory):
    """One picture with a map, through the command line."""
    folder = tmp_path_factory.mktemp("render")
    code = run_command(["render", "teapot", *SMALL, "-o", str(folder / "out.png"), "--map", "quads"])
    return code, folder


def test_render_writes_the_picture(rendered):
    code, folder = rendered
    assert code == 0
    assert Image.open(folder / "out.png").size == (64, 48)


def test_render_writes_the_heat_map_beside_the_picture(rendered):
    assert (rendered[1] / "out.quads.png").exists()


def test_json_has_stages_counts_and_milliseconds(capsys):
    assert run_command(["render", "teapot", *SMALL, "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["milliseconds"] > 0
    assert "tile_raster" in answer["stages"]
    assert answer["counts"]["tile_raster.GRIDS"] > 0


def test_only_times_by_the_schedule_say_how_far_off_they_may_be(capsys):
    said = []
    for fidelity in ("schedule", "bounds"):
        assert run_command(["render", "teapot", *SMALL, "--fidelity", fidelity]) == 0
        said.append("expect " in capsys.readouterr().out)
    assert said == [True, False]


def test_a_what_if_changes_the_time_and_not_the_counts(capsys):
    answers = []
    for change in ([], ["--set", "sm.clock_mhz=2592.0"]):
        assert run_command(["render", "teapot", *SMALL, "--json", *change]) == 0
        answers.append(json.loads(capsys.readouterr().out))
    assert answers[0]["counts"] == answers[1]["counts"]
    assert answers[1]["milliseconds"] < answers[0]["milliseconds"]


@pytest.mark.parametrize("kind", ["scenes", "pipelines", "machines", "experiments"])
def test_list_says_what_each_thing_is(kind, capsys):
    assert run_command(["list", kind, "--json"]) == 0
    lines = json.loads(capsys.readouterr().out)
    assert lines
    assert all(line for line in lines.values())


@pytest.mark.parametrize(
    ("arguments", "names"),
    [
        (["render", "no-such-scene"], "no-such-scene"),
        (["render", "missing.bpt"], "missing.bpt"),
        (["render", "teapot", "--machine", "gtx9999"], "gtx9999"),
        (["render", "teapot", "--pipeline", "raytracer"], "raytracer"),
        (["render", "teapto"], "did you mean 'teapot'?"),
        (["render", "model.ply"], "put model.ply into"),
        (["render", "teapot", "--pipeline", "free-pipe"], "did you mean 'freepipe'?"),
        (["reproduce", "eisenacher2010/tabel3"], "did you mean 'eisenacher2010/table3'?"),
        (["render", "teapot", "--size", "big"], "--size"),
        (["render", "teapot", "--size", "0x10"], "width"),
        (["render", "teapot", "--size", "900000x900000"], "memory"),
        (["render", "teapot", *SMALL, "--tile", "5"], "5"),
        (["render", "teapot", *SMALL, "--spp", "3"], "3"),
        (["render", "teapot", *SMALL, "--tile", "32"], "512 threads"),
        (["render", "teapot", *SMALL, "--msaa", "4"], "msaa"),
        (["render", "no-such-folder/model.obj"], "no-such-folder/model.obj"),
        (["render", "teapot", *SMALL, "-O", "texture=3"], "texture"),
        (["render", "teapot", *SMALL, "--set", "sm.cout=3"], "sm.cout"),
        (["render", "teapot", *SMALL, "-o", "nowhere/out.png"], "nowhere"),
        (["render", "teapot", *SMALL, "-o", "out.gif"], ".png"),
        (["render", "teapot", *SMALL, "--map", "quads"], "-o"),
        (["render", "teapot", *SMALL, "--camera", "missing.json"], "missing.json"),
        (["reproduce", "no-such-table"], "no-such-table"),
        (["reproduce", "laine2011/memory", "-o", "/dev/null/results"], "/dev/null/results"),
        (["list", "planets"], "planets"),
        (["list", "machines", "h200", "h100"], "h100: more than"),
        (["paint"], "paint"),
    ],
)
def test_bad_input_is_one_sentence_and_exit_code_2(arguments, names, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run_command(arguments) == BAD_INPUT
    said = capsys.readouterr().err.strip().splitlines()[-1]
    assert said.startswith("tilestamp: ")
    assert names in said
    assert "Traceback" not in said
    assert not list(tmp_path.iterdir())


def test_an_interrupt_is_one_sentence_and_exit_code_130(capsys, monkeypatch):
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("tilestamp.simulator.simulation.simulate", interrupted)
    assert run_command(["render", "teapot", *SMALL]) == 130
    assert "interrupted" in capsys.readouterr().err


def test_a_pipeline_that_is_fixed_function_throughout_needs_no_mix(capsys):
    assert run_command(["render", "spot", *SMALL, "--pipeline", "hardware", "--machine", "gtx480", "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["stages"]["hardware"]["milliseconds"] > 0


def test_an_output_that_is_a_folder_is_refused_before_anything_is_drawn(tmp_path, capsys):
    (tmp_path / "out.png").mkdir()
    assert run_command(["render", "teapot", *SMALL, "-o", str(tmp_path / "out.png")]) == BAD_INPUT
    assert "is a folder" in capsys.readouterr().err


def test_a_map_that_the_pipeline_does_not_draw_leaves_no_picture_behind(tmp_path, capsys):
    output = ["-o", str(tmp_path / "out.png"), "--map", "quads"]
    assert run_command(["render", "teapot", *SMALL, "--pipeline", "stamps", *output]) == BAD_INPUT
    assert "no map of quads" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_without_counting_there_is_a_picture_and_no_time(tmp_path, capsys):
    options = ["render", "teapot", *SMALL, "--no-counting", "-o", str(tmp_path / "out.png")]
    assert run_command(options) == 0
    assert (tmp_path / "out.png").exists()
    assert "nothing was counted, so there is no time" in capsys.readouterr().out
    assert run_command([*options, "--map", "tests"]) == BAD_INPUT
    assert "it has none where nothing is counted" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--pipeline", "freepipe"], "several triangles at the nearest depth"),
        (["--pipeline", "bit-mask", "-O", "group=2048"], "another micropolygon than without the mask"),
    ],
)
def test_what_was_lost_or_left_to_chance_is_a_line_of_its_own(options, sentence, capsys):
    assert run_command(["render", "teapot", *SMALL, *options]) == 0
    assert any(sentence in line for line in capsys.readouterr().out.splitlines())
    assert run_command(["render", "teapot", *SMALL, *options, "--json"]) == 0
    assert any(sentence in warning for warning in json.loads(capsys.readouterr().out)["warnings"])


def test_a_clean_frame_has_nothing_to_remark(capsys):
    assert run_command(["render", "teapot", *SMALL, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["warnings"] == []


def test_help_shows_defaults_as_they_are_typed_and_none_that_is_nothing(capsys):
    assert run_command(["compare", "--help"]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert "[default: 1024x768]" in shown
    assert "[default: ()]" not in shown
    assert "[default: False]" not in shown
