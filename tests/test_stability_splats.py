"""The stability atlas: where splats by tile lists show a wrong picture, pinned by holding and breaking."""

import pytest

from tilestamp.experiments.stability import splat_shapes, splats


@pytest.mark.parametrize(("opacity", "wrong"), [(0.35, False), (0.42, True)])
def test_the_square_cuts_alphas_that_show_from_opacity_0_39_on(opacity, wrong):
    """At three sigmas alpha is 0.0111 of the opacity: 1/255 where that is 0.353; pixels are whole."""
    assert (splats.cut(opacity) > 1e-4) == wrong


def test_a_larger_tile_cuts_less():
    assert splats.cut(1.0, tile=16) <= splats.cut(1.0, tile=4)


@pytest.mark.parametrize(("sigmas", "wrong"), [(6.0, False), (4.0, True)])
def test_gaussians_that_overlap_pop_as_the_camera_turns(sigmas, wrong):
    assert splats.pops(sigmas) == wrong


@pytest.mark.parametrize(("depth", "lost"), [(0.21, False), (0.199, True)])
def test_what_is_nearer_than_a_fifth_is_lost(depth, lost):
    assert splats.lost_near(depth) == lost


@pytest.mark.parametrize(("count", "wrong"), [(16_570, False), (16_571, True)])
def test_offsets_wrap_around_at_two_to_the_31_pairs(count, wrong):
    """A screen of 1920x1080 has 129,600 tiles of 4."""
    assert splats.overflows(count) == wrong


@pytest.mark.parametrize(("power", "lost"), [(6, False), (10, True)])
def test_a_sliver_without_width_is_lost_where_a_pixel_is_too_small_to_count(power, lost):
    assert splats.vanishes(power) == lost


@pytest.mark.parametrize(("scale", "waits"), [(0.05, False), (2.0, True)])
def test_one_thread_writes_all_tiles_of_a_large_gaussian(scale, waits):
    assert (splats.waits(scale) > 0.5) == waits


def test_a_small_gaussian_is_where_it_is_seen_and_a_large_one_is_not():
    assert splat_shapes.width_error(0.02) < 0.05
    assert splat_shapes.width_error(0.2) > 5


def test_the_determinant_of_a_long_needle_cancels():
    assert splat_shapes.determinant_error(300.0) < 0.02
    assert splat_shapes.determinant_error(10000.0) > 0.1
