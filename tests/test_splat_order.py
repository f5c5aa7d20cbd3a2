"""Splats in the order of each pixel, and the truth that the frontier measures errors against."""

import numpy as np
import pandas as pd
import pytest

from tests.test_splats import FORWARD, HEIGHT, WIDTH, draw, scene
from tilestamp import TilestampError, simulate
from tilestamp.experiments.silicon.splat_inputs import MEASURED
from tilestamp.experiments.splats import frontier
from tilestamp.experiments.stability.splats import drawn, pops
from tilestamp.models.machine import load_machine
from tilestamp.simulator.reference.splats import Fragments, composed, in_order, stochastic
from tilestamp.simulator.stages.kerbl2023.project import Projected
from tilestamp.simulator.stages.kerbl2023.rays import ray_rows


def truth(run, made=None):
    splats = (made or scene()).splats
    buffers = run.frame.buffers
    projected = Projected(**{name: buffers[name] for name in Projected._fields})
    return composed(splats, splats.colours, projected, FORWARD, WIDTH, HEIGHT)


def off(run):
    return np.abs(run.frame.buffers["colours"] - truth(run)).max()


@pytest.fixture(scope="module")
def sorted_run():
    return draw(bound="box", order="pixel", window=24)


def test_a_window_that_is_long_enough_gives_the_truth(sorted_run):
    """But for the early stop at a transmittance of 0.0001, and rounding."""
    assert sorted_run.counts["blend.EARLY"] == 0
    assert off(sorted_run) < 2e-4
    assert off(draw(bound="box")) > 0.05


def test_the_tile_does_not_matter_to_a_pixel_that_sorts(sorted_run):
    other = draw(bound="ellipse", order="pixel", window=24, tile=8)
    assert np.abs(sorted_run.frame.buffers["colours"] - other.frame.buffers["colours"]).max() < 1e-6


def test_a_ray_is_densest_where_its_row_says():
    """Of the exponent of the Gaussian itself, tried along the ray."""
    splats = scene().splats
    rows, centres = ray_rows(splats, FORWARD)
    depths, ray = np.linspace(-20.0, 20.0, 400_001), np.array([0.3, -0.2, 1.0])
    for i in range(1, 20):
        unit = splats.rotations[i].astype(float)
        w, vector = unit[0], unit[1:]
        away = depths[:, None] * ray - splats.means[i]
        own = away + 2 * np.cross(np.cross(away, vector) + w * away, vector)  # turned back
        exponent = ((own / splats.scales[i]) ** 2).sum(axis=1)
        u = rows[i] @ ray
        assert u @ centres[i] / (u @ u) == pytest.approx(depths[exponent.argmin()], abs=2e-4)


def test_gaussians_that_pop_by_centres_do_not_pop_by_pixels():
    assert pops(3.0)
    assert not pops(3.0, order="pixel")


def test_every_gaussian_that_is_sorted_in_is_blended_or_ends_its_pixel(sorted_run):
    counts, plain = sorted_run.counts, draw(bound="box").counts
    assert counts["blend.INSERTED"] == sum(counts[f"blend.{name}"] for name in ("BLENDED", "STOPPED", "DROPPED"))
    assert counts["blend.EVALUATIONS"] + counts["blend.IDLE_LANES"] == 32 * counts["blend.STEPS"]
    assert counts["blend.SLOTS"] == 24 * counts["blend.INSERT_STEPS"]
    assert counts["blend.PIXELS"] == plain["blend.PIXELS"]
    assert counts["blend.LIST"] == plain["blend.LIST"]
    assert counts["blend.STORE_TRANSACTIONS"] == plain["blend.STORE_TRANSACTIONS"]


def test_a_shorter_window_blends_more_too_early():
    early = [
        simulate("playbot", "splat", "h200", width=240, height=180, order="pixel", window=window).counts["blend.EARLY"]
        for window in (4, 24)
    ]
    assert early[0] > early[1]


def test_one_gaussian_is_the_same_in_any_order():
    one = [drawn([(0.1, 0.0, 2.0)], 0.1, 0.7, bound="box", order=order) for order in ("tile", "pixel")]
    first, second = (run.frame.buffers for run in one)
    assert (first["colours"] == second["colours"]).all()
    assert (first["transmittance"] == second["transmittance"]).all()
    assert (first["reached"] == second["reached"]).all()


def test_a_pixel_that_sorts_takes_longer():
    tile, pixel = (
        simulate("playbot", "splat", "h200", width=240, height=180, order=order).stages.milliseconds["blend"]
        for order in ("tile", "pixel")
    )
    assert pixel > tile


def test_what_cannot_sort_is_refused():
    with pytest.raises(TilestampError, match="thread of its own"):
        draw(order="pixel", threads=64)
    with pytest.raises(TilestampError, match="no backward pass"):
        draw(order="pixel", gradients="lanes")


def test_the_truth_of_one_gaussian_is_its_alpha():
    run = drawn([(0.0, 0.0, 2.0)], 0.1, 0.7, bound="box", fidelity="counts")
    buffers = run.frame.buffers
    a, b, c, opacity = buffers["conics"][0].astype(float)
    y, x = np.mgrid[:128, :128]
    dx, dy = buffers["positions"][0, 0] - x, buffers["positions"][0, 1] - y
    alpha = opacity * np.exp(-0.5 * (a * dx**2 + c * dy**2) - b * dx * dy)
    assert buffers["colours"][:, :, 0] == pytest.approx(np.where(alpha >= 1 / 255, alpha, 0), abs=1e-5)


def test_the_frontier_has_a_point_for_each_rule_tile_and_precision(monkeypatch):
    monkeypatch.setenv("TILESTAMP_SCENES", "")
    monkeypatch.setattr(frontier, "WIDTH", 120)
    monkeypatch.setattr(frontier, "HEIGHT", 90)
    points = frontier.run(lambda _: None).tables["points"].set_index(["rule", "tile"])
    assert len(points) == points.index.nunique() == 3 * 3 * 3 + 4
    assert points.rms["ellipse, window 16", 16] < 0.5 * points.rms["ellipse", 16]
    assert (points.ms > 0).all()
    assert points.front.any()


def one_layer(alpha, count=40_000):
    """A fragment of white at each pixel of a long row."""
    places = np.arange(count)
    return Fragments(places, np.zeros(count, np.int64), np.full(count, alpha), np.ones(count))


@pytest.mark.parametrize(("alpha", "samples"), [(0.5, 1), (0.2, 4), (0.9, 16)])
def test_stochastic_transparency_has_the_mean_and_the_variance_of_coin_flips(alpha, samples):
    shown = stochastic(one_layer(alpha), np.ones((1, 3), np.float32), 40_000, 1, samples)[0, :, 0]
    assert shown.mean() == pytest.approx(alpha, abs=4 * np.sqrt(alpha * (1 - alpha) / samples / 40_000))
    assert shown.var() == pytest.approx(alpha * (1 - alpha) / samples, rel=0.05)


def test_the_mean_of_many_samples_is_the_sorted_picture():
    run, splats = draw(bound="box"), scene().splats
    projected = Projected(**{name: run.frame.buffers[name] for name in Projected._fields})
    found = in_order(splats, projected, FORWARD, WIDTH, HEIGHT)
    apart = [
        np.sqrt(np.mean((stochastic(found, splats.colours, WIDTH, HEIGHT, n) - truth(run)) ** 2)) for n in (4, 256)
    ]
    assert apart[1] == pytest.approx(apart[0] / 8, rel=0.1)


def test_half_precision_is_no_finer_than_a_thousandth():
    assert frontier.half(np.array([1.0, 1 + 2**-12, 0.1], np.float32)).tolist()[:2] == [1.0, 1.0]


def test_additions_of_floats_at_one_address_are_not_merged_on_an_h200_and_not_priced_so():
    table = pd.read_csv(MEASURED / "red_lanes.csv").set_index(["type", "warps_sharing", "lanes"]).ms
    one, all_lanes = table["float", 1, 1], table["float", 1, 32]
    assert all_lanes / one == pytest.approx(32, rel=0.1)
    atomics, additions = load_machine("h200").atomics, 2048 * 8 * 64 * 9
    assert additions * atomics.spread_ns_per_request / atomics.units == pytest.approx(one * 1e6, rel=0.1)
