"""Splats with a mask of pixels that are not done: the same picture in fewer trips."""

import numpy as np
import pytest

from tests.test_splats import draw
from tilestamp import TilestampError, simulate
from tilestamp.experiments.stability.splats import drawn
from tilestamp.models.kernel import kernel
from tilestamp.simulator.stages.kerbl2023.blend_walk import touches


@kernel
def compiled_touches(box, left, right, top, bottom, live):
    return touches(box, (left, right, top, bottom), live)


SAME = ("colours", "transmittance", "reached", "uses")


@pytest.mark.parametrize("machine", ["h200", "mi300x"])
@pytest.mark.parametrize("tile", [4, 8, "16x8", 16, 32])
def test_a_mask_changes_trips_and_nothing_else(tile, machine):
    plain, masked = (draw(machine=machine, tile=tile, mask=mask) for mask in (False, True))
    for name in SAME:
        assert (plain.frame.buffers[name] == masked.frame.buffers[name]).all()
    before, after = plain.counts, masked.counts
    for name in (
        "BLENDED",
        "BLEND_STEPS",
        "BLEND_TRIPS",
        "STOPPED",
        "SKIPPED_POWER",
        "ENTRIES",
        "BATCHES",
        "WARP_BATCHES",
    ):
        assert after[f"blend.{name}"] == before[f"blend.{name}"]
    assert after["blend.BLEND_TRIPS"] <= after["blend.TRIPS"] < before["blend.TRIPS"]
    assert after["blend.SLOWEST_TRIPS"] <= before["blend.SLOWEST_TRIPS"]
    skipped = after["blend.SKIPPED_ALPHA"] + after["blend.SKIPPED_POWER"] + after["blend.STOPPED"]
    assert skipped + after["blend.BLENDED"] == after["blend.EVALUATIONS"]


def trips(places, *, mask):
    """Of one tile: opaque Gaussians over the middle of its left half, and small ones farther away."""
    wall = [(-1.0, 0.0, 1.5 + 0.01 * k) for k in range(40)]
    scales = [[0.4] * 3] * len(wall) + [[0.05] * 3] * len(places)
    run = drawn([*wall, *places], scales, 0.99, side=32, bound="box", tile=32, mask=mask, fidelity="counts")
    return run.counts["blend.TRIPS"]


def test_entries_that_only_touch_pixels_that_are_done_are_skipped():
    behind, beside = ([(x, 0.0, 3.0 + 0.01 * k) for k in range(64)] for x in (-1.2, 1.2))
    assert trips(behind, mask=True) == trips([], mask=True)
    assert trips(behind, mask=False) > trips([], mask=False)
    assert trips(beside, mask=True) > trips([], mask=True)


@pytest.mark.parametrize(
    ("box", "done", "touched"),
    [
        ((3, 4, 1, 1), 0, True),
        ((3, 4, 1, 1), 0b11000 << 16, False),  # of the second row the pixels 3 and 4
        ((3, 4, 1, 1), 0b01000 << 16, True),
        ((3, 4, 0, 5), 0b11000 << 16 | 0b11000, False),
        ((-9, -1, 0, 1), 0, False),
        ((16, 20, 0, 1), 0, False),
        ((3, 4, 2, 2), 0, False),
        ((-9, 99, -9, 99), 2**32 - 2, True),
        ((-9, 99, -9, 99), 2**32 - 1, False),
    ],
)
def test_a_box_touches_a_warp_where_one_of_its_pixels_is_not_done(box, done, touched):
    """Of 16x2 pixels."""
    assert compiled_touches(np.array(box, np.int32), 0, 15, 0, 1, np.uint64(2**32 - 1 - done)) == touched


def test_a_mask_saves_instructions_where_most_entries_miss_a_warp():
    runs = [simulate("playbot", "splat", "h200", width=480, height=360, tile=32, mask=mask) for mask in (False, True)]
    assert runs[1].stages.milliseconds["blend"] < runs[0].stages.milliseconds["blend"]
    assert np.array_equal(runs[0].image, runs[1].image)


def test_what_has_no_mask_is_refused():
    with pytest.raises(TilestampError, match="a thread each"):
        draw(mask=True, threads=64)
    with pytest.raises(TilestampError, match="order of the tile"):
        draw(mask=True, order="pixel")
