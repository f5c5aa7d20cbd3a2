"""Patch files: what is read, and the line that is named where one is broken."""

import numpy as np
import pytest

from tilestamp.models.errors import TilestampError
from tilestamp.simulator.scenes.bpt import read_bpt
from tilestamp.simulator.scenes.library import DATA
from tilestamp.simulator.scenes.scene import Patches

NUMBERS = ",".join(map(str, range(1, 17)))
POINTS = [f"{i},{2 * i},{3 * i}" for i in range(16)]


def write(path, *, count="1", numbers=NUMBERS, points=None, point_count=None, tail=""):
    points = POINTS if points is None else points
    lines = [count, numbers, str(len(points)) if point_count is None else point_count, *points]
    path.write_text("\n".join(lines) + "\n" + tail)
    return path


def changed(line, text):
    return [text if i == line else point for i, point in enumerate(POINTS)]


def test_points_are_in_the_order_of_their_numbers(tmp_path):
    numbers = ",".join(map(str, range(16, 0, -1)))
    points = read_bpt(write(tmp_path / "a.bpt", numbers=numbers)).points
    assert points[0].tolist() == [[i, 2 * i, 3 * i, 1] for i in range(15, -1, -1)]


def test_a_fourth_number_is_the_weight(tmp_path):
    points = read_bpt(write(tmp_path / "a.bpt", points=[f"{point},0.5" for point in POINTS])).points
    assert points[0, 15].tolist() == [7.5, 15, 22.5, 0.5]


def test_the_teapot_has_32_patches_and_8_collapsed_edges():
    nets = read_bpt(DATA / "teapot.bpt").points.reshape(-1, 4, 4, 4)
    edges = np.stack([nets[:, 0], nets[:, 3], nets[:, :, 0], nets[:, :, 3]], axis=1)
    assert (len(nets), int((edges == edges[:, :, :1]).all(axis=(2, 3)).sum())) == (32, 8)


@pytest.mark.parametrize(("name", "patches"), [("bigguy", 3570), ("killeroo", 11532)])
def test_the_papers_models_have_the_papers_patch_counts(name, patches, shared):
    assert read_bpt(shared / "scenes" / "patches" / f"{name}.bpt").points.shape == (patches, 16, 4)


@pytest.mark.parametrize(
    ("change", "line", "sentence"),
    [
        ({"count": "many"}, 1, "the number of patches should be here"),
        ({"count": "0"}, 1, "the number of patches should be here"),
        ({"count": "9"}, 3, "16 point numbers should be here"),
        ({"count": "99"}, 20, "the file ends after 18 of 99"),
        ({"numbers": NUMBERS.replace("5", "5.5", 1)}, 2, "16 point numbers should be here"),
        ({"numbers": NUMBERS + ",17"}, 2, "16 point numbers should be here"),
        ({"numbers": NUMBERS.replace("5", "five")}, 2, "16 point numbers should be here"),
        ({"numbers": NUMBERS.replace("16", "17")}, 2, "not between 1 and 16"),
        ({"numbers": "0" + NUMBERS[1:]}, 2, "not between 1 and 16"),
        ({"point_count": "-16"}, 3, "the number of points should be here"),
        ({"point_count": "15"}, 19, "the file should end here"),
        ({"point_count": "17"}, 20, "the file ends after 16 of 17"),
        ({"points": changed(4, "1,2")}, 8, "3 or 4 coordinates should be here"),
        ({"points": changed(4, "1,2,3,4")}, 8, "3 or 4 coordinates should be here"),
        ({"points": changed(4, "1,2,x")}, 8, "3 or 4 coordinates should be here"),
        ({"points": changed(4, "")}, 8, "3 or 4 coordinates should be here"),
        ({"points": changed(4, "1,nan,3")}, 8, "NaN, infinite or too large"),
        ({"points": changed(4, "1,inf,3")}, 8, "NaN, infinite or too large"),
        ({"points": changed(4, "1,1e300,3")}, 8, "NaN, infinite or too large"),
        ({"points": [f"{point},{int(i != 4)}" for i, point in enumerate(POINTS)]}, 8, "weight .* must be positive"),
        ({"points": [f"{point},{-1 if i == 4 else 1}" for i, point in enumerate(POINTS)]}, 8, "weight .* must be"),
        ({"tail": "1,2,3\n"}, 20, "the file should end here"),
    ],
)
def test_a_broken_line_is_named(change, line, sentence, tmp_path):
    with pytest.raises(TilestampError, match=rf"a\.bpt:{line}: .*{sentence}"):
        read_bpt(write(tmp_path / "a.bpt", **change))


def test_an_empty_file_has_no_patch_count(tmp_path):
    (tmp_path / "a.bpt").write_text("")
    with pytest.raises(TilestampError, match=r"a\.bpt:1: the number of patches"):
        read_bpt(tmp_path / "a.bpt")


def test_a_file_of_other_bytes_is_refused(tmp_path):
    (tmp_path / "a.bpt").write_bytes(bytes(range(256)))
    with pytest.raises(TilestampError, match="not a text file of patches"):
        read_bpt(tmp_path / "a.bpt")


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(TilestampError, match=r"a\.bpt: there is no such file"):
        read_bpt(tmp_path / "a.bpt")


@pytest.mark.parametrize(
    ("points", "sentence"),
    [
        (np.ones((2, 16, 3), np.float32), "must be"),
        (np.ones((0, 16, 4), np.float32), "must be"),
        (np.full((2, 16, 4), np.inf, np.float32), "patch 0 has a control point that is NaN or infinite"),
        (np.zeros((2, 16, 4), np.float32), "patch 0 has a weight that is not positive"),
    ],
)
def test_patches_made_by_hand_are_checked_too(points, sentence):
    with pytest.raises(TilestampError, match=sentence):
        Patches(points)
