"""Stability atlas, patches, lists and orders: each row's boundary lies where it was found, and its cure holds."""

import numpy as np
import pytest

from tilestamp.experiments.stability import (
    collapsed_edges,
    cracks,
    displacement,
    eye_plane,
    folds,
    half_words,
    huge_triangle,
    kept_fragments,
    one_counter,
    races,
    rational_weights,
    resident_blocks,
    retries,
    tile_lists,
)
from tilestamp.experiments.stability.patch_frames import split
from tilestamp.models.errors import TilestampError
from tilestamp.models.machine import load_machine
from tilestamp.models.simt import Simt
from tilestamp.simulator.stages.eisenacher2010.snap_edges import shared_edges, snap_edges
from tilestamp.simulator.stages.zhang2025.primitive_compaction import most_triangles

BOUND = 16.0  # pixels: sheets have three depths


def test_near_the_eye_splitting_ends_only_by_the_depth_limit():
    assert not eye_plane.breaks_off(0.0013)
    assert eye_plane.breaks_off(0.0011)


def test_two_further_halvings_allow_a_quarter_of_the_distance():
    assert not eye_plane.breaks_off(0.0052, max_depth=12)
    assert eye_plane.breaks_off(0.0044, max_depth=12)


def test_through_the_eye_the_queue_grows_by_as_many_in_every_pass():
    lengths = eye_plane.frame(1e-5).subpatches.passes[:, 0]
    growth = np.diff(lengths)[-6:-1]
    assert growth.min() > 0.95 * growth.max()


def test_a_near_limit_ends_splitting_through_the_eye():
    assert not eye_plane.breaks_off(1e-5, near=eye_plane.NEAR)


def test_a_near_limit_changes_nothing_where_nothing_is_near():
    plain, limited = eye_plane.frame(0.05), eye_plane.frame(0.05, near=eye_plane.NEAR)
    assert plain.subpatches.passes.tolist() == limited.subpatches.passes.tolist()


def test_a_least_depth_beyond_the_largest_is_refused():
    with pytest.raises(TilestampError, match="min_depth"):
        split(eye_plane.FLOOR, np.eye(4), 32, 32, min_depth=3, max_depth=2)


def test_a_least_depth_gives_all_sub_patches_of_a_sheet_the_same():
    levels = cracks.front_end(BOUND, 2, one_depth=True).subpatches.level
    assert levels.min() == levels.max() == cracks.front_end(BOUND, 2).subpatches.level.max()


def test_cracks_show_from_a_bound_of_16_pixels():
    assert cracks.crack_pixels(8.0) == 0
    assert cracks.crack_pixels(BOUND) > 0


@pytest.mark.parametrize("cure", ["one depth", "snapped edges"])
def test_both_cures_leave_no_crack(cure):
    assert cracks.crack_pixels(BOUND, cure) == 0


def test_snapped_vertices_lie_on_an_edge_of_a_coarser_neighbour():
    made, snapped = cracks.front_end(BOUND, 2), cracks.snapped(BOUND, 2).outputs.grids.vertices
    moved = np.argwhere((snapped[..., :3] != made.grids.vertices[..., :3]).any(axis=2))
    assert len(moved) > 50
    levels = made.subpatches.level
    edges = np.concatenate(
        [snapped[:, a : b + 1 : step, :2] for a, b, step in ((0, 3, 1), (12, 15, 1), (0, 12, 4), (3, 15, 4))]
    )
    owner = np.tile(levels, 4)
    for grid, vertex in moved[::7]:
        coarser = edges[owner < levels[grid]].astype(np.float64)
        assert distance(snapped[grid, vertex, :2], coarser) < 1e-3


def distance(point, polylines):
    """Least distance of a point from the segments of polylines (E, 4, 2)."""
    start, way = polylines[:, :-1], np.diff(polylines, axis=1)
    along = ((point - start) * way).sum(axis=-1) / np.maximum((way**2).sum(axis=-1), 1e-12)
    nearest = start + np.clip(along, 0, 1)[..., None] * way
    return np.sqrt(((nearest - point) ** 2).sum(axis=-1)).min()


def test_patches_find_each_other_by_shared_edges_whichever_way_they_run():
    sheet = cracks.sheet(2)[:2]
    turned = sheet[1].reshape(4, 4, 4)[::-1, ::-1].reshape(16, 4)
    assert shared_edges(sheet)[0, 3].tolist() == [1, 2, 0]
    assert shared_edges(np.stack([sheet[0], turned]))[0, 3].tolist() == [1, 3, 1]


def test_snapping_does_not_depend_on_the_way_a_patch_is_turned():
    sheet = cracks.sheet(2)
    turned = np.stack([p.reshape(4, 4, 4)[::-1, ::-1].reshape(16, 4) if k % 2 else p for k, p in enumerate(sheet)])
    counts = []
    for points in (sheet, turned):
        made = split(points, cracks.VIEW.matrix(320, 240), 320, 240, bound=BOUND)
        counts.append(int(snap_edges(points, made.subpatches, made.grids, Simt()).outputs.touched.sum()))
    assert counts[0] == counts[1] > 0


@pytest.mark.parametrize(("bound", "holds", "breaks"), [(2.0, 4.3, 4.7), (4.0, 2.9, 3.2)])
def test_displacement_leaves_the_four_tiles(bound, holds, breaks):
    assert displacement.lost(bound, holds) == (0, 0)
    assert displacement.lost(bound, breaks)[1] > 0


def test_a_bound_as_large_as_the_tile_leaves_no_room_for_displacement():
    assert displacement.boundary(8.0) == (None, 0.5)


@pytest.mark.parametrize(("machine", "low", "high"), [("gtx280", 0.009, 0.013), ("h200", 0.06, 0.10)])
def test_a_crowd_in_one_tile_makes_the_address_calculation_twice_as_slow(machine, low, high):
    holds, breaks = one_counter.boundary(machine, "as published")
    assert low < holds < breaks < high


@pytest.mark.parametrize("machine", one_counter.MACHINES)
def test_padding_does_not_help_one_counter_but_one_atomic_a_warp_does(machine):
    plain, padded, merged = (one_counter.address_ms(1.0, machine, variant) for variant in one_counter.VARIANTS)
    assert padded == pytest.approx(plain, rel=0.01)
    assert merged < 0.1 * plain


def test_cudaraster_overtakes_freepipe_at_one_triangle_of_860_pixels():
    small, large = (
        [huge_triangle.milliseconds(p, area) for p in ("freepipe", "cudaraster")] for area in (800.0, 920.0)
    )
    assert small[0] < small[1]
    assert large[0] > large[1]


def test_the_mask_breaks_where_the_second_half_comes_in_front():
    assert folds.wrong_share(88, 0) < 0.01 < folds.wrong_share(95, 0)
    assert folds.wrong_share(40, 45) < 0.01 < folds.wrong_share(52, 45)


@pytest.mark.parametrize("kind", ["facing", "depth"])
def test_both_other_masks_draw_a_fold_right(kind):
    assert folds.wrong_share(150, 0, kind) < 0.01


def test_half_words_mix_colours_within_one_step_of_depth():
    assert half_words.mixed_pixels(1.7e-6) == 0
    assert half_words.mixed_pixels(1.6e-6) > 0
    assert half_words.mixed_pixels(2.0**-24, "64") == 0


@pytest.mark.parametrize(("queue", "fits"), [("sub-triangles", 2048), ("bin segments", 16384), ("tile segments", 64)])
def test_a_queue_of_cudaraster_takes_exactly_so_many_triangles(queue, fits):
    shape = retries.SHAPES[queue]
    assert not retries.attempt(fits, shape).overflows(queue)
    assert retries.attempt(fits + 1, shape).overflows(queue)


def test_a_tile_list_has_room_for_a_hundred_triangles_but_not_for_101():
    assert tile_lists.lost(100, 100) == (0, 0)
    assert tile_lists.lost(101, 101)[0] == 91


def test_a_tile_list_has_room_for_a_tenth_of_a_model():
    assert tile_lists.lost(1000, 100) == (0, 0)
    assert tile_lists.lost(1000, 101)[0] == 1


def test_a_pixel_keeps_four_transparent_layers():
    assert kept_fragments.lost(4, "oit") == (0, 0)
    assert kept_fragments.lost(5, "oit")[1] > 0


def test_in_api_order_the_newest_four_are_enough():
    fragments, pixels = kept_fragments.lost(8, "api")
    assert fragments > 0
    assert pixels == 0


def test_four_layers_of_whole_quads_outgrow_the_fragment_stream():
    assert kept_fragments.beyond_the_stream(3) == 0
    assert kept_fragments.beyond_the_stream(4) > 0


@pytest.mark.parametrize("name", resident_blocks.MACHINES)
def test_compaction_takes_as_many_triangles_as_threads_are_resident(name):
    most = most_triangles(load_machine(name))
    assert resident_blocks.boundary(load_machine(name)) == (most, most + 1)


def test_one_layer_races_at_edges_alone_and_two_do_everywhere():
    assert 0 < races.wrong_runs(1, 3).mean() < races.EDGES
    assert races.wrong_runs(2, 3).mean() > 50 * races.EDGES


def test_another_order_of_the_warps_leaves_other_pixels_wrong():
    assert (races.wrong(4, 1) != races.wrong(4, 2)).any()


@pytest.mark.parametrize(("depth", "holds", "breaks"), [(7, 0.042, 0.039), (9, 0.0105, 0.0095)])
def test_two_halvings_allow_a_quarter_of_the_weight(depth, holds, breaks):
    assert rational_weights.missing(holds, depth) == 0
    assert rational_weights.missing(breaks, depth) > 0


def test_balanced_weights_draw_what_the_given_ones_lose():
    assert rational_weights.missing(0.001, 9) > 0
    assert rational_weights.missing(0.001, 9, balanced=True) == 0


def test_balanced_weights_move_equally_fast_at_both_ends():
    weights = rational_weights.balance(np.array([0.01, 1.0, 0.5, 2.0]))
    assert weights[1] / weights[0] == pytest.approx(weights[2] / weights[3])


def test_normals_at_a_pole_are_noise_where_the_edge_is_a_few_roundings_long():
    assert collapsed_edges.error(1e-6) <= collapsed_edges.WRONG < collapsed_edges.error(2e-7)


@pytest.mark.parametrize(("length", "welded"), [(0.0, False), (2e-7, True)])
def test_a_collapsed_edge_borrows_its_normal(length, welded):
    assert collapsed_edges.error(length, welded=welded) <= collapsed_edges.WRONG


def test_the_first_retry_of_a_frame_is_what_its_first_attempt_took():
    holds, breaks = (retries.frame(count) for count in (64, 65))
    assert [run.frame.facts["retries"] for run in (holds, breaks)] == [0, 1]
    tried = retries.attempt(65).works
    for tables in zip(breaks.frame.works[:3], tried, strict=True):
        assert np.array_equal(*(work.table for work in tables))
