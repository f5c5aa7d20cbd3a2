"""The pipeline splat against a slow one, and what holds of its lists, its sort and its counts whatever is drawn."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests import naive_splats as naive
from tests.ledger.scenes import odd_splats
from tilestamp import TilestampError, simulate
from tilestamp.models.kernel import kernel
from tilestamp.simulator.scenes.pinhole import Pinhole, PinholeCamera
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.scenes.splat_view import perspective
from tilestamp.simulator.stages.kerbl2023.blend_step import blend_step
from tilestamp.simulator.stages.kerbl2023.duplicate import keys_of
from tilestamp.simulator.stages.kerbl2023.exponential import exp32
from tilestamp.simulator.stages.kerbl2023.tiles import to_int

WIDTH, HEIGHT = 75, 50
FORWARD = perspective(np.eye(4), 1.0, HEIGHT / WIDTH)


@kernel
def compiled_step(state, lasts, alive, entry):
    return blend_step(state, lasts, 0, alive, entry, 7)


def scene(count=40, seed=3) -> Scene:
    """Splats in front of a camera that looks along z; the first is too near."""
    draw = np.random.default_rng(seed)
    means = draw.uniform((-2.0, -1.5, 1.0), (2.0, 1.5, 4.0), (count, 3))
    means[0, 2] = 0.1
    turns = draw.normal(size=(count, 4))
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    sizes, opacities = draw.uniform(0.01, 0.3, (count, 3)), draw.uniform(0.05, 1.0, count)
    return Scene.from_splats(means, sizes, turns, opacities, draw.uniform(size=(count, 3)))


def draw(made=None, machine="h200", **options):
    return simulate(
        made or scene(), "splat", machine, width=WIDTH, height=HEIGHT, fidelity="counts",
        camera=PinholeCamera(FORWARD), **options,
    )  # fmt: skip


def sides(tile):
    return (tile, tile) if isinstance(tile, int) else tuple(map(int, tile.split("x")))


@pytest.fixture(scope="module")
def found():
    return naive.projected(scene().splats, FORWARD, WIDTH, HEIGHT)


def tile_lists(run):
    """Gaussians of each tile, by row and column."""
    buffers, columns = run.frame.buffers, run.frame.maps["pairs"].shape[1]
    parts = np.split(buffers["listed"], buffers["starts"][1:-1])
    return {divmod(tile, columns): part.tolist() for tile, part in enumerate(parts)}


def test_positions_depths_and_conics_are_those_of_textbook_matrices(found):
    buffers, opacities = draw().frame.buffers, scene().splats.opacities
    seen = np.flatnonzero(buffers["radii"])
    assert len(seen) > 20
    for i in seen:
        depth, place, covariance = found[i]
        inverse = np.linalg.inv(covariance)
        assert buffers["depths"][i] == pytest.approx(depth, rel=1e-6)
        assert buffers["positions"][i] == pytest.approx(place, abs=1e-4)
        expected = [inverse[0, 0], inverse[0, 1], inverse[1, 1], opacities[i]]
        assert buffers["conics"][i] == pytest.approx(expected, rel=1e-4, abs=1e-6)


@pytest.mark.parametrize("tile", [4, 8, "16x8", 16, 32])
def test_each_tile_lists_those_whose_square_touches_it_from_near_to_far(found, tile):
    def listed(i, column, row):
        return naive.square(*found[i][1:], column, row, sides(tile))

    assert tile_lists(draw(tile=tile)) == naive.lists(found, WIDTH, HEIGHT, sides(tile), listed)


@pytest.mark.parametrize("tile", [4, 8, "16x8", 16])
def test_the_ellipse_touches_the_tiles_that_a_fine_grid_finds(found, tile):
    opacities = scene().splats.opacities.astype(float)

    def listed(i, column, row):
        return naive.ellipse(*found[i][1:], opacities[i], column, row, sides(tile))

    slow, ours = naive.lists(found, WIDTH, HEIGHT, sides(tile), listed), tile_lists(draw(tile=tile, bound="ellipse"))
    assert all(set(slow[at]) <= set(ours[at]) for at in slow)  # the grid may miss a tip
    assert sum(map(len, ours.values())) - sum(map(len, slow.values())) <= 0.02 * sum(map(len, slow.values()))


@pytest.mark.parametrize("tile", [4, 8, "16x8", 16, 32])
def test_the_box_holds_the_ellipse(tile):
    inner, outer = tile_lists(draw(tile=tile, bound="ellipse")), tile_lists(draw(tile=tile, bound="box"))
    assert all(set(inner[at]) <= set(outer[at]) for at in inner)


@pytest.mark.parametrize(("tile", "bound"), [(8, "square"), ("16x8", "ellipse"), (16, "square")])
def test_pixels_and_counts_are_those_of_one_pixel_after_another(found, tile, bound):
    run = draw(tile=tile, bound=bound)
    splats, buffers, lists = scene().splats, run.frame.buffers, tile_lists(run)
    entries = {
        i: (one[1], np.linalg.inv(one[2]), float(splats.opacities[i]), splats.colours[i].astype(float))
        for i, one in enumerate(found)
        if one is not None
    }
    totals = np.zeros(3, int)
    for y in range(HEIGHT):
        for x in range(WIDTH):
            listed = [entries[i] for i in lists[y // sides(tile)[1], x // sides(tile)[0]]]
            colour, left, last, evaluations, blends, stopped = naive.blend(listed, x, y)
            assert buffers["colours"][y, x] == pytest.approx(colour, abs=2e-5)
            assert buffers["transmittance"][y, x] == pytest.approx(left, abs=2e-5)
            assert buffers["reached"][y, x] == last
            totals += evaluations, blends, stopped
    assert totals.tolist() == [run.counts[f"blend.{name}"] for name in ("EVALUATIONS", "BLENDED", "STOPPED")]


@pytest.mark.parametrize(("tile", "threads"), [(16, 64), (16, 128), (32, 256), (8, 32)])
def test_fewer_threads_draw_the_same_and_take_more_steps_a_trip(tile, threads):
    few, many = draw(tile=tile, threads=threads), draw(tile=tile)
    assert (few.image == many.image).all()
    for name in ("EVALUATIONS", "BLENDED", "STOPPED", "STEPS", "BLEND_STEPS"):
        assert few.counts[f"blend.{name}"] == many.counts[f"blend.{name}"], name
    assert few.counts["blend.TRIPS"] < many.counts["blend.TRIPS"]
    assert few.counts["blend.BATCHES"] >= many.counts["blend.BATCHES"]


@pytest.mark.parametrize("options", [{}, {"tile": 8, "bound": "ellipse"}, {"tile": 4}, {"tile": 16, "threads": 64}])
@pytest.mark.parametrize("made", [scene, odd_splats], ids=["usual", "odd"])
def test_counts_add_up(made, options):
    run = draw(made(), **options)
    counts, buffers, lists = run.counts, run.frame.buffers, np.diff(run.frame.buffers["starts"])
    assert counts["project.GAUSSIANS"] == len(buffers["radii"])
    culled = [counts[f"project.CULLED_{why}"] for why in ("NEAR", "DETERMINANT", "SCREEN")]
    assert counts["project.VISIBLE"] + sum(culled) == counts["project.GAUSSIANS"]
    assert counts["duplicate.PAIRS"] == counts["blend.LIST"] == lists.sum() == buffers["tiles"].sum()
    assert counts["ranges.LISTED_TILES"] == np.count_nonzero(lists)
    parts = [counts[f"blend.{name}"] for name in ("BLENDED", "SKIPPED_POWER", "SKIPPED_ALPHA", "STOPPED")]
    assert sum(parts) == counts["blend.EVALUATIONS"]
    assert counts["blend.EVALUATIONS"] + counts["blend.IDLE_LANES"] == 32 * counts["blend.STEPS"]
    assert counts["blend.PIXELS"] == WIDTH * HEIGHT
    assert counts["blend.COLOUR_FETCHES"] <= counts["blend.BLEND_TRIPS"] <= counts["blend.BLEND_STEPS"]
    assert counts["blend.SLOWEST_TRIPS"] <= counts["blend.ENTRIES"] <= counts["blend.LIST"]


@pytest.mark.parametrize("tile", [8, 16])
def test_the_backward_pass_counts_what_each_pixel_walks_back_and_adds(tile):
    plain, reduced = draw(tile=tile, gradients="lanes"), draw(tile=tile, gradients="reduced")
    counts, less, buffers = plain.counts, reduced.counts, plain.frame.buffers
    assert counts["gradients.EVALUATIONS"] == buffers["reached"].sum()
    assert counts["gradients.ATOMIC_LANES"] == 9 * counts["blend.BLENDED"]
    assert less["gradients.ATOMIC_LANES"] == 9 * counts["blend.BLEND_STEPS"]
    assert counts["gradients.ATOMIC_CONFLICTS"] == 9 * (counts["blend.BLENDED"] - counts["blend.BLEND_STEPS"])
    assert less["gradients.ATOMIC_CONFLICTS"] == 0
    assert buffers["uses"].sum(axis=0).tolist() == [counts["blend.BLENDED"], counts["blend.BLEND_STEPS"]]
    work = plain.frame.works[-1]
    assert work.atomic_requests.sum() == counts["gradients.ATOMIC_REQUESTS"]
    walked = sum(
        max(buffers["reached"][y : y + 32 // tile, x : x + tile].max(), 0)
        for x in range(0, WIDTH, tile)
        for top in range(0, HEIGHT, tile)
        for y in range(top, min(top + tile, HEIGHT), 32 // tile)
    )
    assert counts["gradients.WALK_STEPS"] == walked


def test_atomics_of_a_warp_that_adds_up_first_take_less_time():
    made = [simulate("playbot", "splat", "h200", width=480, height=360, gradients=how) for how in ("lanes", "reduced")]
    lanes, reduced = (run.stages.loc["gradients", "milliseconds"] for run in made)
    assert reduced < lanes


def test_keys_of_32_bits_take_four_passes_and_order_what_lies_far_enough_apart():
    short, long = draw(key=32), draw(key=64)
    assert [sum(work.kernel == "sort_onesweep" for work in run.frame.works) for run in (short, long)] == [4, 5]
    depths, lists = short.frame.buffers["depths"], tile_lists(short)
    assert {at: sorted(ours) for at, ours in lists.items()} == {
        at: sorted(ours) for at, ours in tile_lists(long).items()
    }
    bits = keys_of(20, 4).depth_bits
    step = np.float32(4.0) * 2.0 ** (23 - bits + 8 - 23)  # of depths under 4: a float's bits but the lowest
    for ours in lists.values():
        assert (np.diff(depths[ours]) > -step).all()


@settings(max_examples=200, deadline=None)
@given(st.floats(-87.0, -0.0, width=32))
def test_exp_is_within_two_units_in_the_last_place(power):
    power = np.float32(max(power, -80.0))
    exact = np.float32(np.exp(np.float64(power)))
    assert abs(int(exp32(power).view(np.int32)) - int(exact.view(np.int32))) <= 2


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(0, 2**32 - 1))
def test_a_step_of_vectors_does_what_the_step_of_single_pixels_does(seed, alive):
    draw_ = np.random.default_rng(seed)
    state = draw_.uniform(0.0, 1.0, (7, 32)).astype(np.float32)
    state[:2] *= 16
    entry = draw_.uniform(0.0, 1.0, 10).astype(np.float32)
    entry[:2] *= 16
    entry[2:5] *= draw_.choice([0.02, 0.5, -0.5], 3)
    entry[9] = -np.inf
    single = state.copy()
    found = compiled_step(state, state.view(np.int32), np.uint32(alive), entry)
    assert tuple(map(int, found)) == blend_step(single, single.view(np.int32), 0, alive, entry, 7)
    assert (state.view(np.int32) == single.view(np.int32)).all()


def test_what_a_pipeline_cannot_draw_is_refused_in_a_sentence():
    with pytest.raises(TilestampError, match="cudaraster draws no splats, and playbot has nothing else; splat can"):
        simulate("playbot", "cudaraster", "h200")
    with pytest.raises(TilestampError, match="the pipeline splat draws splats, and teapot has none"):
        simulate("teapot", "splat", "h200")
    with pytest.raises(TilestampError, match="threads: a tile of 8 has 64 pixels, fewer than 128"):
        draw(tile=8, threads=128)


def nasty(count=64):
    """Splats with numbers that are none, or beyond all others."""
    made = odd_splats(count).splats
    means, scales, turns = (array.copy() for array in (made.means, made.scales, made.rotations))
    opacities = made.opacities.copy()
    scales[20], scales[21, 1], scales[22], turns[23, 0], turns[24] = np.nan, np.nan, np.inf, np.nan, 1e20
    scales[25], means[26], means[27, 0], scales[28], turns[29] = 1e12, 1e38, np.nan, 0.0, 0.0
    opacities[30:36] = np.nan, np.inf, -1.0, 2.0, 0.0, 1e7
    return Scene.from_splats(means, scales, turns, opacities, made.colours)


@pytest.mark.parametrize("bound", ["square", "box", "ellipse"])
def test_gaussians_of_no_numbers_fill_their_pairs_or_have_none(bound):
    run = draw(nasty(), bound=bound, tile=8)
    buffers, lists = run.frame.buffers, tile_lists(run)
    assert not buffers["radii"][[20, 21, 23]].any()
    assert not buffers["tiles"][buffers["radii"] == 0].any()
    assert sorted(np.repeat(np.arange(64), buffers["tiles"])) == sorted(i for ours in lists.values() for i in ours)


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("away", [3e6, 1e8])
def test_a_gaussian_far_beside_the_screen_that_covers_it_is_seen_by_all_pixels(side, away):
    made = Scene.from_splats([(side * away, 0.0, 2.0)], [(away, away, 1.0)], [(1, 0, 0, 0)], [0.9], np.ones((1, 3)))
    assert draw(made).frame.buffers["reached"].all()


def test_a_radius_without_bound_is_the_largest_integer():
    assert to_int(np.float32(np.inf)) == 2**31 - 1
    assert to_int(np.float32(-np.inf)) == -(2**31)
    assert to_int(np.float32(np.nan)) == 0


def test_a_machine_of_other_sms_has_another_histogram_and_so_another_run():
    run = simulate("playbot", "splat", "h200", width=64, height=48)
    assert run.on("h100").milliseconds == simulate("playbot", "splat", "h100", width=64, height=48).milliseconds
    with pytest.raises(TilestampError, match="sms 132 and 108"):
        run.on("a100")


def test_any_camera_of_right_angles_sees_what_its_pinhole_sees():
    through = simulate(scene(), "splat", "h200", width=WIDTH, height=HEIGHT, fidelity="counts",
                       camera=PinholeCamera(FORWARD).matrix(WIDTH, HEIGHT))  # fmt: skip
    assert np.abs(through.image.astype(int) - draw().image).max() <= 1


def test_a_skewed_camera_is_refused():
    skewed = PinholeCamera(FORWARD).matrix(WIDTH, HEIGHT)
    skewed[0, 1] += 0.5
    with pytest.raises(TilestampError, match="right angles"):
        simulate(scene(), "splat", "h200", width=WIDTH, height=HEIGHT, camera=skewed)


def test_the_eye_of_a_pinhole_is_where_its_view_sees_nothing():
    view = np.eye(4, dtype=np.float32)
    view[:3, 3] = 1, 2, 3
    assert Pinhole(view, view, np.float32(1), np.float32(1)).eye == pytest.approx([-1, -2, -3])
