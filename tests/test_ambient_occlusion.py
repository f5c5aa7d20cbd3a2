"""Ambient occlusion of Ru's pipelines, and its blur."""

import numpy as np
import pytest

from tests.ru_pictures import CAMERA, HEIGHT, SIMT, WIDTH, draw, work
from tests.textured_soup import soup
from tilestamp.models.errors import TilestampError
from tilestamp.models.simt import Simt
from tilestamp.simulator.scenes.scene import Mesh, Scene
from tilestamp.simulator.stages.ru2016.occlusion_blur import occlusion_blur


@pytest.fixture(scope="module")
def scene():
    return soup()


@pytest.fixture(scope="module")
def matrix():
    return CAMERA.matrix(WIDTH, HEIGHT)


@pytest.fixture
def rng_light():
    return np.random.default_rng(3).random((HEIGHT, WIDTH), np.float32)


def test_occlusion_only_darkens(scene, matrix):
    lit, dark = draw(scene, matrix).image.astype(int), draw(scene, matrix, ssao=True).image.astype(int)
    assert (dark <= lit).all()
    assert (dark < lit).any()


def test_the_blur_is_the_mean_of_a_window_of_four_pixels(rng_light):
    blurred, (work,), _ = occlusion_blur(rng_light, SIMT)
    for y, x in [(0, 0), (1, 30), (20, 20), (HEIGHT - 1, WIDTH - 1)]:
        window = rng_light[max(y - 2, 0) : y + 2, max(x - 2, 0) : x + 2]
        assert blurred[y, x] == pytest.approx(window.mean(), rel=1e-6)
    assert work.block == 144


def test_the_blur_loads_and_stores_as_often_as_an_h200_counts():
    """Measured on the original at 800x800: a sector for each thread that loads, and for each that stores."""
    counts = occlusion_blur(np.ones((800, 800), np.float32), Simt()).works[0].counts()
    assert counts["STORE_TRANSACTIONS"] == 640_000
    assert counts["LOAD_TRANSACTIONS"] == pytest.approx(1_429_963, rel=0.01)
    assert (counts["WARPS"], counts["BLUR_WARPS"]) == (50_000, 40_000)


def test_a_lone_plane_is_not_occluded(matrix):
    corners = np.array([[-9, -9, 0, 1], [9, -9, 0, 1], [0, 12, 0, 1]], np.float32)
    plane = Scene("plane", mesh=Mesh(corners, np.array([[0, 1, 2]], np.int32)))
    assert (draw(plane, matrix, ssao=True).image == draw(plane, matrix).image).all()


def test_occlusion_has_the_threads_of_the_screen_and_reads_by_what_is_drawn(scene, matrix):
    counts = []
    for s in (scene, soup(seed=9, count=5)):
        frame = draw(s, matrix, ssao=True)
        counts.append((work(frame, "ambient_occlusion").counts(), int((frame.triangle_ids >= 0).sum())))
    (one, drawn), (other, fewer) = counts
    assert one["WARP_LANES"] == other["WARP_LANES"] == WIDTH * HEIGHT
    assert one["LOAD_TRANSACTIONS"] - other["LOAD_TRANSACTIONS"] == 100 * (drawn - fewer)


def test_occlusion_refuses_a_parallel_projection(scene):
    with pytest.raises(TilestampError, match="perspective"):
        draw(scene, np.diag([0.3, 0.3, -0.1, 1.0]), ssao=True)
