"""nvdiffrast's cube maps and viewports beside slow forms of their arithmetic: every bit."""

import numpy as np
import pytest

from tilestamp.simulator.nvdiffrast import texture
from tilestamp.simulator.nvdiffrast.draw import through_viewport, viewports
from tilestamp.simulator.stages.laine2011.exact import fma

HALF = np.float32(0.5)
THIRD = np.float32(0.33333333)


def lookup(faces, direction, **options):
    """One direction in each image of a batch of cube maps."""
    d = np.array([[[direction]]] * len(faces), np.float32)
    return texture(faces.astype(np.float32), d, boundary_mode="cube", **options)[:, 0, 0, 0]


def constant_faces(size):
    """Faces 1 to 6."""
    return np.arange(1.0, 7)[None, :, None, None, None] * np.ones((1, 6, size, size, 1))


@pytest.mark.parametrize(
    ("direction", "face"), [((1, 1, 1), 1), ((-1, 1, 1), 2), ((1, -1, 0), 1), ((0, 1, -1), 3), ((1, 0, -1), 1)]
)
def test_of_equal_components_x_goes_before_y_and_y_before_z(direction, face):
    assert lookup(constant_faces(4), direction, filter_mode="nearest") == face


def toward_zero(value):
    """1 / value, not larger than it is."""
    rounded = np.float32(1) / value
    return np.nextafter(rounded, np.float32(0)) if float(rounded) * float(value) > 1 else rounded


def test_every_bit_inside_a_face():
    rng = np.random.default_rng(4)
    faces = rng.uniform(-1, 1, (1, 6, 8, 8, 1)).astype(np.float32)
    for x, y, z in rng.uniform(-0.7, 0.7, (40, 3)).astype(np.float32) + np.float32([2, 0, 0]):
        m = toward_zero(x) * HALF
        s, t = fma(fma(-z, m, HALF), np.float32(8), -HALF), fma(fma(-y, m, HALF), np.float32(8), -HALF)
        i, j = int(s), int(t)
        s, t = s - np.float32(i), t - np.float32(j)
        low, high = (fma(s, b - a, a) for a, b in faces[0, 0, j : j + 2, i : i + 2, 0])
        assert lookup(faces, (x, y, z)) == fma(t, high - low, low)


def test_the_missing_texel_of_a_corner_is_a_third_of_its_neighbours_sum():
    x, y, z = np.float32([0.1, 0.7, 0.3])
    faces = constant_faces(2)
    faces[0, [0, 2, 4]] = np.array([x, y, z])[:, None, None, None]
    missing = THIRD * ((y + z) + x)
    low, high = fma(HALF, y - missing, missing), fma(HALF, x - z, z)
    assert lookup(faces, (1, 1, 1)) == fma(HALF, high - low, low)


def test_kept_the_missing_texel_of_the_second_map_is_the_first_of_the_first_maps_last_face():
    faces = np.zeros((2, 6, 2, 2, 1))
    faces[0, 5, 0, 0], faces[1] = 1, 2
    assert lookup(faces, (1, 1, 1)).tolist() == [0, 1.75]
    assert lookup(faces, (1, 1, 1), faults="mended").tolist() == [0, 2]


@pytest.mark.parametrize(
    "direction", [(2, 0.3, -0.5), (-2, 0.3, 0.5), (0.2, 1, 0.6), (0.3, -3, 1), (0.1, 0.2, 1), (0.4, 1, -2)]
)
def test_the_level_of_a_cube_map_is_that_of_the_step_on_its_face(direction):
    direction, step = np.array(direction), np.array([0.3, -0.2, 0.25])
    major = np.abs(direction).argmax()
    others = np.arange(3) != major
    ahead, behind = (direction + sign * 1e-6 * step for sign in (1, -1))
    texels = (
        (ahead / abs(ahead[major]) - behind / abs(behind[major]))[others] / 2e-6 * 32
    )  # a face is 64 wide, of -1 to 1
    uv_da = np.zeros((1, 1, 1, 6), np.float32)
    uv_da[..., ::2] = step
    levels = [np.full((1, 6, 64 >> n, 64 >> n, 1), n, np.float32) for n in range(1, 7)]
    found = lookup(np.zeros((1, 6, 64, 64, 1)), direction, uv_da=uv_da, mip=levels)
    assert found == pytest.approx(np.log2(np.hypot(*texels)), abs=1e-4)


@pytest.mark.parametrize(
    ("pixels", "sizes"), [(2048, [2048]), (2049, [1032, 1017]), (4097, [1368, 1368, 1361]), (5000, [1672, 1672, 1656])]
)
def test_viewports_are_of_whole_tiles_and_the_last_is_shorter(pixels, sizes):
    found = list(viewports(pixels))
    assert [size for _, size in found] == sizes
    assert [first for first, _ in found] == [0, *np.cumsum(sizes[:-1]).tolist()]


def test_every_bit_of_a_position_through_a_viewport():
    pos = np.random.default_rng(5).uniform(-2, 2, (50, 4)).astype(np.float32)
    moved = through_viewport(pos, (4097, 3000), (2736, 1504), (1361, 1496))
    for (x, y, z, w), out in zip(pos, moved, strict=True):
        scale_x, scale_y = np.float32(4097) / np.float32(1361), np.float32(3000) / np.float32(1496)
        shift_x = np.float32(4097 - 1361 - 2 * 2736) / np.float32(1361)
        shift_y = np.float32(3000 - 1496 - 2 * 1504) / np.float32(1496)
        assert out.tolist() == [fma(x, scale_x, w * shift_x), fma(y, scale_y, w * shift_y), z, w]
