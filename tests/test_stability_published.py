"""The stability atlas: what the published sources of Ru and Zhang leave out or move, pinned by holding and breaking."""

import pytest

from tilestamp.experiments.stability import as_published


@pytest.mark.parametrize(("height", "missing"), [(1056, 0), (1057, 1), (1080, 24), (1088, 0)])
def test_zhang_never_draws_the_rows_beyond_whole_blocks(height, missing):
    assert as_published.rows_missing(height) == missing


@pytest.mark.parametrize("leg", [2, 32])
def test_zhang_loses_one_fragment_of_a_frame(leg):
    assert as_published.pixels_missing(leg) == 1


@pytest.mark.parametrize(("minification", "noisy"), [(8.0, False), (11.0, True)])
def test_four_levels_leave_noise_beyond_eight_texels_a_pixel(minification, noisy):
    assert as_published.noisy(minification) == noisy


@pytest.mark.parametrize(("offset", "wrong"), [(0.6, 0), (0.4, 2)])
def test_samples_at_corners_move_an_edge_that_lies_left_of_the_centre(offset, wrong):
    assert as_published.columns_wrong(offset) == wrong
