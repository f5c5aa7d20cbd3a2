"""Every event of triangle setup against Python."""

import numpy as np
import pytest

from tests.naive_setup import setup_counts
from tests.test_counts_of_warps import nonzero
from tests.test_fine_raster import mesh_soup
from tilestamp.models.simt import Coalescing, Simt
from tilestamp.simulator.stages.laine2011.triangle_setup import triangle_setup

LINES, SECTORS = Simt(coalescing=Coalescing.WARP_LINES), Simt(coalescing=Coalescing.WARP_SECTORS)


def mixed():
    """Triangles of all kinds: whole, across the planes, outside, far out, and about as small as a pixel."""
    parts = [mesh_soup(1, 60, 0.8), mesh_soup(2, 60, 1.5, 0.6), mesh_soup(3, 40, 300.0, 0.3)]
    for seed, size in ((4, 1.0), (5, 0.3)):
        part = mesh_soup(seed, 80, 0.9)
        part[0][1::3] = part[0][0::3] + np.float32([0.14 * size, 0.02 * size, 0, 0])
        part[0][2::3] = part[0][0::3] + np.float32([0.02 * size, 0.1 * size, 0, 0])
        parts.append(part)
    positions = np.concatenate([part[0] for part in parts])
    return positions, np.arange(len(positions), dtype=np.int32).reshape(-1, 3)


@pytest.mark.parametrize("simt", [LINES, SECTORS], ids=["lines", "sectors"])
@pytest.mark.parametrize(("release", "samples"), [("1.1", 1), ("1.1", 4), ("nvdiffrast", 1)])
def test_triangle_setup(release, samples, simt):
    positions, triangles = mixed()
    _, (work,), _ = triangle_setup(positions, triangles, 20, 13, simt, release=release, samples=samples)
    expected = setup_counts(positions, triangles, 20, 13, release, samples, simt)
    assert {"BETWEEN_CULLED", "RETEST_WARPS", "ATOMIC_CONFLICTS", "VIEWPORT_CULLED"} <= nonzero(expected).keys()
    assert nonzero(work.counts()) == nonzero(expected)


@pytest.mark.parametrize(("depth", "interpolate"), [(False, True), (True, False), (False, False)])
def test_what_a_mode_does_not_need_is_not_stored(depth, interpolate):
    positions, triangles = mesh_soup(1, 60, 0.8)
    options = {"depth": depth, "interpolate": interpolate}
    _, (work,), _ = triangle_setup(positions, triangles, 20, 13, SECTORS, release="1.1", **options)
    expected = setup_counts(positions, triangles, 20, 13, "1.1", 1, SECTORS, **options)
    assert nonzero(work.counts()) == nonzero(expected)
