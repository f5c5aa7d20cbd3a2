"""Bound and split: facts of the queue, the same as an independent front end and a slow one found."""

import json

import numpy as np
import pytest

from tests import naive_patches
from tilestamp.models.errors import TilestampError
from tilestamp.models.simt import Coalescing, Simt
from tilestamp.simulator.scenes import LookAt, load_scene
from tilestamp.simulator.stages.eisenacher2010.bound_and_split import MAX_DEPTH, bound_and_split
from tilestamp.simulator.stages.eisenacher2010.split_counts import OracleEvent, SubdivideEvent, TransformEvent

GTX280 = Simt(warp=32, coalescing=Coalescing.HALF_WARP_SEGMENTS, banks=16, bank_lanes=16)
VIEW = LookAt((1.0, -5.0, 2.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 40.0, 0.1, 50.0)


def bent(seed=3, patches=3):
    """Patches around the origin, bent at random."""
    rng = np.random.default_rng(seed)
    y, x = np.divmod(np.arange(16), 4)
    flat = np.stack([x - 1.5, y - 1.5, 0 * x, 0 * x + 1], axis=1).astype(np.float32)
    points = np.repeat(flat[None], patches, axis=0)
    points[..., :3] += rng.uniform(-0.5, 0.5, (patches, 16, 3))
    return points.astype(np.float32)


def split(points, bound=8.0, width=96, height=64, view=VIEW, **options):
    return bound_and_split(points, view.matrix(width, height), width, height, bound, GTX280, **options)


def entries(subpatches):
    return list(zip(*(array.tolist() for array in subpatches[:4]), strict=True))


@pytest.mark.parametrize("rule", ["control_points", "pixel_extent"])
def test_the_queue_is_that_of_a_slow_splitter(rule):
    points = bent()
    subpatches, _, _ = split(points, bound_rule=rule)
    queue, passes = naive_patches.bound_and_split(points, VIEW.matrix(96, 64), 96, 64, 8.0, rule == "pixel_extent")
    assert entries(subpatches) == queue
    assert subpatches.passes.tolist() == passes


@pytest.fixture(scope="module")
def front_end(shared):
    """Scenes of the H200 measurements and what their front end found."""
    return json.loads((shared / "silicon" / "micropolygon_cameras.json").read_text())


@pytest.mark.shared
@pytest.mark.parametrize(
    "name",
    [
        "teapot_1600x1200_bb4",
        "teapot_1600x1200_bb8",
        "teapot_512x512_bb4",
        "teapot_512x512_bb8",
        "bigguy_512x512_bb4",
        "bigguy_512x512_bb8",
    ],
)
def test_every_queue_pass_is_that_of_the_measured_front_end(front_end, name):
    scene = front_end[name]
    points = load_scene(scene["model"]).patches.points
    size = scene["width"], scene["height"]
    subpatches, _, _ = bound_and_split(
        points, scene["model_to_clip"], *size, scene["bound_pixels"], GTX280, counting=False
    )
    assert subpatches.passes[:, :4].tolist() == scene["queue_passes"]
    assert len(subpatches.patch) == scene["subpatches"]


def test_passes_add_up():
    passes = split(bent())[0].passes
    assert (passes[:, 0] == passes[:, 1:].sum(axis=1)).all()
    assert (passes[1:, 0] == passes[:-1, 2] + 4 * passes[:-1, 3]).all()


def test_squares_of_a_patch_that_is_all_on_screen_tile_the_unit_square():
    subpatches, _, _ = split(bent(patches=1))
    assert subpatches.passes[:, [1, 4]].sum() == 0
    assert (0.25 ** subpatches.level.astype(np.float64)).sum() == 1.0
    assert len(set(entries(subpatches))) == len(subpatches.patch)


def test_counting_changes_nothing_but_the_works():
    counted, works, _ = split(bent())
    uncounted, none, _ = split(bent(), counting=False)
    assert entries(counted) == entries(uncounted)
    assert works
    assert none == ()


def test_works_count_what_the_passes_say():
    subpatches, works, _ = split(bent())
    oracles = [work for work in works if work.kernel == "oracle"]
    events = [OracleEvent.EXAMINE_LANES, OracleEvent.CULLED, OracleEvent.KEPT, OracleEvent.SPLIT, OracleEvent.GIVEN_UP]
    assert [[work.total(event) for event in events] for work in oracles] == subpatches.passes.tolist()
    moved = [work for work in works if work.kernel == "subdivide"]
    splits = [work.total(SubdivideEvent.SPLIT_LANES) for work in moved]
    assert splits == subpatches.passes[: len(moved), 3].tolist()


def test_points_are_transformed_once_a_frame():
    _, works, _ = split(bent(patches=3))
    transforms = [work for work in works if work.kernel == "transform"]
    assert [work.total(TransformEvent.POINT_LANES) for work in transforms] == [48]
    # 48 points of 16 bytes: three half-warps of two full segments
    assert transforms[0].total(TransformEvent.LOAD_TRANSACTIONS) == 6
    assert transforms[0].total(TransformEvent.STORE_BYTES) == 48 * 16


def test_sub_patches_of_one_patch_share_the_loads_of_its_points():
    _, works, _ = split(bent(patches=1))
    first, second = [work for work in works if work.kernel == "oracle"][:2]
    # one segment for each of 16 points, and one for the queue entries, with one lane and with four
    assert first.total(OracleEvent.LOAD_TRANSACTIONS) == second.total(OracleEvent.LOAD_TRANSACTIONS) == 17


def test_a_warp_in_which_only_some_lanes_measure_a_box_diverges():
    points = np.concatenate([bent(patches=1), bent(patches=1) + np.float32([200, 0, 0, 0])])
    oracle = next(work for work in split(points)[1] if work.kernel == "oracle")
    assert oracle.total(OracleEvent.CULLED) == 1
    assert oracle.total(OracleEvent.BOX_LANES) == 1
    assert oracle.total(OracleEvent.DIVERGENT_WARPS) == 1


def test_what_is_beside_the_screen_or_behind_the_eye_is_culled():
    beside = bent(patches=1) + np.float32([200, 0, 0, 0])
    behind = bent(patches=1) + np.float32([0, -50, 0, 0])
    subpatches, _, _ = split(np.concatenate([beside, behind]))
    assert subpatches.passes.tolist() == [[2, 2, 0, 0, 0]]
    assert len(subpatches.patch) == 0


def test_a_patch_around_the_eye_ends_and_says_what_was_given_up():
    inside = LookAt((0.0, 0.0, 0.02), (1.0, 0.1, 0.0), (0.0, 0.0, 1.0), 60.0, 0.01, 10.0)
    subpatches, _, _ = split(bent(), view=inside, max_depth=9)
    assert len(subpatches.passes) <= 11
    assert subpatches.passes[:, 4].sum() > 0
    assert len(subpatches.patch) > 0
    assert subpatches.level.max() <= 9


def test_from_inside_the_teapot_everything_kept_is_in_front_of_the_eye():
    points = load_scene("teapot").patches.points
    inside = LookAt((0.0, 0.0, 1.0), (1.0, 0.3, 1.0), (0.0, 0.0, 1.0), 70.0, 0.01, 10.0)
    subpatches, _, _ = split(points, view=inside)
    assert len(subpatches.patch) > 500
    matrix = inside.matrix(96, 64)
    for patch, level, i, j in entries(subpatches)[::97]:
        assert all(np.isfinite(naive_patches.grid(points[patch], level, i, j, matrix, 96, 64)).ravel())
        assert np.dot(matrix[3], naive_patches.surface(points[patch], i / 2**level, j / 2**level)) > 0


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"max_depth": MAX_DEPTH + 1}, "max_depth must lie between"),
        ({"bound": 1e-3}, "asks for"),
    ],
)
def test_bad_options_are_named(options, words):
    with pytest.raises(TilestampError, match=words):
        split(bent(patches=1), **options)


@pytest.mark.parametrize(("number", "words"), [(np.nan, "finite"), (np.inf, "finite"), (1e38, "finite")])
def test_points_that_float32_cannot_hold_on_screen_are_refused(number, words):
    points = bent()
    points[1, 2, 0] = number
    with pytest.raises(TilestampError, match=words):
        split(points)


@pytest.mark.parametrize("weight", [0.0, -1.0])
def test_weights_must_be_positive(weight):
    points = bent()
    points[1, 2, 3] = weight
    with pytest.raises(TilestampError, match="weights"):
        split(points)
