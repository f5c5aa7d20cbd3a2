"""Derivatives of texture coordinates from planes: those of fractions, and what they change in the pipeline."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.textured_soup import soup
from tilestamp.experiments.exploration import derivatives as road
from tilestamp.simulator.simulation import simulate
from tilestamp.simulator.stages.zhang2025.pixel_shader_planes import plane_derivatives
from tilestamp.simulator.stages.zhang2025.triangle_setup import ONE_OVER_W, PLANES, UV

SIZE = {"width": 72, "height": 56}


def found(planes, x, y):
    uv, derivatives = np.zeros(2, np.float32), np.zeros((2, 2), np.float32)
    plane_derivatives(planes, np.float32(x), np.float32(y), uv, derivatives)
    return uv, derivatives


@given(st.integers(0, 10**6), st.integers(0, 500), st.integers(0, 500))
@settings(max_examples=60, deadline=None)
def test_derivatives_of_planes_are_those_of_fractions(seed, i, j):
    """The quotient rule in whole numbers."""
    rng = np.random.default_rng(seed)
    planes = np.zeros((PLANES, 3), np.float32)
    planes[[UV, UV + 1]] = rng.normal(size=(2, 3)) * [0.01, 0.01, 1]
    planes[ONE_OVER_W] = np.append(rng.uniform(-0.001, 0.001, 2), 1.5)
    x, y = Fraction(2 * i + 1, 2), Fraction(2 * j + 1, 2)
    value = lambda plane: Fraction(plane[0]) * x + Fraction(plane[1]) * y + Fraction(plane[2])  # noqa: E731
    exact = {n: [Fraction(float(c)) for c in planes[n]] for n in (UV, UV + 1, ONE_OVER_W)}
    below = value(exact[ONE_OVER_W])
    _, got = found(planes, float(x), float(y))
    for n in range(2):
        above = value(exact[UV + n])
        for d in range(2):
            wanted = (exact[UV + n][d] * below - above * exact[ONE_OVER_W][d]) / below**2
            assert got[n, d] == pytest.approx(float(wanted), abs=1e-5)


def test_on_a_plane_without_perspective_quads_choose_the_same_levels():
    level = road.levels(0.0)
    assert level["quads"] == pytest.approx(level["planes"], abs=1e-12)


def test_levels_of_a_floor_are_those_of_tiny_differences():
    """The closed form against differences over a thousandth of a pixel."""
    tilt, step, j = 0.9, 1e-3, np.arange(road.HEIGHT)
    depth = lambda rows: 1.0 / (1.0 + tilt * ((2 * rows + 1) / road.HEIGHT - 1))  # noqa: E731
    scale = road.WIDTH / 2
    x = (2 * 7 + 1) / road.WIDTH - 1
    up = (depth(j + step) - depth(j - step)) / (2 * step) * scale
    along = np.hypot(2 / road.WIDTH * depth(j) * scale, 0)
    wanted = np.log2(np.maximum(along, np.abs(up) * np.hypot(x, 1)))
    assert road.levels(tilt)["planes"][:, 7] == pytest.approx(wanted, abs=1e-5)


@pytest.mark.parametrize("area", [3.0, 50.0])
def test_without_quads_a_pixel_of_a_floor_is_shaded_once(area):
    quads, planes = (
        simulate(road.floor(0.5, area).scene, "binned", "h200", derivatives=way, cull_backfaces=False, **SIZE)
        for way in road.WAYS
    )
    pixels = SIZE["width"] * SIZE["height"]
    lanes = planes.counts["PixelShader.WARP_LANES"]
    assert pixels <= lanes == planes.counts["ROP.LIST_LANES"] < 1.01 * pixels  # its edges own both sides' samples
    assert quads.counts["PixelShader.WARP_LANES"] == 4 * quads.frame.facts["quads"] > 1.01 * pixels


def test_without_a_choice_of_level_both_draw_the_same_picture():
    quads, planes = (
        simulate(soup(), "binned", "h200", derivatives=way, texture_filter="bilinear", **SIZE) for way in road.WAYS
    )
    assert (quads.image == planes.image).all()


def test_a_level_apart_is_seen_where_quads_cross_the_curve():
    """On a steep floor some pixel has another colour, and none that of another triangle."""
    quads, planes = (
        simulate(road.floor(0.95, 100.0).scene, "binned", "h200", derivatives=way, cull_backfaces=False, **SIZE)
        for way in road.WAYS
    )
    assert (quads.image != planes.image).any()
    assert (quads.triangle_ids == planes.triangle_ids).all()
