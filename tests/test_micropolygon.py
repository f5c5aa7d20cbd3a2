"""The micropolygon pipeline as a whole: one contract, and the scenes whose counts are known."""

import numpy as np
import pytest

from tilestamp.models.errors import TilestampError
from tilestamp.models.simt import AtomicMerge, Coalescing, Simt
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.pipelines.micropolygon import MicropolygonOptions, micropolygon
from tilestamp.simulator.scenes import Scene, load_scene, read_camera
from tilestamp.simulator.simulation import simulate
from tilestamp.simulator.stages.eisenacher2010.bucket_count import BucketCountEvent
from tilestamp.simulator.stages.eisenacher2010.bucket_write import BucketWriteEvent
from tilestamp.simulator.stages.eisenacher2010.tile_raster_events import TileRasterEvent

GT200 = Simt(32, Coalescing.HALF_WARP_SEGMENTS, 16, 16, AtomicMerge.NONE, 30)
WIDTH, HEIGHT = 160, 120


def teapot(counting=True, **options):
    scene = load_scene("teapot")
    matrix = read_camera("default", scene).matrix(WIDTH, HEIGHT)
    execute = Executor(counting=counting)
    simt = options.pop("simt", GT200)
    return micropolygon(scene, matrix, WIDTH, HEIGHT, simt, MicropolygonOptions(**options), execute)


def by_kernel(frame):
    return {work.kernel: work for work in frame.works}


def test_stages_run_in_the_order_of_the_overview():
    stages = list(dict.fromkeys(work.stage for work in teapot().works))
    assert stages == ["bound_and_split", "dice", "bucket_count", "bucket_scan", "bucket_write", "tile_raster"]


def test_the_picture_is_the_same_with_and_without_counting():
    counted, plain = teapot(), teapot(counting=False)
    assert np.array_equal(counted.image, plain.image)
    assert np.array_equal(counted.depth, plain.depth)
    assert plain.works == []


def test_the_teapot_covers_part_of_the_picture():
    covered = (teapot().depth < 1).mean()
    assert 0.05 < covered < 0.9


def test_patches_in_tiles_are_the_same_number_in_every_stage():
    frame = teapot()
    works = by_kernel(frame)
    assert (
        works["address_calculation"].total(BucketCountEvent.SLOT_LANES)
        == works["bucket_write"].total(BucketWriteEvent.WRITE_LANES)
        == works["tile_raster"].total(TileRasterEvent.GRIDS)
        == frame.maps["atomics"].sum()
        == frame.facts["patches_written"]
    )


def test_maps_add_up_to_the_counters():
    frame = teapot()
    raster = by_kernel(frame)["tile_raster"]
    assert frame.maps["tests"].sum() == raster.total(TileRasterEvent.SAMPLE_TESTS)
    assert frame.maps["quads"].sum() == raster.total(TileRasterEvent.SUBTILE_PASS)
    assert frame.maps["overdraw"].shape == (HEIGHT, WIDTH)
    assert frame.maps["ste"].max() <= 1


def test_a_smaller_tile_than_the_bound_draws_the_same_coverage():
    assert np.array_equal(teapot(tile=4, bound=8).depth < 1, teapot(tile=8, bound=8).depth < 1)


def test_the_picture_does_not_depend_on_the_machine():
    assert np.array_equal(teapot().image, teapot(simt=Simt()).image)


def test_the_hybrid_covers_what_the_tiles_cover():
    hybrid, tiles = teapot(hybrid=True), teapot()
    assert [work.stage for work in hybrid.works][-1] == "hardware"
    background = (32, 32, 64)
    differ = (hybrid.image != background).any(axis=2) != (tiles.image != background).any(axis=2)
    assert differ.mean() < 0.01  # pixel centres on edges, snapped there and not here


def test_a_scene_without_patches_is_refused():
    with pytest.raises(TilestampError, match="draws patches, and nothing has none"):
        micropolygon(Scene("nothing"), np.eye(4), 64, 64, GT200, MicropolygonOptions(), Executor())


def test_a_near_limit_culls_what_lies_before_it():
    everything, nothing = teapot(near=0.0), teapot(near=1e6)
    assert everything.facts["subpatches"] > 0
    assert nothing.facts["subpatches"] == 0
    assert (nothing.depth == 1).all()


def test_a_least_depth_halves_every_patch_so_often():
    depths = len(teapot(bound=200).facts["queue_passes"]), len(teapot(bound=200, min_depth=4).facts["queue_passes"])
    assert depths[0] < depths[1] == 5


def test_snapped_edges_are_a_stage_of_their_own_that_dices_again():
    run = simulate("teapot", width=WIDTH, height=HEIGHT, snap_edges=True)
    plain = simulate("teapot", width=WIDTH, height=HEIGHT)
    assert list(run.stages.index) == [*plain.stages.index[:2], "snap_edges", *plain.stages.index[2:]]
    assert run.counts["snap_edges.LOOKUPS"] >= run.counts["snap_edges.SNAPPED"] > 0
    assert run.counts["snap_edges.PATCHES"] == run.counts["snap_edges.SNAPPED"] < run.counts["dice.PATCHES"]
    assert run.stages.milliseconds["snap_edges"] > 0


def test_look_ups_have_no_price():
    run = simulate("teapot", width=WIDTH, height=HEIGHT, snap_edges=True)
    launch = next(launch for launch in run.launches if launch.kernel == "snap_edges")
    assert not launch.events.any()
