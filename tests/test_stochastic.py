"""Moving, defocused triangles: samples against fractions, bounds that hold, events against Python, options."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests import naive_stochastic
from tests.test_counts_of_warps import HOPPER, by_machine
from tilestamp import simulate
from tilestamp.models.coalescing import transactions
from tilestamp.models.errors import TilestampError
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.stages.fatahalian2009.micropolygons import micropolygons
from tilestamp.simulator.stages.fatahalian2009.motion import BlurPattern, blur_samples, moved, stratified_pattern
from tilestamp.simulator.stages.fatahalian2009.motion_interval import intervals_of, motion_brute_force
from tilestamp.simulator.stages.stochastic.bounds import EVERYTHING, visit_tiles
from tilestamp.simulator.stages.stochastic.sample_raster import SampleRasterEvent, sample_raster
from tilestamp.simulator.stages.stochastic.tile_lists import ENTRY_BYTES, MovingListEvent, MovingLists, moving_lists
from tilestamp.simulator.stages.stochastic.triangles import (
    Lens,
    homogeneous_pixels,
    moving_triangles,
    scene_triangles,
)

WIDTH, HEIGHT, TILE, SPP = 19, 13, 4, 3
TILES = -(-WIDTH // TILE) * -(-HEIGHT // TILE)
LENS = Lens(1.5, 2.0)


def pattern_of_eighths(seed=1):
    """Samples at eighths of pixel, shutter and lens: float64 is exact, and many samples lie on edges."""
    rng = np.random.default_rng(seed)
    place = rng.integers(0, 8, (2, 2, SPP, 2)) * 512
    time = (np.arange(SPP) + rng.integers(0, 3, (2, 2, SPP)) / 2) / 4
    lens = rng.integers(-5, 6, (2, 2, SPP, 2)) / 8
    return BlurPattern(place.astype(np.int64), np.concatenate([time[..., None], lens], axis=-1))


def soup(count, seed=2, *, behind=0, lens=LENS, double=True):
    """Triangles with whole coordinates, some corners of the first ``behind`` of them behind the eye at some time."""
    rng = np.random.default_rng(seed)
    ends = []
    for _ in range(2):
        w = rng.integers(1, 4, (count, 3))
        w[:behind] = rng.integers(-2, 3, (behind, 3))
        places = rng.integers((-2, -2), (WIDTH + 3, HEIGHT + 3), (count, 3, 2))
        z = rng.integers(-8, 9, (count, 3)) / 8 * w
        ends.append(np.concatenate([places * w[..., None], z[..., None], w[..., None]], axis=-1).astype(np.float32))
    return moving_triangles(*ends, lens, double=double)


def everywhere(triangles):
    """Lists of every triangle in every tile, with all samples: brute force."""
    count = len(triangles.corners)
    entries = np.tile(np.arange(count, dtype=np.int32), TILES)
    return MovingLists(np.arange(TILES + 1) * count, entries, np.full(len(entries), (1 << SPP) - 1))


def draw(triangles, lists, pattern, simt=HOPPER):
    samples = blur_samples(WIDTH, HEIGHT, pattern)
    return samples, sample_raster(triangles, lists, pattern, samples, simt, tile=TILE).works[0]


def bounded(triangles, pattern, count=None, simt=HOPPER):
    visits = visit_tiles(triangles, intervals_of(pattern, count), SPP, WIDTH, HEIGHT, TILE)
    return visits, moving_lists(visits, TILES, simt)


@pytest.mark.parametrize("behind", [0, 6])
@pytest.mark.parametrize("lens", [Lens(0.0, 1.0), LENS], ids=["3D", "5D"])
def test_every_sample_is_that_of_fractions(behind, lens):
    triangles, pattern = soup(6, behind=behind, lens=lens), pattern_of_eighths()
    samples, _ = draw(triangles, everywhere(triangles), pattern)
    for y, x, s in np.ndindex(HEIGHT, WIDTH, SPP):
        expected = naive_stochastic.nearest(triangles, pattern, x, y, s)
        assert samples.polygon.reshape(HEIGHT, WIDTH, SPP)[y, x, s] == expected, (x, y, s)


@pytest.mark.small
def test_a_triangle_whose_place_is_no_number_meets_no_tile():
    triangles = soup(1)
    triangles.corners[..., :2] = np.nan
    assert len(visit_tiles(triangles, intervals_of(pattern_of_eighths()), SPP, WIDTH, HEIGHT, TILE).tiles) == 0


def test_depth_is_that_of_fractions():
    triangles, pattern = soup(1, seed=8), pattern_of_eighths()
    samples, _ = draw(triangles, everywhere(triangles), pattern)
    depth = samples.depth.reshape(HEIGHT, WIDTH, SPP)
    found = [(at, naive_stochastic.hit(triangles, pattern, 0, at[1], at[0], at[2])) for at in np.ndindex(depth.shape)]
    hits = [(at, z) for at, z in found if z is not None]
    assert hits
    for at, z in hits:
        assert depth[at] == pytest.approx(z, abs=1e-6)


def fan(seed):
    """A fan around a point that covers the screen at all times: its rim moves along, its middle by itself."""
    rng = np.random.default_rng(seed)
    rim = np.array([[-40, -40], [40, -50], [70, -40], [70, 60], [30, 70], [-40, 60]])
    ends = []
    for _ in range(2):
        middle, w = rng.integers((2, 2), (WIDTH - 2, HEIGHT - 2)), rng.integers(1, 4, 7)
        places = np.concatenate([rim, [middle]])
        corners = np.concatenate([places * w[:, None], np.zeros((7, 1)), w[:, None]], axis=-1).astype(np.float32)
        ends.append(corners[[[i, (i + 1) % 6, 6] for i in range(6)]])
    return ends


@pytest.mark.parametrize("double", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_each_sample_of_a_moving_fan_is_hit_once(seed, double):
    """No cracks and nothing twice, in float32 too, also where samples lie on edges."""
    pattern = stratified_pattern(SPP, tile=3) if seed % 2 else pattern_of_eighths()
    triangles = moving_triangles(*fan(seed), Lens(2.0, 2.0), double=double)
    samples, work = draw(triangles, everywhere(triangles), pattern)
    assert (samples.polygon >= 0).all()
    assert work.total(SampleRasterEvent.SAMPLE_HITS) == WIDTH * HEIGHT * SPP


@given(st.integers(0, 10**6), st.integers(0, 4), st.booleans(), st.sampled_from([1, 2, None]))
@settings(max_examples=30, deadline=None)
def test_no_hit_lies_outside_the_bounds(seed, behind, double, count):
    rng = np.random.default_rng(seed)
    lens = Lens(float(rng.integers(0, 4)), float(rng.uniform(0.2, 4)))
    triangles = soup(4, seed, behind=behind, lens=lens, double=double)
    pattern = stratified_pattern(SPP, tile=3, seed=seed)
    brute, brute_work = draw(triangles, everywhere(triangles), pattern)
    lists = bounded(triangles, pattern, count)[1].outputs
    samples, work = draw(triangles, lists, pattern)
    assert work.total(SampleRasterEvent.SAMPLE_HITS) == brute_work.total(SampleRasterEvent.SAMPLE_HITS)
    assert (samples.polygon == brute.polygon).all()


@pytest.mark.parametrize("behind", [0, 8])
def test_bounds_list_what_planes_in_fractions_leave(behind):
    """The margin lists a little more, never less, and little more."""
    triangles, pattern = soup(8, seed=5, behind=behind), pattern_of_eighths()
    intervals = intervals_of(pattern)
    visits = visit_tiles(triangles, intervals, SPP, WIDTH, HEIGHT, TILE)
    columns, more = -(-WIDTH // TILE), 0
    found = np.zeros((8, TILES), int)
    for p in range(8):
        part = slice(visits.starts[p], visits.starts[p + 1])
        found[p, visits.tiles[part]] = visits.masks[part]
    for p, i in np.ndindex(8, TILES):
        x, y = i % columns * TILE, i // columns * TILE
        sides = (x, y, x + TILE, y + TILE)
        whole = naive_stochastic.stays_off(triangles, p, sides, EVERYTHING)
        live = 0 if whole else sum(
            1 << s for s in range(SPP) if not naive_stochastic.stays_off(triangles, p, sides, intervals[s])
        )  # fmt: skip
        more += int(found[p, i] & ~live).bit_count()
        assert live & ~found[p, i] == 0, (p, i)
    assert more <= 12


def test_intervals_leave_out_samples_that_the_whole_blur_may_reach():
    triangles, pattern = soup(30, seed=4, lens=Lens(0.0, 1.0)), pattern_of_eighths()
    tests = [
        draw(triangles, bounded(triangles, pattern, count)[1].outputs, pattern)[1].total(SampleRasterEvent.SAMPLE_TESTS)
        for count in (1, None)
    ]
    assert tests[1] < 0.8 * tests[0]


@by_machine
def test_every_event_of_the_lists_is_that_of_python(simt):
    triangles, pattern = soup(150, seed=6, behind=9), pattern_of_eighths()
    visits, (lists, works, _) = bounded(triangles, pattern, simt=simt)
    expected = dict.fromkeys(("VISIT_STEPS", "VISIT_LANES", "BOUND_STEPS", "BOUND_LANES", "APPENDS", "APPEND_LANES"), 0)
    stored, places = 0, lists.starts[:-1].copy()
    for first in range(0, 150, 32):
        walks = [range(visits.starts[p], visits.starts[p + 1]) for p in range(first, min(first + 32, 150))]
        for step in range(max(map(len, walks))):
            now = [walk[step] if step < len(walk) else None for walk in walks]
            active = [at for at in now if at is not None]
            appends = [at for at in active if visits.masks[at]]
            expected["VISIT_STEPS"] += 1
            expected["VISIT_LANES"] += len(active)
            expected["BOUND_STEPS"] += max(visits.bounds[at] for at in active)
            expected["BOUND_LANES"] += sum(visits.bounds[at] for at in active)
            expected["APPENDS"] += bool(appends)
            expected["APPEND_LANES"] += len(appends)
            to = np.full(len(now), -1)
            for lane, at in enumerate(now):
                if at is not None and visits.masks[at]:
                    to[lane] = ENTRY_BYTES * places[visits.tiles[at]]
                    places[visits.tiles[at]] += 1
            stored += transactions(to, len(to), ENTRY_BYTES, int(simt.coalescing))[0]
    counts = works[-1].counts()
    assert {name: counts[name] for name in expected} == expected
    assert counts["STORE_TRANSACTIONS"] == stored
    assert works[0].total(MovingListEvent.STORE_TRANSACTIONS) == 0
    assert counts["ATOMIC_LANES"] == len(lists.entries) == counts["APPEND_LANES"]
    assert (places == lists.starts[1:]).all()


def test_tests_are_the_masks_and_hits_those_of_fractions():
    triangles, pattern = soup(5, seed=9), pattern_of_eighths()
    lists = bounded(triangles, pattern)[1].outputs
    samples, work = draw(triangles, lists, pattern)
    bits = sum(int(mask).bit_count() for mask in lists.masks)
    hits = sum(
        naive_stochastic.hit(triangles, pattern, p, x, y, s) is not None
        for p in range(5) for y, x, s in np.ndindex(HEIGHT, WIDTH, SPP)
    )  # fmt: skip
    assert work.total(SampleRasterEvent.SAMPLE_TESTS) == bits * TILE * TILE
    assert work.total(SampleRasterEvent.TEST_WARPS) == bits * -(-TILE * TILE // 32)
    assert work.total(SampleRasterEvent.SAMPLE_HITS) == hits
    assert samples.tests.sum() < bits * TILE * TILE  # off-screen lanes test in vain


def flat_scene(count):
    """Triangles of all sizes, straight to clip space."""
    rng = np.random.default_rng(12)
    corners = np.concatenate([rng.uniform(-1, 1, (3 * count, 3)), np.ones((3 * count, 1))], axis=1)
    return Scene.from_clip_space(corners, np.arange(3 * count).reshape(-1, 3))


def test_what_moves_on_screen_is_what_the_interval_method_draws():
    """The same scene, motion and samples by Fatahalian's brute force, whose corners are snapped to 1/4096 pixel."""
    width, height, way = 64, 48, (6.0, -3.0)
    scene = flat_scene(60)
    pattern = stratified_pattern(4)
    still = micropolygons(scene, np.eye(4), width, height)
    theirs = blur_samples(width, height, pattern)
    motion_brute_force(moved(still, way), pattern, theirs, HOPPER)
    start = homogeneous_pixels(scene_triangles(scene, np.eye(4), width, height, 1.0)[0], width, height)
    end = start.copy()
    end[..., :2] += np.float32(way) * end[..., 3:]
    triangles = moving_triangles(start, end, Lens(0.0, 1.0), double=True)
    tiles = -(-width // 8) * -(-height // 8)
    lists = moving_lists(visit_tiles(triangles, intervals_of(pattern), 4, width, height, 8), tiles, HOPPER).outputs
    ours = blur_samples(width, height, pattern)
    sample_raster(triangles, lists, pattern, ours, HOPPER, tile=8)
    assert (ours.polygon >= 0).mean() > 0.5
    assert (ours.polygon != theirs.polygon).mean() < 2e-3


def picture(**options):
    return simulate("teapot", "stochastic", width=64, height=48, fidelity="counts", edge=4.0, **options).image.astype(
        int
    )


def test_bounds_and_tiles_do_not_change_the_picture():
    usual = picture()
    assert (picture(bounds="whole") == usual).all()
    assert (picture(tile=16) == usual).all()


def test_a_scene_that_comes_nearer_grows():
    still, near = (np.count_nonzero(picture(motion=0.0, lens=0.0, dolly=way) < 255) for way in (0.0, 3.0))
    assert near > 1.1 * still


def test_no_dolly_without_perspective():
    with pytest.raises(TilestampError, match="dolly needs a perspective camera"):
        simulate(flat_scene(2), "stochastic", width=16, height=16, dolly=1.0)


def test_single_precision_is_wrong_in_few_samples():
    wrong = (picture(double=True) != picture()).any(axis=2).mean()
    assert wrong < 1e-2


def test_patches_and_triangles_say_what_is_missing():
    with pytest.raises(TilestampError, match="neither patches nor triangles"):
        scene_triangles(Scene("nothing"), np.eye(4), 8, 8, 1.0)


@pytest.mark.parametrize("turn", [1, -1])
def test_left_and_top_edges_have_the_samples_on_them(turn):
    """Two squares, one above the other, whose edges all run through samples at the corners of pixels."""
    boxes = [(4, 2, 8, 4), (4, 4, 8, 9)]
    halves = [[(a, b), (c, b), (c, d)][::turn] for a, b, c, d in boxes] + [
        [(a, b), (c, d), (a, d)][::turn] for a, b, c, d in boxes
    ]
    flat = np.ones((4, 3, 4), np.float32)
    flat[..., :2], flat[..., 2] = halves, 0
    triangles = moving_triangles(flat, flat, Lens(0.0, 1.0), double=True)
    pattern = BlurPattern(np.zeros((1, 1, SPP, 2), np.int64), np.zeros((1, 1, SPP, 3)))
    samples, work = draw(triangles, everywhere(triangles), pattern)
    shown = samples.polygon.reshape(HEIGHT, WIDTH, SPP)[..., 0] >= 0
    expected = np.zeros((HEIGHT, WIDTH), bool)
    expected[2:9, 4:8] = True
    assert (shown == expected).all()
    assert work.total(SampleRasterEvent.SAMPLE_HITS) == expected.sum() * SPP
