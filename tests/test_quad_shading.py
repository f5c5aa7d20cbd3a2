"""Quads of 2x2 pixels: merging as a list of dictionaries does it, and what it may not change."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests import naive_quads
from tilestamp.models.machine import load_machine
from tilestamp.simulator.simulation import simulate
from tilestamp.simulator.stages.fatahalian2009.micropolygon_samples import new_samples
from tilestamp.simulator.stages.fatahalian2009.micropolygons import Micropolygons
from tilestamp.simulator.stages.fatahalian2009.sample_positions import sample_positions
from tilestamp.simulator.stages.fatahalian2009.stamps import stamp_shape, stamps
from tilestamp.simulator.stages.fatahalian2010.quad_shading import QuadEvent, quad_shading

WIDTH, HEIGHT = 11, 9
SIMT = load_machine("h200").simt
COUNTED = ("BATCHES", "QUADS", "COMPARE_LANES", "MERGED_QUADS", "SHADED_QUADS", "SHADE_WARPS", "SHADE_LANES", "HELPERS")


def mesh(size=1.7, corners=3, seed=1, layers=2):
    """Grids of moved corners, one behind the other, the second turned over; polygons in rows."""
    rng = np.random.default_rng(seed)
    polygons = []
    for layer in range(layers):
        columns, rows = int(WIDTH / size) + 2, int(HEIGHT / size) + 2
        grid = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), -1) * size - 1.0
        points = np.concatenate([grid + rng.uniform(-0.4, 0.4, grid.shape), rng.random((rows, columns, 1))], -1)
        for i in range(rows - 1):
            for j in range(columns - 1):
                a, b, c, d = points[i, j], points[i, j + 1], points[i + 1, j + 1], points[i + 1, j]
                polygons += [[a, b, c, d]] if corners == 4 else [[a, c, d], [a, b, c]]
        if layer:
            polygons = [polygon[::-1] for polygon in polygons]
    vertices = np.array(polygons, np.float32)
    return Micropolygons(vertices, np.arange(len(vertices), dtype=np.int32), np.zeros(len(vertices), np.uint8))


def shade(polygons, entries, spp=1, shared=1, size=(WIDTH, HEIGHT)):
    samples = new_samples(*size, sample_positions(spp))
    shaded, (work,), _ = quad_shading(polygons, samples, entries, SIMT, shared)
    assert shaded.shades.sum() == work.total(QuadEvent.SHADED_QUADS)
    return samples, shaded.seen, work


def square(*corners, depth=0.5):
    return [[x, y, depth] for x, y in corners]


def given_polygons(*polygons):
    vertices = np.array(polygons, np.float32)
    return Micropolygons(vertices, np.arange(len(vertices), dtype=np.int32), np.zeros(len(vertices), np.uint8))


@pytest.mark.parametrize("corners", [3, 4])
@pytest.mark.parametrize(("entries", "shared", "spp"), [(0, 1, 4), (1, 2, 1), (3, 1, 4), (16, 2, 4), (64, 0, 4)])
def test_events_and_colours_are_those_of_dictionaries(corners, entries, shared, spp):
    polygons = mesh(corners=corners)
    samples, seen, work = shade(polygons, entries, spp, shared)
    wanted, colors = naive_quads.quad_shading(
        polygons.vertices.tolist(), WIDTH, HEIGHT, samples.offsets.tolist(), entries, shared
    )
    assert {name: work.total(QuadEvent[name]) for name in COUNTED} == {name: wanted[name] for name in COUNTED}
    found = seen.reshape(HEIGHT, WIDTH, spp)
    assert {(x, y, s): found[y, x, s] for y, x, s in np.argwhere(found >= 0).tolist()} == colors


@given(st.integers(0, 40), st.integers(0, 2), st.floats(0.6, 6.0), st.integers(0, 1000))
@settings(max_examples=30, deadline=None)
def test_at_one_sample_a_pixel_merging_changes_no_colour(entries, shared, size, seed):
    samples, seen, _ = shade(mesh(size, seed=seed), entries, 1, shared)
    assert (seen == samples.polygon).all()


@given(st.integers(0, 40), st.integers(0, 1000))
@settings(max_examples=20, deadline=None)
def test_samples_are_those_of_any_other_rasterizer(entries, seed):
    polygons = mesh(seed=seed)
    samples, _, _ = shade(polygons, entries, 4)
    other = new_samples(WIDTH, HEIGHT, sample_positions(4))
    stamps(polygons, other, stamp_shape(2, "box"), SIMT)
    assert (samples.polygon == other.polygon).all()


def test_without_a_buffer_every_sample_has_the_colour_of_its_own_polygon():
    samples, seen, work = shade(mesh(), 0, 4)
    assert (seen == samples.polygon).all()
    assert work.total(QuadEvent.SHADED_QUADS) == work.total(QuadEvent.QUADS)


HALVES = square((0, 0), (2, 0), (2, 2)), square((0, 0), (2, 2), (0, 2))


def test_two_halves_of_a_quad_are_shaded_once():
    assert shade(given_polygons(*HALVES), 1)[2].total(QuadEvent.SHADED_QUADS) == 1


def test_halves_that_face_apart_are_shaded_twice():
    assert shade(given_polygons(HALVES[0], HALVES[1][::-1]), 4)[2].total(QuadEvent.SHADED_QUADS) == 2


def test_halves_without_a_vertex_in_common_merge_only_where_none_need_be():
    apart = given_polygons(square((0, 0), (0.9, 0), (0.9, 2)), square((1.1, 0), (2, 0), (2, 2)))
    assert [shade(apart, 4, 4, shared)[2].total(QuadEvent.SHADED_QUADS) for shared in (2, 1, 0)] == [2, 2, 1]


def test_a_nearer_polygon_on_the_same_samples_is_not_merged():
    nearer = square((0, 0), (2, 0), (2, 2), depth=0.25)
    assert shade(given_polygons(HALVES[0], nearer), 4)[2].total(QuadEvent.SHADED_QUADS) == 2


def test_a_quad_passes_none_that_has_one_of_its_samples():
    """It could join the first, whose side it faces; but the second covers its samples and is written after it."""
    left = square((0, 0), (1, 0), (1, 2), (0, 2))
    away = square((1, 0), (1, 2), (2, 2), (2, 0))
    nearer = square((1, 0), (2, 0), (2, 2), (1, 2), depth=0.25)
    assert shade(given_polygons(left, nearer), 4, shared=0)[2].total(QuadEvent.SHADED_QUADS) == 1
    assert shade(given_polygons(left, away, nearer), 4, shared=0)[2].total(QuadEvent.SHADED_QUADS) == 3


def test_the_pipeline_shades_what_is_on_screen():
    options = {"width": 48, "height": 36, "spp": 4, "stamp": 2}
    plain, quads, merged = (
        simulate("teapot", pipeline="stamps", machine="h200", **options, **more)
        for more in ({}, {"merge_entries": 0}, {"merge_entries": 32})
    )
    assert (plain.image == quads.image).all()
    assert merged.counts["quad_shading.SHADED_QUADS"] < quads.counts["quad_shading.SHADED_QUADS"]
    assert merged.counts["quad_shading.SAMPLE_HITS"] == quads.counts["quad_shading.SAMPLE_HITS"]
