"""Every reader, on files cut off and changed at random: a scene or a sentence, never a traceback."""

import base64
import json
import random

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.reader_files import CORNERS, FACES, PLY, SQUARE, TEXTURED, gltf, stl
from tilestamp.models.errors import TilestampError
from tilestamp.simulator.scenes import load_scene

CALM = settings(  # 40 cases of each of the 13 kinds of file
    max_examples=40, deadline=None, derandomize=True, database=None, suppress_health_check=list(HealthCheck)
)
MANY = 10_000  # of all kinds together in the benchmark
WORDS = [
    b"-1",
    b"99999999999999999999",
    b"nan",
    b"1e999",
    b"\\\n",
    b"#",
    b"/",
    b"{",
    b"[",
    b'"',
    b"\0",
    b"\xff" * 4,
    b" ",
    b"\n",
]


def glb():
    text = json.dumps(gltf()).encode()
    return b"glTF" + np.array([2, 20 + len(text), len(text)], "<u4").tobytes() + b"JSON" + text


def npz(folder):
    np.savez(folder / "seed.npz", positions=np.eye(4, dtype=np.float32)[:3], triangles=np.int32([[0, 1, 2]]))
    return (folder / "seed.npz").read_bytes()


POINTS = "".join(f"{i},0,0\n" for i in range(16))
SEEDS = {
    "a.obj": (SQUARE + "v 0 0 0 1 1 1\ns 1\nl 1 2\nusemtl m\nf 1 2 3 4\nf -1//1 -2 -3 \\\n-4 # x\nvn 0 0 1\n").encode(),
    "textured.obj": ("mtllib m.mtl\n" + SQUARE + TEXTURED + "f 1/1/1 2/2/1 3/3 4/4\nvn 0 0 1\n").encode(),
    "a.mtl": b"newmtl m\nKd 1 0.5 0\nd -halo 0.5\nTr 0.5\nmap_Kd -s 1 1 1 m.png\nKs 1\n",
    "a.ply": (PLY + FACES + CORNERS + "4 0 1 2 3\n").encode(),
    "b.ply": (PLY.replace("ascii", "binary_big_endian") + FACES).encode() + bytes(48) + b"\3" + bytes(12),
    "a.off": ("COFF\n4 2 0\n" + CORNERS.replace("0\n", "0 9 9 9 9\n") + "4 0 1 2 3\n3 0 1 2 1 0 0\n").encode(),
    "a.stl": stl(2, 2),
    "b.stl": b"solid a\nfacet normal 0 0 1\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendfacet\nendsolid a\n",
    "a.bpt": ("1\n" + ",".join(str(i + 1) for i in range(16)) + "\n16\n" + POINTS).encode(),
    "b.bpt": b"1\n3 3\n" + b"0 0 0\n" * 16,
    "a.gltf": json.dumps(gltf()).encode(),
    "a.glb": glb(),
}


def mutated(seed, chance):
    """Cut, overwrite, insert or repeat, once to four times."""
    data = bytearray(seed)
    for _ in range(chance.randint(1, 4)):
        at = chance.randint(0, len(data))
        end = at + chance.randint(0, 12)
        kind = chance.randint(0, 4)
        if kind == 0:
            del data[at:]
        elif kind == 1:
            data[at:end] = chance.choice(WORDS)
        elif kind == 2:
            data[at:end] = chance.randbytes(end - at)
        elif kind == 3:
            del data[at:end]
        else:
            data[at:at] = data[at : at + 40]
    return bytes(data)


def try_to_load(folder, name, data):
    (folder / "m.mtl").write_bytes(data if name == "a.mtl" else SEEDS["a.mtl"])
    path = folder / ("textured.obj" if name == "a.mtl" else name)
    path.write_bytes(SEEDS["textured.obj"] if name == "a.mtl" else data)
    for kind in (None, "patches") if path.suffix == ".obj" else (None,):
        try:
            load_scene(path, kind=kind)
        except TilestampError as error:
            assert error.__cause__ is None  # noqa: PT017 - a sentence of the reader's own


@pytest.mark.parametrize("name", [*SEEDS, "a.npz"])
def test_a_mutated_file_gives_a_scene_or_a_sentence(name, tmp_path):
    seed = npz(tmp_path) if name == "a.npz" else SEEDS[name]

    @settings(CALM)
    @given(st.integers(0, 2**32))
    def one(number):
        try_to_load(tmp_path, name, mutated(seed, random.Random(number)))  # noqa: S311 - no secret

    one()


@pytest.mark.parametrize("name", [*SEEDS, "a.npz"])
def test_many_mutated_files_give_scenes_or_sentences(name, tmp_path, benchmark):
    seed = npz(tmp_path) if name == "a.npz" else SEEDS[name]
    chance = random.Random(2026)  # noqa: S311 - no secret

    def run():
        for _ in range(MANY // (len(SEEDS) + 1) + 1):
            try_to_load(tmp_path, name, mutated(seed, chance))

    benchmark.pedantic(run, rounds=1)


@pytest.mark.parametrize(
    "tree",
    [
        {"nodes": "x"},
        {"meshes": {}},
        {"accessors": [None] * 4},
        {"nodes": [{"mesh": 0, "children": 3}]},
        {"nodes": [{"mesh": 0.5}]},
        {"nodes": [{"mesh": 0, "scale": [1]}]},
        {"nodes": [[]]},
        {"scene": "one"},
        {"scenes": [3]},
        {"scenes": [{"nodes": [[]]}]},
        {"materials": 5},
        {"buffers": [{"uri": 5}]},
        {"bufferViews": [{"buffer": 0, "byteOffset": -5, "byteLength": 48}]},
        {"bufferViews": [{"buffer": 0, "byteLength": 48, "byteStride": 10**30}]},
        {"extensionsRequired": 5},
        {"asset": []},
    ],
)
def test_gltf_values_of_another_kind_give_a_sentence(tree, tmp_path):
    try_to_load(tmp_path, "a.gltf", json.dumps({**gltf(), **tree}).encode())


@pytest.mark.parametrize(
    "text", ["[" * 100_000, '{"asset": ' * 5000, "1" * 5000, '{"asset": {"version": "2.0"}, "scene": 1e999}']
)
def test_json_that_is_deep_or_large_gives_a_sentence(text, tmp_path):
    try_to_load(tmp_path, "a.gltf", text.encode())


def test_a_data_uri_that_is_no_base64_gives_a_sentence(tmp_path):
    data = base64.b64encode(b"x" * 9).decode()[:-3]
    try_to_load(tmp_path, "a.gltf", json.dumps({**gltf(), "buffers": [{"uri": "data:;base64," + data}]}).encode())
