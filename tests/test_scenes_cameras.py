"""Cameras: what they show, all the forms that they are read from, and what is wrong with those that are not."""

import json

import numpy as np
import pytest

from tilestamp.models.errors import TilestampError
from tilestamp.simulator.scenes import LookAt, ModelToClip, Scene, read_camera
from tilestamp.simulator.scenes.camera import fit_camera
from tilestamp.simulator.scenes.scene import Patches


def project(camera, point, width=400, height=300):
    clip = camera.matrix(width, height) @ [*point, 1.0]
    return clip[:3] / clip[3]


def test_the_target_is_in_the_middle():
    np.testing.assert_allclose(project(LookAt((1, 2, 3), (4, 4, 4)), (4, 4, 4))[:2], 0, atol=1e-12)


def test_near_and_far_are_minus_one_and_one():
    camera = LookAt((0, 0, 5), (0, 0, 0), near=2, far=7)
    np.testing.assert_allclose([project(camera, (0, 0, z))[2] for z in (3, -2)], [-1, 1])


def test_the_field_of_view_is_vertical():
    camera = LookAt((0, 0, 1), (0, 0, 0), fov_degrees=90)
    np.testing.assert_allclose(project(camera, (4 / 3, 1, 0))[:2], [1, 1])


def test_up_is_up_and_right_is_right():
    x, y, _ = project(LookAt((0, 0, 5), (0, 0, 0)), (0.1, 0.2, 0))
    assert x > 0
    assert y > 0


def test_clip_w_is_the_distance_in_front_of_the_eye():
    assert (LookAt((0, 0, 5), (0, 0, 0)).matrix(4, 3) @ [9, 9, 1, 1])[3] == pytest.approx(4)


@pytest.mark.parametrize("size", [(1600, 1200), (300, 900), (2000, 10)])
@pytest.mark.parametrize("up", [(0, 1, 0), (0, 0, 1)])
def test_a_fitted_camera_shows_the_whole_box_and_fills_a_side(size, up):
    low, high = np.array([-3, 1, 10]), np.array([5, 2, 11])
    matrix = fit_camera([low, high], up).matrix(*size)
    corners = np.array([[x, y, z, 1] for x in (-3, 5) for y in (1, 2) for z in (10, 11)]) @ matrix.T
    shown = np.abs(corners[:, :3] / corners[:, 3:])
    assert shown.max() < 1
    assert shown[:, :2].max() > 0.9


def test_a_fitted_camera_shows_a_single_point():
    np.testing.assert_allclose(project(fit_camera([[7, 7, 7], [7, 7, 7]]), (7, 7, 7))[:2], 0, atol=1e-9)


MATRIX = [[1.0, 0, 0, 0], [0, 2, 0, 0], [0, 0, 1, -3], [0, 0, -1, 9]]
LOOK = {"eye": [0, 0, 5], "target": [0, 0, 4], "up": [0, 1, 0], "fov_degrees": 30, "near": 1, "far": 9}
AHEAD = {"position": [0, 0, 5], "forward": [0, 0, -1], "up": [0, 1, 0], "fov_degrees": 30, "near": 1, "far": 9}


@pytest.mark.parametrize("form", [MATRIX, np.array(MATRIX), {"model_to_clip": MATRIX}, ModelToClip(MATRIX)])
def test_a_matrix_is_a_camera(form):
    assert read_camera(form).matrix(7, 9).tolist() == MATRIX


@pytest.mark.parametrize("form", [LOOK, AHEAD])
def test_a_place_and_a_direction_are_a_camera(form):
    wanted = LookAt((0, 0, 5), (0, 0, 0), fov_degrees=30, near=1, far=9)
    np.testing.assert_allclose(read_camera(form).matrix(4, 3), wanted.matrix(4, 3))


@pytest.mark.parametrize(("document", "keys"), [(AHEAD, ""), ({"a": AHEAD}, ":a"), ({"a": [LOOK, AHEAD]}, ":a:1")])
def test_a_camera_is_read_from_a_part_of_a_file(document, keys, tmp_path):
    (tmp_path / "cameras.json").write_text(json.dumps(document))
    camera = read_camera(f"{tmp_path}/cameras.json{keys}")
    assert camera.matrix(4, 3).tolist() == read_camera(AHEAD).matrix(4, 3).tolist()


def test_a_view_is_found_by_name():
    view = ModelToClip(MATRIX)
    assert read_camera("front", {"front": view}) is view


def test_no_camera_is_the_default_view():
    view = ModelToClip(MATRIX)
    assert read_camera(None, {"default": view}) is view


def test_a_scene_made_by_hand_has_a_default_view():
    points = np.random.default_rng(7).normal(size=(2, 16, 4)).astype(np.float32)
    points[..., 3] = 1
    clip = points.reshape(-1, 4) @ read_camera(None, Scene("two", patches=Patches(points))).matrix(640, 480).T
    assert (np.abs(clip[:, :3]) < clip[:, 3:]).all()


def test_the_measured_cameras_are_read(shared):
    path = shared / "silicon" / "micropolygon_cameras.json"
    wanted = json.loads(path.read_text())["teapot_512x512_bb4"]["model_to_clip"]
    assert read_camera(f"{path}:teapot_512x512_bb4").matrix(512, 512).tolist() == wanted


def test_the_published_cameras_are_read(shared):
    camera = read_camera(f"{shared / 'published' / 'laine2011' / 'cameras.json'}:buddha:4")
    assert camera.eye == (-0.0655624, 0.0716163, 0.1541543)


@pytest.mark.parametrize(
    ("source", "sentence"),
    [
        (np.zeros((4, 4)), "singular"),
        (np.diag([1, 1, 0, 1]), "singular"),
        ([[1, 2], [3, 4]], "needs 4x4 numbers, not 2x2"),
        (np.full((4, 4), np.nan), "NaN or infinity"),
        ({"model_to_clip": "words"}, "not made of numbers"),
        ({**LOOK, "target": [0, 0, 5]}, "the same point"),
        ({**LOOK, "eye": [0, 0, float("inf")]}, "eye holds NaN or infinity"),
        ({**LOOK, "up": [0, 0, 2]}, "up points along the line of sight"),
        ({**LOOK, "up": [0, 0, 0]}, "up points along the line of sight"),
        ({**LOOK, "fov_degrees": 180}, "between 0 and 180"),
        ({**LOOK, "near": 0}, "0 < near < far"),
        ({**LOOK, "far": 0.5}, "0 < near < far"),
        ({**AHEAD, "forward": [0, 0]}, "3 numbers each"),
        ({"eye": [0, 0, 1]}, "it has eye"),
        ({**LOOK, "fov": 90}, "did you mean 'fov_degrees'"),
        ({**LOOK, "farr": 90}, "did you mean 'far'"),
        (42, "42 is not a camera"),
        ("nowhere", "no such view"),
        ("missing.json", "missing.json: there is no such file"),
    ],
)
def test_what_is_wrong_with_a_camera_is_a_sentence(source, sentence):
    with pytest.raises(TilestampError, match=sentence):
        read_camera(source)


@pytest.mark.parametrize(
    ("text", "keys", "sentence"),
    [
        ("{", "", r"cameras.json:1: not JSON"),
        ('{"a": [1]}', ":b", r"cameras.json:b: there is no 'b' in it; it has a"),
        ('{"a": [1]}', ":a:7", r"there is no '7' in it; it is a list of 1"),
        ('{"a": 1, "b": 2}', "", r"cameras.json: camera: needs one of the forms"),
    ],
)
def test_what_is_wrong_with_a_camera_file_names_it(text, keys, sentence, tmp_path):
    (tmp_path / "cameras.json").write_text(text)
    with pytest.raises(TilestampError, match=sentence):
        read_camera(f"{tmp_path}/cameras.json{keys}")


def test_an_image_without_pixels_has_no_shape():
    with pytest.raises(TilestampError, match="0x3 pixels"):
        LookAt((0, 0, 1), (0, 0, 0)).matrix(0, 3)


def test_a_camera_may_have_keys_that_describe_it():
    assert read_camera({**LOOK, "name": "front", "note": "of the paper"}) == read_camera(LOOK)
