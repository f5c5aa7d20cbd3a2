"""Eight pixels of a row at once, in Ru's tiled raster: compiled vectors against plain Python."""

import numpy as np
import pytest

from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.ru2016.row_lanes import eight_inside, write_nearer
from tilestamp.simulator.stages.ru2016.tiled_raster import mark_warps

TRIANGLES = {  # x and y of three corners
    "large": (-5, -5, 30, 2, 3, 40),
    "on samples": (2.5, 0.5, 7.5, 0.5, 2.5, 5.5),
    "sliver": (0, 0, 9, 2.5, 4.5, 1.25001),
    "without area": (1, 1, 3, 3, 2, 2),
    "not a number": (np.nan, 1, 3, 3, 2, 7),
}


@kernel(error_model="numpy")
def _inside(triangle, x, py):
    return eight_inside(triangle, x, py)


@kernel(error_model="numpy")
def _write(triangle, x, y, py, bits, t, depth, drawn):
    return write_nearer(triangle, x, y, py, bits, t, depth, drawn)


def described(name):
    """The corners, one over the area, and depths."""
    x0, y0, x1, y1, x2, y2 = corners = tuple(map(np.float32, TRIANGLES[name]))
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = np.float32(1) / ((x2 - x0) * (y1 - y0) - (x1 - x0) * (y2 - y0))
    return corners, inverse, tuple(map(np.float32, (0.25, 0.75, -0.125)))


@pytest.mark.parametrize("name", TRIANGLES)
@pytest.mark.filterwarnings("ignore:invalid value")
def test_pixels_inside_are_those_of_plain_python(name):
    for y in range(8):
        for x in (0, 3, 20):
            given = described(name), x, np.float32(y + 0.5)
            assert _inside(*given) == eight_inside(*given)


def test_samples_on_an_edge_lie_inside():
    assert _inside(described("on samples"), 0, np.float32(0.5)) == 0b11111100


@pytest.mark.parametrize("name", TRIANGLES)
@pytest.mark.filterwarnings("ignore:invalid value")
def test_nearer_pixels_are_written_as_by_plain_python(name):
    triangle, depths = described(name), np.linspace(-0.5, 1, 48, dtype=np.float32).reshape(3, 16)[:, ::-1]
    for bits in (0xFF, 0b10110010, 0):
        both = [(np.ascontiguousarray(depths), np.full((3, 16), -1, np.int32)) for _ in range(2)]
        given = triangle, 5, 1, np.float32(1.5), np.uint64(bits), 7
        assert _write(*given, *both[0]) == write_nearer(*given, *both[1])
        assert all(map(np.array_equal, *both))


def test_pixels_without_a_bit_are_not_touched_at_the_end_of_an_array():
    depth, drawn = np.ones((1, 9), np.float32), np.full((1, 9), -1, np.int32)
    assert _write(described("large"), 4, 0, np.float32(0.5), np.uint64(0b1), 3, depth, drawn) == 1
    assert drawn.tolist() == [[-1, -1, -1, -1, 3, -1, -1, -1, -1]]


@pytest.mark.parametrize(("lane", "warp", "hit"), [(0, 32, [0]), (28, 32, [0, 1]), (8, 4, [2, 3]), (5, 3, [1, 3, 4])])
def test_a_row_marks_the_warps_that_its_lanes_belong_to(lane, warp, hit):
    marks = np.zeros((4, 6), np.int64)
    mark_warps(np.uint64(0b10010001), np.uint64(1), lane, warp, marks)
    assert np.flatnonzero(marks[0]).tolist() == hit
    assert np.flatnonzero(marks[1]).tolist() == hit[:1]
