"""Readers of scenes, what trips others over and what is left out: polygons, PLY, OFF, STL."""

import numpy as np
import pytest

from tests.reader_files import CORNERS, FACES, PLY, area, stl
from tilestamp.models.errors import TilestampError
from tilestamp.simulator.scenes.polygons import triangulate

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
