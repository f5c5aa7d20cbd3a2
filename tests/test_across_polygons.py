"""Across polygons: the exact picture in every packing, and warps as long as their longest lane."""

import numpy as np
import pytest

from tests import naive_ste
from tests.test_stamps import GT200, HEIGHT, WIDTH, soup
from tilestamp.simulator.stages.fatahalian2009.across_polygons import (
    CHUNK,
    PACKINGS,
    AcrossPolygonsEvent,
    across_polygons,
)
from tilestamp.simulator.stages.fatahalian2009.micropolygon_samples import new_samples
from tilestamp.simulator.stages.fatahalian2009.sample_positions import sample_positions
from tilestamp.simulator.stages.fatahalian2009.stamps import stamp_shape
from tilestamp.simulator.stages.fatahalian2009.stamps_count import count_tests


def draw(polygons, packing, spp=1):
    samples = new_samples(WIDTH, HEIGHT, sample_positions(spp))
    return samples, across_polygons(polygons, samples, packing, GT200).works[0]


def box_samples(polygons):
    return [len(naive_ste.box_stamps(p, WIDTH, HEIGHT, 1, 1)) for p in polygons.vertices.tolist()]


@pytest.mark.parametrize("packing", PACKINGS)
def test_every_packing_draws_the_exact_picture(packing):
    polygons = soup(60)
    samples, _ = draw(polygons, packing, 2)
    ids, _ = naive_ste.render(polygons.vertices.tolist(), WIDTH, HEIGHT, samples.offsets.tolist())
    assert samples.polygon.reshape(HEIGHT, WIDTH, 2).tolist() == ids


@pytest.mark.parametrize("packing", PACKINGS)
def test_tests_and_hits_are_those_of_one_pixel_stamps(packing):
    polygons = soup(300)
    samples, work = draw(polygons, packing, 4)
    counted = count_tests(polygons, WIDTH, HEIGHT, samples.offsets, stamp_shape(1, "box"))
    assert counted == (work.total(AcrossPolygonsEvent.SAMPLE_TESTS), work.total(AcrossPolygonsEvent.SAMPLE_HITS))


def test_a_warp_runs_as_long_as_its_longest_lane():
    polygons = soup(100)
    sizes = box_samples(polygons)
    longest = sum(max(sizes[k : k + 32]) for k in range(0, 100, 32))
    assert draw(polygons, "in-order")[1].total(AcrossPolygonsEvent.TEST_WARPS) == longest


def test_sorted_lanes_are_sorted_by_the_samples_of_their_boxes():
    polygons = soup(CHUNK)
    sizes = sorted(box_samples(polygons))
    longest = sum(max(sizes[k : k + 32]) for k in range(0, CHUNK, 32))
    assert draw(polygons, "sorted")[1].total(AcrossPolygonsEvent.TEST_WARPS) == longest


def test_repacking_is_never_longer_than_waiting_and_sets_up_more_often():
    polygons = soup(CHUNK * 3, size=4.0)
    waiting, repacked = (draw(polygons, packing)[1] for packing in ("in-order", "repacked"))
    assert repacked.total(AcrossPolygonsEvent.TEST_WARPS) < waiting.total(AcrossPolygonsEvent.TEST_WARPS)
    assert repacked.total(AcrossPolygonsEvent.SETUP_WARPS) > waiting.total(AcrossPolygonsEvent.SETUP_WARPS)


def test_every_polygon_is_set_up_once():
    for packing in PACKINGS:
        assert draw(soup(500), packing)[1].total(AcrossPolygonsEvent.POLYGONS) == 500


def test_nothing_is_drawn_of_nothing():
    nothing = soup(3)._replace(vertices=np.zeros((0, 4, 3), np.float32), patch=np.zeros(0, np.int32))
    samples, work = draw(nothing, "in-order")
    assert (samples.polygon == -1).all()
    assert work.table.shape[0] == 0
