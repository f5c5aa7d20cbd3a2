"""Readers of scenes: legal files that others trip over are read, and what is left out is said (`Scene.note`)."""

import base64
import json
import re
import struct
import zlib

import numpy as np
import pytest
from PIL import Image

from tilestamp.models.errors import TilestampError
from tilestamp.simulator.scenes import load_scene
from tilestamp.simulator.scenes.images import read_image
from tilestamp.simulator.scenes.polygons import triangulate
from tilestamp.simulator.scenes.text_scan import Row, scan

SQUARE = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\n"
TEXTURED = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3\n"
MARK = b"\xef\xbb\xbf"
PLY = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
FACES = "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
CORNERS = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n"


@pytest.fixture
def load(tmp_path):
    """Write files, the last of them the scene, and load it."""

    def loaded(name, content, **others):
        for other, text in {**others, name: content}.items():
            path = tmp_path / other.replace("__", ".")
            path.parent.mkdir(exist_ok=True)
            path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return load_scene(tmp_path / name)

    return loaded


def png(path, color=(255, 0, 0)):
    Image.new("RGB", (2, 2), color).save(path)


def area(mesh):
    a, b, c = (mesh.positions[mesh.triangles[:, k], :3].astype(float) for k in range(3))
    return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2


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


# Polygons


@pytest.mark.parametrize("kind", ["obj", "ply", "off"])
@pytest.mark.parametrize("turn", range(5))
def test_a_concave_polygon_covers_its_area(kind, turn, load):
    face = [(k + turn) % 5 for k in (3, 4, 0, 1, 2)]
    points = ["0 0 0", "4 0 0", "4 4 0", "0 4 0", "3 2 0"]
    points = [points[k] for k in (4, 0, 1, 2, 3)]  # the notch is the first vertex
    texts = {
        "obj": "".join(f"v {point}\n" for point in points) + "f " + " ".join(str(k + 1) for k in face),
        "ply": PLY.replace("4", "5") + FACES + "\n".join(points) + "\n5 " + " ".join(map(str, face)),
        "off": "OFF 5 1 0\n" + "\n".join(points) + "\n5 " + " ".join(map(str, face)),
    }
    mesh = load(f"a.{kind}", texts[kind]).mesh
    assert area(mesh) == pytest.approx(10)
    assert len(mesh.triangles) == 3


@pytest.mark.parametrize("turn", range(4))
@pytest.mark.parametrize("plane", [(0, 1, 2), (1, 2, 0), (2, 0, 1), (1, 0, 2)])
def test_an_arrow_is_cut_at_its_notch(turn, plane):
    points = np.array([[0, 0, 0], [4, 4, 0], [0, 1, 0], [-4, 4, 0]], float)[:, plane]
    corners = np.roll(np.arange(4), turn)
    cut, polygon = triangulate(points, corners, np.array([4]))
    a, b, c = (points[corners[cut[:, k]]] for k in range(3))
    normals = np.cross(b - a, c - a)
    assert np.linalg.norm(normals, axis=1).sum() / 2 == pytest.approx(4)
    assert (normals @ normals[0] > 0).all()
    assert polygon.tolist() == [0, 0]


def test_a_concave_polygon_keeps_its_winding():
    points = np.array([[0, 0, 0], [4, 0, 0], [4, 4, 0], [3, 2, 0], [0, 4, 0]], float)[::-1]
    corners = np.array([1, 2, 3, 4, 0])
    cut, _ = triangulate(points, corners, np.array([5]))
    a, b, c = (points[corners[cut[:, k]]] for k in range(3))
    assert (np.cross(b - a, c - a)[:, 2] < 0).all()


def test_polygons_after_a_concave_one_keep_their_place():
    points = np.array([[0, 0, 0], [4, 4, 0], [0, 1, 0], [-4, 4, 0]], float)
    corners = np.array([0, 1, 2, 1, 2, 3, 0, 0, 1, 2])
    cut, polygon = triangulate(points, corners, np.array([3, 4, 3]))
    assert corners[cut[[0, 3]]].tolist() == [[0, 1, 2], [0, 1, 2]]
    assert polygon.tolist() == [0, 1, 1, 2]


# PLY


@pytest.mark.parametrize("count", ["uchar", "int"])
@pytest.mark.parametrize("order", ["<", ">"])
def test_binary_faces_of_all_sizes_come_in_the_files_order(order, count, load):
    name = "little" if order == "<" else "big"
    head = PLY.replace("ascii", f"binary_{name}_endian") + FACES.replace("face 1", "face 3").replace("uchar", count)
    body = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], f"{order}f4").tobytes()
    for face in ([0, 1, 2], [0, 1, 2, 3], [3, 2, 1]):
        size = np.array(len(face), "u1" if count == "uchar" else f"{order}i4")
        body += size.tobytes() + np.array(face, f"{order}i4").tobytes()
    mesh = load("a.ply", head.encode() + body).mesh
    assert mesh.triangles.tolist() == [[0, 1, 2], [0, 1, 2], [0, 2, 3], [3, 2, 1]]


def test_quads_of_a_text_ply_come_in_the_files_order(load):
    text = PLY + FACES.replace("face 1", "face 2") + CORNERS + "4 0 1 2 3\n4 3 2 1 0\n"
    assert load("a.ply", text).mesh.triangles.tolist() == [[0, 1, 2], [0, 2, 3], [3, 2, 1], [3, 1, 0]]


def test_a_comment_may_come_before_the_format(load):
    text = (PLY + FACES + CORNERS + "3 0 1 2\n").replace("ply\n", "ply\ncomment made by hand\n", 1)
    assert len(load("a.ply", text).mesh.triangles) == 1


def test_a_ply_one_face_short_is_refused_with_both_numbers(load):
    with pytest.raises(TilestampError, match="after 1 of 2 rows of face"):
        load("a.ply", PLY + FACES.replace("face 1", "face 2") + CORNERS + "3 0 1 2\n")


def test_a_ply_that_says_more_than_it_has_costs_no_memory(load):
    with pytest.raises(TilestampError, match="of 999999999999 rows"):
        load("a.ply", PLY + FACES.replace("face 1", "face 999999999999") + CORNERS)


@pytest.mark.parametrize(("kind", "white"), [("uchar", 255), ("ushort", 65535), ("float", 1)])
def test_colours_of_a_ply_are_read_by_their_type(kind, white, load):
    colors = "".join(f"property {kind} {name}\n" for name in ("red", "green", "blue"))
    rows = CORNERS.replace("0\n", f"0 {white} 0 0\n")
    assert load("a.ply", PLY + colors + FACES + rows + "3 0 1 2\n").mesh.colors[0].tolist() == [1, 0, 0, 1]


def test_face_colours_of_polygons_reach_all_their_triangles(load):
    face = FACES.replace("end_header", "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header")
    mesh = load("a.ply", PLY + face + CORNERS + "4 0 1 2 3 0 255 0\n").mesh
    assert (mesh.colors[mesh.triangles] == [0, 1, 0, 1]).all()


def test_strips_of_a_ply_are_drawn(load):
    strips = "element tristrips 1\nproperty list int int vertex_indices\nend_header\n"
    mesh = load("a.ply", PLY + strips + CORNERS + "8 0 1 3 2 -1 2 1 0\n").mesh
    assert mesh.triangles.tolist() == [[0, 1, 3], [1, 2, 3], [2, 1, 0]]


def test_what_a_ply_has_beside_is_named(load):
    text = PLY + "property float quality\n" + FACES + CORNERS.replace("0\n", "0 7\n") + "3 0 1 2\n"
    assert "vertex.quality" in load("a.ply", text).note


# OFF


@pytest.mark.parametrize("color", ["255 0 0 255", "1.0 0 0 1.0", "255 0 0"])
def test_vertex_colours_of_an_off_are_read(color, load):
    text = "COFF\n3 1 0\n" + "".join(f"{x} {color}\n" for x in ("0 0 0", "1 0 0", "0 1 0")) + "3 0 1 2\n"
    assert load("a.off", text).mesh.colors.tolist() == [[1, 0, 0, 1]] * 3


def test_face_colours_of_an_off_are_read(load):
    text = "OFF\n# a comment\n4 2 0\n" + CORNERS + "3 0 1 2 0 255 0\n3 0 2 3 0 0 255 51\n"
    mesh = load("a.off", text).mesh
    np.testing.assert_allclose(mesh.colors[mesh.triangles[:, 0]], [[0, 1, 0, 1], [0, 0, 1, 0.2]])


def test_normals_of_an_off_are_read(load):
    text = "NOFF 3 1 0\n0 0 0 0 0 -2\n1 0 0 0 0 -2\n0 1 0 0 0 -2\n3 0 1 2\n"
    assert load("a.off", text).mesh.normals.tolist() == [[0, 0, -1]] * 3


def test_quads_of_an_off_come_in_the_files_order(load):
    text = "OFF\n4 2 0\n" + CORNERS + "4 0 1 2 3\n4 3 2 1 0\n"
    assert load("a.off", text).mesh.triangles.tolist() == [[0, 1, 2], [0, 2, 3], [3, 2, 1], [3, 1, 0]]


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("OFF\n4 2 0\n" + CORNERS + "3 0 1 2\n", "says 4 vertices and 2 faces, but ends after 4 vertices and 1 faces"),
        ("OFF BINARY\n", "binary OFF"),
        ("4nOFF\n", "n-dimensional"),
        ("OFF\n4 1 0\n" + CORNERS + "4 0 1 2\n", r":7: a face of 4 corners has 3 numbers"),
    ],
)
def test_an_off_that_cannot_be_read_says_why(text, sentence, load):
    with pytest.raises(TilestampError, match=sentence):
        load("a.off", text)


# STL


def stl(count, facets, *, header=b"", attribute=0):
    facet = struct.pack("<12fH", 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, attribute)
    return header.ljust(80, b"\0") + struct.pack("<I", count) + facet * facets


def test_a_binary_stl_may_start_with_solid(load):
    assert len(load("a.stl", stl(2, 2, header=b"solid part")).mesh.triangles) == 2


@pytest.mark.parametrize(("count", "facets"), [(1, 2), (3, 2), (2**32 - 1, 2)])
def test_a_binary_stl_of_wrong_length_says_both(count, facets, load):
    with pytest.raises(
        TilestampError, match=rf"{count} triangles would have {84 + 50 * count} bytes, but there are 184"
    ):
        load("a.stl", stl(count, facets))


def test_attributes_of_a_binary_stl_are_named(load):
    assert "attributes" in load("a.stl", stl(1, 1, attribute=7)).note


def test_a_text_stl_cut_short_is_refused(load):
    text = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n"
    with pytest.raises(TilestampError, match="1 facets begin, 0 end, and they have 2 vertices"):
        load("a.stl", text)


# Bezier patches


def test_headed_patches_of_lower_degree_are_raised(load):
    points = "".join(f"{x} {y} 0\n" for y in (0, 3) for x in (0, 3))
    net = load("a.bpt", "1\n1 1\n" + points).patches.points.reshape(4, 4, 4)
    np.testing.assert_allclose(net[..., 0], np.tile([0, 1, 2, 3], (4, 1)), atol=1e-6)
    np.testing.assert_allclose(net[..., 1], np.tile([[0], [1], [2], [3]], (1, 4)), atol=1e-6)


def test_a_headed_patch_may_have_two_degrees(load):
    net = load("a.bpt", "1\n1 2\n0 0 0\n1 0 0\n2 0 0\n0 3 0\n1 3 0\n2 3 0\n").patches.points.reshape(4, 4, 4)
    np.testing.assert_allclose(net[:, 0, 1], [0, 1, 2, 3], atol=1e-6)
    np.testing.assert_allclose(net[0, :, 0], [0, 2 / 3, 4 / 3, 2], atol=1e-6)


def test_headed_patches_of_degree_three_are_as_they_stand(load):
    points = "".join(f"{i} {2 * i} {3 * i}\n" for i in range(16))
    patches = load("a.bpt", "2\n" + ("3 3\n" + points) * 2).patches.points
    assert patches.tolist() == [[[i, 2 * i, 3 * i, 1] for i in range(16)]] * 2


def test_a_headed_patch_of_higher_degree_is_named(load):
    with pytest.raises(TilestampError, match=r"a\.bpt:19: the degrees \(1 to 3\) of patch 2"):
        load("a.bpt", "2\n3 3\n" + "0 0 0\n" * 16 + "5 3\n" + "0 0 0\n" * 24)


# Images


def test_grey_of_16_bits_is_scaled():
    png16 = np.array([[0x4000, 0x8000, 0xFFFF]], np.uint16)
    data = encoded(3, 1, 16, 0, png16.astype(">u2").tobytes())
    assert read_image(data, "it")[0].tolist() == [[64, 64, 64, 255], [128, 128, 128, 255], [255, 255, 255, 255]]


def encoded(width, height, bits, kind, row, *chunks):
    """Give a PNG of one row, by the specification."""

    def chunk(name, body):
        return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))

    head = struct.pack(">IIBBBBB", width, height, bits, kind, 0, 0, 0)
    extra = b"".join(chunk(*one) for one in chunks)
    return (
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", head)
        + extra
        + chunk(b"IDAT", zlib.compress(b"\0" + row))
        + chunk(b"IEND", b"")
    )


@pytest.mark.parametrize(
    ("bits", "kind", "row", "chunks"),
    [
        (16, 0, b"\x40\x00\x80\x00", [(b"tRNS", b"\x80\x00")]),
        (8, 0, b"\x40\x80", [(b"tRNS", b"\0\x80")]),
        (8, 3, b"\0\1", [(b"PLTE", bytes([64, 64, 64, 128, 128, 128])), (b"tRNS", b"\xff\0")]),
        (8, 2, b"\x40\x40\x40\x80\x80\x80", [(b"tRNS", b"\0\x80\0\x80\0\x80")]),
        (16, 2, b"\x40\0\x40\0\x40\0\x80\0\x80\0\x80\0", [(b"tRNS", b"\x80\0\x80\0\x80\0")]),
        (8, 4, b"\x40\xff\x80\0", []),
    ],
)
def test_transparency_of_every_kind_of_png(bits, kind, row, chunks):
    image = read_image(encoded(2, 1, bits, kind, row, *chunks), "it")
    assert image[0, :, 0].tolist() == [64, 128]
    assert image[0, :, 3].tolist() == [255, 0]


def test_an_image_too_large_to_decode_is_a_sentence():
    with pytest.raises(TilestampError, match=r"not an image that can be read .*pixels"):
        read_image(encoded(40000, 40000, 8, 0, b""), "it")


# glTF

POINTS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], np.float32)
UVS = np.array([[[0, 0], [1, 0], [0, 1], [1, 1]], [[0.25, 0.5]] * 4], np.float32)


def gltf(change=None):
    """Four points, drawn as a list of their first three; ``change`` edits the tree."""
    data = POINTS.tobytes() + UVS.tobytes() + np.array([0, 1, 2], np.uint16).tobytes()
    accessor = {"componentType": 5126, "count": 4}
    tree = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1, "TEXCOORD_1": 2}, "indices": 3}]}],
        "accessors": [
            {**accessor, "bufferView": 0, "type": "VEC3"},
            {**accessor, "bufferView": 1, "type": "VEC2"},
            {**accessor, "bufferView": 1, "byteOffset": 32, "type": "VEC2"},
            {"bufferView": 2, "componentType": 5123, "count": 3, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 64},
            {"buffer": 0, "byteOffset": 112, "byteLength": 6},
        ],
        "buffers": [{"byteLength": len(data), "uri": "data:;base64," + base64.b64encode(data).decode()}],
    }
    if change:
        change(tree)
    return tree


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


# All kinds


def test_arrays_that_are_not_read_are_named(tmp_path):
    corners = np.float32([[-1, -1, 0, 1], [1, -1, 0, 1], [0, 1, 0, 1]])
    np.savez(tmp_path / "a.npz", positions=corners, triangles=np.int32([[0, 1, 2]]), colors=corners)
    assert "colors" in load_scene(tmp_path / "a.npz").note


def test_a_kind_that_needs_a_module_names_the_extra(tmp_path, monkeypatch):
    import trimesh

    def missing(*_, **__):
        raise ModuleNotFoundError("No module named 'lxml'", name="lxml")

    monkeypatch.setattr(trimesh, "load_scene", missing)
    (tmp_path / "a.3mf").write_bytes(b"PK")
    with pytest.raises(TilestampError, match=r"needs a module .*lxml.*: install tilestamp\[formats\]"):
        load_scene(tmp_path / "a.3mf")


def test_a_scene_much_larger_than_its_file_says_so(tmp_path):
    Image.new("RGB", (3000, 3000)).save(tmp_path / "t.png")
    (tmp_path / "a.mtl").write_text("newmtl m\nmap_Kd t.png\n")
    (tmp_path / "a.obj").write_text("mtllib a.mtl\n" + SQUARE + TEXTURED)
    assert "times the file's size" in load_scene(tmp_path / "a.obj").note


def test_a_cage_that_needs_much_more_memory_than_its_file_says_so(load):
    rows = np.arange(156 * 156).reshape(156, 156)
    quads = np.stack([rows[:-1, :-1], rows[:-1, 1:], rows[1:, 1:], rows[1:, :-1]], axis=-1).reshape(-1, 4) + 1
    text = "".join(f"v {k % 156} {k // 156} 0\n" for k in range(156 * 156))
    text += "".join("f {} {} {} {}\n".format(*quad) for quad in quads.tolist())
    assert "times the file's size" in load("a.obj", text).note


def test_a_note_is_shown_on_the_terminal(tmp_path, capsys):
    from tilestamp.experiments.command_line import run_command

    (tmp_path / "a.obj").write_text(SQUARE + "l 1 2\nf 1 2 3\n")
    command = ["render", str(tmp_path / "a.obj"), "--pipeline", "freepipe", "--machine", "gtx480", "--size", "32x32"]
    assert run_command(command) == 0
    assert "statements that are not read: l (1)" in capsys.readouterr().out
