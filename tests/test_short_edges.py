"""Edge equations in 16 bits: rounded as they should be, and coverage by the rounded terms."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.test_tile_raster import HEIGHT, WIDTH, drawn, some_grids
from tilestamp.experiments.exploration import short_edges
from tilestamp.models.errors import TilestampError
from tilestamp.simulator.pipelines.micropolygon import MicropolygonOptions
from tilestamp.simulator.simulation import simulate
from tilestamp.simulator.stages.eisenacher2010.dice import Grids
from tilestamp.simulator.stages.eisenacher2010.edge_equations import (
    CORNERS,
    snap_vertices,
    snapped_bits,
    stored_edges,
)
from tilestamp.simulator.stages.eisenacher2010.tile_raster_events import TileRasterEvent as Event


@pytest.mark.parametrize("precision", ["half", "fixed"])
def test_terms_are_those_of_the_edges_within_their_precision(precision):
    vertices = some_grids(50)
    stored = stored_edges(vertices, precision)
    step = 2.0**-11 if precision == "half" else 2.0**-15
    for grid, quad, edge in np.ndindex(50, 9, 4):
        p, q = (vertices[grid, CORNERS[quad, k % 4], :2] - stored.origin[grid] for k in (edge, edge + 1))
        exact = np.array([p[1] - q[1], q[0] - p[0], p[0] * q[1] - p[1] * q[0]], np.float64)
        size = np.abs(exact) if precision == "half" else np.abs(stored.terms[grid]).max(axis=(0, 1))
        if precision == "fixed":
            size = np.array([max(size[:2])] * 2 + [size[2]])
        assert (np.abs(stored.terms[grid, quad, edge] - exact) <= 1.01 * step * size + 1e-5).all()


@pytest.mark.parametrize("precision", ["half", "fixed"])
def test_terms_need_no_more_than_16_bits(precision):
    terms = stored_edges(some_grids(50), precision).terms
    if precision == "half":
        assert (terms == terms.astype(np.float16)).all()
        return
    for part in (terms[..., :2], terms[..., 2:]):
        largest = np.abs(part).max(axis=(1, 2, 3))
        steps = part / 2.0 ** (np.ceil(np.log2(largest)) - 15)[:, None, None, None]
        assert (steps == np.round(steps)).all() or np.abs(steps * 2 - np.round(steps * 2)).max() == 0
        assert np.abs(steps).max() <= 2**16


def naive_hits(vertices, precision):
    """Quads that cover each pixel, by the stored terms in rational arithmetic."""
    stored = stored_edges(vertices, precision)
    hits = np.zeros((HEIGHT, WIDTH), int)
    for grid, quad in np.ndindex(len(vertices), 9):
        xy = vertices[grid, CORNERS[quad], :2]
        low, high = xy.min(axis=0), xy.max(axis=0)
        for y in range(max(0, int(low[1]) - 1), min(HEIGHT, int(high[1]) + 2)):
            for x in range(max(0, int(low[0]) - 1), min(WIDTH, int(high[0]) + 2)):
                if not (low[0] <= x + 0.5 <= high[0] and low[1] <= y + 0.5 <= high[1]):
                    continue
                place = [Fraction(x + 0.5) - Fraction(float(stored.origin[grid, 0])),
                         Fraction(y + 0.5) - Fraction(float(stored.origin[grid, 1])), Fraction(1)]  # fmt: skip
                values = [
                    sum(Fraction(float(t)) * p for t, p in zip(terms, place, strict=True))
                    for terms in stored.terms[grid, quad]
                ]
                hits[y, x] += min(values) >= 0 or max(values) <= 0
    return hits


@pytest.mark.parametrize("precision", ["half", "fixed"])
def test_coverage_is_that_of_the_stored_terms_exactly(precision):
    vertices = some_grids(60)
    overdraw = drawn(vertices, edges=precision)[2]
    assert np.array_equal(overdraw, naive_hits(vertices, precision))


@settings(max_examples=50, deadline=None)
@given(st.sampled_from([0.5, 1.0, 2.0, 4.0, 8.0, 16.0]), st.integers(0, 2**31))
def test_snapped_vertices_have_equations_that_16_bits_hold_exactly(bound, seed):
    bits = snapped_bits(bound)
    random = np.random.default_rng(seed)
    vertices = np.zeros((1, 16, 4), np.float32)
    vertices[..., :2] = random.uniform(0, 100, (1, 1, 2)) + random.uniform(0, bound, (1, 16, 2))
    xy = snap_vertices(Grids(vertices, np.zeros((1, 4), np.float32)), bound).vertices[0, :, :2].astype(np.float64)
    xy -= np.floor(xy[0])
    for corners in CORNERS:
        for k in range(4):
            (px, py), (qx, qy) = xy[corners[k]], xy[corners[(k + 1) % 4]]
            slopes, rest = np.array([py - qy, qx - px]) * 2**bits, (px * qy - py * qx) * 4**bits
            assert (slopes == np.round(slopes)).all()
            assert rest == round(rest)
            assert max(*np.abs(slopes), abs(rest)) < 2**15


def test_snapped_vertices_move_by_half_a_step_at_most():
    vertices = some_grids(100)
    moved = snap_vertices(Grids(vertices, np.zeros((100, 4), np.float32)), 4.0)
    assert np.abs(moved.vertices[..., :2] - vertices[..., :2]).max() <= 2.0 ** -(snapped_bits(4.0) + 1)
    assert (moved.boxes[:, :2] == moved.vertices[..., :2].min(axis=1)).all()


def test_16_bits_halve_the_equations_that_a_block_loads():
    vertices = some_grids(200)
    computed, loaded, half = (drawn(vertices, edges=edges)[3][0] for edges in ("computed", "loaded", "half"))
    lists = loaded.total(Event.GRIDS)
    assert loaded.total(Event.EDGE_GATHER_LANES) == 27 * lists
    assert half.total(Event.EDGE_GATHER_LANES) == 14 * lists
    assert half.total(Event.LOAD_BYTES) - computed.total(Event.LOAD_BYTES) == 224 * lists
    assert half.shared_bytes - computed.shared_bytes == 4 * 224  # of a batch of four grids


def test_a_sheet_is_covered_once_and_16_bits_break_that():
    whole, half, snapped = (
        short_edges.sheet(edges, 8.0).run("h200").frame.maps["overdraw"] for edges in ("computed", "half", "snapped")
    )
    assert (whole == 1).all()
    assert 0 < (half != 1).sum() < 0.01 * half.size
    assert snapped.min() == 1


def test_few_pixels_of_the_teapot_change():
    size = {"machine": "h200", "width": 160, "height": 120}
    plain, fixed = simulate("teapot", **size), simulate("teapot", edges="fixed", **size)
    assert (plain.image != fixed.image).any(axis=2).sum() < 20


@pytest.mark.parametrize("options", [{"spp": 4}, {"tile": 16}, {"shading": "visible"}, {"box_tests": False}])
def test_what_does_not_go_together_is_refused(options):
    with pytest.raises(TilestampError, match=r"^edges of 16 bits"):
        MicropolygonOptions(edges="half", **options)


@pytest.mark.parametrize("precision", ["half", "fixed"])
def test_a_sample_on_an_edge_is_covered(precision):
    """Edges along columns and rows of samples: those between two quads are covered twice, as with 32 bits."""
    vertices = some_grids(1)
    rows, columns = np.divmod(np.arange(16), 4)
    vertices[0, :, :2] = np.stack([columns, rows], axis=1) * 2 + 4.5
    overdraw = drawn(vertices, edges=precision, bound=8)[2]
    assert np.array_equal(overdraw, drawn(vertices, bound=8)[2])
    assert overdraw[4:11, 4:11].tolist() == np.outer(*[[1, 1, 2, 1, 2, 1, 1]] * 2).tolist()
