"""Scenes by name: embedded, on the search path, missing, and stood in for."""

import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

from tests import naive_scenes
from tests.test_scenes_bpt import write as write_bpt
from tests.test_scenes_meshes import SQUARE
from tilestamp.models.errors import TilestampError
from tilestamp.simulator.scenes import Scene, list_scenes, load_scene
from tilestamp.simulator.scenes.library import bounds, scene_or_stand_in, stand_in
from tilestamp.simulator.scenes.search_path import SCENES_VARIABLE, find_scene
from tilestamp.simulator.scenes.subpatches import cut, edge_lengths, tessellate, with_mesh
from tilestamp.simulator.simulation import simulate


@pytest.fixture
def alone(monkeypatch):
    """Nothing on the search path."""
    monkeypatch.delenv(SCENES_VARIABLE, raising=False)


@pytest.mark.parametrize(("name", "patches"), [("teapot", 32), ("spot", 732)])
def test_embedded_scenes_need_no_search_path(name, patches, alone):
    scene = load_scene(name)
    assert len(scene.patches.points) == patches
    assert scene.note == ""


@pytest.mark.parametrize("name", ["teapot", "spot"])
def test_every_model_lies_inside_its_default_view(name, alone):
    scene = load_scene(name)
    clip = scene.patches.points.reshape(-1, 4).astype(np.float64) @ scene.views["default"].matrix(640, 480).T
    assert (np.abs(clip[:, :3]) < clip[:, 3:]).all()


@pytest.mark.parametrize("folders", ["", "one", "one/two"])
def test_a_scene_is_found_two_folders_deep(folders, tmp_path, alone):
    (tmp_path / folders).mkdir(parents=True, exist_ok=True)
    write_bpt(tmp_path / folders / "thing.bpt")
    assert load_scene("thing", scene_path=tmp_path).name == "thing"


def test_a_scene_is_not_looked_for_three_folders_deep(tmp_path, alone):
    (tmp_path / "one/two/three").mkdir(parents=True)
    write_bpt(tmp_path / "one/two/three/thing.bpt")
    assert find_scene("thing", tmp_path) is None


def test_the_environment_names_folders_too(tmp_path, monkeypatch):
    write_bpt(tmp_path / "thing.bpt")
    monkeypatch.setenv(SCENES_VARIABLE, str(tmp_path))
    assert load_scene("thing").patches is not None


def test_the_setting_comes_before_the_environment(tmp_path, monkeypatch):
    for folder in ("mine", "theirs"):
        (tmp_path / folder).mkdir()
        write_bpt(tmp_path / folder / "thing.bpt")
    monkeypatch.setenv(SCENES_VARIABLE, str(tmp_path / "theirs"))
    assert find_scene("thing", tmp_path / "mine").parent.name == "mine"


def test_patches_are_preferred_to_a_cage_of_the_same_name(tmp_path, alone):
    (tmp_path / "thing.obj").write_text(SQUARE + "f 1 2 3 4\n")
    write_bpt(tmp_path / "thing.bpt")
    assert find_scene("thing", tmp_path).suffix == ".bpt"
    assert find_scene("thing.obj", tmp_path).suffix == ".obj"


def test_a_missing_scene_says_where_its_file_goes(tmp_path, alone):
    with pytest.raises(TilestampError, match=rf"'killeroo' is neither .* put killeroo\.bpt.* folders {tmp_path}"):
        load_scene("killeroo", scene_path=tmp_path)


def test_a_missing_scene_names_the_variable_where_no_folder_is_set(alone):
    with pytest.raises(TilestampError, match="TILESTAMP_SCENES"):
        load_scene("killeroo")


def test_the_list_says_that_a_scene_is_missing(alone):
    lines = dict(list_scenes())
    assert set(lines) == {"teapot", "spot", "playbot", "bigguy", "killeroo"}
    assert "put killeroo.bpt on the scene search path" in lines["killeroo"]


def test_the_list_names_files_on_the_search_path(tmp_path, alone):
    write_bpt(tmp_path / "thing.bpt")
    assert "thing.bpt" in dict(list_scenes(tmp_path))["thing"]


@pytest.mark.parametrize(("name", "patches"), [("bigguy", 3570), ("killeroo", 11532)])
def test_a_stand_in_has_the_models_patch_count_and_says_what_it_is(name, patches):
    scene = stand_in(name)
    assert len(scene.patches.points) == patches
    assert "stand-in" in scene.note
    assert f"put {name}.bpt" in scene.note


def test_a_stand_in_serves_only_where_the_file_is_missing(tmp_path, alone):
    assert scene_or_stand_in("bigguy", tmp_path).note != ""
    write_bpt(tmp_path / "bigguy.bpt")
    assert scene_or_stand_in("bigguy", tmp_path).note == ""


@pytest.mark.parametrize("name", ["bigguy", "killeroo"])
def test_a_stand_in_has_the_models_views_and_fits_them(name, shared):
    real, other = load_scene(name), stand_in(name)
    assert list(other.views) == list(real.views)
    clip = other.patches.points.reshape(-1, 4).astype(np.float64) @ other.views["default"].matrix(1600, 1200).T
    shown = np.abs(clip[:, :3] / clip[:, 3:]).max()
    assert 0.5 < shown < 1


@pytest.mark.parametrize("name", ["bigguy", "killeroo"])
def test_a_stand_ins_patches_are_as_long_and_as_slender_as_the_models(name, shared):
    real, other = (np.sort(edge_lengths(scene.patches), axis=1) for scene in (load_scene(name), stand_in(name)))
    scale = np.sqrt(real.prod(axis=1).sum() / other.prod(axis=1).sum())  # its surface is a little larger
    np.testing.assert_allclose(np.median(scale * other, axis=0), np.median(real, axis=0), rtol=0.25)
    assert np.median(other[:, 1] / other[:, 0]) == pytest.approx(np.median(real[:, 1] / real[:, 0]), rel=0.2)


@pytest.mark.parametrize("bound", [4, 8])
def test_a_frame_of_the_killeroos_stand_in_takes_as_long_as_the_killeroos(bound, shared):
    real, other = (
        simulate(scene, "micropolygon", "gtx280", width=1600, height=1200, bound=bound).milliseconds
        for scene in (load_scene("killeroo"), stand_in("killeroo"))
    )
    assert other == pytest.approx(real, rel=0.05)


def test_there_is_no_stand_in_for_other_models():
    with pytest.raises(TilestampError, match="no stand-in for 'bunny'"):
        stand_in("bunny")


def test_splitting_leaves_the_surface_alone():
    """The first patch, cut in four, row by row: each quarter's middle is a point of the whole."""
    teapot = load_scene("teapot").patches
    quarters = cut(teapot, 2, 2).points.reshape(-1, 4, 4, 4)[:4].astype(float)
    whole = teapot.points.reshape(-1, 4, 4, 4)[0].astype(float)
    middle = naive_scenes.bernstein(0.5)
    for quarter, (u, v) in zip(quarters, [(0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)], strict=True):
        wanted = naive_scenes.surface_point(whole, naive_scenes.bernstein(v), naive_scenes.bernstein(u))
        np.testing.assert_allclose(naive_scenes.surface_point(quarter, middle, middle), wanted, atol=1e-6)


def test_parts_stand_in_the_place_of_their_patch():
    teapot = load_scene("teapot").patches
    along_u, along_v = 1 + np.arange(32) % 3, 1 + np.arange(32) % 2
    parts = cut(teapot, along_u, along_v).points
    first = np.concatenate([[0], np.cumsum(along_u * along_v)])
    np.testing.assert_allclose(parts[first[:-1], 0], teapot.points[:, 0], atol=1e-6)
    np.testing.assert_allclose(parts[first[1:] - 1, 15], teapot.points[:, 15], atol=1e-6)


def test_a_patch_cannot_be_cut_into_no_parts():
    with pytest.raises(TilestampError, match="fewer parts than one"):
        cut(load_scene("teapot").patches, 0)


def test_a_tessellation_lies_on_the_surface():
    teapot = load_scene("teapot").patches
    mesh = tessellate(teapot, 4)
    whole = teapot.points.reshape(-1, 4, 4, 4)[5].astype(float)
    wanted = naive_scenes.surface_point(whole, naive_scenes.bernstein(0.25), naive_scenes.bernstein(0.75))
    np.testing.assert_allclose(mesh.positions.reshape(32, 5, 5, 4)[5, 1, 3], wanted, atol=1e-6)


def test_normals_of_a_tessellation_stand_on_its_triangles():
    mesh = tessellate(load_scene("spot").patches, 8)
    a, b, c = (mesh.positions[mesh.triangles[:, corner], :3].astype(float) for corner in range(3))
    across = np.cross(b - a, c - a)
    along = (across * mesh.normals[mesh.triangles[:, 0]]).sum(axis=1) / np.linalg.norm(across, axis=1)
    assert along.min() > 0.9


def test_patches_can_be_drawn_as_triangles():
    assert len(with_mesh(load_scene("teapot")).mesh.triangles) == 32 * 16 * 16 * 2


def test_a_scene_with_a_mesh_keeps_it():
    scene = Scene.from_clip_space(np.eye(4)[:3], [[0, 1, 2]])
    assert with_mesh(scene) is scene


def test_an_empty_scene_cannot_be_drawn():
    with pytest.raises(TilestampError, match="neither patches nor triangles"):
        with_mesh(Scene("nothing"))


@pytest.mark.parametrize(
    ("faces", "kind", "patches", "triangles"),
    [
        ("f 1 2 3 4\n", None, 1, 2),
        ("f 1 2 3 4\n", "patches", 1, None),
        ("f 1 2 3 4\n", "mesh", None, 2),
        ("f 1 2 3\nf 1 3 4\n", None, None, 2),
        ("f 1 2 3\nf 1 3 4\n", "patches", 6, None),
    ],
)
def test_an_obj_file_is_a_cage_where_most_faces_are_quads(faces, kind, patches, triangles, tmp_path):
    (tmp_path / "a.obj").write_text(SQUARE + faces)
    scene = load_scene(tmp_path / "a.obj", kind=kind)
    assert (scene.patches and len(scene.patches.points)) == patches
    assert (scene.mesh and len(scene.mesh.triangles)) == triangles


def test_a_file_named_like_an_embedded_scene_is_the_file(tmp_path):
    (tmp_path / "spot.obj").write_text(SQUARE + "f 1 2 3 4\n")
    assert len(load_scene(tmp_path / "spot.obj").patches.points) == 1


def test_textures_of_an_obj_file_come_along(tmp_path):
    Image.new("RGB", (2, 1), (255, 0, 0)).save(tmp_path / "red.png")
    (tmp_path / "a.mtl").write_text("newmtl skin\nmap_Kd red.png\n")
    (tmp_path / "a.obj").write_text("mtllib a.mtl\nusemtl skin\n" + SQUARE + "vt 0 0\nf 1/1 2/1 3/1\n")
    mesh = load_scene(tmp_path / "a.obj").mesh
    assert mesh.textures[0].tolist() == [[[255, 0, 0, 255]] * 2]
    assert mesh.texture_ids.tolist() == [0]


def test_textures_of_a_gltf_file_come_along(shared):
    assert len(load_scene(shared / "scenes" / "triangles" / "Duck.glb").mesh.textures) == 1


@pytest.mark.parametrize(
    ("name", "content"), [("a.glb", b"glTF\x02\0\0\0"), ("a.gltf", b"{"), ("a.gltf", b'{"asset": {}}'), ("a.glb", b"")]
)
def test_a_broken_gltf_file_is_named(name, content, tmp_path):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(TilestampError, match=name):
        load_scene(tmp_path / name)


def test_a_triangle_file_gives_no_patches(tmp_path):
    (tmp_path / "a.ply").write_text("ply")
    with pytest.raises(TilestampError, match=r"a\.ply: only \.bpt and \.obj"):
        load_scene(tmp_path / "a.ply", kind="patches")


def test_an_unknown_kind_is_refused():
    with pytest.raises(TilestampError, match="kind must be"):
        load_scene("teapot", kind="voxels")


def test_a_scene_is_given_back():
    scene = load_scene("teapot")
    assert load_scene(scene) is scene


def test_bounds_are_those_of_the_used_vertices(tmp_path):
    (tmp_path / "a.obj").write_text(SQUARE + "v 99 99 99\nf 1 2 3\n")
    assert bounds(load_scene(tmp_path / "a.obj")).tolist() == [[0, 0, 0], [1, 1, 0]]


def test_importing_scenes_brings_in_nothing_slow():
    slow = "[m for m in ('pandas', 'trimesh', 'matplotlib') if m in sys.modules]"
    code = f"import sys, tilestamp.simulator.scenes; print({slow})"
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, check=True)  # noqa: S603 - our own interpreter and code
    assert done.stdout == "[]\n"


def test_the_measured_cameras_were_made_for_the_embedded_teapot(shared):
    """In the fourth queue pass of the 1600x1200 frame exactly two sub-patches are under 4 pixels."""
    from tilestamp.simulator.scenes import read_camera

    camera = read_camera(f"{shared / 'silicon' / 'micropolygon_cameras.json'}:teapot_1600x1200_bb4")
    nets = cut(load_scene("teapot").patches, 8, 8).points.astype(np.float64)
    clip = nets @ camera.matrix(1600, 1200).T
    pixels = clip[..., :2] / clip[..., 3:] * [800, 600]
    assert int((np.ptp(pixels, axis=1) < 4).all(axis=1).sum()) == 2
