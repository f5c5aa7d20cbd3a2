"""Ru's pipelines: coverage, depth and attributes against double precision; lists, race, switches, bad options."""

from dataclasses import replace

import numpy as np
import pytest

from tests import naive_textured as naive
from tests.ru_pictures import CAMERA, HEIGHT, SIMT, WIDTH, draw, work
from tests.textured_soup import soup
from tilestamp.models.machine import load_machine
from tilestamp.models.occupancy import residency
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.mix import load_mix
from tilestamp.simulator.pipelines import pipeline_options
from tilestamp.simulator.pipelines.per_primitive import per_primitive
from tilestamp.simulator.pipelines.tiled import tiled
from tilestamp.simulator.scenes.camera import LookAt
from tilestamp.simulator.scenes.scene import Mesh, Scene
from tilestamp.simulator.scenes.textured_mesh import draws, geometry
from tilestamp.simulator.simulation import simulate
from tilestamp.simulator.stages.ru2016.fragment_shading import interpolate
from tilestamp.simulator.stages.ru2016.tile_lists import tile_lists
from tilestamp.simulator.stages.ru2016.tile_lists_fill import overlaps
from tilestamp.simulator.stages.ru2016.tiled_raster import Visible
from tilestamp.simulator.stages.ru2016.vertex_shading import vertex_shading

NEAR_EDGE = 1e-4  # barycentric: float32 may decide otherwise here


@pytest.fixture(scope="module")
def scene():
    return soup()


@pytest.fixture(scope="module")
def matrix():
    return CAMERA.matrix(WIDTH, HEIGHT)


@pytest.mark.parametrize("culling", [True, False])
@pytest.mark.parametrize(("pipeline", "options"), [(tiled, {}), (per_primitive, {"race": False})])
def test_coverage_and_depth_are_those_of_double_precision(scene, matrix, pipeline, options, culling):
    frame = draw(scene, matrix, pipeline, cull_backfaces=culling, **options)
    screen = naive.project(scene.mesh.positions, matrix, WIDTH, HEIGHT)
    ids, depth, doubt = naive.draw(screen, scene.mesh.triangles, WIDTH, HEIGHT, culling=culling)
    sure = doubt > NEAR_EDGE
    assert sure.mean() > 0.9
    assert (frame.triangle_ids[sure] == ids[sure]).all()
    drawn = sure & (ids >= 0)
    assert frame.depth[drawn] == pytest.approx(depth[drawn], abs=1e-5)


@pytest.mark.parametrize(("pipeline", "options"), [(tiled, {}), (per_primitive, {"race": False})])
def test_samples_at_corners_are_those_of_a_picture_half_a_pixel_on(scene, matrix, pipeline, options):
    """Up is y in the original: the sample is the lower left corner of its pixel."""
    frame = draw(scene, matrix, pipeline, samples="corners", **options)
    moved = np.array([0.5, -0.5, 0.0, 0.0])
    screen = naive.project(scene.mesh.positions, matrix, WIDTH, HEIGHT) + moved
    ids, _, doubt = naive.draw(screen, scene.mesh.triangles, WIDTH, HEIGHT)
    sure = doubt > NEAR_EDGE
    assert (frame.triangle_ids[sure] == ids[sure]).all()
    assert (frame.triangle_ids[sure] != draw(scene, matrix, pipeline, **options).triangle_ids[sure]).any()


@pytest.mark.parametrize("name", ["Duck_fit", "CesiumMilkTruck_near"])
def test_with_samples_at_corners_lists_and_pixels_are_the_originals_on_a_gpu(shared, name):
    given, gpu = (np.load(shared / f"silicon/textured/{part}/ru_{name}.npz") for part in ("inputs", "measured/ids"))
    corners = np.column_stack([given["positions"], np.ones(len(given["positions"]), np.float32)])
    made = Scene(name, mesh=Mesh(corners, given["triangles"].astype(np.int32)))
    frame = tiled(made, given["matrix"], 800, 800, SIMT, pipeline_options("tiled", {"samples": "corners"}), Executor())
    assert (frame.maps["list length"][::-1].ravel() == gpu["t8c_cnt"].ravel()).all()
    assert np.count_nonzero(frame.triangle_ids[::-1].ravel() != gpu["t8c_id"].ravel()) <= 1  # equal depths


@pytest.mark.parametrize("name", ["Duck_fit", "CesiumMilkTruck_near"])
def test_per_primitive_tests_as_many_pixels_as_the_original_does(shared, name):
    """The near view has triangles beside the screen: they walk its border."""
    given = np.load(shared / f"silicon/textured/inputs/ru_{name}.npz")
    corners = np.column_stack([given["positions"], np.ones(len(given["positions"]), np.float32)])
    made = Scene(name, mesh=Mesh(corners, given["triangles"].astype(np.int32)))
    options = pipeline_options("per-primitive", {"samples": "corners"})
    counts = work(
        per_primitive(made, given["matrix"], 800, 800, SIMT, options, Executor()), "per_primitive_raster"
    ).counts()
    counted = (shared / f"silicon/textured/source_on_cpu/ru_{name}.csv").read_text().splitlines()
    for event in ("sample_tests", "sample_hits"):
        assert f"per_primitive_cull,_rasterize,{event},{counts[event.upper()]}" in counted


def test_attributes_are_perspective_correct_within_1e_5(scene, matrix):
    mesh = geometry(scene)
    vertices, _, _ = vertex_shading(mesh, matrix, WIDTH, HEIGHT, SIMT)
    frame = draw(scene, matrix)
    fragments = interpolate(mesh, vertices, Visible(frame.triangle_ids, frame.depth))
    screen = naive.project(scene.mesh.positions, matrix, WIDTH, HEIGHT)
    for y, x in np.argwhere(frame.triangle_ids >= 0)[::17]:
        t = mesh.triangles[frame.triangle_ids[y, x]]
        exact = naive.perspective(screen[t], mesh.uvs[t], x + 0.5, y + 0.5)
        area = np.linalg.det(np.concatenate([screen[t][:, :2], np.ones((3, 1))], axis=1))
        assert fragments.uvs[y, x] == pytest.approx(exact, abs=1e-5 * max(1.0, 200.0 / abs(area)))


def test_without_perspective_correction_the_picture_differs(scene, matrix):
    assert (draw(scene, matrix).image != draw(scene, matrix, perspective=False).image).any()


@pytest.mark.parametrize("tile", [4, 5, 16, 32])
def test_the_picture_does_not_depend_on_the_tile(scene, matrix, tile):
    assert (draw(scene, matrix, tile=tile).image == draw(scene, matrix).image).all()


def test_tiles_and_primitives_agree_without_the_race(scene, matrix):
    tiles, primitives = (
        draw(scene, matrix, cull_backfaces=False),
        draw(scene, matrix, per_primitive, race=False, cull_backfaces=False),
    )
    assert (tiles.triangle_ids != primitives.triangle_ids).mean() < 0.002  # equal integer depths


def test_a_tile_list_holds_every_triangle_that_covers_a_pixel_of_it(scene, matrix):
    frame = draw(scene, matrix, tile=8)
    lengths = frame.maps["list length"]
    assert (frame.maps["tests"] == 64 * lengths).all()
    for y, x in np.argwhere(frame.triangle_ids >= 0):
        assert lengths[y // 8, x // 8] > 0


def test_the_separating_axis_test_rejects_a_corner_of_the_box():
    corners = [np.float32(v) for v in (0, 0, 30, 0, 0, 30)]
    assert overlaps(*corners, *map(np.float32, (8, 8, 4)))
    assert not overlaps(*corners, *map(np.float32, (24, 24, 4)))


def test_a_triangle_and_tile_take_one_atomic(scene, matrix):
    frame = draw(scene, matrix)
    counts = work(frame, "tile_lists").counts()
    assert counts["ATOMIC_LANES"] == counts["APPEND_LANES"] == frame.facts["list entries"]


def test_every_thread_tests_every_entry(scene, matrix):
    frame = draw(scene, matrix, tile=8)
    assert work(frame, "tiled_raster").counts()["SAMPLE_TESTS"] == 64 * frame.facts["list entries"]


def test_the_originals_room_overflows_and_says_so():
    scene = soup(seed=1, count=110)
    matrix = LookAt((0, 0, 40), (0, 0, 0), fov_degrees=45).matrix(WIDTH, HEIGHT)
    assert draw(scene, matrix, capacity="original", cull_backfaces=False).facts["list entries lost by overflow"] > 0
    assert draw(scene, matrix, capacity="safe", cull_backfaces=False).facts["list entries lost by overflow"] == 0


def test_what_is_lost_or_wrong_is_said(matrix):
    far = LookAt((0, 0, 40), (0, 0, 0), fov_degrees=45).matrix(WIDTH, HEIGHT)
    lossy = draw(soup(seed=1, count=110), far, capacity="original", cull_backfaces=False)
    assert any("no room" in sentence for sentence in lossy.warnings)
    assert any("not the nearest" in sentence for sentence in draw(soup(count=400), matrix, per_primitive).warnings)
    assert draw(soup(count=1), matrix).warnings == ()


def test_both_ways_cull_backfaces_as_both_published_versions(scene, matrix):
    for pipeline, options in ((tiled, {}), (per_primitive, {"race": False})):
        default, culled = (draw(scene, matrix, pipeline, **options, **cull) for cull in ({}, {"cull_backfaces": True}))
        assert (default.triangle_ids == culled.triangle_ids).all()
        assert (
            default.triangle_ids != draw(scene, matrix, pipeline, cull_backfaces=False, **options).triangle_ids
        ).any()


def test_one_triangle_cannot_race(matrix):
    frame = draw(soup(count=1), matrix, per_primitive)
    assert frame.facts["pixels wrong by the race"] == 0


def test_a_warp_walks_the_widest_box_of_each_row_of_tiles(matrix):
    """Lanes of a warp meet after each row: two boxes of 1x4 and 4x1 tiles take 4 + 1 + 1 + 1 steps, not 4."""
    corners = [(0, 0), (6, 0), (0, 30), (0, 0), (30, 0), (0, 6)]
    screen = np.array([[x + 1, y + 1, 0.5, 1.0] for x, y in corners], np.float32)
    lists = tile_lists(
        screen, np.arange(6, dtype=np.int32).reshape(2, 3), np.arange(2, dtype=np.int32), WIDTH, HEIGHT, SIMT,
        tile=8, culling=False, capacity="safe",
    )  # fmt: skip
    assert lists.works[-1].counts()["BOX_STEPS"] == 4 + 1 + 1 + 1


def test_each_part_of_a_model_is_transformed_and_assembled_by_itself(scene, matrix):
    parts = np.array([[60, 20], [30, 10], [30, 10]])
    drawn = draw(Scene("parts", mesh=replace(scene.mesh, draws=parts)), matrix)
    grids = [w.total(w.events.WARP_LANES) for w in drawn.works if w.stage == "primitive_assembly"]
    assert grids == [60, 30, 30]
    assert drawn.facts["launches that the host waits for"] == 2 * 3 + 3
    assert (drawn.image == draw(scene, matrix).image).all()


def test_triangles_that_are_not_finite_are_missing_from_their_part(scene):
    points = scene.mesh.positions.copy()
    points[0, 0] = np.nan
    whole = Scene("parts", mesh=replace(scene.mesh, positions=points, draws=np.array([[60, 20], [60, 20]])))
    assert draws(whole, geometry(whole)).tolist() == [[60, 19], [60, 20]]


def test_the_longest_warp_of_a_tile_hits_as_often_as_all_where_it_is_alone(scene, matrix):
    counts = work(draw(scene, matrix, tile=4), "tiled_raster").counts()
    assert counts["LONGEST_HITS"] == counts["HIT_WARPS"]
    assert counts["LONGEST_NEARER"] == counts["NEARER_WARPS"]


def test_four_pixel_tiles_are_slower_than_eight_for_want_of_warps():
    """Published: 33.3 and 27.2 ms. Both hold 16 lists on an SM; 4x4 has more of them."""
    rng = np.random.default_rng(5)
    dense = soup(count=1)
    points = rng.uniform(-1.5, 1.5, (4000, 1, 3)) + rng.uniform(-0.08, 0.08, (4000, 3, 3))
    positions = np.concatenate([points.reshape(-1, 3), np.ones((12000, 1))], axis=1).astype(np.float32)
    mesh = Mesh(positions, np.arange(12000, dtype=np.int32).reshape(-1, 3))
    times = [
        simulate(replace(dense, mesh=mesh), "tiled", "gt750m", width=320, height=320, camera=CAMERA, tile=tile)
        .stages.loc["tiled_raster"].milliseconds
        for tile in (4, 8)
    ]  # fmt: skip
    assert times[0] > times[1]


def test_a_texture_costs_the_shading_kernel_only_where_it_shows(scene, matrix):
    plain = Scene("plain", mesh=replace(scene.mesh, texture_ids=None, textures=()))
    shaded = [work(draw(s, matrix), "fragment_shading_bilinear") for s in (scene, plain)]
    assert [w.total(w.events.TEXTURED_LANES) > 0 for w in shaded] == [True, False]
    assert shaded[0].total(shaded[0].events.DRAWN_LANES) == shaded[1].total(shaded[1].events.DRAWN_LANES)


def test_overlapping_triangles_race():
    frame = draw(soup(count=400), CAMERA.matrix(WIDTH, HEIGHT), per_primitive)
    assert 0 < frame.facts["pixels wrong by the race"] < frame.facts["pixels drawn"]


def test_the_race_spoils_the_fragment_but_not_the_depth():
    scene, matrix = soup(count=400), CAMERA.matrix(WIDTH, HEIGHT)
    raced, meant = draw(scene, matrix, per_primitive), draw(scene, matrix, per_primitive, race=False)
    wrong = raced.maps["pixels wrong by the race"].astype(bool)
    assert (raced.depth == meant.depth).all()
    assert ((raced.triangle_ids != meant.triangle_ids) == wrong).all()


def test_a_triangle_behind_the_eye_is_dropped_and_counted(matrix):
    scene = soup(count=2)
    points = scene.mesh.positions.copy()
    points[0, 2] = 10.0
    frame = draw(Scene("behind", mesh=replace(scene.mesh, positions=points)), matrix)
    assert frame.facts["triangles not drawn (behind the eye, or not finite)"] == 1


def test_a_degenerate_triangle_draws_nothing(matrix):
    scene = soup(count=1)
    points = np.repeat(scene.mesh.positions[:1], 3, axis=0)
    frame = draw(Scene("point", mesh=replace(scene.mesh, positions=points)), matrix, cull_backfaces=False)
    assert (frame.triangle_ids == -1).all()


@pytest.mark.parametrize(("tile", "occupancy"), [(4, 0.25), (8, 0.5), (16, 0.5), (32, 0.5)])
def test_occupancy_is_the_published_one(tile, occupancy):
    assert residency(load_machine("gt750m"), tile * tile, 63, 0).occupancy == occupancy


@pytest.mark.parametrize(("name", "pipeline"), [("tiled", tiled), ("per-primitive", per_primitive)])
def test_every_kernel_has_a_price(scene, matrix, name, pipeline):
    mix = load_mix(name, "3.0")
    for w in draw(scene, matrix, pipeline, ssao=True).works:
        assert mix.launch(w, 32).events.sum() > 0


@pytest.mark.parametrize("ssao", [False, True])
def test_fragments_of_tiles_have_padding_unless_occlusion_fills_it(scene, matrix, ssao):
    """DRAM counters of an H200: his raster fetches 18.7 MB while it stores, the one with occlusion 0.5."""
    frame = draw(scene, matrix, tiled, ssao=ssao)
    (raster,) = (work for work in frame.works if work.kernel == "tiled_raster")
    assert [stream.gaps for stream in raster.streams if stream.op == "store"] == [not ssao]


@pytest.mark.parametrize("pipeline", [tiled, per_primitive])
def test_colors_are_cleared_once_and_right_before_shading(scene, matrix, pipeline):
    kernels = [work.kernel for work in draw(scene, matrix, pipeline).works]
    assert kernels.count("clear_colors") == 1
    assert kernels[kernels.index("clear_colors") + 1] == "fragment_shading_bilinear"
