"""Motion blur and defocus: every algorithm against brute force, brute force against Python, and what each costs."""

import numpy as np
import pytest

from tests import naive_ste
from tests.test_stamps import HEIGHT, WIDTH, soup
from tilestamp.models.errors import TilestampError
from tilestamp.simulator.stages.fatahalian2009.micropolygons import Micropolygons
from tilestamp.simulator.stages.fatahalian2009.motion import (
    MotionEvent,
    blur_samples,
    circle_of_confusion,
    interleaved_pattern,
    moved,
    stratified_pattern,
)
from tilestamp.simulator.stages.fatahalian2009.motion_interleaved import motion_interleaved
from tilestamp.simulator.stages.fatahalian2009.motion_interval import motion_brute_force, motion_interval

PATTERNS = {"stratified": stratified_pattern(4, tile=3), "interleaved": interleaved_pattern(2, tile=2)}


def draw(algorithm, polygons, pattern):
    samples = blur_samples(WIDTH, HEIGHT, pattern)
    return samples, algorithm(polygons, pattern, samples).works[0]


def blurred(count=10, way=(4.0, -2.0), seed=3):
    polygons = soup(count, seed=seed)
    rng = np.random.default_rng(seed)
    return moved(polygons, np.asarray(way) + rng.random((count, 4, 2)), rng.random((count, 4)) * 2)


@pytest.mark.parametrize("name", PATTERNS)
def test_brute_force_is_python_at_every_sample(name):
    pattern, moving = PATTERNS[name], blurred(6)
    samples, _ = draw(motion_brute_force, moving, pattern)
    tile = len(pattern.place)
    for y, x, s in np.ndindex(HEIGHT, WIDTH, pattern.place.shape[2]):
        t, u, v = pattern.time_lens[y % tile, x % tile, s]
        dx, dy = (int(d) for d in pattern.place[y % tile, x % tile, s])
        shown, nearest = -1, np.inf
        for p in range(6):
            placed = moving.start[p].astype(float) + t * (moving.end[p] - moving.start[p])
            placed = placed.astype(np.float32)
            placed[:, :2] += moving.blur[p][:, None] * np.array([u, v])
            depth = naive_ste.cover(placed.tolist(), x * naive_ste.SUB + dx, y * naive_ste.SUB + dy)
            if depth is not None and np.float32(depth) < nearest:
                shown, nearest = p, np.float32(depth)
        assert samples.polygon.reshape(HEIGHT, WIDTH, -1)[y, x, s] == shown


@pytest.mark.parametrize("name", PATTERNS)
def test_intervals_draw_what_brute_force_draws(name):
    moving = blurred(40)
    brute, interval = (draw(a, moving, PATTERNS[name])[0] for a in (motion_brute_force, motion_interval))
    assert (brute.polygon == interval.polygon).all()


def test_interleaving_draws_what_brute_force_draws():
    moving = blurred(40)
    brute, interleaved = (draw(a, moving, PATTERNS["interleaved"])[0] for a in (motion_brute_force, motion_interleaved))
    assert (brute.polygon == interleaved.polygon).all()


def test_hits_do_not_depend_on_how_they_are_found():
    moving = blurred(40)
    hits = {
        draw(a, moving, PATTERNS["interleaved"])[1].total(MotionEvent.SAMPLE_HITS)
        for a in (motion_brute_force, motion_interval, motion_interleaved)
    }
    assert len(hits) == 1


def one_square(way, at=3.0):
    square = np.array([[[0, 0, 0.5], [1, 0, 0.5], [1, 1, 0.5], [0, 1, 0.5]]], np.float32) + np.float32([at, at, 0])
    return moved(Micropolygons(square, np.zeros(1, np.int32), np.zeros(1, np.uint8)), way)


def test_interval_tests_grow_with_motion_and_interleaved_set_ups_do_not():
    interval = [draw(motion_interval, one_square((w, w / 2), 3.2), PATTERNS["stratified"])[1] for w in (0, 8)]
    interleaved = [draw(motion_interleaved, one_square((w, w / 2), 3.2), PATTERNS["interleaved"])[1] for w in (0, 8)]
    assert interval[1].total(MotionEvent.SAMPLE_TESTS) > 1.5 * interval[0].total(MotionEvent.SAMPLE_TESTS)
    assert [w.total(MotionEvent.SETUPS) for w in interleaved] == [8, 8]


@pytest.mark.parametrize(
    ("make", "algorithm"), [(stratified_pattern, motion_interval), (interleaved_pattern, motion_interleaved)]
)
def test_coverage_converges_to_the_blurred_area(make, algorithm):
    """A unit square that moves 4 pixels to the right covers 1 pixel's worth of samples, 1/4 in each pixel crossed."""
    errors = []
    for spp in (2, 64):
        pattern = make(spp)
        samples = blur_samples(WIDTH, HEIGHT, pattern)
        algorithm(one_square((4.0, 0.0)), pattern, samples)
        cover = (samples.polygon.reshape(HEIGHT, WIDTH, spp) >= 0).mean(axis=2)
        errors.append(np.abs(cover[3, 3:8] - [0.125, 0.25, 0.25, 0.25, 0.125]).max())
    assert errors[1] < 0.08
    assert errors[1] < errors[0]


def test_interleaved_samples_are_distinct_in_time_and_lens():
    pattern = interleaved_pattern(4, tile=4)
    assert len(np.unique(pattern.time_lens.reshape(-1, 3), axis=0)) == 64


@pytest.mark.parametrize("make", [stratified_pattern, interleaved_pattern])
def test_patterns_stay_in_shutter_lens_and_pixel(make):
    pattern = make(7)
    time, lens = pattern.time_lens[..., 0], pattern.time_lens[..., 1:]
    assert (time >= 0).all()
    assert (time <= 1).all()
    assert (np.linalg.norm(lens, axis=-1) <= 1).all()
    assert (pattern.place >= 0).all()
    assert (pattern.place < naive_ste.SUB).all()


def test_what_is_in_focus_has_no_circle_of_confusion():
    assert circle_of_confusion([2.0, 4.0, 1e9], 2.0, 6.0).tolist() == [0.0, 3.0, 6.0]


@pytest.mark.parametrize("make", [stratified_pattern, interleaved_pattern])
def test_no_samples_are_refused(make):
    with pytest.raises(TilestampError):
        make(0)
