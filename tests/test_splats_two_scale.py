"""Two scales: what macro tiles, masks and batches blend is what the lists of tiles do."""

from dataclasses import replace

import numpy as np
import pytest

from tests import naive_splats as naive
from tests.ledger.scenes import odd_splats
from tests.test_splats import FORWARD, HEIGHT, WIDTH, draw, scene
from tilestamp import TilestampError
from tilestamp.models.machine import load_machine
from tilestamp.simulator.stages.kerbl2023.harmonics import colours_seen
from tilestamp.simulator.stages.kerbl2023.project import Projected
from tilestamp.simulator.stages.kerbl2023.tiles import tiles_of
from tilestamp.simulator.stages.kerbl2023.two_scale import BATCH, blend_batches
from tilestamp.simulator.stages.kerbl2023.two_scale_join import blend_partials

H200 = load_machine("h200").simt
CROWD = 6000  # three batches in the fullest macro tile
OPAQUE = 1e-4
ROUNDING = 1e-5


def faint(count=CROWD):
    """So many that lists need several batches, so faint that no pixel grows opaque."""
    made = scene(count, seed=8)
    return replace(made, splats=replace(made.splats, opacities=made.splats.opacities * np.float32(0.02)))


def both(made, **options):
    return draw(made, **options), draw(made, two_scale=True, **options)


def batched(made, tile, batch):
    """Partial results, pixels and counts of batches of another size."""
    run = draw(made, tile=tile, bound="ellipse", two_scale=True)
    projected = Projected(**{name: run.frame.buffers[name] for name in Projected._fields})
    macro, tiles = tiles_of(WIDTH, HEIGHT, 8 * tile, 4 * tile), tiles_of(WIDTH, HEIGHT, tile, tile)
    lists = (run.frame.buffers["starts"], run.frame.buffers["listed"])
    colours = colours_seen(made.splats, FORWARD)
    partials, works, _ = blend_batches(*lists, projected, colours, macro, tiles, H200, bound="ellipse", batch=batch)
    return partials, blend_partials(partials, macro, tiles, H200).outputs, works[0].counts()


@pytest.mark.parametrize("bound", ["square", "box", "ellipse"])
@pytest.mark.parametrize("tile", [8, 16])
@pytest.mark.parametrize("made", [scene, odd_splats], ids=["usual", "odd"])
def test_of_one_batch_the_picture_is_the_same_to_the_bit(made, tile, bound):
    one, two = both(made(), tile=tile, bound=bound)
    for name in ("colours", "transmittance"):
        assert (one.frame.buffers[name] == two.frame.buffers[name]).all(), name
    assert (one.depth == two.depth).all()


@pytest.mark.parametrize("tile", [8, 16])
def test_of_several_batches_a_pixel_that_never_grows_opaque_differs_by_rounding(tile):
    one, two = both(faint(), tile=tile, bound="ellipse")
    assert np.diff(two.frame.buffers["starts"]).max() > 2 * BATCH
    assert one.counts["blend.STOPPED"] == two.counts["blend.STOPPED"] == 0
    for name in ("colours", "transmittance"):
        assert np.abs(one.frame.buffers[name] - two.frame.buffers[name]).max() < ROUNDING, name
    assert (one.depth == two.depth).all()


@pytest.mark.parametrize("tile", [8, 16])
def test_an_opaque_pixel_differs_by_no_more_than_the_transmittance_that_lists_leave_over(tile):
    one, two = (run.frame.buffers for run in both(scene(CROWD, seed=8), tile=tile, bound="ellipse"))
    bound = one["transmittance"] + ROUNDING  # colours are at most 1
    assert (np.abs(one["colours"] - two["colours"]).max(axis=2) <= bound).all()
    assert (two["colours"] >= one["colours"] - ROUNDING).all()
    assert (two["transmittance"] <= one["transmittance"] + ROUNDING).all()


def test_a_pixel_that_grows_opaque_within_its_first_batch_is_the_same_to_the_bit():
    made, tile = scene(CROWD, seed=8), 8
    one, two = (run.frame.buffers for run in both(made, tile=tile, bound="ellipse"))
    partials = batched(made, tile, BATCH)[0]
    columns, same = -(-WIDTH // (8 * tile)), 0
    for y in range(HEIGHT):
        for x in range(WIDTH):
            row, column = y // tile, x // tile
            first = partials.firsts[row // 4 * columns + column // 8]
            own = row % 4 * 8 + column % 8
            if partials.masks[first] >> own & 1 and partials.values[first, own, y % tile * tile + x % tile, 3] < 0:
                assert (one["colours"][y, x] == two["colours"][y, x]).all()
                assert one["transmittance"][y, x] == two["transmittance"][y, x]
                same += 1
    assert same > 100


@pytest.mark.parametrize("bound", ["square", "ellipse"])
@pytest.mark.parametrize("tile", [8, 16])
@pytest.mark.parametrize("made", [scene, odd_splats, faint], ids=["usual", "odd", "faint"])
def test_bits_of_the_masks_are_the_pairs_of_the_lists_of_tiles(made, tile, bound):
    one, two = both(made(), tile=tile, bound=bound)
    assert two.counts["blend.MASK_BITS"] == one.counts["duplicate.PAIRS"]
    assert two.counts["blend.ENTRIES"] == two.counts["duplicate.PAIRS"] < one.counts["duplicate.PAIRS"]
    assert two.counts["blend.MASK_TESTS"] == 32 * two.counts["duplicate.PAIRS"]


@pytest.mark.parametrize("tile", [8, 16])
def test_where_no_pixel_grows_opaque_evaluations_are_those_of_the_lists(tile):
    one, two = both(faint(), tile=tile, bound="ellipse")
    for name in ("EVALUATIONS", "BLENDED"):
        assert one.counts[f"blend.{name}"] == two.counts[f"blend.{name}"], name
    assert two.counts["blend.TRIPS"] == two.counts["blend.MASK_BITS"]


@pytest.mark.parametrize("batch", [7, 64])
def test_each_batch_is_evaluated_as_if_nothing_were_in_front(batch):
    made, tile = scene(300, seed=4), 8
    found = naive.projected(made.splats, FORWARD, WIDTH, HEIGHT)
    macro = draw(made, tile=tile, bound="ellipse", two_scale=True).frame.buffers
    fine = draw(made, tile=tile, bound="ellipse").frame
    columns, totals = fine.maps["pairs"].shape[1], np.zeros(3, int)
    tiles = np.split(fine.buffers["listed"], fine.buffers["starts"][1:-1])
    for at, listed in enumerate(np.split(macro["listed"], macro["starts"][1:-1])):
        for tile_at in range(len(tiles)):
            row, column = divmod(tile_at, columns)
            if (row // 4) * -(-columns // 8) + column // 8 != at:
                continue
            own = set(tiles[tile_at].tolist())
            for first in range(0, len(listed), batch):
                entries = [_entry(made, found, i) for i in listed[first : first + batch] if i in own]
                for y in range(row * tile, min(row * tile + tile, HEIGHT)):
                    for x in range(column * tile, min(column * tile + tile, WIDTH)):
                        totals += naive.blend(entries, x, y)[3:] if entries else (0, 0, 0)
    counts = batched(made, tile, batch)[2]
    assert totals.tolist() == [counts[name] for name in ("EVALUATIONS", "BLENDED", "STOPPED")]


def _entry(made, found, i):
    splats = made.splats
    inverse = np.linalg.inv(found[i][2])
    return found[i][1], inverse, float(splats.opacities[i]), splats.colours[i].astype(float)


@pytest.mark.parametrize("tile", [8, 16])
def test_counts_of_batches_add_up(tile):
    counts = draw(scene(CROWD, seed=8), tile=tile, bound="ellipse", two_scale=True).counts
    slots = tile * tile // 32
    assert counts["blend.EVALUATIONS"] + counts["blend.IDLE_LANES"] == 32 * counts["blend.STEPS"]
    assert counts["blend.STEPS"] == slots * counts["blend.TRIPS"]
    assert counts["blend.TRIPS"] < counts["blend.MASK_BITS"]  # some grow opaque
    assert counts["blend.TRIPS"] <= 64 * counts["blend.DRAINS"]
    assert counts["blend.MASKS_READ"] <= 32 * counts["blend.MINI_BATCHES"]
    assert counts["blend.PARTIAL_BYTES"] == 16 * tile * tile * counts["blend.TILES"]
    assert counts["blend.PARTIALS"] <= counts["blend.TILES"]  # behind opaque ones none is read
    assert counts["blend.SLOWEST_STEPS"] * 10 >= counts["blend.STEPS"]
    assert counts["blend.PIXELS"] == WIDTH * HEIGHT


def test_smaller_batches_show_the_same():
    made = scene(300, seed=4)
    small, whole = batched(made, 8, 7)[1], batched(made, 8, BATCH)[1]
    still = whole.transmittance > 0.05  # far from opaque
    assert np.abs(small.colours - whole.colours)[still].max() < ROUNDING
    assert (small.reached == whole.reached)[still].all()


@pytest.mark.parametrize("options", [{"tile": 4}, {"tile": 32}, {"threads": 64}, {"gradients": "lanes"}])
def test_what_two_scales_do_not_take_is_said(options):
    with pytest.raises(TilestampError, match="two_scale"):
        draw(two_scale=True, **options)
