"""Every event of fine raster against Python, in both releases, all modes, one sample a pixel and several."""

import pytest

from tests import naive_fine
from tests.test_counts_of_warps import nonzero
from tests.test_fine_raster import MODES, mesh_soup
from tests.tile_lists import box_lists
from tilestamp.models.simt import Coalescing, Simt
from tilestamp.simulator.stages.laine2011 import fine_raster as stage
from tilestamp.simulator.stages.laine2011.triangle_setup import triangle_setup

LINES, SECTORS = Simt(coalescing=Coalescing.WARP_LINES, sms=2), Simt(coalescing=Coalescing.WARP_SECTORS, sms=2)


@pytest.mark.parametrize("simt", [LINES, SECTORS], ids=["lines", "sectors"])
@pytest.mark.parametrize(
    ("release", "samples", "mode"),
    [
        ("1.1", 1, "depth"),
        ("1.1", 1, "blend"),
        ("1.1", 1, "color"),
        ("1.1", 1, "depth-only"),
        ("nvdiffrast", 1, "depth"),
        ("1.1", 4, "depth"),
        ("1.1", 2, "blend"),
        ("1.1", 8, "color"),
        ("1.1", 2, "depth-only"),
    ],
)
def test_fine_raster(release, samples, mode, simt):
    size = (12, 7)
    depth, interpolate = MODES[mode]
    positions, triangles = mesh_soup(2, count=150, spread=1.2, near=0.3)
    positions[:3] = [[-4, -4, -0.9, 1], [8, -4, -0.9, 1], [-4, 8, -0.9, 1]]  # over all tiles, and in front
    setup, _, _ = triangle_setup(
        positions, triangles, *size, simt, release=release, samples=samples, depth=depth, interpolate=interpolate
    )
    starts, entries, active = box_lists(setup, *size)
    options = {"release": release, "samples": samples, "mode": mode}
    _, (work,), _ = stage.fine_raster(setup, starts, entries, active, *size, simt, **options)
    job = naive_fine.Job(setup, *size, simt, release == "nvdiffrast", samples, *stage.MODES[mode])
    expected = naive_fine.fine(job, starts, entries, active)
    assert expected["EARLY_Z_KILLS"] > 0 or release != "1.1" or not depth
    assert nonzero(work.counts()) == nonzero(expected)


def test_a_second_draw_loads_the_tiles_of_the_first():
    """Colour and depth of 6 tiles, 8 rows each; samples stay in memory, and so are not loaded."""
    size, options = (20, 13), {"release": "1.1", "mode": "blend"}
    positions, triangles = mesh_soup(2, count=8)
    for samples, loads in ((1, 6 * 16), (2, 0)):
        setup, _, _ = triangle_setup(positions, triangles, *size, SECTORS, samples=samples, release="1.1", depth=False)
        lists = box_lists(setup, *size)
        buffers, (first,), _ = stage.fine_raster(setup, *lists, *size, SECTORS, samples=samples, **options)
        _, (second,), _ = stage.fine_raster(setup, *lists, *size, SECTORS, samples=samples, buffers=buffers, **options)
        E = first.events
        assert first.total(E.TILE_LOADS) == 0
        assert second.total(E.TILE_LOADS) == (6 if samples == 1 else 0)
        assert second.total(E.LOAD_TRANSACTIONS) - first.total(E.LOAD_TRANSACTIONS) == loads
        assert second.total(E.TILE_STORES) == (6 if samples == 1 else 0)
