"""Zhang's pipeline: coverage and depth in double precision, clipping, order, transparency, quads, texture traffic."""

from dataclasses import replace

import numpy as np
import pytest

from tests import naive_textured as naive
from tests.textured_soup import soup
from tilestamp import simulate
from tilestamp.models.errors import TilestampError
from tilestamp.models.machine import altered, load_machine
from tilestamp.models.price import price
from tilestamp.models.simt import Simt
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.mix import load_mix
from tilestamp.simulator.pipelines.binned import BinnedOptions, binned
from tilestamp.simulator.scenes.camera import LookAt
from tilestamp.simulator.scenes.scene import Mesh, Scene
from tilestamp.simulator.scenes.textured_mesh import geometry
from tilestamp.simulator.stages.thread_per_item import Access, thread_per_item
from tilestamp.simulator.stages.zhang2025.depth import DEPTH_STEPS
from tilestamp.simulator.stages.zhang2025.fine_tile import live_quads
from tilestamp.simulator.stages.zhang2025.pixel_shader_block import quad_coordinates
from tilestamp.simulator.stages.zhang2025.primitive_assembly import primitive_assembly
from tilestamp.simulator.stages.zhang2025.primitive_compaction import most_triangles, primitive_compaction
from tilestamp.simulator.stages.zhang2025.triangle_setup import triangle_setup
from tilestamp.simulator.stages.zhang2025.vertex_fetch_and_shading import vertex_fetch_and_shading

WIDTH, HEIGHT = 141, 131  # two bins each way, no multiples of a tile
SIMT = Simt()
CAMERA = LookAt((0, 0, 4), (0, 0, 0), fov_degrees=45)
NEAR_EDGE = 3e-4  # his edge functions lose bits in their constant


@pytest.fixture(scope="module")
def scene():
    return soup()


@pytest.fixture(scope="module")
def matrix():
    return CAMERA.matrix(WIDTH, HEIGHT)


def draw(scene, matrix, **options):
    return binned(scene, matrix, WIDTH, HEIGHT, SIMT, BinnedOptions(**options), Executor())


def work(frame, stage):
    return next(w for w in frame.works if w.stage == stage)


def opaque_colors(scene, seed=2):
    """Flat colours a triangle, no texture, no light."""
    count = len(scene.mesh.triangles)
    colors = np.repeat(np.random.default_rng(seed).uniform(0.1, 1, (count, 4)), 3, axis=0).astype(np.float32)
    normals = np.zeros((3 * count, 3), np.float32)
    return replace(scene, mesh=replace(scene.mesh, colors=colors, normals=normals, texture_ids=None, textures=()))


@pytest.mark.parametrize("culling", [True, False])
def test_coverage_and_depth_are_those_of_double_precision(scene, matrix, culling):
    frame = draw(scene, matrix, cull_backfaces=culling)
    screen = naive.project(scene.mesh.positions, matrix, WIDTH, HEIGHT)
    ids, depth, doubt = naive.draw(screen, scene.mesh.triangles, WIDTH, HEIGHT, culling=culling)
    sure = doubt > NEAR_EDGE
    assert sure.mean() > 0.9
    assert (frame.triangle_ids[sure] == ids[sure]).all()
    drawn = sure & (ids >= 0)
    assert frame.depth[drawn] == pytest.approx(depth[drawn], abs=1e-5)


def test_api_order_is_drawing_one_triangle_after_another(scene, matrix):
    scene = opaque_colors(scene)
    whole = draw(scene, matrix, fragments_a_pixel=0)
    image, nearest = np.zeros((HEIGHT, WIDTH, 3), np.uint8), np.full((HEIGHT, WIDTH), 2**25)
    for t in range(len(scene.mesh.triangles)):
        alone = draw(replace(scene, mesh=replace(scene.mesh, triangles=scene.mesh.triangles[t : t + 1])), matrix)
        z = np.rint(alone.depth.astype(np.float64) * float(DEPTH_STEPS)).astype(np.int64)
        wins = (alone.triangle_ids >= 0) & (z <= nearest)
        image[wins], nearest[wins] = alone.image[wins], z[wins]
    assert (whole.image == image).all()


def test_the_later_of_two_equal_triangles_is_seen(matrix):
    points = np.array([[-1, -1, 0, 1], [1, -1, 0, 1], [0, 1, 0, 1]] * 2, np.float32)
    scene = Scene("twice", mesh=Mesh(points, np.arange(6, dtype=np.int32).reshape(2, 3)))
    ids = draw(scene, matrix).triangle_ids
    assert set(np.unique(ids)) == {-1, 1}


def test_transparency_is_sorting_the_fragments_of_each_pixel(scene, matrix):
    scene = opaque_colors(scene)
    frame = draw(scene, matrix, order="oit", fragments_a_pixel=0)
    layers = []
    for t in range(len(scene.mesh.triangles)):
        alone = draw(replace(scene, mesh=replace(scene.mesh, triangles=scene.mesh.triangles[t : t + 1])), matrix)
        layers.append((alone.depth, alone.triangle_ids >= 0, scene.mesh.colors[3 * t]))
    for y, x in np.argwhere(frame.triangle_ids >= 0)[::29]:
        fragments = [(d[y, x], t, c) for t, (d, hit, c) in enumerate(layers) if hit[y, x]]
        assert frame.image[y, x] == pytest.approx(255.0 * naive.over(fragments), abs=1.01)


def test_fragments_beyond_the_kept_ones_are_counted(scene, matrix):
    every = draw(scene, matrix, order="oit", fragments_a_pixel=0, cull_backfaces=False)
    few = draw(scene, matrix, order="oit", fragments_a_pixel=2, cull_backfaces=False)
    assert every.facts["fragments lost beyond the kept ones"] == 0
    kept = work(few, "ROP").counts()
    assert kept["LOST"] + kept["BLEND_LANES"] == work(every, "ROP").counts()["BLEND_LANES"]
    assert kept["LOST"] > 0
    assert [any("illegal memory access" in said for said in each.warnings) for each in (few, every)] == [True, False]


def test_clipping_changes_nothing_inside(matrix):
    """A triangle that leaves the view on all sides covers every pixel, and its attributes stay exact."""
    corners = np.array([[-90, -90, 0, 1], [90, -90, 0, 1], [0, 120, 0, 1]], np.float32)
    frame = draw(Scene("wall", mesh=Mesh(corners, np.array([[0, 1, 2]], np.int32))), matrix)
    assert (frame.triangle_ids == 0).mean() > 0.999  # his planes can leave a hole on a seam of the fan
    assert work(frame, "PrimitiveAssembly").counts()["CLIPPED"] == 1


def test_a_triangle_through_the_eye_plane_is_clipped(matrix):
    corners = np.array([[-1, -1, 0, 1], [1, -1, 0, 1], [0, 0.5, 9, 1]], np.float32)
    frame = draw(Scene("ramp", mesh=Mesh(corners, np.array([[0, 1, 2]], np.int32))), matrix, cull_backfaces=False)
    assert (frame.triangle_ids == 0).any()


def test_with_the_originals_faults_the_rows_beyond_whole_blocks_and_one_fragment_are_missing(scene, matrix):
    """131 rows of pixels are 17 rows of tiles: 16 of them are launched, 128 rows of pixels from the bottom."""
    wall = np.array([[-9, -9, 0, 1], [9, -9, 0, 1], [0, 14, 0, 1]], np.float32)
    covered = Scene("wall", mesh=Mesh(wall, np.array([[0, 1, 2]], np.int32)))
    whole, lossy = (draw(covered, matrix, original_faults=faults).triangle_ids for faults in (False, True))
    missing = (whole >= 0) & (lossy < 0)
    assert (lossy[:3] < 0).all()
    assert missing[3:].sum() == 1
    assert missing[-1, 0]  # the first quad of the first tile


def test_fragment_0_is_lost_below_another_one_too(matrix):
    """Two walls by order-independent transparency: fragment 0 ends the list of the lower left pixel."""
    corners = [(x, y, z, 1) for z in (0, 1) for x, y in ((-9, -9), (9, -9), (0, 14))]
    mesh = Mesh(np.array(corners, np.float32), np.arange(6, dtype=np.int32).reshape(2, 3))
    whole, lossy = (
        draw(Scene("walls", mesh=mesh), matrix, order="oit", opacity=0.5, original_faults=faults).image[3:].astype(int)
        for faults in (False, True)
    )
    assert [tuple(place) for place in np.argwhere((whole != lossy).any(axis=2))] == [(HEIGHT - 4, 0)]
    assert (lossy[-1, 0] > 0).all()  # the other wall


def test_at_1080_the_top_24_rows_stay_empty_as_on_a_gpu(shared):
    name = "zh_bunny_5k_near.npz"
    given, gpu = (np.load(shared / f"silicon/textured/{part}/{name}") for part in ("inputs", "measured/ids"))
    made = Scene("bunny", mesh=Mesh(given["positions"], given["triangles"].astype(np.int32)))
    options = BinnedOptions(original_faults=True)
    ids = binned(made, given["matrix"], 1920, 1080, SIMT, options, Executor()).triangle_ids[::-1]
    assert np.flatnonzero((gpu["id"] >= 0).any(axis=1)).max() == 1055
    assert ((ids >= 0) != (gpu["id"] >= 0)).sum() < 20  # float32 edges: 15 of 612,751


def test_hi_z_rejects_nothing_visible(matrix):
    far = soup(seed=5, count=30).mesh
    wall = np.array([[-9, -9, 2, 1], [9, -9, 2, 1], [0, 12, 2, 1]], np.float32)
    mesh = Mesh(np.concatenate([wall, far.positions]), np.arange(93, dtype=np.int32).reshape(-1, 3))
    frame = draw(Scene("hidden", mesh=mesh), matrix)
    screen = naive.project(mesh.positions, matrix, WIDTH, HEIGHT)
    ids, _, doubt = naive.draw(screen, mesh.triangles, WIDTH, HEIGHT)
    assert (frame.triangle_ids == ids)[doubt > NEAR_EDGE].all()


def test_a_quad_is_live_if_one_pixel_is():
    assert live_quads(np.uint64(1) << np.uint64(63)) == 1 << 54
    assert live_quads(np.uint64(0x0101)) == 1


def test_every_covered_fragment_is_shaded_in_a_quad(scene, matrix):
    frame = draw(scene, matrix)
    counts = work(frame, "PixelShader").counts()
    assert counts["WARP_LANES"] == 4 * frame.facts["quads"] == counts["ATOMIC_LANES"]


@pytest.mark.parametrize("options", [{"texture_layout": "rows"}, {"optimized": False}])
def test_layout_and_optimization_change_no_pixel(scene, matrix, options):
    assert (draw(scene, matrix).image == draw(scene, matrix, **options).image).all()


def test_the_tiled_layout_moves_less_along_columns(matrix):
    """A texture seen turned by 90 degrees: rows of the screen run along its columns."""
    corners = np.array([[-2, -2, 0, 1], [2, -2, 0, 1], [2, 2, 0, 1], [-2, 2, 0, 1]], np.float32)
    uvs = np.array([[0, 0], [0, 1], [1, 1], [1, 0]], np.float32)
    texture = np.full((256, 256, 4), 200, np.uint8)
    triangles = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    mesh = Mesh(corners, triangles, uvs=uvs, texture_ids=np.zeros(2, np.int32), textures=(texture,))
    moved = [
        work(draw(Scene("turned", mesh=mesh), matrix, texture_layout=layout), "PixelShader").counts()["TEXTURE_BYTES"]
        for layout in ("tiled", "rows")
    ]
    assert moved[0] < moved[1]


def test_compaction_keeps_what_assembly_did_not_cull(scene, matrix):
    frame = draw(scene, matrix)
    assert work(frame, "PrimitiveCompaction").counts()["KEPT"] == frame.facts["primitives after culling"]


def test_the_machine_limits_the_cooperative_launch():
    machine = load_machine("ga104")
    assert most_triangles(machine) == 48 * 6 * 256 // 4  # six blocks of 256 threads and 40 registers an SM


def test_a_picture_beyond_the_bins_is_refused(scene):
    with pytest.raises(TilestampError, match="2048"):
        binned(scene, CAMERA.matrix(2100, 100), 2100, 100, SIMT, BinnedOptions(), Executor())


@pytest.mark.parametrize("optimized", [True, False])
def test_every_kernel_has_a_price(scene, matrix, optimized):
    mix = load_mix("binned", "8.6")
    for w in draw(scene, matrix, optimized=optimized).works:
        assert mix.launch(w, 32).events.sum() > 0


def test_blocks_without_a_primitive_run_the_ballots_too(scene, matrix):
    """The original launches blocks for at least 2,048 compacted primitives, not knowing how many there are."""
    frame = draw(scene, matrix)
    assert work(frame, "TriangleSetup").grid == work(frame, "PrimitiveBinning").grid == 8
    assert work(frame, "PrimitiveBinning").counts()["WARPS"] == 8 * 8
    assert work(frame, "TriangleSetup").counts()["WARPS"] < 8 * 8


def test_a_block_of_the_fine_rasterizer_waits_for_its_slowest_tile(scene, matrix):
    counts = work(draw(scene, matrix), "FineRasterizer").counts()
    assert counts["EARLY_Z_STEPS"] / 4 <= counts["CRITICAL_Z_STEPS"] <= counts["EARLY_Z_STEPS"]


@pytest.mark.parametrize("tile", [2, 8])
def test_the_size_of_a_storage_tile_changes_no_pixel(scene, matrix, tile):
    assert (draw(scene, matrix).image == draw(scene, matrix, texture_tile=tile).image).all()


def test_depth_stepped_within_a_quad_leaves_holes_and_a_bias_cures_them(scene, matrix):
    """One-pixel holes, as in the original: the ROP's depth is a unit beyond the one that early z stored."""
    direct, stepped, biased = (draw(scene, matrix, fragment_depth=way) for way in ("direct", "stepped", "biased"))
    lost = (direct.triangle_ids >= 0) & (stepped.triangle_ids < 0)
    assert stepped.facts["holes"] == lost.sum() > 0
    assert direct.facts["holes"] == biased.facts["holes"] == 0
    assert (biased.image == direct.image).all()


def test_stores_that_scatter_leave_an_sm_at_their_own_rate():
    """Words 140 bytes apart take a sector a lane, and half a sector leaves an SM in a clock."""
    machine = load_machine("ga104")
    setup = thread_per_item("TriangleSetup", "TriangleSetup", 2304, 256, SIMT, stores=(Access("setup", 140, 35),))
    launch = load_mix("binned", "8.6").launch(setup, 32)
    gathered = altered(
        machine, {"memory.l1_write_bytes_per_clock": 0.0, "memory.l1_line_cycles": 0.0}, "assumed", "a test"
    )
    assert price([launch], machine)[0].cycles > 2.0 * price([launch], gathered)[0].cycles


def test_coordinates_of_a_quad_are_perspective_correct_within_1e_5(scene, matrix):
    """Planes of 1/w and of coordinates over w, against the division at each pixel in double precision."""
    mesh = geometry(scene)
    vertices, _, _ = vertex_fetch_and_shading(mesh, matrix, SIMT)
    slots, _, _ = primitive_assembly(mesh, vertices, WIDTH, HEIGHT, SIMT)
    primitives, _, _ = primitive_compaction(slots, len(mesh.triangles), SIMT)
    data, _, _ = triangle_setup(primitives, SIMT)
    screen = naive.project(scene.mesh.positions, matrix, WIDTH, HEIGHT) * (1, -1, 1, 1) + (0, HEIGHT, 0, 0)
    uv = np.zeros((4, 2), np.float32)
    whole = np.flatnonzero(np.bincount(data.ids, minlength=len(mesh.triangles)) == 1)  # not clipped
    assert len(whole) > 10
    for p in np.flatnonzero(np.isin(data.ids, whole)):
        t = mesh.triangles[data.ids[p]]
        x, y = (int(v) // 2 * 2 for v in screen[t][:, :2].mean(axis=0))
        quad_coordinates(data.planes[p], np.array([x, y], np.int32), uv)
        area = np.linalg.det(np.concatenate([screen[t][:, :2], np.ones((3, 1))], axis=1))
        for k in range(4):
            exact = naive.perspective(screen[t], mesh.uvs[t], x + k % 2 + 0.5, y + k // 2 + 0.5)
            assert uv[k] == pytest.approx(exact, abs=1e-5 * max(1.0, 1000.0 / abs(area)))


def test_an_image_of_one_bin_keeps_its_pixels():
    """The cursors of tile queues once were a view of their starts, and moved them."""
    small = simulate("teapot", "binned", "ga104", width=96, height=72)
    other = simulate("teapot", "cudaraster", "ga104", width=96, height=72)
    drawn, expected = (small.triangle_ids >= 0).sum(), (other.triangle_ids >= 0).sum()
    assert abs(int(drawn) - int(expected)) < 0.05 * expected
