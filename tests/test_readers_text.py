"""Readers of scenes, what trips others over and what is left out: numbers, lines, OBJ, materials."""

import json
import re

import pytest

from tests.reader_files import CORNERS, FACES, MARK, PLY, SQUARE, TEXTURED, gltf, png
from tilestamp.models.errors import TilestampError
from tilestamp.simulator.scenes.text_scan import Row, scan

# Numbers and lines


@pytest.mark.parametrize(
    "word", ["0.1", "1e-3", "123456789.123456789", "1e23", "9007199254740993", "-.5", "5.", "+2E+05", "1e400", "0"]
)
def test_decimals_are_converted_as_python_does(word, tmp_path):
    assert scan(tmp_path, f"v {word} 0 0".encode()).values[0] == float(word)


@pytest.mark.parametrize("word", ["one", "1,5", "1_0", "1e", "--1", "0x10", "1.2.3"])
def test_words_that_are_no_numbers_are_found(word, tmp_path):
    found = scan(tmp_path, f"v {word} 0 0".encode())
    with pytest.raises(TilestampError, match=":1: why"):
        found.table(Row.V, 3, 3, "why")


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_lines_end_as_any_system_ends_them(end, load):
    assert len(load("a.obj", (SQUARE + "f 1 2 \\\n3 4\n").replace("\n", end)).mesh.triangles) == 2


def test_a_line_after_continued_ones_keeps_its_number(load):
    with pytest.raises(TilestampError, match=r"a\.obj:7: "):
        load("a.obj", SQUARE + "f 1 \\\n2 3\nf 1 2 9\n")


def test_a_backslash_ends_no_comment_late(load):
    assert len(load("a.obj", "# folder\\\n" + SQUARE + "f 1 2 3\n").mesh.positions) == 4


@pytest.mark.parametrize("marked", [lambda text: MARK + text.encode(), lambda text: text.encode("utf-16")])
@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.obj", SQUARE + "f 1 2 3 4\n"),
        ("a.ply", PLY + FACES + CORNERS + "4 0 1 2 3\n"),
        ("a.off", "OFF\n4 1 0\n" + CORNERS + "4 0 1 2 3\n"),
        ("a.stl", "solid\n" + ("facet normal 0 0 1\n" + "vertex 0 0 0\n" * 3 + "endfacet\n") * 2 + "endsolid"),
    ],
)
def test_a_byte_order_mark_is_no_content(name, text, marked, load):
    assert len(load(name, marked(text)).mesh.triangles) == 2


def test_a_byte_order_mark_of_materials_patches_and_gltf(load, tmp_path):
    points = "".join(f"{i},0,0\n" for i in range(16))
    numbers = ",".join(str(i + 1) for i in range(16))
    assert load("a.bpt", MARK + f"1\n{numbers}\n16\n{points}".encode()).patches is not None
    scene = load("a.obj", SQUARE + "mtllib a.mtl\nusemtl m\nf 1 2 3\n", a__mtl=MARK + b"newmtl m\nKd 1 0 0\n")
    assert scene.mesh.colors[0].tolist() == [1, 0, 0, 1]
    assert len(load("a.gltf", MARK + json.dumps(gltf()).encode()).mesh.triangles) == 1


# OBJ and its materials


def test_comments_may_follow_a_statement(load):
    scene = load("a.obj", SQUARE + "f 1 2 3 # front\nf 1 3 4# back\n")
    assert (len(scene.mesh.triangles), scene.note) == (2, "")


def test_one_line_may_name_several_libraries(load):
    text = "mtllib other.mtl red.mtl\n" + SQUARE + "usemtl red\nf 1 2 3\n"
    scene = load("a.obj", text, other__mtl="newmtl blue\nKd 0 0 1\n", red__mtl="newmtl red\nKd 1 0 0\n")
    assert scene.mesh.colors[0].tolist() == [1, 0, 0, 1]


def test_a_librarys_name_may_have_spaces(load):
    text = "mtllib my red.mtl\n" + SQUARE + "usemtl red\nf 1 2 3\n"
    assert load("a.obj", text, **{"my red.mtl": "newmtl red\nKd 1 0 0\n"}).mesh.colors[0].tolist() == [1, 0, 0, 1]


@pytest.mark.parametrize(
    ("material", "color"),
    [
        ("Kd 0.5", [0.5, 0.5, 0.5, 1]),
        ("Kd spectral a.rfl", [1, 1, 1, 1]),
        ("d -halo 0.5", [1, 1, 1, 0.5]),
        ("Tr 0.25", [1, 1, 1, 0.75]),
        ("Kd 1 0 0 # red", [1, 0, 0, 1]),
        ("Kd 1 0 \\\n0", [1, 0, 0, 1]),
    ],
)
def test_materials_in_every_legal_form(material, color, load):
    text = "mtllib a.mtl\n" + SQUARE + "usemtl m\nf 1 2 3\n"
    assert load("a.obj", text, a__mtl=f"newmtl m\n{material}\n").mesh.colors[0].tolist() == color


def test_a_material_whose_name_has_a_number_sign_is_itself(load):
    library = "newmtl M #1\nKd 1 0 0\nnewmtl M #2\nKd 0 1 0\n"
    scene = load("a.obj", "mtllib a.mtl\n" + SQUARE + "usemtl M #1\nf 1 2 3\n", a__mtl=library)
    assert scene.mesh.colors[0].tolist() == [1, 0, 0, 1]


def test_a_comment_may_follow_a_materials_name(load):
    scene = load("a.obj", "mtllib a.mtl\n" + SQUARE + "usemtl m\nf 1 2 3\n", a__mtl="newmtl m # skin\nKd 1 0 0\n")
    assert scene.mesh.colors[0].tolist() == [1, 0, 0, 1]


@pytest.mark.parametrize(
    ("file", "name"),
    [
        ("my tex.png", "my tex.png"),
        ("my tex.png", '"my tex.png"'),
        ("tex.png", "-s 2 2 1 -clamp on tex.png"),
        ("sub/tex.png", "sub\\tex.png"),
        ("lib/tex.png", "tex.png"),
        ("tex.png", "tex.png # skin"),
    ],
)
def test_a_textures_file_is_found(file, name, load, tmp_path):
    (tmp_path / file).parent.mkdir(exist_ok=True)
    png(tmp_path / file)
    others = {"lib/a.mtl": f"newmtl m\nmap_Kd {name}\n"}
    assert len(load("a.obj", "mtllib lib/a.mtl\n" + SQUARE + TEXTURED, **others).mesh.textures) == 1


def test_textured_faces_may_come_before_their_vertices(load, tmp_path):
    png(tmp_path / "t.png")
    text = "mtllib a.mtl\nusemtl m\nf 1/1 2/2 3/3\n" + SQUARE + "vt 0 0\nvt 1 0\nvt 1 1\n"
    mesh = load("a.obj", text, a__mtl="newmtl m\nmap_Kd t.png\n").mesh
    assert mesh.uvs[mesh.triangles[0]].tolist() == [[0, 1], [1, 1], [1, 0]]


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("l 1 2\nf 1 2 3\n", r"l \(1\)"),
        ("t crease 2/1/0 0 1 10.0\nf 1 2 3\n", "crease tags"),
        ("s 1\nf 1 2 3\n", r"s \(1\)"),
        ("vn 0 0 1\nf 1//1 2//1 3//1\n", "normals"),
        ("mtllib no.mtl\nf 1 2 3\n", "no.mtl is not there"),
        ("usemtl gold\nf 1 2 3\n", "gold"),
        ("v 0 0 0 1 0 0\nf 1 2 3\n", "colours of 1 of 5 vertices"),
        ("v 0 0 0 0.5\nf 1 2 3\n", "weight"),
    ],
)
def test_what_an_obj_file_has_beside_is_named(text, word, load):
    assert re.search(word, load("a.obj", SQUARE + text).note)


def test_a_plain_obj_file_has_no_note(load):
    text = "mtllib a.mtl\no it\ng part\n" + SQUARE + "vt 0 0\nusemtl m\nf 1/1 2/1 3/1\n"
    assert load("a.obj", text, a__mtl="newmtl m\nKd 1 0 0\n").note == ""


@pytest.mark.parametrize(
    ("material", "word"),
    [
        ("map_Kd no.png", "no.png is not there"),
        ("Kd spectral a.rfl", "spectral"),
        ("d -halo 0.5", "halo"),
        ("Ks 1 1 1\nbump b.png", "Ks, bump"),
        ("map_Kd -clamp on t.png", "-clamp"),
    ],
)
def test_what_a_material_has_beside_is_named(material, word, load):
    assert word in load("a.obj", "mtllib a.mtl\n" + SQUARE + TEXTURED, a__mtl=f"newmtl m\n{material}\n").note
