"""Habits of other exporters and odd names of files: what comes out of each, or the sentence that refuses it."""

import os
import struct

import numpy as np
import pytest

from tilestamp import Scene, TilestampError, load_machine, load_scene, simulate
from tilestamp.experiments.command_line import BAD_INPUT, run_command
from tilestamp.experiments.eisenacher2010 import frames
from tilestamp.simulator.scenes import read_camera
from tilestamp.simulator.scenes.geometry import Patches
from tilestamp.simulator.scenes.library import is_stand_in, list_scenes, stand_in

SQUARE = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\n"
CORNERS = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n"
FACET = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
PLY = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
FACES = "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
MARK = b"\xef\xbb\xbf"
LONG = ["x" * 300, "/".join(["y" * 200] * 30), "a\0b"]


@pytest.fixture
def load(tmp_path):
    """Write a scene file and load its mesh and note."""

    def loaded(name, content):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return load_scene(path, kind="mesh")

    return loaded


def area(scene):
    a, b, c = (scene.mesh.positions[scene.mesh.triangles[:, k], :3].astype(float) for k in range(3))
    return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2


@pytest.mark.parametrize(
    "text",
    [
        SQUARE + "f 1 2 \\ \n3 4\n",
        SQUARE + "f 1 2 3 4\\",
        MARK.decode() * 2 + SQUARE + "f 1 2 3 4\n",
        SQUARE[:10] + MARK.decode() + SQUARE[10:] + "f 1 2 3 4\n",
        SQUARE.replace(" 0\n", " 0 1.0\n") + "f 1 2 3 4\n",
    ],
    ids=["blank behind a backslash", "backslash at the end", "two marks", "a mark inside", "weights of one"],
)
def test_an_odd_obj_is_read_whole_without_a_note(text, load):
    scene = load("a.obj", text)
    assert (area(scene), scene.note) == (4, "")


def test_a_weight_that_is_not_one_is_named(load):
    assert "weights" in load("a.obj", SQUARE.replace("v 1 1 0", "v 1 1 0 2") + "f 1 2 3\n").note


@pytest.mark.parametrize("libraries", ["red.mtl # ours", '"my red.mtl" red.mtl', "\tred.mtl"])
def test_libraries_of_a_line_may_be_quoted_and_commented(libraries, load, tmp_path):
    (tmp_path / "red.mtl").write_text("newmtl m\nKd 1 0 0\n")
    (tmp_path / "my red.mtl").write_text("newmtl other\n")
    scene = load("a.obj", f"mtllib {libraries}\n{SQUARE}usemtl m\nf 1 2 3\n")
    assert scene.mesh.colors[0].tolist() == [1, 0, 0, 1]
    assert scene.note == ""


@pytest.mark.parametrize("name", ["a", "facet 1", "my vertex 1 2 3"])
@pytest.mark.parametrize("apart", ["\n", " ", "\t\t"])
def test_words_of_a_text_stl_may_share_lines(apart, name, load):
    scene = load("a.stl", f"solid {name}\n{FACET.replace(chr(10), apart)}{FACET}endsolid {name}\n")
    assert (area(scene), len(scene.mesh.triangles)) == (1, 2)


def test_the_counts_of_an_off_may_have_a_line_each(load):
    assert area(load("a.off", f"OFF\n4\n1\n0\n{CORNERS}4 0 1 2 3\n")) == 1


def test_face_colours_of_an_off_are_fractions_or_bytes_each(load):
    scene = load("a.off", f"OFF\n4 3 0\n{CORNERS}3 0 1 2 0.5 0 0\n3 0 2 3 255 0 51\n3 0 1 3\n")
    assert scene.mesh.colors[::3] == pytest.approx(np.array([[0.5, 0, 0, 1], [1, 0, 0.2, 1], [1, 1, 1, 1]]))


@pytest.mark.parametrize(
    ("name", "text"), [("a.off", f"OFF\n4 1 0\n{CORNERS}3 0 1.5 2\n"), ("a.ply", f"{PLY}{FACES}{CORNERS}3 0 1.5 2\n")]
)
def test_half_a_vertex_is_refused(name, text, load):
    with pytest.raises(TilestampError, match=r"a face uses the vertex 1\.5, which is no whole number"):
        load(name, text)


def test_colours_of_a_ply_may_be_called_diffuse(load):
    colored = PLY + "".join(f"property uchar diffuse_{name}\n" for name in ("red", "green", "blue")) + FACES
    assert load("a.ply", colored + CORNERS.replace("\n", " 255 0 51\n") + "3 0 1 2\n").mesh.colors[0, 2] == 51 / 255


def test_numbers_behind_a_header_of_carriage_returns_may_start_as_a_newline(load):
    header = (PLY + FACES).replace("ascii", "binary_little_endian").replace("\n", "\r").encode()
    first = struct.unpack("<f", b"\n\0\x80\x40")[0]
    body = struct.pack("<12fB3i", first, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 3, 0, 1, 2)
    assert load("a.ply", header + body).mesh.positions[0, 0] == np.float32(first)


def test_blank_lines_may_part_headed_patches(tmp_path):
    patch = "3 3\n" + "".join(f"{i % 4} {i // 4} 0\n" for i in range(16))
    (tmp_path / "a.bpt").write_text(f"\n2\n\n{patch}\n\n{patch}")
    assert load_scene(tmp_path / "a.bpt").patches.points.shape == (2, 16, 4)


@pytest.mark.parametrize("name", LONG)
@pytest.mark.parametrize("what", [load_scene, load_machine, read_camera])
def test_a_name_that_no_file_can_have_is_a_sentence(what, name):
    for ending in ("", ".obj", ".toml", ".json"):
        with pytest.raises(TilestampError):
            what(name + ending)


@pytest.mark.parametrize("kind", ["folder", "pipe", "loop"])
@pytest.mark.parametrize(
    ("what", "name"), [(load_scene, "a.obj"), (load_scene, "a.xyz"), (load_machine, "a.toml"), (read_camera, "a.json")]
)
def test_what_is_no_file_is_a_sentence(kind, what, name, tmp_path):
    path = tmp_path / name
    {"folder": path.mkdir, "pipe": lambda: os.mkfifo(path), "loop": lambda: path.symlink_to(path)}[kind]()
    with pytest.raises(TilestampError, match="there is no"):
        what(path)


def test_a_buffer_that_is_a_pipe_is_not_waited_for(load, tmp_path):
    os.mkfifo(tmp_path / "a.bin")
    accessor = '{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}'
    tree = f"""{{"asset": {{"version": "2.0"}}, "nodes": [{{"mesh": 0}}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}}}]}}], "accessors": [{accessor}],
        "bufferViews": [{{"buffer": 0, "byteLength": 36}}], "buffers": [{{"byteLength": 36, "uri": "a.bin"}}]}}"""
    with pytest.raises(TilestampError, match=r"cannot read a\.bin"):
        load("a.gltf", tree)


def test_the_search_path_has_files_of_any_case_and_no_folders(tmp_path, monkeypatch):
    monkeypatch.setenv("TILESTAMP_SCENES", str(tmp_path))
    (tmp_path / "SHIP.OBJ").write_text(SQUARE + "f 1 2 3\n")
    (tmp_path / "fold.obj").mkdir()
    names = dict(list_scenes())
    assert "SHIP" in names
    assert "fold" not in names
    assert load_scene("SHIP").mesh is not None


@pytest.mark.parametrize("flag", ["-o", "--machine", "--camera"])
def test_a_flag_with_too_long_a_name_is_a_sentence(flag, capsys):
    name = "x" * 300 + {"-o": ".png", "--machine": ".toml", "--camera": ".json"}[flag]
    assert run_command(["render", "teapot", "--size", "16x12", flag, name]) == BAD_INPUT
    assert "tilestamp: " in capsys.readouterr().err


def test_a_name_in_capitals_is_nearest_to_the_machine():
    with pytest.raises(TilestampError, match="did you mean 'gtx280'"):
        load_machine("GTX280")


@pytest.mark.parametrize("value", ["x", 1, None])
def test_counting_is_true_or_false(value):
    with pytest.raises(TilestampError, match="counting takes true or false"):
        simulate("teapot", width=16, height=12, counting=value)


@pytest.mark.parametrize(
    ("pipeline", "machine"), [("tiled", "gt750m"), ("per-primitive", "gt750m"), ("binned", "ga104")]
)
def test_textured_pipelines_leave_clip_space_where_it_is(pipeline, machine):
    """A triangle of half the width and height of the screen: an eighth of 64x64 pixels, whatever the camera."""
    scene = Scene.from_clip_space([[-0.5, -0.5, 0, 1], [0.5, -0.5, 0, 1], [0, 0.5, 0, 1]], [[0, 1, 2]])
    camera = np.diag([0.5, 0.5, 1, 1])
    run = simulate(scene, pipeline, machine, width=64, height=64, camera=camera, fidelity="counts")
    assert (run.frame.triangle_ids >= 0).sum() == 64 * 64 / 8


def test_a_stand_in_bears_no_models_name():
    scene = stand_in("killeroo")
    assert scene.name == "stand-in for killeroo"
    assert is_stand_in(scene)


@pytest.mark.parametrize(("name", "start"), [("killeroo", "killeroo: "), ("stand-in for killeroo", "STAND-IN")])
def test_only_stand_ins_are_warned_of_as_such(name, start, monkeypatch):
    scene = Scene(name, patches=Patches(np.ones((1, 16, 4), np.float32)), note="something was skipped")
    monkeypatch.setattr(frames, "model", lambda _: scene)
    (warning,) = frames.stand_in_warnings("killeroo")
    assert warning.startswith(start)
    assert warning.endswith("something was skipped")
