"""Textures: mip chains, layouts, filters against a direct evaluation in double precision."""

import numpy as np
import pytest

from tests import naive_textured as naive
from tilestamp.simulator.scenes.texture import (
    TILE,
    add_bilinear,
    add_trilinear,
    level_of_detail,
    nearest,
    texel_index,
    texel_step,
    texture_chains,
)

POINTS = [(0.0, 0.0), (0.31, 0.77), (0.999, 0.001), (1.0, 1.0), (-0.3, 2.6), (5.5, -7.25)]


@pytest.fixture(scope="module")
def image():
    return np.random.default_rng(1).integers(0, 256, (16, 8, 4), dtype=np.uint8)


@pytest.mark.parametrize("tile", [0, TILE, 8])
@pytest.mark.parametrize("point", POINTS)
def test_bilinear_filtering_is_the_direct_evaluation(image, point, tile):
    out = np.zeros(4, np.float32)
    u, v = map(np.float32, point)
    add_bilinear(texture_chains([image], tile=tile), 0, 0, u, v, np.float32(1.0), out)
    assert out == pytest.approx(naive.bilinear(image / 255.0, *point), abs=2e-5)


@pytest.mark.parametrize("tile", [0, TILE, 8])
@pytest.mark.parametrize("lod", [0.0, 0.5, 1.25, 3.0, 4.0])
def test_trilinear_filtering_is_the_direct_evaluation(image, lod, tile):
    out = np.zeros(4, np.float32)
    chains = texture_chains([image], tile=tile)
    add_trilinear(chains, 0, np.float32(lod), np.float32(0.31), np.float32(0.77), out)
    assert out == pytest.approx(naive.trilinear(image / 255.0, 0.31, 0.77, lod), abs=1e-5)


def test_nearest_takes_the_texel_that_the_coordinate_falls_into(image):
    out = np.zeros(4, np.float32)
    nearest(texture_chains([image]), 0, np.float32(0.26), np.float32(0.51), out)
    assert out == pytest.approx(image[8, 2] / 255.0)


def test_coordinates_outside_wrap(image):
    chains = texture_chains([image])
    assert texel_index(chains, 0, 0, -1, -1) == texel_index(chains, 0, 0, 7, 15)


def test_the_tiled_layout_holds_every_texel_once():
    image = np.arange(5 * 6 * 4, dtype=np.uint8).reshape(5, 6, 4)
    chains = texture_chains([image], tile=TILE, mips=False)
    for y in range(5):
        for x in range(6):
            assert chains.texels[texel_index(chains, 0, 0, x, y)] * 255.0 == pytest.approx(image[y, x])


def test_a_storage_tile_is_contiguous(image):
    chains = texture_chains([image], tile=TILE)
    indices = {texel_index(chains, 0, 0, x, y) for y in range(TILE) for x in range(TILE)}
    assert indices == set(range(TILE * TILE))


def test_a_chain_of_an_odd_size_ends_in_one_texel():
    chains = texture_chains([np.full((5, 3, 4), 255, np.uint8)])
    last = chains.levels[0, chains.counts[0] - 1]
    assert (last[1], last[2]) == (1, 1)
    assert chains.texels.max() == chains.texels.min() == 1.0


def test_two_textures_keep_apart():
    black, white = np.zeros((4, 4, 4), np.uint8), np.full((2, 2, 4), 255, np.uint8)
    chains = texture_chains([black, white])
    out = np.zeros(4, np.float32)
    nearest(chains, 1, np.float32(0.9), np.float32(0.9), out)
    assert out == pytest.approx([1.0] * 4)


def test_the_level_of_detail_is_the_log_of_the_longer_derivative(image):
    chains = texture_chains([image])
    step = texel_step(chains, 0, *map(np.float32, (0.0, 0.25, 0.125, 0.0)))  # 4 texels down, 1 across
    assert step == pytest.approx(16.0)
    lod = level_of_detail(chains, 0, step)
    assert lod == pytest.approx(2.0)


def test_magnification_has_level_zero(image):
    assert level_of_detail(texture_chains([image]), 0, np.float32(0.9)) == 0.0


def test_a_chain_has_as_many_levels_as_asked_for():
    image = np.zeros((64, 64, 4), np.uint8)
    counts = [int(texture_chains([image], levels=levels).counts[0]) for levels in (0, 4, 20)]
    assert counts == [7, 4, 7]
