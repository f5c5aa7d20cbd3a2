"""What simulate takes, what it refuses in a sentence, and what it says where nothing is to be seen."""

from pathlib import Path

import numpy as np
import pytest

import tilestamp
from tests.drawable import scene_for
from tilestamp import LookAt, ModelToClip, Scene, TilestampError, load_machine, load_scene, simulate
from tilestamp.experiments.command_line import BAD_INPUT, run_command
from tilestamp.simulator.frame import NOTHING
from tilestamp.simulator.launchable import launchable_values, listed
from tilestamp.simulator.pipelines import pipeline_names, pipeline_options

PACKAGE = Path(tilestamp.__file__).parent
SMALL = {"width": 48, "height": 36, "fidelity": "bounds"}
MACHINES = {
    "splat": "h200",
    "interval": "h200",
    "interleaved": "h200",
    "tiled": "gt750m",
    "per-primitive": "gt750m",
    "binned": "ga104",
}
EYE = np.eye(4)


def draw(scene="teapot", pipeline="micropolygon", machine="gtx480", **given):
    return simulate(scene, pipeline, machine, **{**SMALL, **given})


def triangle(*corners):
    return Scene.from_clip_space([[*corner, 0, 1] for corner in corners], [[0, 1, 2]])


def test_scenes_and_machines_are_taken_as_paths():
    run = draw(PACKAGE / "simulator/scenes/data/teapot.bpt", machine=PACKAGE / "models/machines/gtx480.toml")
    assert run.counts == draw().counts
    assert run.on(PACKAGE / "models/machines/gtx480.toml").milliseconds == run.milliseconds


def test_a_machine_is_taken_as_it_is():
    machine = load_machine("gtx480")
    assert load_machine(machine) is machine


def test_sizes_are_taken_as_whole_floats_and_numpy_numbers():
    run = draw(width=48.0, height=np.int16(36), picture=np.True_)
    assert (run.width, run.height) == (48, 36)
    assert run.image.shape == (36, 48, 3)


@pytest.mark.parametrize("camera", [EYE, EYE.tolist(), np.float32(EYE), ModelToClip(EYE), LookAt((3, 2, 9), (0, 0, 0))])
def test_cameras_are_taken_as_matrices_and_objects(camera):
    assert draw(camera=camera).width == 48


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"scene": 3}, "a scene is a Scene, a name or a file, not 3"),
        ({"scene": ["teapot"]}, "a scene is"),
        ({"scene": Scene("nothing")}, "the scene nothing has neither patches nor triangles"),
        ({"machine": None}, "a machine is a Machine, a name or a machine file, not None"),
        ({"machine": b"gtx480"}, "a machine is"),
        ({"pipeline": None}, "no pipeline is called None"),
        ({"pipeline": np.zeros(2)}, "no pipeline is called"),
        ({"camera": 3}, "camera: 3 is not a camera"),
        ({"camera": LookAt}, "is not a camera"),
        ({"camera": np.eye(3)}, "needs 4x4 numbers, not 3x3"),
        ({"camera": {"eye": 1}}, "camera: needs one of the forms"),
        ({"camera": type("Mine", (), {"matrix": lambda *_: [[1.0]]})()}, "camera: its matrix needs 4x4 numbers"),
        ({"camera": type("Mine", (), {"matrix": 3})()}, "is not a camera"),
        ({"width": "48"}, "width takes a whole number of 1 or more, not '48'"),
        ({"width": 48.5}, "width takes"),
        ({"height": 0}, "height takes"),
        ({"height": True}, "height takes"),
        ({"width": 10**12}, "width takes a whole number of 1 or more that fits in 32 bits"),
        ({"width": 10**9, "height": 10**9}, "memory"),
        ({"fidelity": "exact"}, "fidelity takes counts, bounds or schedule, not 'exact'"),
        ({"picture": "no"}, "picture takes true or false, not 'no'"),
    ],
)
def test_another_type_is_one_sentence(given, sentence):
    with pytest.raises(TilestampError) as refused:
        draw(**given)
    assert sentence in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("picture", [True, False])
@pytest.mark.parametrize("pipeline", pipeline_names())
@pytest.mark.parametrize("target", [(0, -40, 2), (40, -20, 2)], ids=["behind the eye", "beside the view"])
def test_a_picture_of_nothing_says_so(pipeline, target, picture):
    if pipeline == "nonlinear" and target[0]:
        pytest.skip("a fisheye sees what lies beside a perspective view")
    camera = LookAt((0, -20, 2), target, (0, 0, 1))
    run = draw(
        load_scene(scene_for(pipeline)), pipeline, MACHINES.get(pipeline, "gtx480"), camera=camera, picture=picture
    )
    assert NOTHING in run.frame.remarks


@pytest.mark.parametrize("pipeline", pipeline_names())
def test_a_picture_of_something_does_not(pipeline):
    assert NOTHING not in draw(scene_for(pipeline), pipeline, MACHINES.get(pipeline, "gtx480")).frame.remarks


@pytest.mark.parametrize("pipeline", sorted({*pipeline_names()} - {"micropolygon", "splat", "nonlinear"}))
@pytest.mark.parametrize("corners", [[(0, 0)] * 3, [(-0.5, -0.5), (0, 0), (0.5, 0.5)]], ids=["a point", "a line"])
def test_triangles_without_area_show_nothing(pipeline, corners):
    run = draw(triangle(*corners), pipeline, MACHINES.get(pipeline, "gtx480"), camera=EYE)
    assert NOTHING in run.frame.remarks


@pytest.mark.parametrize("pipeline", ["cudaraster", "hardware", "tiled", "binned"])
def test_a_triangle_that_is_culled_shows_nothing(pipeline):
    back = triangle((-0.5, -0.5), (0, 0.5), (0.5, -0.5))
    for culling in (True, False):
        run = draw(back, pipeline, MACHINES.get(pipeline, "gtx480"), camera=EYE, cull_backfaces=culling)
        assert (NOTHING in run.frame.remarks) == culling


def test_without_counts_a_picture_of_nothing_says_so():
    away = LookAt((0, -20, 2), (0, -40, 2), (0, 0, 1))
    assert NOTHING in draw(camera=away, counting=False).frame.remarks
    assert NOTHING not in draw(counting=False).frame.remarks


def test_nothing_to_be_seen_is_said_on_the_terminal(tmp_path, capsys):
    camera = tmp_path / "away.json"
    camera.write_text('{"eye": [0, -20, 2], "target": [0, -40, 2], "up": [0, 0, 1]}')
    assert run_command(["render", "teapot", "--size", "48x36", "--camera", str(camera)]) == 0
    assert NOTHING in capsys.readouterr().out.splitlines()


@pytest.mark.parametrize(
    ("pipeline", "machine", "given", "cure"),
    [
        ("micropolygon", "gtx280", {"tile": 32}, "512 threads a block, not 1024; it can launch tile 4, 8 or 16"),
        ("micropolygon", "gtx480", {"tile": 32, "spp": 16}, "it can launch tile 4, 8 or 16, or spp 1 or 4"),
        ("stamps", "gtx280", {"merge_entries": 256}, "at most 16368 bytes of shared memory, not 49152; gtx480, h200"),
        ("tiled", "gtx280", {"tile": 32}, "it can launch tile 4 to 16"),
        ("freepipe", "gtx280", {"block": 1024}, "it can launch block 32 to 512"),
    ],
)
def test_a_block_that_the_machine_cannot_launch_is_refused_before_anything_runs(
    pipeline, machine, given, cure, monkeypatch
):
    monkeypatch.setattr("tilestamp.simulator.simulation.load_pipeline", lambda _: pytest.fail("it ran"))
    with pytest.raises(TilestampError) as refused:
        draw("teapot", pipeline, machine, **given)
    assert cure in str(refused.value)


def test_counts_alone_need_no_launch():
    assert draw(machine="gtx280", tile=32, fidelity="counts").counts["tile_raster.GRIDS"] > 0


@pytest.mark.parametrize("machine", ["gtx280", "gtx480"])
def test_the_tiles_that_are_listed_are_those_that_can_be_priced(machine):
    options = pipeline_options("micropolygon", {})
    listed_tiles = launchable_values("micropolygon", options, load_machine(machine)).get("tile", [4, 8, 16, 32])
    for tile in (4, 8, 16, 32):
        run = draw(machine=machine, tile=tile, fidelity="counts")
        try:
            priced = bool(run.on(machine, "bounds").milliseconds)
        except TilestampError:
            priced = False
        assert priced == (tile in listed_tiles), tile


def test_tiles_that_a_machine_can_launch_are_listed(capsys):
    assert run_command(["list", "options", "micropolygon", "--machine", "gtx280"]) == 0
    assert "can launch 4, 8 or 16" in " ".join(capsys.readouterr().out.split())
    assert run_command(["list", "scenes", "--machine", "gtx280"]) == BAD_INPUT


def test_many_values_are_said_by_their_ends():
    assert (listed([1]), listed([1, 2, 3]), listed(list(range(4, 17)))) == ("1", "1, 2 or 3", "4 to 16")
