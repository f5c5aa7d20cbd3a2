"""Every event of stages that walk boxes in lockstep, against Python: FreePipe, stamps, across polygons, bit mask."""

import numpy as np
import pytest

from tests import naive_stamps, naive_warps
from tests.test_freepipe import TINY, flat
from tests.test_freepipe import soup as triangle_soup
from tests.test_stamps import GT200, HEIGHT, WIDTH, soup
from tilestamp.models.simt import AtomicMerge, Coalescing, Simt
from tilestamp.simulator.stages.fatahalian2009.across_polygons import PACKINGS, across_polygons
from tilestamp.simulator.stages.fatahalian2009.micropolygon_samples import new_samples
from tilestamp.simulator.stages.fatahalian2009.sample_positions import sample_positions
from tilestamp.simulator.stages.fatahalian2009.stamps import stamp_shape, stamps
from tilestamp.simulator.stages.liu2010.freepipe import freepipe
from tilestamp.simulator.stages.liu2010.freepipe_triangle import make_pieces
from tilestamp.simulator.stages.yao2011.bit_mask import KINDS, bit_mask

HOPPER = Simt(coalescing=Coalescing.WARP_SECTORS, atomic_merge=AtomicMerge.SECTOR)
SHAPES = [("gt200", GT200), ("hopper", HOPPER)]
by_machine = pytest.mark.parametrize("simt", [simt for _, simt in SHAPES], ids=[name for name, _ in SHAPES])


def twice(polygons):
    """Each polygon two times, one after the other: lanes that want the same samples."""
    return polygons._replace(
        vertices=polygons.vertices.repeat(2, axis=0), patch=polygons.patch.repeat(2), shade=polygons.shade.repeat(2)
    )


def nonzero(counts):
    return {name: count for name, count in counts.items() if count}


@by_machine
def test_freepipe(simt):
    positions, triangles = triangle_soup(40, seed=2)
    triangles = triangles.repeat(2, axis=0)
    _, (work,), _ = freepipe(positions, triangles, 24, 16, simt, block=64)
    unroll = 4 if simt is HOPPER else 1
    expected = naive_warps.freepipe(triangles, make_pieces(positions, triangles, 24, 16), 24, 64, unroll, simt)
    assert min(expected["CLIP_HITS"], expected["ATOMIC_CONFLICTS"]) > 0
    assert nonzero(work.counts()) == nonzero(expected)


def test_freepipe_reads_each_pixel_that_it_hits_first():
    """Two triangles over one pixel, in one warp: one read of 8 bytes; the farther one sends no atomic after it."""
    corners, depths = flat(TINY * 2), np.repeat(np.float32([0.5, 0.0]), 3)
    positions, triangles = corners
    positions[:, 2] = depths
    plain, early = (freepipe(positions, triangles, 64, 64, HOPPER, early=e)[1][0] for e in (False, True))
    added = {name: n - plain.counts()[name] for name, n in early.counts().items() if n != plain.counts()[name]}
    assert added == {"READS": 1, "LOAD_TRANSACTIONS": 1, "LOAD_BYTES": 32}


@by_machine
@pytest.mark.parametrize("packing", PACKINGS)
def test_across_polygons(packing, simt):
    polygons = twice(soup(40))
    samples = new_samples(WIDTH, HEIGHT, sample_positions(2))
    (work,) = across_polygons(polygons, samples, packing, simt).works
    offsets = samples.offsets.tolist()
    expected = naive_warps.across_polygons(polygons.vertices.tolist(), WIDTH, HEIGHT, offsets, packing, simt)
    assert nonzero(work.counts()) == nonzero(expected)


@by_machine
@pytest.mark.parametrize("shape", [(4, "box", 0), ((4, 2), "polygon", 0), (8, "box", 0), (2, "polygon", 4)])
def test_stamps(shape, simt):
    polygons = soup(24, corners=3, size=18.0, seed=8)
    samples = new_samples(WIDTH, HEIGHT, sample_positions(2))
    laid = stamp_shape(*shape)
    (work,) = stamps(polygons, samples, laid, simt).works
    expected = naive_stamps.stamps(polygons.vertices.tolist(), WIDTH, HEIGHT, samples.offsets.tolist(), laid, simt)
    assert (expected["FILLED_WARPS"] > 0) == (shape[2] > 0)
    named = {name: count for name, count in expected.items() if name != "ATOMIC_CONFLICTS"}
    assert expected["ATOMIC_CONFLICTS"] == 0
    assert nonzero(work.counts()) == nonzero(named)


@by_machine
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("in_flight", [1, 32])
def test_bit_mask(kind, in_flight, simt):
    polygons = twice(soup(20, size=4.0))
    samples = new_samples(WIDTH, HEIGHT, sample_positions(4))
    (work,) = bit_mask(polygons, samples, kind, in_flight, simt).works
    given = (polygons.vertices.tolist(), polygons.patch.tolist(), WIDTH, HEIGHT, samples.offsets.tolist())
    assert nonzero(work.counts()) == nonzero(naive_stamps.bit_mask(*given, kind, in_flight, simt))


def test_a_mask_beyond_512_words_lies_in_global_memory():
    """Of 64 x 64 pixels with 16 samples: 2048 words."""
    polygons = soup(4, size=60.0)
    samples = new_samples(64, 64, sample_positions(16))
    (work,) = bit_mask(polygons, samples, "plain", 32, GT200).works
    given = (polygons.vertices.tolist(), polygons.patch.tolist(), 64, 64, samples.offsets.tolist())
    expected = naive_stamps.bit_mask(*given, "plain", 32, GT200)
    assert expected["GLOBAL_WRITE_WARPS"] > 0
    assert nonzero(work.counts()) == nonzero(expected)
