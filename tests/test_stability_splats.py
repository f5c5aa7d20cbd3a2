"""Atlas rows of splats, with room around each boundary."""

import pytest

from tilestamp.experiments.stability import splat_lists, splat_order, splat_projection


@pytest.mark.parametrize("tile", [4, 16])
def test_below_an_opacity_of_0_35_the_square_cuts_nothing(tile):
    """exp(-9 / 2) times it is 1/255: at three standard deviations nothing can be seen."""
    assert splat_lists.lost(0.34, tile) == 0


def test_of_opaque_gaussians_the_square_cuts_what_can_be_seen():
    assert splat_lists.lost(0.99, 16) > 1.5 / 255
    assert splat_lists.lost(0.99, 4) > 2.5 / 255


def test_list_lengths_of_full_screens_fill_32_bits():
    most = splat_lists.overflow(1920, 1080)
    assert most * 120 * 68 <= 2**32 - 1 < (most + 1) * 120 * 68


def test_crossing_discs_pop_by_the_product_of_opacities():
    """At equal alphas a, the order moves a * a of a channel from one colour to the other."""
    assert splat_order.jump(0.99, 0.0) == pytest.approx(0.83, abs=0.03)
    assert splat_order.jump(0.1, 0.0) == pytest.approx(0.0084, abs=0.001)


def test_a_gaussian_nearer_than_0_2_is_dropped_whole():
    assert not splat_projection.vanishes(0.21)
    assert splat_projection.vanishes(0.19)


def test_a_small_gaussian_is_where_it_is_seen_and_a_large_one_is_not():
    assert splat_projection.width_error(0.02) < 0.05
    assert splat_projection.width_error(0.2) > 10


def test_the_determinant_of_a_long_needle_cancels():
    assert splat_projection.determinant_error(300.0) < 0.02
    assert splat_projection.determinant_error(10000.0) > 0.1
