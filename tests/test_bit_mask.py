"""Bit masks: what they filter, where the plain mask errs, and that the depth mask never does."""

import numpy as np
import pytest

from tests import naive_ste
from tests.test_stamps import GT200, HEIGHT, WIDTH, soup
from tilestamp.models.errors import TilestampError
from tilestamp.models.simt import Simt
from tilestamp.simulator.stages.fatahalian2009.micropolygon_samples import new_samples
from tilestamp.simulator.stages.fatahalian2009.micropolygons import Micropolygons
from tilestamp.simulator.stages.fatahalian2009.sample_positions import sample_positions
from tilestamp.simulator.stages.yao2011.bit_mask import KINDS, BitMaskEvent, bit_mask


def draw(polygons, kind, lanes, spp=1):
    samples = new_samples(WIDTH, HEIGHT, sample_positions(spp))
    return samples, bit_mask(polygons, samples, kind, lanes, GT200).works[0]


def flat_grid(cells=12, side=0.7):
    """One flat patch of small squares, row by row."""
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * side
    at = np.stack(np.meshgrid(np.arange(cells), np.arange(cells)), axis=-1).reshape(-1, 1, 2) * side + 0.3
    vertices = np.concatenate([at + corners, np.full((cells * cells, 4, 1), 0.5)], axis=2)
    return Micropolygons(vertices.astype(np.float32), np.zeros(cells**2, np.int32), np.zeros(cells**2, np.uint8))


def exact(polygons, spp=1):
    return naive_ste.render(polygons.vertices.tolist(), WIDTH, HEIGHT, sample_positions(spp).tolist())[0]


def ids(samples):
    return samples.polygon.reshape(HEIGHT, WIDTH, -1).tolist()


@pytest.mark.parametrize("spp", [1, 4])
def test_in_sequence_the_mask_filters_what_was_hit_before(spp):
    polygons = soup(60, size=4.0)
    _, work = draw(polygons, "plain", 1, spp)
    naive = naive_ste.mask_tests(
        polygons.vertices.tolist(), polygons.patch.tolist(), WIDTH, HEIGHT, sample_positions(spp).tolist()
    )
    assert (work.total(BitMaskEvent.SAMPLE_TESTS), work.total(BitMaskEvent.SAMPLE_HITS)) == naive


@pytest.mark.parametrize("lanes", [1, 7, 32])
@pytest.mark.parametrize("spp", [1, 8])
def test_the_depth_mask_is_exact(lanes, spp):
    polygons = soup(60, size=4.0)
    assert ids(draw(polygons, "depth", lanes, spp)[0]) == exact(polygons, spp)


def test_the_depth_mask_is_exact_on_triangles():
    polygons = soup(60, corners=3, size=6.0)
    assert ids(draw(polygons, "depth", 32)[0]) == exact(polygons)


def test_the_depth_mask_still_filters():
    tests = {kind: draw(flat_grid(), kind, 1)[1].total(BitMaskEvent.SAMPLE_TESTS) for kind in KINDS}
    assert tests["plain"] == tests["facing"] == tests["depth"]


@pytest.mark.parametrize("kind", KINDS)
def test_a_flat_patch_is_exact_under_every_mask(kind):
    assert ids(draw(flat_grid(), kind, 1)[0]) == exact(flat_grid())


def test_the_plain_mask_keeps_the_back_of_a_patch_that_covers_a_sample_twice():
    far, near = [[[1, 1, z], [6, 1, z], [6, 6, z], [1, 6, z]] for z in (0.8, 0.2)]
    both = Micropolygons(np.array([far, near], np.float32), np.zeros(2, np.int32), np.zeros(2, np.uint8))
    shown = {kind: set(draw(both, kind, 1)[0].polygon.tolist()) for kind in KINDS}
    assert shown == {"plain": {-1, 0}, "facing": {-1, 0}, "depth": {-1, 1}}


def test_the_facing_mask_keeps_both_sides_of_a_patch():
    far, near = [[[1, 1, z], [6, 1, z], [6, 6, z], [1, 6, z]] for z in (0.8, 0.2)]
    both = Micropolygons(np.array([far, near[::-1]], np.float32), np.zeros(2, np.int32), np.zeros(2, np.uint8))
    assert set(draw(both, "facing", 1)[0].polygon.tolist()) == {-1, 1}


def test_patches_do_not_filter_each_other():
    polygons = soup(40, size=4.0)
    apart = polygons._replace(patch=np.arange(40, dtype=np.int32))
    samples, work = draw(apart, "plain", 32)
    assert ids(samples) == exact(polygons)
    assert len(work.table) == 40


def test_polygons_in_flight_together_do_not_see_each_others_hits():
    """Two equal squares of one pixel: the second is filtered only where the first is done."""
    square = [[3.2, 3.2, 0.5], [3.8, 3.2, 0.5], [3.8, 3.8, 0.5], [3.2, 3.8, 0.5]]
    twice = Micropolygons(np.array([square, square], np.float32), np.zeros(2, np.int32), np.zeros(2, np.uint8))
    tests = [draw(twice, "plain", lanes)[1].total(BitMaskEvent.SAMPLE_TESTS) for lanes in (1, 2)]
    assert tests == [1, 2]


def test_every_hit_writes_the_mask():
    _, work = draw(flat_grid(), "plain", 32)
    assert work.total(BitMaskEvent.MASK_WRITES) == work.total(BitMaskEvent.SAMPLE_HITS)
    assert work.total(BitMaskEvent.MASK_WRITE_CONFLICTS) > 0


def test_a_mask_too_large_for_shared_memory_is_read_from_global_memory():
    wide = np.array([[[0, 0, 0], [500, 0, 0], [500, 200, 0], [0, 200, 0]]], np.float32)
    samples = new_samples(512, 256, sample_positions(1))
    one = Micropolygons(wide, np.zeros(1, np.int32), np.zeros(1, np.uint8))
    work = bit_mask(one, samples, "plain", 32, Simt()).works[0]
    assert work.total(BitMaskEvent.MASK_READ_WARPS) == 0
    assert work.total(BitMaskEvent.GLOBAL_READ_WARPS) > 0


def test_a_warp_has_no_more_micropolygons_in_flight_than_lanes():
    with pytest.raises(TilestampError, match="1 to 32"):
        draw(soup(), "plain", 33)
