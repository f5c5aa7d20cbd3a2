"""Textured meshes: glTF with nodes, instances, materials; OBJ with MTL; broken files in a sentence."""

import json
import struct

import numpy as np
import pytest
from PIL import Image

from tilestamp.models.errors import TilestampError
from tilestamp.simulator.scenes.gltf_mesh import read_gltf
from tilestamp.simulator.scenes.obj_file import read_obj
from tilestamp.simulator.scenes.obj_mesh import mesh_from_obj
from tilestamp.simulator.scenes.scene import Mesh, Scene
from tilestamp.simulator.scenes.textured_mesh import geometry

POINTS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)


def glb(tmp_path, change=None, binary=None):
    """One triangle, drawn by one node; ``change`` edits the tree."""
    data = POINTS.tobytes() + np.array([0, 1, 2], np.uint16).tobytes() if binary is None else binary
    tree = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3},
            {"bufferView": 1, "componentType": 5123, "type": "SCALAR", "count": 3},
        ],
        "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 6}],
        "buffers": [{"byteLength": len(data)}],
    }
    if change:
        change(tree)
    text = json.dumps(tree).encode()
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(data), 0x004E4942) + data
    path = tmp_path / "model.glb"
    path.write_bytes(struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks)
    return path


def _few_normals(tree):
    tree["accessors"].append({"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 2})
    tree["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = 2


def _short_colour(tree):
    tree["materials"] = [{"pbrMetallicRoughness": {"baseColorFactor": [1, 2]}}]
    tree["meshes"][0]["primitives"][0]["material"] = 0


def test_a_node_places_its_mesh(tmp_path):
    mesh = read_gltf(glb(tmp_path, lambda tree: tree["nodes"][0].update(translation=[1, 2, 3], scale=[2, 2, 2])))
    assert mesh.positions[:, :3].tolist() == [[1, 2, 3], [3, 2, 3], [1, 4, 3]]


def test_a_child_is_placed_by_its_parents(tmp_path):
    def change(tree):
        tree["nodes"] = [
            {"children": [1], "translation": [1, 0, 0]},
            {"mesh": 0, "rotation": [0, 0, 0.5**0.5, 0.5**0.5]},
        ]

    assert read_gltf(glb(tmp_path, change)).positions[1, :3] == pytest.approx([1, 1, 0])


def test_a_mesh_drawn_twice_is_there_twice(tmp_path):
    def change(tree):
        tree["nodes"].append({"mesh": 0})
        tree["scenes"][0]["nodes"] = [0, 1]

    mesh = read_gltf(glb(tmp_path, change))
    assert len(mesh.triangles) == 2
    assert mesh.draws.tolist() == [[3, 1], [3, 1]]


def test_a_mirror_turns_the_winding_back(tmp_path):
    mesh = read_gltf(glb(tmp_path, lambda tree: tree["nodes"][0].update(scale=[-1, 1, 1])))
    a, b, c = mesh.positions[mesh.triangles[0], :3]
    assert np.cross(b - a, c - a)[2] > 0


def test_a_base_colour_becomes_the_vertex_colour(tmp_path):
    def change(tree):
        tree["materials"] = [{"pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.25, 0, 1]}}]
        tree["meshes"][0]["primitives"][0]["material"] = 0

    assert read_gltf(glb(tmp_path, change)).colors[0].tolist() == [0.5, 0.25, 0, 1]


def test_missing_normals_are_made(tmp_path):
    assert read_gltf(glb(tmp_path)).normals[0].tolist() == [0, 0, 1]


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda t: t["accessors"][0].update(sparse={}), "accessor 0"),
        (lambda t: t.update(extensionsRequired=["KHR_draco_mesh_compression"]), "KHR_draco_mesh_compression"),
        (lambda t: t["asset"].update(version="1.0"), "only glTF 2.0"),
        (lambda t: t["accessors"][0].update(count=99), "accessor 0"),
        (lambda t: t["meshes"][0]["primitives"][0]["attributes"].clear(), "no positions"),
        (lambda t: t["meshes"][0]["primitives"][0].update(mode=1), "no lists of triangles"),
        (lambda t: t["nodes"][0].update(children=[0]), "its own ancestor"),
        (lambda t: t["nodes"][0].update(mesh=4), "no mesh 4"),
        (lambda t: t["meshes"][0]["primitives"][0].update(material=7), "no material 7"),
        (lambda t: t["meshes"][0].update(primitives="x"), "broken glTF"),
        (lambda t: t["nodes"][0].update(matrix=[1, 2, 3]), "broken glTF"),
        (lambda t: t["nodes"][0].update(rotation=[1, 0]), "broken glTF"),
        (lambda t: t["meshes"][0]["primitives"][0]["attributes"].update(NORMAL=2), "no accessors 2"),
        (_few_normals, "2 normals for 3 vertices"),
        (_short_colour, "a colour of 2 numbers"),
    ],
)
def test_a_broken_file_is_refused_in_a_sentence(tmp_path, change, sentence):
    with pytest.raises(TilestampError, match=sentence):
        read_gltf(glb(tmp_path, change))


def test_a_file_that_ends_early_is_refused(tmp_path):
    path = glb(tmp_path)
    path.write_bytes(path.read_bytes()[:-10])
    with pytest.raises(TilestampError, match="broken glTF"):
        read_gltf(path)


def test_an_index_beyond_the_vertices_is_refused(tmp_path):
    data = POINTS.tobytes() + np.array([0, 1, 9], np.uint16).tobytes()
    with pytest.raises(TilestampError, match="index 9"):
        read_gltf(glb(tmp_path, binary=data))


def read_textured_obj(path):
    return mesh_from_obj(read_obj(path), path)


def obj(tmp_path, material):
    (tmp_path / "m.mtl").write_text(material)
    path = tmp_path / "m.obj"
    path.write_text("mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0.25\nusemtl a\nf 1/1 2/2 3/1\n")
    return path


def test_an_obj_has_texture_coordinates_from_the_top(tmp_path):
    mesh = read_textured_obj(obj(tmp_path, "newmtl a\nmap_Kd nowhere.png\n"))
    assert sorted(map(tuple, mesh.uvs.tolist())) == [(0.0, 1.0), (0.0, 1.0), (1.0, 0.75)]


def test_an_mtl_names_colour_and_texture(tmp_path):
    Image.new("RGB", (3, 5), (255, 0, 0)).save(tmp_path / "red.png")
    mesh = read_textured_obj(obj(tmp_path, "newmtl a\nKd 0.5 1 1\nmap_Kd red.png\n"))
    assert mesh.textures[0].shape == (5, 3, 4)
    assert mesh.texture_ids.tolist() == [0]
    assert mesh.colors[0, 0] == 0.5


def test_a_missing_texture_shows_the_colour(tmp_path):
    mesh = read_textured_obj(obj(tmp_path, "newmtl a\nKd 0 1 0\nmap_Kd nowhere.png\n"))
    assert mesh.texture_ids.tolist() == [-1]
    assert mesh.colors[0].tolist() == [0, 1, 0, 1]


def test_a_broken_line_is_named(tmp_path):
    path = tmp_path / "m.obj"
    path.write_text("v 0 0 0\nf 1 2 3\n")
    with pytest.raises(TilestampError, match=r"m\.obj:2"):
        read_textured_obj(path)


def test_a_triangle_with_a_nan_vertex_is_not_drawn():
    points = np.ones((4, 4), np.float32)
    points[3, 0] = np.nan
    mesh = geometry(Scene("s", mesh=Mesh(points, np.array([[0, 1, 3], [0, 1, 2]], np.int32))))
    assert mesh.ids.tolist() == [1]


def test_nan_coordinates_show_the_base_colour():
    uvs = np.full((3, 2), np.nan, np.float32)
    mesh = Mesh(
        np.ones((3, 4), np.float32), np.array([[0, 1, 2]], np.int32), uvs=uvs, texture_ids=np.zeros(1, np.int32)
    )
    assert geometry(Scene("s", mesh=mesh)).texture_ids.tolist() == [-1]


def test_a_scene_without_triangles_is_refused():
    with pytest.raises(TilestampError, match="neither patches nor triangles"):
        geometry(Scene("empty"))


@pytest.mark.parametrize(
    ("name", "triangles"), [("2CylinderEngine", 121_496), ("CesiumMilkTruck", 3_624), ("Duck", 4_212)]
)
def test_the_models_have_the_published_triangles(shared, name, triangles):
    assert len(read_gltf(shared / "scenes" / "triangles" / f"{name}.glb").triangles) == triangles
