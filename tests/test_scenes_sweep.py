"""The synthetic sweep of Figure 5: the authors' random numbers, triangle counts and shapes."""

from functools import cache

import numpy as np
import pytest

from tests import naive_scenes
from tilestamp.models.errors import TilestampError
from tilestamp.simulator.scenes import Scene
from tilestamp.simulator.scenes.sweep import Layout, layout, sweep_mesh
from tilestamp.simulator.scenes.xorshift import AUTHORS_SEED, draw_floats, draw_words, random_state

COUNTS = [  # area in pixels, layers, step, triangles: the notes on the benchmark, section 9.1
    (0, 16, 28, 1023768),
    (0.25, 16, 56, 1027411),
    (0.5, 17, 40, 1063942),
    (1, 16, 28, 1024651),
    (2, 17, 20, 1063356),
    (4, 16, 14, 1019568),
    (8, 17, 10, 1059275),
    (16, 22, 8, 1067083),
    (40, 54, 8, 1039592),
]


swept = cache(sweep_mesh)


def areas(mesh, width=1024, height=768):
    """Signed areas in pixels."""
    points = mesh.positions[:, :2].astype(np.float64) * [width / 2, height / 2]
    a, b, c = (points[mesh.triangles[:, corner]] for corner in range(3))
    return ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2


@pytest.mark.small
@pytest.mark.parametrize("seed", [1, AUTHORS_SEED, 0xFFFFFFFF])
def test_random_words_are_the_benchmarks(seed):
    assert draw_words(random_state(seed), 100).tolist() == naive_scenes.xorshift_draws(seed, 100)


@pytest.mark.small
def test_the_first_draw_of_the_authors_seed_is_the_published_one():
    assert draw_words(random_state(AUTHORS_SEED), 1).tolist() == [359192888]


@pytest.mark.small
def test_draws_go_on_where_they_stopped():
    state = random_state()
    parts = [*draw_words(state, 5), *draw_words(state, 17)]
    assert parts == naive_scenes.xorshift_draws(AUTHORS_SEED, 22)


def test_a_float_is_its_word_over_two_to_the_32():
    assert draw_floats(random_state(), 1)[0] == np.float32(359192888) * np.float32(2.0**-32)


@pytest.mark.parametrize(("area", "layers", "step", "triangles"), COUNTS)
def test_the_triangle_count_is_the_published_one(area, layers, step, triangles):
    assert layout(area or 1, 1024, 768) == Layout(step, layers)
    assert len(swept(area).triangles) == triangles


def test_every_triangle_has_the_area_asked_for():
    np.testing.assert_allclose(areas(swept(16)), 16, rtol=1e-3)


def test_area_zero_is_one_pixel_facing_away():
    np.testing.assert_allclose(areas(swept(0)), -1, rtol=2e-2)


def test_triangles_are_equilateral():
    mesh = swept(40)
    points = mesh.positions[mesh.triangles[:, [0, 1, 2, 0]], :2].astype(np.float64) * [512, 384]
    sides = np.linalg.norm(np.diff(points, axis=1), axis=2)
    np.testing.assert_allclose(sides, np.sqrt(40 * 4 / np.sqrt(3)), rtol=1e-3)


def test_triangles_lie_inside_the_viewport_and_come_layer_by_layer():
    mesh = swept(8)
    used = mesh.positions[mesh.triangles[:, 0]]
    assert np.abs(used[:, :2]).max() <= 1
    assert (np.diff(used[:, 2]) <= 0).all()
    assert len(np.unique(used[:, 2])) == 17


def test_a_generator_is_moved_past_the_colours_of_an_area():
    state = random_state()
    mesh = sweep_mesh(40, state=state)
    used = 3 * 54 + 3 * len(mesh.positions)  # a layer, a vertex
    assert draw_words(state, 3).tolist() == draw_words(random_state(), used + 3)[-3:].tolist()


def test_seed_zero_is_the_authors_and_another_seed_is_not():
    assert np.array_equal(sweep_mesh(40, seed=AUTHORS_SEED).positions, swept(40).positions)
    assert not np.array_equal(sweep_mesh(40, seed=7).positions[:81], swept(40).positions[:81])


def test_the_scene_is_in_clip_space_with_colours_of_alpha_one_half():
    scene = Scene.sweep(40)
    assert scene.mesh.clip_space
    assert (scene.mesh.colors[:, 3] == 0.5).all()
    assert np.array_equal(scene.views["default"].matrix(1024, 768), np.eye(4))


@pytest.mark.parametrize("options", [{"area": -1}, {"area": float("nan")}, {"area": 1e9}, {"area": 1, "width": 0}])
def test_areas_that_fill_no_viewport_are_refused(options):
    with pytest.raises(TilestampError, match="sweep: triangles of"):
        Scene.sweep(**options)
