"""Decoupled shading: caches as dictionaries, what a cache may not change, and multisampling as its limit."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests import naive_decoupled
from tests.test_counts_of_warps import HOPPER
from tests.test_motion import blurred
from tests.test_stamps import HEIGHT, WIDTH, soup
from tilestamp import simulate
from tilestamp.simulator.stages.fatahalian2009.motion import blur_samples, moved, stratified_pattern
from tilestamp.simulator.stages.fatahalian2009.motion_interval import motion_interval
from tilestamp.simulator.stages.ragankelley2011.decoupled_shading import DecoupledEvent, Shading, decoupled_shading

PATTERN = stratified_pattern(4, tile=3)
COUNTED = ("BATCHES", "VISIBLE", "KEY_WARPS", "HITS", "SHADES", "SHADE_WARPS")


def shade(moving, rate=1.0, cache=1024, decoupled=True):
    samples = blur_samples(WIDTH, HEIGHT, PATTERN)
    outputs, (work,), _ = decoupled_shading(moving, PATTERN, samples, Shading(rate, cache, decoupled), HOPPER)
    return samples, outputs, {name: work.total(DecoupledEvent[name]) for name in COUNTED}


@pytest.mark.parametrize(
    ("rate", "cache", "decoupled"), [(1.0, 3, True), (0.5, 1, True), (2.0, 16, True), (1.0, 4, False)]
)
def test_events_are_those_of_a_dictionary(rate, cache, decoupled):
    moving = blurred(8)
    wanted, _ = naive_decoupled.shading(moving, PATTERN, WIDTH, HEIGHT, rate, cache, decoupled)
    assert wanted["HITS"] > 0
    assert shade(moving, rate, cache, decoupled)[2] == {name: wanted[name] for name in COUNTED}


def test_points_at_rest_are_those_of_areas():
    moving = blurred(6)
    samples, outputs, _ = shade(moving)
    spp = PATTERN.place.shape[2]
    for at in np.flatnonzero(samples.polygon >= 0):
        (y, x), s = divmod(at // spp, WIDTH), at % spp
        wanted = naive_decoupled.at_rest(moving, PATTERN, samples.polygon[at], x, y, s)
        assert outputs.point[at] == pytest.approx(wanted, abs=1e-9)


def test_a_large_cache_shades_each_cell_once():
    moving = blurred(8)
    _, asked = naive_decoupled.shading(moving, PATTERN, WIDTH, HEIGHT, 1.0, 1024, True)
    assert shade(moving)[2]["SHADES"] == len(asked)


@given(st.integers(0, 1000), st.integers(1, 20), st.integers(1, 20), st.floats(0.25, 4.0))
@settings(max_examples=25, deadline=None)
def test_a_larger_cache_never_shades_more(seed, cache, more, rate):
    """What is used last stays in any larger cache."""
    moving = blurred(10, seed=seed)
    small, large = (shade(moving, rate, size)[2]["SHADES"] for size in (cache, cache + more))
    assert large <= small


@given(st.integers(0, 1000))
@settings(max_examples=10, deadline=None)
def test_samples_are_those_of_intervals(seed):
    moving = blurred(20, seed=seed)
    other = blur_samples(WIDTH, HEIGHT, PATTERN)
    motion_interval(moving, PATTERN, other, HOPPER)
    assert (shade(moving, cache=4)[0].polygon == other.polygon).all()


def test_at_rest_it_is_multisampling():
    still = moved(soup(12), (0.0, 0.0))
    _, decoupled, counts = shade(still)
    _, by_pixel, others = shade(still, decoupled=False)
    assert (decoupled.cell == by_pixel.cell).all()
    assert counts == others


def test_a_cell_of_a_large_polygon_is_shaded_once_however_it_moves():
    """Multisampling shades it in every pixel that it sweeps over."""
    rates = {"shade_cache": 256, "spp": 4, "motion": 6.0, "lens": 4.0, "edge": 8.0, "width": 48, "height": 36}
    ours, theirs = (
        simulate("teapot", "interval", "h200", decoupled=way, **rates).counts["decoupled_shading.SHADES"]
        for way in (True, False)
    )
    assert ours < 0.8 * theirs


@pytest.mark.parametrize("pipeline", ["interval", "interleaved"])
def test_shading_changes_no_picture(pipeline):
    size = {"width": 40, "height": 30, "edge": 8.0}
    plain, shaded = (simulate("teapot", pipeline, "h200", shade_cache=cache, **size) for cache in (None, 32))
    assert (plain.image == shaded.image).all()
    assert shaded.milliseconds > plain.milliseconds
