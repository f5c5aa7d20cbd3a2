"""Atlas rows of moving triangles and bent pictures: where each breaks, with room around it."""

import pytest

from tilestamp.experiments.stability import field_of_view, moving_eye

SCREEN, FREE, LENS = moving_eye.METHODS


def test_even_pace_on_screen_breaks_as_triangles_come_nearer():
    assert moving_eye.wrong(SCREEN, 0.03) < moving_eye.WRONG < moving_eye.wrong(SCREEN, 0.3)


@pytest.mark.parametrize("name", [FREE, LENS])
@pytest.mark.parametrize("way", [0.3, 1.0, 2.0])
def test_homogeneous_corners_go_through_the_eye(name, way):
    assert moving_eye.wrong(name, way) < 1e-3


@pytest.mark.parametrize(("kind", "whole", "torn"), [("fisheye", 240.0, 300.0), ("paraboloid", 345.0, 359.0)])
def test_edges_tear_at_the_back_of_a_wide_picture(kind, whole, torn):
    name = f"{kind}, tessellated"
    assert field_of_view.holes(name, whole) == 0
    assert field_of_view.holes(name, torn) > 10


@pytest.mark.parametrize("kind", ["fisheye", "paraboloid", "cylindrical"])
def test_lines_of_sight_have_no_hole_beyond_180_degrees(kind):
    assert [field_of_view.holes(f"{kind}, lines of sight", fov) for fov in (179.0, 181.0, 359.0)] == [0, 0, 0]
