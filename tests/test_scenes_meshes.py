"""Meshes: OBJ files line by line, files that trimesh reads, clip-space arrays; and every kind of broken input."""

import base64
import json

import numpy as np
import pytest
import trimesh

from tilestamp.models.errors import TilestampError
from tilestamp.simulator.scenes import Scene, load_scene
from tilestamp.simulator.scenes.clip_space import read_clip_space
from tilestamp.simulator.scenes.mesh_file import read_mesh
from tilestamp.simulator.scenes.obj_file import read_obj
from tilestamp.simulator.scenes.obj_mesh import mesh_from_obj

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


@pytest.fixture
def write(tmp_path):
    def save(name, content):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return save


def obj_mesh(path):
    return mesh_from_obj(read_obj(path), path)


def test_obj_polygons_are_kept(write):
    model = read_obj(write("a.obj", SQUARE + "v 2 2 2\nf 1 2 3 4\nf 1/1 2/2/2 3//3\nf 1 2 3 4 5\n"))
    assert model.sizes.tolist() == [4, 3, 5]
    assert model.corners.tolist() == [0, 1, 2, 3, 0, 1, 2, 0, 1, 2, 3, 4]


def test_negative_obj_indices_count_from_the_vertex_read_last(write):
    model = read_obj(write("a.obj", SQUARE + "f -4 -3 -2\nv 5 5 5\nf -1 -2 -3\n"))
    assert model.corners.tolist() == [0, 1, 2, 4, 3, 2]


def test_obj_faces_may_come_before_their_vertices(write):
    assert read_obj(write("a.obj", "f 1 2 3\n" + SQUARE)).corners.tolist() == [0, 1, 2]


def test_obj_polygons_become_fans_in_the_files_order(write):
    mesh = obj_mesh(write("a.obj", SQUARE + "v 2 2 2\nf 1 2 3 4 5\nf 3 2 1\n"))
    assert mesh.triangles.tolist() == [[0, 1, 2], [0, 2, 3], [0, 3, 4], [2, 1, 0]]


def test_obj_vertex_colours_are_read(write):
    mesh = obj_mesh(write("a.obj", "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 .5\nf 1 2 3\n"))
    assert mesh.colors.tolist() == [[1, 0, 0, 1], [0, 1, 0, 1], [0, 0, 0.5, 1]]


def test_obj_materials_give_each_face_its_own_colour(write):
    write("a.mtl", "newmtl red\nKd 1 0 0\nnewmtl glass\nKd 0 0 1\nd 0.25\n")
    faces = "mtllib a.mtl\nf 1 2 3\nusemtl red\nf 1 2 3\nusemtl glass\nf 1 3 4\n"
    mesh = obj_mesh(write("a.obj", SQUARE + faces))
    colors = mesh.colors[mesh.triangles]
    assert colors[:, 0].tolist() == [[1, 1, 1, 1], [1, 0, 0, 1], [0, 0, 1, 0.25]]
    assert (colors == colors[:, :1]).all()
    assert mesh.positions[mesh.triangles[1], :2].tolist() == [[0, 0], [1, 0], [1, 1]]


@pytest.mark.parametrize(
    ("text", "line", "sentence"),
    [
        ("v 0 0\n", 1, "a vertex needs three numbers"),
        ("v 0 zero 0\n", 1, "a vertex needs three numbers"),
        ("v 0 nan 0\n", 1, "a vertex is NaN or infinite"),
        (SQUARE + "f 1 2 5\n", 5, r"vertex 5, which does not exist \(the file has 4\)"),
        (SQUARE + "f 1 2 99999999999999999999\n", 5, "vertex of more than nine digits, which does not exist"),
        (SQUARE + "f 1 2\n", 5, "at least three corners"),
        (SQUARE + "f 1 2 0\n", 5, "the vertex 0, which does not exist"),
        (SQUARE + "f 1 2 -5\n", 5, "the vertex -5, which does not exist"),
        (SQUARE + "f 1 2 x/3\n", 5, "the vertex that is no number, which does not exist"),
    ],
)
def test_a_broken_obj_line_is_named(text, line, sentence, write):
    with pytest.raises(TilestampError, match=rf"a\.obj:{line}: .*{sentence}"):
        read_obj(write("a.obj", text))


@pytest.mark.parametrize(("text", "sentence"), [("", "has no faces"), (SQUARE, "has no faces")])
def test_an_obj_file_without_a_surface_is_refused(text, sentence, write):
    with pytest.raises(TilestampError, match=rf"a\.obj: .*{sentence}"):
        read_obj(write("a.obj", text))


def test_a_broken_material_line_is_named(write):
    write("a.mtl", "newmtl red\nKd 1 0\n")
    with pytest.raises(TilestampError, match=r"a\.mtl:2: Kd needs 3 numbers"):
        read_obj(write("a.obj", SQUARE + "mtllib a.mtl\nusemtl red\nf 1 2 3\n"))


def triangle(**options):
    return trimesh.Trimesh(
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 2], [0, 2, 3]], process=False, **options
    )


def test_triangles_keep_the_order_of_the_file(write):
    mesh = read_mesh(write("a.ply", triangle().export(file_type="ply")))
    assert mesh.triangles.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert mesh.positions[3].tolist() == [0, 0, 1, 1]


def test_degenerate_and_duplicate_triangles_are_kept(write):
    faces = [[0, 1, 2], [0, 1, 2], [1, 1, 2]]
    part = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], faces, process=False)
    assert read_mesh(write("a.ply", part.export(file_type="ply"))).triangles.tolist() == faces


def test_vertex_colours_are_read(write):
    part = triangle(vertex_colors=[[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [51, 51, 51, 255]])
    mesh = read_mesh(write("a.ply", part.export(file_type="ply")))
    np.testing.assert_allclose(mesh.colors[[0, 3]], [[1, 0, 0, 1], [0.2, 0.2, 0.2, 1]])


def test_face_colours_are_not_shared_between_triangles(write):
    part = triangle(face_colors=[[255, 0, 0, 255], [0, 0, 255, 255]])
    mesh = read_mesh(write("a.ply", part.export(file_type="ply")))
    assert mesh.colors[mesh.triangles].tolist() == [[[1, 0, 0, 1]] * 3, [[0, 0, 1, 1]] * 3]


def test_parts_of_a_gltf_scene_are_placed_by_their_nodes_and_have_their_base_colours(write):
    scene = trimesh.Scene()
    for color, shift in (((255, 0, 0, 255), 0.0), ((0, 0, 255, 255), 10.0)):
        material = trimesh.visual.material.PBRMaterial(baseColorFactor=color)
        part = triangle(visual=trimesh.visual.TextureVisuals(material=material))
        scene.add_geometry(part, transform=trimesh.transformations.translation_matrix([shift, 0, 0]))
    mesh = read_mesh(write("a.glb", scene.export(file_type="glb")))
    assert mesh.triangles.tolist() == [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]]
    assert mesh.positions[:, 0].tolist() == [0, 1, 0, 0, 10, 11, 10, 10]
    assert mesh.colors[[0, 7]].tolist() == [[1, 0, 0, 1], [0, 0, 1, 1]]


def two_scenes(default):
    """Write a glTF of two scenes, a node each, that draw the same triangle at x = 0 and x = 10."""
    corners = np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0]]).tobytes()
    uri = "data:application/octet-stream;base64," + base64.b64encode(corners).decode()
    document = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}, {"nodes": [1]}],
        "nodes": [{"mesh": 0}, {"mesh": 0, "translation": [10, 0, 0]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]}
        ],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"byteLength": 36, "uri": uri}],
    }
    return json.dumps(document if default is None else {**document, "scene": default})


@pytest.mark.parametrize(("default", "x"), [(None, 0), (0, 0), (1, 10)])
def test_of_several_scenes_the_default_one_is_drawn(default, x, write):
    mesh = load_scene(write("a.gltf", two_scenes(default))).mesh
    assert mesh.positions[mesh.triangles[0], 0].tolist() == [x, x + 1, x]
    assert len(mesh.triangles) == 1


def test_normals_of_the_file_are_kept_and_turned_with_their_node(write):
    part = triangle(vertex_normals=[[0, 0, 1]] * 4)
    quarter = trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0])
    scene = trimesh.Scene()
    scene.add_geometry(part, transform=quarter)
    mesh = read_mesh(write("a.glb", scene.export(file_type="glb", include_normals=True)))
    np.testing.assert_allclose(mesh.normals, [[0, -1, 0]] * 4, atol=1e-6)


def test_normals_are_made_where_the_file_has_none(write):
    mesh = obj_mesh(write("a.obj", SQUARE + "v 9 9 9\nf 1 2 3 4\n"))
    assert mesh.normals.tolist() == [[0, 0, 1]] * 4 + [[0, 0, 0]]


PLY = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
PLY_FACES = "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n"


@pytest.mark.parametrize(
    ("name", "content", "sentence"),
    [
        ("a.ply", PLY + "end_header\n0 0 0\n1 0 0\n0 1 0\n", "has no faces"),
        ("a.ply", PLY + PLY_FACES + "0 nan 0\n3 0 1 2\n", "vertex 2 is NaN"),
        ("a.ply", PLY + PLY_FACES + "0 1e300 0\n3 0 1 2\n", "vertex 2 is NaN, infinite or too large"),
        ("a.ply", PLY + PLY_FACES + "0 1 0\n3 0 1 7\n", r"face 0 uses vertices \[0, 1, 7\]"),
        ("a.ply", "ply\nnothing", "cannot be read as a mesh"),
        ("a.glb", b"glTF\x02\0\0\0", "broken glTF"),
        ("a.xyzzy", "?", "cannot be read as a mesh"),
    ],
)
def test_what_is_wrong_with_a_mesh_file_is_a_sentence(name, content, sentence, write):
    with pytest.raises(TilestampError, match=rf"{name}: .*{sentence}"):
        read_mesh(write(name, content))


def test_a_missing_mesh_file_is_named(tmp_path):
    with pytest.raises(TilestampError, match=r"a\.ply: there is no such file"):
        read_mesh(tmp_path / "a.ply")


CORNERS = [[-1, -1, 0, 1], [1, -1, 0, 1], [0, 1, 0, 1]]


def test_clip_space_goes_through_as_it_is():
    scene = Scene.from_clip_space(CORNERS, [[0, 1, 2]])
    assert scene.mesh.clip_space
    assert scene.mesh.positions.tolist() == CORNERS
    assert (scene.mesh.positions.dtype, scene.mesh.triangles.dtype) == (np.float32, np.int32)


@pytest.mark.parametrize("w", [0.0, -1.0])
def test_vertices_behind_the_eye_are_the_rasterizers_business(w):
    corners = [[0, 0, 0, w], *CORNERS[1:]]
    assert Scene.from_clip_space(corners, [[0, 1, 2]]).mesh.positions[0, 3] == w


def test_a_clip_space_file_is_what_its_arrays_are(tmp_path):
    np.savez(tmp_path / "a.npz", positions=np.float32(CORNERS), triangles=np.int32([[2, 1, 0]]))
    scene = load_scene(tmp_path / "a.npz")
    assert scene.mesh.positions.tolist() == CORNERS
    assert scene.mesh.triangles.tolist() == [[2, 1, 0]]
    assert scene.views["default"].matrix(3, 4).tolist() == np.eye(4).tolist()


@pytest.mark.parametrize(
    ("positions", "triangles", "sentence"),
    [
        ([[0, 0, 0]], [[0, 0, 0]], r"positions must be \(V, 4\) numbers"),
        (CORNERS, [[0, 1]], r"triangles must be \(F, 3\) integers"),
        (CORNERS, [[0.0, 1.0, 2.0]], r"triangles must be \(F, 3\) integers, not .* float64"),
        (CORNERS, np.zeros((0, 3), np.int32), "has no triangles"),
        (CORNERS, [[0, 1, 2], [0, 1, 3]], r"triangle 1 uses vertices \[0, 1, 3\], but there are 3"),
        (CORNERS, [[0, 1, -1]], r"triangle 0 uses vertices \[0, 1, -1\]"),
        ([*CORNERS[:2], [0, 0, np.nan, 1]], [[0, 1, 2]], "vertex 2 is NaN"),
        ([*CORNERS[:2], [0, 0, np.inf, 1]], [[0, 1, 2]], "vertex 2 is NaN"),
        ([*CORNERS[:2], [0, 1e39, 0, 1]], [[0, 1, 2]], "too large for float32"),
    ],
)
def test_what_is_wrong_with_clip_space_arrays_is_a_sentence(positions, triangles, sentence):
    with pytest.raises(TilestampError, match=sentence):
        Scene.from_clip_space(positions, triangles)


def test_a_clip_space_file_without_triangles_is_refused(tmp_path):
    np.savez(tmp_path / "a.npz", positions=np.float32(CORNERS))
    with pytest.raises(TilestampError, match=r"a\.npz: has no array 'triangles' \(it has: positions\)"):
        read_clip_space(tmp_path / "a.npz")


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 not a zip", b"words"])
def test_a_file_that_is_no_npz_is_refused(content, write):
    with pytest.raises(TilestampError, match=r"a\.npz: is not a \.npz file of plain arrays"):
        read_clip_space(write("a.npz", content))


def test_one_bare_array_is_no_npz(tmp_path):
    np.save(tmp_path / "a.npy", np.float32(CORNERS))
    (tmp_path / "a.npy").rename(tmp_path / "a.npz")
    with pytest.raises(TilestampError, match=r"is not a \.npz file of plain arrays"):
        read_clip_space(tmp_path / "a.npz")


@pytest.mark.parametrize(
    ("name", "triangles"),
    [("bunny.ply", 69451), ("cow.obj", 5804), ("CornellBox-Original.obj", 36), ("CesiumMilkTruck.glb", 3624)],
)
def test_real_meshes_have_the_triangles_that_they_are_known_for(name, triangles, shared):
    assert len(load_scene(shared / "scenes" / "triangles" / name).mesh.triangles) == triangles
