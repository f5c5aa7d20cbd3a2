"""Motion blur and defocus: every algorithm against brute force, brute force against Python, and what each costs."""

import numpy as np
import pytest
from numba import get_num_threads, set_num_threads

from tests import naive_motion, naive_ste
from tests.test_counts_of_warps import HOPPER, by_machine, nonzero
from tests.test_stamps import HEIGHT, WIDTH, soup
from tilestamp import simulate
from tilestamp.models.errors import TilestampError
from tilestamp.simulator.scenes import load_scene, read_camera
from tilestamp.simulator.scenes.camera import fit_camera
from tilestamp.simulator.stages.fatahalian2009.micropolygon_samples import BACKGROUND
from tilestamp.simulator.stages.fatahalian2009.micropolygons import Micropolygons, micropolygons, project
from tilestamp.simulator.stages.fatahalian2009.motion import (
    MotionEvent,
    blur_samples,
    interleaved_pattern,
    moved,
    stratified_pattern,
)
from tilestamp.simulator.stages.fatahalian2009.motion_interleaved import motion_interleaved
from tilestamp.simulator.stages.fatahalian2009.motion_interval import motion_brute_force, motion_interval
from tilestamp.simulator.stages.fatahalian2009.stamps import stamp_shape, stamps
from tilestamp.simulator.stages.fatahalian2009.thin_lens import circle_of_confusion, defocus, eye_distances

PATTERNS = {"stratified": stratified_pattern(4, tile=3), "interleaved": interleaved_pattern(2, tile=2)}


def draw(algorithm, polygons, pattern, simt=HOPPER, *more):
    samples = blur_samples(WIDTH, HEIGHT, pattern)
    return samples, algorithm(polygons, pattern, samples, simt, *more).works[0]


def blurred(count=10, way=(4.0, -2.0), seed=3):
    polygons = soup(count, seed=seed)
    rng = np.random.default_rng(seed)
    return moved(polygons, np.asarray(way) + rng.random((count, 4, 2)), rng.random((count, 4)) * 2)


@pytest.mark.parametrize("name", PATTERNS)
def test_brute_force_is_python_at_every_sample(name):
    pattern, moving = PATTERNS[name], blurred(6)
    samples, _ = draw(motion_brute_force, moving, pattern)
    for y, x, s in np.ndindex(HEIGHT, WIDTH, pattern.place.shape[2]):
        shown, nearest = -1, np.inf
        for p in range(6):
            depth = naive_motion.depth(moving, pattern, p, x, y, s)
            if depth is not None and np.float32(depth) < nearest:
                shown, nearest = p, np.float32(depth)
        assert samples.polygon.reshape(HEIGHT, WIDTH, -1)[y, x, s] == shown


@pytest.mark.parametrize("intervals", [1, 2, 3])
def test_samples_that_share_an_interval_are_drawn_as_by_brute_force(intervals):
    moving, pattern = blurred(40), PATTERNS["stratified"]
    brute, shared = draw(motion_brute_force, moving, pattern), draw(motion_interval, moving, pattern, HOPPER, intervals)
    assert (brute[0].polygon == shared[0].polygon).all()
    assert shared[1].total(MotionEvent.BOXES) == intervals * 40


@by_machine
@pytest.mark.parametrize("intervals", [4, 3])
def test_every_event_of_intervals_is_that_of_python(simt, intervals):
    moving, pattern = twice(blurred(20)), PATTERNS["stratified"]
    _, work = draw(motion_interval, moving, pattern, simt, intervals)
    expected = naive_motion.interval(moving, pattern, WIDTH, HEIGHT, intervals, simt)
    assert expected["ATOMIC_CONFLICTS"] > 0
    assert nonzero(work.counts()) == nonzero(expected)


@by_machine
def test_every_event_of_interleaving_is_that_of_python(simt):
    moving, pattern = twice(blurred(20)), PATTERNS["interleaved"]
    _, work = draw(motion_interleaved, moving, pattern, simt)
    expected = naive_motion.interleaved(moving, pattern, WIDTH, HEIGHT, simt)
    assert expected["ATOMIC_CONFLICTS"] > 0
    assert nonzero(work.counts()) == nonzero(expected)


def twice(moving):
    """Each polygon two times, one after the other: lanes that want the same samples."""
    return type(moving)(*(part.repeat(2, axis=0) for part in moving))


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


def squares(count):
    """Squares of a pixel here and there, again and again, which move and are blurred alike."""
    rng = np.random.default_rng(5)
    at = rng.random((count // 4, 1, 3)) * [WIDTH, HEIGHT, 1]
    corners = np.tile((at + np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])).astype(np.float32), (4, 1, 1))
    made = Micropolygons(corners, np.zeros(count, np.int32), np.zeros(count, np.uint8))
    return made, moved(made, (1.5, -0.5), 1.0)


def test_no_sample_just_inside_is_left_out():
    """Interleaving places polygons at each time and lens point, and has no bounds that could leave a sample out."""
    _, moving = squares(400)
    works = [draw(a, moving, PATTERNS["interleaved"])[1] for a in (motion_interval, motion_interleaved)]
    assert works[0].total(MotionEvent.SAMPLE_HITS) == works[1].total(MotionEvent.SAMPLE_HITS) > 0


@pytest.mark.parametrize("algorithm", [motion_interval, motion_interleaved, None])
def test_buffers_of_parts_become_one(algorithm):
    """Polygons that are drawn again and again lie in the buffers of several parts, and the first of them stays."""
    still, moving = squares(4800)
    threads, found = get_num_threads(), []
    for count in (threads, 1):
        set_num_threads(count)
        samples = blur_samples(WIDTH, HEIGHT, PATTERNS["stratified"])
        if algorithm is None:
            stamps(still, samples, stamp_shape(2, "box"), HOPPER)
        else:
            algorithm(moving, PATTERNS["stratified"], samples, HOPPER)
        found.append(samples)
    set_num_threads(threads)
    for name in ("depth", "polygon", "tests", "requests"):
        np.testing.assert_array_equal(*(getattr(samples, name) for samples in found), err_msg=name)


def one_square(way, at=3.0):
    square = np.array([[[0, 0, 0.5], [1, 0, 0.5], [1, 1, 0.5], [0, 1, 0.5]]], np.float32) + np.float32([at, at, 0])
    return moved(Micropolygons(square, np.zeros(1, np.int32), np.zeros(1, np.uint8)), way)


def test_interval_tests_grow_with_motion_and_interleaved_set_ups_do_not():
    interval = [draw(motion_interval, one_square((w, w / 2), 3.2), PATTERNS["stratified"])[1] for w in (0, 8)]
    interleaved = [draw(motion_interleaved, one_square((w, w / 2), 3.2), PATTERNS["interleaved"])[1] for w in (0, 8)]
    assert interval[1].total(MotionEvent.SAMPLE_TESTS) > 1.5 * interval[0].total(MotionEvent.SAMPLE_TESTS)
    assert [w.total(MotionEvent.BOXES) for w in interleaved] == [8, 8]


@pytest.mark.parametrize(
    ("make", "algorithm"), [(stratified_pattern, motion_interval), (interleaved_pattern, motion_interleaved)]
)
def test_coverage_converges_to_the_blurred_area(make, algorithm):
    """A unit square that moves 4 pixels to the right covers 1 pixel's worth of samples, 1/4 in each pixel crossed."""
    errors = []
    for spp in (2, 64):
        pattern = make(spp)
        samples = blur_samples(WIDTH, HEIGHT, pattern)
        algorithm(one_square((4.0, 0.0)), pattern, samples, HOPPER)
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


@pytest.mark.parametrize("pipeline", ["interval", "interleaved"])
@pytest.mark.parametrize("direction", [0.0, 90.0])
def test_the_scene_moves_in_its_direction(pipeline, direction):
    still, moving = (extent(pipeline, motion=motion, direction=direction) for motion in (0.0, 12.0))
    left, top, right, low = moving - still
    assert abs(left) <= 1
    assert abs(low) <= 1
    assert (right >= 9, -top >= 9) == (direction == 0.0, direction == 90.0)


def extent(pipeline, **options):
    """First column and row, last column and row that anything is drawn in."""
    image = simulate("teapot", pipeline, width=96, height=72, fidelity="counts", lens=0.0, **options).image
    rows, columns = np.nonzero((image < BACKGROUND).any(axis=2))
    return np.array([columns.min(), rows.min(), columns.max(), rows.max()])


def test_what_lies_at_the_focus_is_sharp_and_the_rest_by_its_distance():
    scene = load_scene("teapot")
    matrix = read_camera("default", scene).matrix(96, 72)
    polygons = micropolygons(scene, matrix, 96, 72)
    distance = eye_distances(polygons, matrix, 96, 72)
    for focus, used in ((distance[5, 1], distance[5, 1]), (None, distance.mean())):
        blur = defocus(polygons, matrix, 96, 72, focus, 6.0)
        assert blur == pytest.approx(6.0 * np.abs(1 - used / distance), abs=1e-5)


def test_a_lens_out_of_focus_blurs_the_picture():
    images = [
        simulate("teapot", "interleaved", width=96, height=72, fidelity="counts", motion=0.0, **lens).image
        for lens in ({"lens": 0.0}, {"lens": 6.0}, {"lens": 6.0, "focus": 1e6})
    ]
    near, far = (int(np.abs(image.astype(int) - images[0]).sum()) for image in images[1:])
    assert 0 < 1.5 * near < far


def test_distances_are_those_of_the_camera():
    camera = fit_camera([[-1, -1, -1], [1, 1, 1]])
    look, matrix = camera.look_at(64, 48), camera.matrix(64, 48)
    points = np.random.default_rng(5).random((7, 3)) * 2 - 1
    screen, _ = project(np.concatenate([points, np.ones((7, 1))], axis=1), matrix, 64, 48)
    polygons = Micropolygons(screen[:, None].astype(np.float32), np.zeros(7, np.int32), np.zeros(7, np.uint8))
    ahead = (np.array(look.target) - look.eye) / np.linalg.norm(np.array(look.target) - look.eye)
    assert eye_distances(polygons, matrix, 64, 48)[:, 0] == pytest.approx((points - look.eye) @ ahead, rel=1e-5)


def test_more_intervals_than_samples_are_refused():
    with pytest.raises(TilestampError, match="intervals is at most spp: 5 of 4 samples"):
        simulate("teapot", "interval", width=8, height=8, intervals=5)


def test_the_options_reach_the_stages():
    small = {"width": 48, "height": 36, "fidelity": "counts", "spp": 4}
    boxes = [
        simulate("teapot", pipeline, **small, **options).counts[f"{pipeline}.BOXES"]
        for pipeline, options in (("interval", {}), ("interval", {"intervals": 2}), ("interleaved", {"tile": 2}))
    ]
    assert boxes == [boxes[0], boxes[0] // 2, 4 * boxes[0]]
