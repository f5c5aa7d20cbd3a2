"""Speed of counting and subdividing: 4 M microquads at 1600x1200 (aim: under 0.5 s), a cube of 7 rounds (under 1 s)."""

import numpy as np
import pytest

from tilestamp.experiments.exploration import nonlinear, quad_merging
from tilestamp.experiments.ste.setting import cube
from tilestamp.models.simt import Simt
from tilestamp.simulator.scenes.catmull_clark import limit_positions, subdivide, surface_of
from tilestamp.simulator.simulation import simulate
from tilestamp.simulator.stages.fatahalian2009.micropolygon_samples import new_samples
from tilestamp.simulator.stages.fatahalian2009.micropolygons import Micropolygons
from tilestamp.simulator.stages.fatahalian2009.motion import blur_samples, moved, stratified_pattern
from tilestamp.simulator.stages.fatahalian2009.sample_positions import sample_positions
from tilestamp.simulator.stages.fatahalian2009.stamps import stamp_shape
from tilestamp.simulator.stages.fatahalian2009.stamps_count import count_tests
from tilestamp.simulator.stages.fatahalian2010.quad_shading import quad_shading
from tilestamp.simulator.stages.ragankelley2011.decoupled_shading import Shading, decoupled_shading

MICROQUADS = 4_000_000
WIDTH, HEIGHT = 1600, 1200


@pytest.fixture(scope="module")
def microquads():
    """Random quads of half a pixel."""
    rng = np.random.default_rng(1)
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * 0.7
    vertices = np.zeros((MICROQUADS, 4, 3), np.float32)
    vertices[:, :, :2] = rng.random((MICROQUADS, 1, 2)) * [WIDTH, HEIGHT] + corners
    return Micropolygons(vertices, np.arange(MICROQUADS, dtype=np.int32), np.zeros(MICROQUADS, np.uint8))


@pytest.mark.parametrize("touch", ["box", "polygon"])
@pytest.mark.parametrize("stamp", [1, 2, 4, 8, 16])
def test_count_4m_microquads(benchmark, microquads, stamp, touch):
    benchmark(count_tests, microquads, WIDTH, HEIGHT, sample_positions(1), stamp_shape(stamp, touch))


def test_subdivide_a_cube_seven_times(benchmark):
    benchmark(lambda: limit_positions(subdivide(surface_of(cube().cage), 7)))


def test_subdivide_bigguy_to_sub_pixel_size(benchmark, shared):
    from tilestamp.simulator.scenes.quad_cage import read_cage

    surface = surface_of(read_cage(shared / "scenes" / "cages" / "bigguy.obj"))
    benchmark(lambda: limit_positions(subdivide(surface, 5)))


@pytest.mark.parametrize("entries", [0, 32])
def test_merge_quads_of_pixel_sized_triangles(benchmark, entries):
    polygons, simt = quad_merging.mesh(0.5, 256), Simt()

    def draw():
        quad_shading(polygons, new_samples(256, 256, sample_positions(4)), entries, simt)

    benchmark(draw)


@pytest.mark.parametrize("bounds", ["whole", "intervals"])
def test_draw_a_moving_defocused_teapot_in_tiles(benchmark, bounds):
    benchmark(
        simulate, "teapot", "stochastic", width=320, height=240, fidelity="counts", edge=8.0, motion=16.0, bounds=bounds
    )


@pytest.mark.parametrize("cache", [16, 1024])
def test_shade_moving_triangles_through_a_cache(benchmark, cache):
    moving, pattern = moved(quad_merging.mesh(100.0, 96), (8.0, 0.0), 1.0), stratified_pattern(4)

    def draw():
        decoupled_shading(moving, pattern, blur_samples(96, 96, pattern), Shading(1.0, cache, True), Simt())

    benchmark(draw)


@pytest.mark.parametrize("method", ["rays", "tessellated"])
def test_draw_a_fisheye_of_a_room(benchmark, method):
    benchmark(
        simulate, nonlinear.room(16), "nonlinear", width=320, height=240, camera=nonlinear.EYE, fidelity="counts",
        method=method,
    )  # fmt: skip
