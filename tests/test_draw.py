"""What ``tilestamp render`` draws where pipeline and machine are not named, nearer, and with a texture."""

import shlex

import numpy as np
import pytest
from PIL import Image

from tests.drawable import scene_for
from tilestamp import load_machine, simulate
from tilestamp.experiments.command_line import BAD_INPUT, run_command
from tilestamp.experiments.commands.draw import OF_MESHES, OF_TEXTURES
from tilestamp.models.errors import TilestampError, UnableError
from tilestamp.models.machine import list_machines
from tilestamp.simulator.launchable import able_machines, check_launches
from tilestamp.simulator.pipelines import options_type, pipeline_names, pipeline_options

SMALL = ["--size", "64x48"]
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"


@pytest.fixture
def mesh(tmp_path):
    """A triangle, which has no patches."""
    (tmp_path / "ok.obj").write_text(TRIANGLE + "f 1 2 3\n")
    return str(tmp_path / "ok.obj")


@pytest.fixture
def mapped(tmp_path):
    """A triangle with texture coordinates and no material; and a red image."""
    (tmp_path / "mapped.obj").write_text(TRIANGLE + "vt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n")
    Image.new("RGB", (4, 4), (255, 0, 0)).save(tmp_path / "red.png")
    return [str(tmp_path / "mapped.obj"), "--texture", str(tmp_path / "red.png")]


@pytest.fixture
def said(capsys):
    """What a command says, with an exit code that is expected."""

    def run(*arguments, code=0):
        assert run_command(["render", *arguments, *SMALL]) == code
        return "".join(capsys.readouterr())

    return run


def test_a_mesh_is_drawn_by_a_pipeline_that_draws_meshes_and_a_machine_that_can_run_it(said, mesh):
    shown = said(mesh)
    assert "ok by cudaraster on gtx480" in shown
    assert "--pipeline chooses another" in shown


def test_a_mesh_on_a_named_machine_is_drawn_by_a_pipeline_that_runs_there(said, mesh):
    assert "ok by freepipe on gtx280" in said(mesh, "--machine", "gtx280")


def test_patches_are_drawn_as_ever_and_nothing_is_said_of_it(said):
    shown = said("teapot")
    assert "teapot by micropolygon on gtx280" in shown
    assert "chooses another" not in shown


def test_a_named_pipeline_runs_on_the_first_machine_that_can_run_it(said):
    assert "gtx280 cannot run binned, so h200 does" in said("teapot", "--pipeline", "binned")


@pytest.mark.parametrize(
    "wrong",
    [
        ["--pipeline", "micropolygon"],
        ["--pipeline=cudaraster", "--machine=gtx280"],
        ["--pipeline", "binned", "--machine", "gtx480"],
        ["--pipeline", "tiled", "--tile", "32", "--machine", "gtx280"],
    ],
)
def test_what_cannot_be_drawn_comes_with_a_command_that_does_it(said, mesh, wrong, capsys):
    command = said(mesh, *wrong, code=BAD_INPUT).split("try: ")[1]
    name, *arguments = shlex.split(command)
    assert (name, run_command(arguments)) == ("tilestamp", 0)


@pytest.mark.parametrize("pipeline", pipeline_names())
def test_what_a_machine_cannot_run_is_said_before_anything_is_executed(pipeline, monkeypatch):
    able = list(able_machines(pipeline, pipeline_options(pipeline, {})))
    for machine in list_machines():
        if machine in able:
            continue
        monkeypatch.setattr("tilestamp.simulator.simulation.load_pipeline", lambda _: pytest.fail("executed"))
        with pytest.raises(UnableError) as refused:
            simulate(scene_for(pipeline), pipeline, machine, width=64, height=48)
        assert refused.value.instead["machine"] == able[0]


@pytest.mark.parametrize("pipeline", ["binned", "cudaraster", "hardware", "interleaved", "interval"])
def test_what_is_said_to_run_runs_and_what_is_refused_would_not(pipeline, monkeypatch):
    able = list(able_machines(pipeline, pipeline_options(pipeline, {})))
    monkeypatch.setattr("tilestamp.simulator.simulation.check_launches", lambda *_: None)
    for machine in ("gtx280", "gtx480", "h100", "h200"):
        try:
            assert simulate("teapot", pipeline, machine, width=32, height=24).milliseconds > 0
            ran = True
        except TilestampError:
            ran = False
        assert ran == (machine in able), machine


@pytest.mark.parametrize("pipeline", [*OF_MESHES, *OF_TEXTURES])
def test_pipelines_that_are_chosen_can_do_what_they_are_chosen_for(pipeline):
    kind = options_type(pipeline)
    assert (kind.patches, kind.textures) == (False, pipeline in OF_TEXTURES)


def test_a_machine_that_runs_the_pipeline_is_not_refused():
    check_launches("cudaraster", pipeline_options("cudaraster", {}), load_machine("gtx480"))


def test_an_option_of_the_wrong_pipeline_is_said_where_none_is_named(said, mesh):
    assert "the pipeline cudaraster has no option tile" in said(mesh, "--tile", "8", code=BAD_INPUT)


def _picture(path):
    return np.asarray(Image.open(path)).astype(int)


def test_a_texture_is_laid_over_a_mesh_by_its_coordinates(said, mapped, tmp_path):
    said(*mapped, "-o", str(tmp_path / "out.png"))
    drawn = _picture(tmp_path / "out.png")
    assert (drawn[..., 0] > 2 * drawn[..., 1]).any()


def test_a_texture_is_laid_over_patches(said, mapped, tmp_path):
    said("teapot", *mapped[1:], "-o", str(tmp_path / "out.png"))
    drawn = _picture(tmp_path / "out.png")
    assert (drawn[..., 0] > 2 * drawn[..., 1]).any()


def test_a_mesh_without_coordinates_takes_no_texture(said, mesh, mapped):
    assert "ok has no texture coordinates" in said(mesh, *mapped[1:], code=BAD_INPUT)


def test_a_pipeline_without_textures_names_one_that_has_them(said, mapped):
    assert "cudaraster draws no textures; tiled can" in said(*mapped, "--pipeline", "cudaraster", code=BAD_INPUT)


def test_a_texture_that_is_not_there_is_said(said):
    assert "--texture nowhere.png: cannot be read" in said("teapot", "--texture", "nowhere.png", code=BAD_INPUT)


def test_a_zoom_of_two_halves_the_distance(said, tmp_path):
    covered = []
    for zoom in ("0.5", "1"):
        said("teapot", "--zoom", zoom, "-o", str(tmp_path / "out.png"))
        drawn = _picture(tmp_path / "out.png")
        covered.append((drawn != drawn[0, 0]).any(axis=2).sum())
    assert 3 < covered[1] / covered[0] < 5


def test_a_map_that_the_pipeline_does_not_draw_is_said_before_anything_is_drawn(said, tmp_path, monkeypatch):
    monkeypatch.setattr("tilestamp.simulator.simulation.simulate", lambda *_, **__: pytest.fail("drawn"))
    output = ["-o", str(tmp_path / "out.png"), "--map", "test"]
    assert "did you mean 'tests'?" in said("teapot", *output, code=BAD_INPUT)
