"""Tile raster: the picture of the kernel, bit for bit, and what each warp of it did."""

import csv

import numpy as np
import pytest
from numba import get_num_threads, set_num_threads

from tests.diced_scenes import diced
from tests.naive_tiles import naive_raster
from tilestamp.models.errors import TilestampError
from tilestamp.models.machine import load_machine
from tilestamp.models.simt import AtomicMerge, Coalescing, Simt
from tilestamp.simulator.stages.eisenacher2010.bucket_count import bucket_count
from tilestamp.simulator.stages.eisenacher2010.bucket_scan import bucket_scan
from tilestamp.simulator.stages.eisenacher2010.bucket_write import bucket_write
from tilestamp.simulator.stages.eisenacher2010.tile_range import screen_tiles
from tilestamp.simulator.stages.eisenacher2010.tile_raster import tile_raster
from tilestamp.simulator.stages.eisenacher2010.tile_raster_events import TileRasterEvent as Event
from tilestamp.simulator.stages.eisenacher2010.tile_raster_events import block_shape, block_traffic

GT200 = Simt(32, Coalescing.HALF_WARP_SEGMENTS, 16, 16, AtomicMerge.NONE, 30)
H200 = Simt()
WIDTH, HEIGHT = 43, 27
BACKGROUND = (32, 32, 64)


def some_grids(number, size=4.0, seed=7):
    """Warped grids below ``size`` pixels, some of them across the border of the screen."""
    random = np.random.default_rng(seed)
    corner = random.uniform([-3, -3], [WIDTH, HEIGHT], (number, 1, 2))
    place = np.stack(np.meshgrid(np.arange(4), np.arange(4)), axis=-1).reshape(16, 2) / 3
    place = place[None] * random.uniform(0.2, 0.8, (number, 1, 2)) + random.uniform(0, 0.15, (number, 16, 2))
    vertices = np.zeros((number, 16, 4), np.float32)
    vertices[..., :2] = corner + place * size
    vertices[..., 2] = random.uniform(0.1, 0.9, (number, 1)) + random.uniform(0, 0.05, (number, 16))
    vertices.view(np.uint32)[..., 3] = random.integers(0, 2**24, (number, 16)) | 0xFF000000
    return vertices


def drawn(vertices, tile=8, simt=H200, width=WIDTH, height=HEIGHT, bound=4, **options):
    boxes = np.hstack([vertices[..., :2].min(axis=1), vertices[..., :2].max(axis=1)])
    tiles = screen_tiles(width, height, tile, bound)
    (count, idx), _, _ = bucket_count(boxes, tiles, simt, counting=False)
    start, _, _ = bucket_scan(count, simt, counting=False)
    lists, _, _ = bucket_write(boxes, tiles, count, start, idx, simt, counting=False)
    result = tile_raster(vertices, count, start, lists, tiles, width, height, simt, **options)
    return *result.outputs, result.works, tiles, [lists[s : s + n].tolist() for s, n in zip(start, count, strict=True)]


@pytest.mark.parametrize("box_tests", [True, False])
@pytest.mark.parametrize(
    ("tile", "spp", "warp"), [(4, 1, 32), (8, 1, 32), (8, 4, 32), (8, 16, 32), (16, 4, 16), (32, 1, 16), (8, 4, 64)]
)
def test_picture_and_events_are_those_of_every_thread_run_by_itself(tile, spp, warp, box_tests):
    vertices = some_grids(14 if box_tests else 4)
    simt = H200._replace(warp=warp)
    image, depth, _, works, tiles, lists = drawn(vertices, tile, simt, spp=spp, box_tests=box_tests)
    side = round(spp**0.5)
    naive_image, naive_depth, events = naive_raster(
        vertices, lists, tile, tiles.columns, WIDTH, HEIGHT, side, warp, box_tests
    )
    assert np.array_equal(image, naive_image)
    assert np.array_equal(depth, naive_depth)
    for name in events[0]:
        assert works[0].table[:, Event[name]].tolist() == [event[name] for event in events], name


@pytest.mark.parametrize("option", [{"box_tests": False}, {"edges": "loaded"}, {"counting": False}])
@pytest.mark.parametrize("spp", [1, 4])
def test_options_change_costs_and_never_the_picture(option, spp):
    vertices = some_grids(200)
    image, depth, *_ = drawn(vertices, spp=spp)
    other_image, other_depth, *_ = drawn(vertices, spp=spp, **option)
    assert np.array_equal(image, other_image)
    assert np.array_equal(depth, other_depth)


def test_one_thread_and_two_draw_and_count_the_same():
    vertices, threads = some_grids(200), get_num_threads()
    image, _, overdraw, works, *_ = drawn(vertices)
    set_num_threads(1)
    try:
        other_image, _, other_overdraw, other_works, *_ = drawn(vertices)
    finally:
        set_num_threads(threads)
    assert np.array_equal(image, other_image)
    assert np.array_equal(overdraw, other_overdraw)
    assert np.array_equal(works[0].table, other_works[0].table)


@pytest.mark.parametrize("tile", [4, 16, 32])
def test_the_size_of_tiles_does_not_change_coverage(tile):
    vertices = some_grids(200)
    assert np.array_equal(drawn(vertices, tile)[2], drawn(vertices, 8)[2])


def test_four_samples_are_the_mean_of_a_picture_twice_as_large():
    vertices = some_grids(150)
    twice = vertices.copy()
    twice[..., :2] *= 2
    large = drawn(twice, width=2 * WIDTH, height=2 * HEIGHT, bound=8)[0].astype(np.int64)
    blocks = large.reshape(HEIGHT, 2, WIDTH, 2, 3).sum(axis=(1, 3))
    assert np.array_equal(drawn(vertices, spp=4)[0], (blocks + 2) // 4)


def test_hits_are_at_most_tests_and_overdraw_adds_up_to_hits_on_the_screen():
    vertices = some_grids(200)
    inside = (vertices[..., :2] >= 0).all(axis=(1, 2)) & (vertices[..., :2] < (WIDTH, HEIGHT)).all(axis=(1, 2))
    _, _, overdraw, works, *_ = drawn(vertices[inside])
    table = works[0].table
    assert (table[:, Event.SAMPLE_HITS] <= table[:, Event.SAMPLE_TESTS]).all()
    assert overdraw.sum() == works[0].total(Event.SAMPLE_HITS) > 0


def test_nothing_drawn_leaves_background_and_far_depth():
    image, depth, overdraw, *_ = drawn(some_grids(0))
    assert (image == BACKGROUND).all()
    assert (depth == 1).all()
    assert not overdraw.any()


def test_a_quad_that_is_one_point_on_a_sample_is_hit_and_has_no_depth_to_show():
    vertices = some_grids(1)
    vertices[..., :2] = 5.5
    _, depth, overdraw, works, *_ = drawn(vertices)
    assert overdraw[5, 5] == works[0].total(Event.HIT_LANES) == 9
    assert works[0].total(Event.Z_LANES) == 0
    assert (depth == 1).all()


def test_a_tile_of_four_pixels_leaves_half_of_each_warp_empty():
    works = drawn(some_grids(50), tile=4)[3]
    assert works[0].total(Event.QUAD_LANES) == 16 * works[0].total(Event.QUAD_WARPS)


def test_a_batch_holds_as_many_grids_as_the_block_has_threads_for():
    works, _, lists = drawn(some_grids(300), tile=8)[3:]
    assert works[0].table[:, Event.BATCHES].tolist() == [-(-len(members) // 4) for members in lists]


@pytest.mark.parametrize(("simt", "transactions", "start"), [(GT200, 2, 4), (H200, 8, 2)])
def test_a_grid_of_256_bytes_is_two_segments_or_eight_sectors(simt, transactions, start):
    """Beside the first grid: its index, and START, which each warp (GT200: half-warp) reads where there are grids."""
    one, none = some_grids(1, 0.1), some_grids(0)
    one[..., :2] = one[..., :2] % 1 + 2
    more = drawn(one, simt=simt)[3][0].total(Event.LOAD_TRANSACTIONS)
    assert more - drawn(none, simt=simt)[3][0].total(Event.LOAD_TRANSACTIONS) == transactions + 1 + start


def test_loading_edge_equations_costs_432_bytes_a_grid_and_saves_computing_them():
    vertices = some_grids(300)
    computed, loaded = (drawn(vertices, edges=edges)[3][0] for edges in ("computed", "loaded"))
    assert computed.total(Event.EDGE_SETUP_WARPS) == computed.total(Event.BOX_WARPS) > 0
    assert loaded.total(Event.EDGE_SETUP_WARPS) == 0
    assert loaded.shared_bytes == computed.shared_bytes + 4 * 432
    assert loaded.total(Event.LOAD_BYTES) >= computed.total(Event.LOAD_BYTES) + 432 * loaded.total(Event.GRIDS)


def test_streams_hold_all_bytes_that_are_loaded_and_stored():
    for edges in ("computed", "loaded"):
        work = drawn(some_grids(300), edges=edges)[3][0]
        moved = {op: sum(s.bytes for s in work.streams if s.op == op) for op in ("load", "store")}
        assert moved == {"load": work.total(Event.LOAD_BYTES), "store": work.total(Event.STORE_BYTES)}


def test_one_sample_stores_colour_and_depth_of_each_pixel_once():
    work = drawn(some_grids(3), width=64, height=32)[3][0]
    assert work.total(Event.STORE_BYTES) == 64 * 32 * 8


def test_warps_that_the_kernel_lacks_are_refused():
    with pytest.raises(TilestampError, match="warps of 16, 32 or 64 lanes, not 8"):
        drawn(some_grids(1), simt=H200._replace(warp=8))


@pytest.mark.shared
@pytest.mark.parametrize(("tile", "spp"), [(4, 1), (8, 1), (8, 4), (32, 4)])
def test_lanes_of_the_measured_scene(tile, spp, shared):
    """Counted by the H200 itself; its grids differ from ours by float32 rounding of dicing."""
    name = "teapot_1600x1200_bb4" if tile == 8 and spp == 1 else "teapot_512x512_bb8"
    grids, camera = diced(shared, name)
    with (shared / "silicon" / "micropolygon.csv").open() as file:
        key = (name, str(tile), str(spp), "stats")
        rows = [r for r in csv.DictReader(file) if (r["scene"], r["tile"], r["spp"], r["kernel"]) == key]
    published = {r["metric"]: float(r["value"]) for r in rows}
    size = (camera["width"], camera["height"])
    image, _, _, works, *_ = drawn(grids.vertices, tile, H200, *size, camera["bound_pixels"], spp=spp)
    ours = {
        "covered_pixels": int((image != BACKGROUND).any(axis=2).sum()),
        "quad_sample_pairs_after_subtile_box": works[0].total(Event.BOX_TEST_LANES),
        "quad_sample_pairs_after_sample_box": works[0].total(Event.BOX_LANES),
        "quad_sample_pairs_covered": works[0].total(Event.HIT_LANES),
    }
    assert ours == pytest.approx({metric: published[metric] for metric in ours}, rel=1e-3)


@pytest.mark.parametrize(
    ("name", "replays"), [("gtx280", 30), ("gtx480", 3), ("gtx680", 1), ("gtx980", 3), ("h200", 3)]
)
def test_vectors_are_stored_by_the_banks_of_the_generation(name, replays):
    """32 lanes of 16 bytes take 32, 4, 2, 4 and 4 passes, of which 2 or 1 are counted with the access itself."""
    simt = load_machine(name).simt
    shape = block_shape(8, 1, simt, box_tests=True, loaded=False)
    assert block_traffic(shape, simt).gather_replays == replays
