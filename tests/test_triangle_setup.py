"""Triangle setup against exact arithmetic and the published totals."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit

from tests import naive_cudaraster as naive
from tilestamp.models.bits import lowest_bit, popcount
from tilestamp.models.errors import TilestampError
from tilestamp.models.simt import Simt
from tilestamp.simulator.stages.laine2011.exact import (
    fma,
    round_to_int32,
    round_to_uint32,
    truncate_to_uint32,
)
from tilestamp.simulator.stages.laine2011.triangle_setup import BLOCK, triangle_setup
from tilestamp.simulator.stages.laine2011.triangle_setup_count import TriangleSetupEvent

E = TriangleSetupEvent
floats = st.floats(width=32, min_value=-1e6, max_value=1e6).map(np.float32)


@njit
def _fma(a, b, c):
    return fma(a, b, c)


@njit
def _bits(word):
    return popcount(word), lowest_bit(word)


def setup(positions, triangles, size=(32, 24), **options):
    options = {"release": "nvdiffrast"} | options
    positions = np.asarray(positions, np.float32)
    return triangle_setup(positions, np.asarray(triangles, np.int32), *size, Simt(), **options)


@given(floats, floats, floats)
@settings(max_examples=100, derandomize=True, deadline=None)
def test_fma_rounds_once(a, b, c):
    wanted = naive.fma(Fraction(float(a)), Fraction(float(b)), Fraction(float(c)))
    assert Fraction(float(_fma(a, b, c))) == wanted
    assert Fraction(float(fma(a, b, c))) == wanted


def test_fma_where_two_roundings_differ_from_one():
    a, c = np.float32(2**12 + 1), np.float32(2**-60)  # a * a is half-way between floats, and c breaks the tie
    assert fma(a, a, c) == _fma(a, a, c) == np.float32(2**24 + 2**13 + 2)
    assert np.float32(float(a) * float(a) + float(c)) == np.float32(2**24 + 2**13)


@pytest.mark.parametrize(
    ("value", "wanted"),
    [(0.5, 0), (1.5, 2), (-2.5, -2), (3e9, 2**31 - 1), (-3e9, -(2**31)), (float("nan"), 0), (float("inf"), 2**31 - 1)],
)
def test_conversion_rounds_half_to_even_and_saturates(value, wanted):
    assert round_to_int32(np.float32(value)) == wanted


def test_unsigned_conversions_saturate():
    assert round_to_uint32(np.float32(-1)) == 0
    assert round_to_uint32(np.float32(1e12)) == 2**32 - 1
    assert truncate_to_uint32(np.float32(2.75)) == 2
    assert truncate_to_uint32(np.float32("nan")) == 0


def test_bit_counts():
    assert _bits(np.uint64(0b1011000)) == (3, 3)
    assert (popcount(np.uint64(2**63)), lowest_bit(np.uint64(2**63))) == (1, 63)


TRIANGLE = [[-0.5, -0.5, 0, 1], [0.5, -0.5, 0, 1], [0, 0.5, 0, 1]]


def test_a_plain_triangle_is_stored_at_its_own_slot():
    out, (work,), facts = setup(TRIANGLE, [[0, 1, 2]])
    assert out.subtriangles.tolist() == [1]
    assert out.records.tolist() == [0]
    assert out.headers.tolist() == [[-128, -96, 128, -96, 0, 96]]
    assert facts["numSubtris"] == 1
    assert work.total(E.STORE_LANES) == 1


def test_a_clockwise_triangle_is_turned_or_culled():
    turned, _, _ = setup(TRIANGLE, [[0, 2, 1]])
    culled, (work,), _ = setup(TRIANGLE, [[0, 2, 1]], release="1.1")
    kept, _, _ = setup(TRIANGLE, [[0, 2, 1]], release="1.1", cull_backfaces=False)
    assert turned.headers.tolist() == kept.headers.tolist() == [[-128, -96, 128, -96, 0, 96]]
    assert culled.subtriangles.tolist() == [0]
    assert work.total(E.BACKFACE_CULLED) == 1


def test_degenerate_triangles_have_no_subtriangle():
    out, (work,), _ = setup(TRIANGLE, [[0, 0, 1], [0, 0, 0], [1, 1, 2]])
    assert out.subtriangles.tolist() == [0, 0, 0]
    assert work.total(E.BACKFACE_CULLED) == 3


def test_a_triangle_between_pixel_centres_is_culled():
    small = np.array(TRIANGLE) * [0.01, 0.01, 1, 1]
    _, (work,), _ = setup(small, [[0, 1, 2]])
    assert work.total(E.BETWEEN_CULLED) == 1


def test_across_the_near_plane_subtriangles_follow_the_own_slots_in_input_order():
    crossing = [[-0.5, -0.5, -2, 1], [0.5, -0.5, 0, 1], [0, 0.5, 0, 1]]
    out, (work,), facts = setup(crossing + TRIANGLE, [[0, 1, 2], [3, 4, 5], [0, 1, 2]])
    assert out.subtriangles.tolist() == [2, 1, 2]
    assert out.records[[3, 4, 1, 5, 6]].tolist() == [1, 2, 0, 3, 4]
    assert out.misc[[0, 2]].tolist() == [3, 5]
    assert out.inputs.tolist() == [1, 0, 0, 2, 2]
    assert facts["numSubtris"] == 7
    assert (work.total(E.ATOMIC), work.total(E.ATOMIC_LANES)) == (1, 2)


def test_a_buffer_that_is_too_small_is_reported():
    crossing = [[-0.5, -0.5, -2, 1], [0.5, -0.5, 0, 1], [0, 0.5, 0, 1]]
    _, _, facts = setup(crossing, [[0, 1, 2]], capacity=2)
    assert facts == {"numSubtris": 3, "capacity": 2, "overflow": True}


def test_guard_band_keeps_what_nvdiffrast_clips():
    wide = [[-5, -5, 0, 1], [5, -5, 0, 1], [0, 5, 0, 1]]
    _, (guarded,), _ = setup(wide, [[0, 1, 2]], release="1.1")
    _, (clipped,), _ = setup(wide, [[0, 1, 2]])
    assert (guarded.total(E.CLIP_LANES), clipped.total(E.CLIP_LANES)) == (0, 1)


def test_far_outside_the_guard_band_is_clipped():
    far = np.array([[-1e5, -1e5, 0, 1], [1e5, -1e5, 0, 1], [0, 1e5, 0, 1]])
    _, (work,), _ = setup(far, [[0, 1, 2]], release="1.1")
    assert work.total(E.CLIP_LANES) == 1


@pytest.mark.parametrize(("width", "clipped"), [(2048, 1), (2047, 0)])
def test_a_span_that_the_coverage_tables_do_not_have_is_clipped(width, clipped):
    across = [[-1, -1, 0, 1], [1, -1, 0, 1], [0, 1, 0, 1]]
    _, (work,), _ = setup(across, [[0, 1, 2]], size=(width, 8), release="1.1")
    assert work.total(E.CLIP_LANES) == clipped


@pytest.mark.parametrize("release", ["1.1", "nvdiffrast"])
@pytest.mark.parametrize("bad", [float("nan"), float("inf"), -float("inf"), 3e38, -3e38])
@pytest.mark.parametrize("component", [0, 1, 2, 3])
def test_values_that_are_no_positions_do_no_harm(release, bad, component):
    positions = np.array(TRIANGLE, np.float32)
    positions[1, component] = bad
    out, _, facts = setup(positions, [[0, 1, 2]], release=release)
    assert facts["numSubtris"] >= 1
    assert out.subtriangles[0] <= 7


def test_zero_w_snaps_to_the_centre():
    out, (work,), _ = setup(np.zeros((3, 4)), [[0, 1, 2]])
    assert out.subtriangles.tolist() == [0]
    assert work.total(E.BACKFACE_CULLED) == 1


def test_indices_out_of_range_are_skipped_by_nvdiffrast_and_refused_by_1_1():
    out, _, _ = setup(TRIANGLE, [[0, 1, 3], [-1, 1, 2], [0, 1, 2]])
    assert out.subtriangles.tolist() == [0, 0, 1]
    with pytest.raises(TilestampError, match="triangle 1 has a vertex index out of range"):
        setup(TRIANGLE, [[0, 1, 2], [0, 1, 3]], release="1.1")


def test_sizes_that_the_original_cannot_draw_are_refused():
    with pytest.raises(TilestampError, match="2049x24"):
        setup(TRIANGLE, [[0, 1, 2]], size=(2049, 24))


def test_other_types_are_refused():
    with pytest.raises(TilestampError, match="float64"):
        triangle_setup(np.zeros((3, 4)), np.zeros((1, 3), np.int32), 8, 8, Simt(), release="1.1")
    with pytest.raises(TilestampError, match="int64"):
        triangle_setup(np.zeros((3, 4), np.float32), np.zeros((1, 3), np.int64), 8, 8, Simt(), release="1.1")


def test_counting_changes_nothing_and_has_a_row_a_block():
    rng = np.random.default_rng(5)
    positions = rng.uniform(-1.2, 1.2, (400, 4)) * [1, 1, 1, 0] + [0, 0, 0, 1]
    triangles = rng.integers(0, 400, (300, 3))
    counted, (work,), _ = setup(positions, triangles)
    plain, none, _ = setup(positions, triangles, counting=False)
    written = np.append(counted.subtriangles == 1, np.ones(len(counted.records) - 300, bool))
    for name in ("headers", "misc", "records"):
        assert np.array_equal(getattr(counted, name)[written], getattr(plain, name)[written])
    for name in ("subtriangles", "planes", "inputs"):
        assert np.array_equal(getattr(counted, name), getattr(plain, name))
    assert len(work.table) == work.grid == -(-300 // BLOCK)
    assert none == ()
    assert work.total(E.TRIANGLE_LANES) == 300


def test_no_triangles_are_no_work():
    out, (work,), facts = setup(TRIANGLE, np.zeros((0, 3)))
    assert (len(out.subtriangles), len(work.table), facts["numSubtris"]) == (0, 0, 0)


TOTALS = [  # section 9.2 of the specification: viewport, backface, between, clipped, sub-triangle slots, survivors
    ("bunny", "1.1", (0, 38464, 400, 0, 69451, 30587)),
    ("bunny", "nvdiffrast", (0, 18, 759, 0, 69451, 68674)),
    ("nearclip5k", "nvdiffrast", (4716, 0, 0, 108, 5095, 331)),
]


@pytest.mark.shared
@pytest.mark.parametrize(("scene", "release", "wanted"), TOTALS)
def test_published_totals(shared, scene, release, wanted):
    with np.load(shared / "silicon" / "ids" / f"{scene}_input.npz") as data:
        out, (work,), facts = setup(data["positions"], data["triangles"], (1024, 768), release=release)
    events = (E.VIEWPORT_CULLED, E.BACKFACE_CULLED, E.BETWEEN_CULLED, E.CLIP_LANES)
    assert (*(work.total(e) for e in events), facts["numSubtris"], int(out.subtriangles.sum())) == wanted
