"""Stamps: exact pictures for every shape, tests as counted by hand, the closed form of expected STE."""

import numpy as np
import pytest

from tests import naive_ste
from tilestamp.models.errors import TilestampError
from tilestamp.models.simt import AtomicMerge, Coalescing, Simt
from tilestamp.simulator.stages.fatahalian2009.micropolygon_samples import new_samples
from tilestamp.simulator.stages.fatahalian2009.micropolygons import Micropolygons
from tilestamp.simulator.stages.fatahalian2009.sample_positions import SUBPIXELS, sample_positions
from tilestamp.simulator.stages.fatahalian2009.stamps import stamp_shape, stamps
from tilestamp.simulator.stages.fatahalian2009.stamps_count import count_tests
from tilestamp.simulator.stages.fatahalian2009.stamps_events import CHUNK, StampsEvent

WIDTH, HEIGHT = 13, 9
GT200 = Simt(32, Coalescing.HALF_WARP_SEGMENTS, 16, 16, AtomicMerge.NONE, 30)


def soup(count=24, corners=4, size=3.0, seed=1):
    """Random polygons in and around the screen, some folded, some without area."""
    rng = np.random.default_rng(seed)
    vertices = (
        rng.random((count, 1, 3)) * [WIDTH + 4, HEIGHT + 4, 1] - [2, 2, 0] + rng.random((count, corners, 3)) * size
    )
    vertices[..., 2] = rng.random((count, corners))
    vertices[1] = vertices[1, :1]
    vertices[2, :, :2] = np.round(vertices[2, :, :2]) + 0.5
    return Micropolygons(vertices.astype(np.float32), np.arange(count, dtype=np.int32) // 5, np.zeros(count, np.uint8))


def draw(polygons, shape, spp=1, simt=GT200):
    samples = new_samples(WIDTH, HEIGHT, sample_positions(spp))
    return samples, stamps(polygons, samples, shape, simt).works[0]


@pytest.mark.parametrize(
    ("stamp", "touch", "coarse", "spp"),
    [
        (1, "box", 0, 1),
        (2, "polygon", 0, 4),
        ((4, 2), "box", 0, 3),
        (8, "polygon", 0, 1),
        (2, "box", 8, 2),
        (1, "polygon", 4, 1),
    ],
)
@pytest.mark.parametrize("corners", [3, 4])
def test_every_stamp_draws_the_exact_picture(stamp, touch, coarse, spp, corners):
    polygons = soup(corners=corners, size=7.0)
    samples, _ = draw(polygons, stamp_shape(stamp, touch, coarse), spp)
    ids, _ = naive_ste.render(polygons.vertices.tolist(), WIDTH, HEIGHT, samples.offsets.tolist())
    assert samples.polygon.reshape(HEIGHT, WIDTH, spp).tolist() == ids


def test_hits_are_those_of_python_integers():
    polygons = soup()
    samples, work = draw(polygons, stamp_shape(4, "box"), 2)
    _, hits = naive_ste.render(polygons.vertices.tolist(), WIDTH, HEIGHT, samples.offsets.tolist())
    assert work.total(StampsEvent.SAMPLE_HITS) == sum(hits)


@pytest.mark.parametrize("stamp", [(1, 1), (4, 4), (8, 2)])
def test_tests_are_all_samples_of_the_stamps_of_the_box(stamp):
    polygons = soup()
    _, work = draw(polygons, stamp_shape(stamp, "box"), 2)
    count = sum(len(naive_ste.box_stamps(p, WIDTH, HEIGHT, *stamp)) for p in polygons.vertices.tolist())
    assert work.total(StampsEvent.SAMPLE_TESTS) == count * stamp[0] * stamp[1] * 2


@pytest.mark.parametrize("stamp", [1, 4])
def test_polygon_stamps_are_those_that_clipping_leaves_something_in(stamp):
    polygons = soup(size=6.0)
    _, work = draw(polygons, stamp_shape(stamp, "polygon"))
    reached = sum(
        naive_ste.reaches(p, i, j, stamp, stamp)
        for p in polygons.vertices.tolist()
        for i, j in naive_ste.box_stamps(p, WIDTH, HEIGHT, stamp, stamp)
    )
    assert work.total(StampsEvent.STAMPS) == reached


@pytest.mark.parametrize("touch", ["box", "polygon"])
@pytest.mark.parametrize("stamp", [1, 2, 8, (4, 2)])
def test_counting_agrees_with_executing(stamp, touch):
    polygons = soup(300, size=5.0)
    samples, work = draw(polygons, stamp_shape(stamp, touch), 4)
    counted = count_tests(polygons, WIDTH, HEIGHT, samples.offsets, stamp_shape(stamp, touch))
    assert counted == (work.total(StampsEvent.SAMPLE_TESTS), work.total(StampsEvent.SAMPLE_HITS))


def test_a_filled_coarse_stamp_is_accepted_without_a_test():
    square = np.array([[[-1, -1, 0.5], [9, -1, 0.5], [9, 9, 0.5], [-1, 9, 0.5]]], np.float32)
    one = Micropolygons(square[:, [0, 1, 3]] * 3, np.zeros(1, np.int32), np.zeros(1, np.uint8))
    samples = new_samples(8, 8, sample_positions(1))
    work = stamps(one, samples, stamp_shape(2, "box", 8), GT200).works[0]
    assert (work.total(StampsEvent.FILLED_SAMPLES), work.total(StampsEvent.SAMPLE_TESTS)) == (64, 0)


def test_a_warp_holds_whole_stamps():
    """A box of 2 x 2 stamps of 16 samples: two warps of 32 lanes."""
    polygon = np.array([[[3, 3, 0], [5, 3, 0], [5, 5, 0], [3, 5, 0]]], np.float32)
    _, work = draw(Micropolygons(polygon, np.zeros(1, np.int32), np.zeros(1, np.uint8)), stamp_shape(4, "box"))
    assert work.total(StampsEvent.TEST_WARPS) == 2


def test_every_hit_is_one_atomic_lane():
    _, work = draw(soup(200), stamp_shape(4, "box"), 4)
    assert work.total(StampsEvent.ATOMIC_LANES) == work.total(StampsEvent.SAMPLE_HITS)
    assert work.atomic_requests.sum() == work.total(StampsEvent.ATOMIC_REQUESTS)


def test_a_unit_is_256_polygons():
    _, work = draw(soup(CHUNK + 1), stamp_shape(1, "box"))
    assert work.table[:, StampsEvent.POLYGONS].tolist() == [CHUNK, 1]


def test_the_map_counts_the_tests_on_screen():
    samples, work = draw(soup(), stamp_shape(1, "box"), 4)
    assert samples.tests.sum() == work.total(StampsEvent.SAMPLE_TESTS)


@pytest.mark.parametrize("spp", range(1, 17))
def test_sample_positions_are_distinct_and_in_the_pixel(spp):
    positions = sample_positions(spp)
    assert len(np.unique(positions, axis=0)) == spp
    assert (positions >= 0).all()
    assert (positions < SUBPIXELS).all()


def test_positions_come_from_a_users_file(tmp_path):
    (tmp_path / "mine.toml").write_text("2 = [[0.25, 0.5], [0.75, 0.0]]")
    assert sample_positions(2, tmp_path / "mine.toml").tolist() == [[1024, 2048], [3072, 0]]


@pytest.mark.parametrize("text", ["2 = [[0.25, 0.5]]", "2 = [[0.25, 1.5], [0, 0]]", "3 = []", "2 = oops"])
def test_a_bad_file_of_positions_is_named(tmp_path, text):
    (tmp_path / "bad.toml").write_text(text)
    with pytest.raises(TilestampError, match=r"bad\.toml"):
        sample_positions(2, tmp_path / "bad.toml")


@pytest.mark.parametrize(("stamp", "touch", "coarse"), [(4, "box", 6), (8, "box", 4)])
def test_stamps_that_cannot_be_laid_are_refused(stamp, touch, coarse):
    with pytest.raises(TilestampError):
        stamp_shape(stamp, touch, coarse)
