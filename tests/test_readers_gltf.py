"""Readers of scenes, what trips others over and what is left out: glTF."""

import base64
import json

import numpy as np
import pytest

from tests.reader_files import POINTS, gltf, png
from tilestamp.models.errors import TilestampError


def textured(tree, info, **texture):
    tree["meshes"][0]["primitives"][0]["material"] = 0
    tree["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, **info}}}]
    tree["textures"] = [{"source": 0, **texture}]
    tree["images"] = [{"uri": "my%20tex.png"}]


@pytest.fixture
def load_gltf(load, tmp_path):
    def loaded(change=None):
        png(tmp_path / "my tex.png")
        return load("a.gltf", json.dumps(gltf(change)))

    return loaded


@pytest.mark.parametrize(("mode", "triangles"), [(5, [[0, 1, 2], [1, 3, 2]]), (6, [[0, 1, 2], [0, 2, 3]])])
def test_strips_and_fans_are_drawn_beside_lists(mode, triangles, load_gltf):
    def change(tree):
        tree["meshes"][0]["primitives"].append({"attributes": {"POSITION": 0}, "mode": mode})

    mesh = load_gltf(change).mesh
    assert mesh.triangles.tolist() == [[0, 1, 2], *(np.array(triangles) + 4).tolist()]
    assert mesh.draws.tolist() == [[4, 1], [4, 2]]


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (lambda t: t["meshes"][0]["primitives"].append({"attributes": {"POSITION": 0}, "mode": 1}), "lines"),
        (lambda t: t["meshes"][0]["primitives"].append({"attributes": {"POSITION": 0}, "mode": 0}), "points"),
        (lambda t: t.update(animations=[{}]), "animations"),
        (lambda t: t["nodes"][0].update(skin=0), "skins"),
        (lambda t: t["meshes"][0]["primitives"][0].update(targets=[{}]), "morph"),
        (lambda t: (textured(t, {}, sampler=0), t.update(samplers=[{"wrapS": 33071}])), "clamp"),
        (lambda t: (textured(t, {}, sampler=0), t.update(samplers=[{"wrapT": 33648}])), "mirror"),
        (lambda t: textured(t, {"texCoord": 2}), "TEXCOORD_2"),
        (lambda t: t.update(materials=[{"alphaMode": "BLEND"}]) or use_material(t), "alphaMode"),
        (lambda t: t.pop("scenes"), "no scene"),
        (lambda t: t["meshes"][0]["primitives"].append({"attributes": {"POSITION": 0}}), "last one or two corners"),
    ],
)
def test_what_a_gltf_file_has_beside_is_named(change, word, load_gltf):
    def changed(tree):
        tree["meshes"][0]["primitives"].insert(0, {"attributes": {"POSITION": 0}, "indices": 3})
        tree["meshes"][0]["primitives"].reverse()
        change(tree)

    assert word in load_gltf(changed).note


def use_material(tree):
    tree["meshes"][0]["primitives"][0]["material"] = 0


def test_a_plain_gltf_file_has_no_note(load_gltf):
    assert load_gltf(lambda tree: textured(tree, {})).note == ""


@pytest.mark.parametrize(
    ("info", "first", "second"),
    [
        ({}, [0, 0], [1, 0]),
        ({"texCoord": 1}, [0.25, 0.5], [0.25, 0.5]),
        ({"extensions": {"KHR_texture_transform": {"offset": [0.5, 0.25], "scale": [2, 1]}}}, [0.5, 0.25], [2.5, 0.25]),
        ({"extensions": {"KHR_texture_transform": {"rotation": np.pi / 2, "offset": [0, 1]}}}, [0, 1], [0, 0]),
        ({"extensions": {"KHR_texture_transform": {"texCoord": 1}}}, [0.25, 0.5], [0.25, 0.5]),
    ],
)
def test_texture_coordinates_are_those_that_the_texture_names(info, first, second, load_gltf):
    mesh = load_gltf(lambda tree: textured(tree, info)).mesh
    np.testing.assert_allclose(mesh.uvs[:2], [first, second], atol=1e-6)
    assert mesh.textures[0][0, 0].tolist() == [255, 0, 0, 255]


def test_without_scenes_every_root_is_drawn_once(load_gltf):
    def change(tree):
        del tree["scenes"]
        tree["nodes"] = [{"children": [1], "translation": [10, 0, 0]}, {"mesh": 0, "translation": [0, 5, 0]}]

    assert load_gltf(change).mesh.positions[:4, :3].tolist() == np.add(POINTS, [10, 5, 0]).tolist()


def test_a_tree_of_5000_nodes_is_walked(load_gltf):
    def change(tree):
        tree["nodes"] = [{"children": [k + 1], "translation": [1, 0, 0]} for k in range(5000)] + [{"mesh": 0}]

    assert load_gltf(change).mesh.positions[0, 0] == 5000


def test_nodes_that_double_at_each_level_are_refused(load_gltf):
    def change(tree):
        tree["nodes"] = [{"children": [k + 1, k + 1]} for k in range(60)] + [{"mesh": 0}]

    with pytest.raises(TilestampError, match="two parents"):
        load_gltf(change)


def test_quantized_positions_are_read(load_gltf):
    def change(tree):
        tree["extensionsRequired"] = tree["extensionsUsed"] = ["KHR_mesh_quantization"]
        data = np.int16([[0, 0, 0], [32767, 0, 0], [0, -32768, 0]]).tobytes()
        tree["buffers"].append({"byteLength": 18, "uri": "data:;base64," + base64.b64encode(data).decode()})
        tree["bufferViews"].append({"buffer": 1, "byteLength": 18})
        place = {"bufferView": 3, "componentType": 5122, "count": 3, "type": "VEC3", "normalized": True}
        tree["accessors"].append(place)
        tree["meshes"][0]["primitives"][0] = {"attributes": {"POSITION": 4}}

    assert load_gltf(change).mesh.positions[:, :3].tolist() == [[0, 0, 0], [1, 0, 0], [0, -1, 0]]


def test_a_sparse_accessor_is_filled_in(load_gltf):
    def change(tree):
        places = {"bufferView": 2, "byteOffset": 2, "componentType": 5123}  # the number 1
        tree["accessors"][0]["sparse"] = {"count": 1, "indices": places, "values": {"bufferView": 1, "byteOffset": 24}}

    assert load_gltf(change).mesh.positions[1, :3].tolist() == [1, 1, 0.25]


def test_a_view_ends_where_it_says(load_gltf):
    with pytest.raises(TilestampError, match="accessor 0"):
        load_gltf(lambda tree: tree["bufferViews"][0].update(byteLength=36))
