"""Redundant shading: larger grids, shared vertices, shading after visibility; counted, and the same picture."""

import numpy as np
import pytest

from tests import naive_patches
from tests.naive_tiles import naive_raster
from tests.test_dice import SIZE, VIEW, flat, squares
from tests.test_tile_raster import HEIGHT, WIDTH, drawn, some_grids
from tilestamp.experiments.exploration import redundant_shading
from tilestamp.models.errors import TilestampError
from tilestamp.models.machine import load_machine
from tilestamp.simulator.pipelines.micropolygon import MicropolygonOptions
from tilestamp.simulator.scenes.scene import Patches, Scene
from tilestamp.simulator.simulation import simulate
from tilestamp.simulator.stages.eisenacher2010.dice import dice
from tilestamp.simulator.stages.eisenacher2010.dice_counts import DiceEvent, dice_work
from tilestamp.simulator.stages.eisenacher2010.larger_grids import GRID_SIDES
from tilestamp.simulator.stages.eisenacher2010.link_grids import NEIGHBOURS, LinkEvent, link_grids
from tilestamp.simulator.stages.eisenacher2010.shade_visible import PixelEvent, pixel_work
from tilestamp.simulator.stages.eisenacher2010.shared_vertices import SharedVertexEvent, dice_shared, own_vertices
from tilestamp.simulator.stages.eisenacher2010.tile_raster_events import TileRasterEvent
from tilestamp.simulator.stages.eisenacher2010.tile_raster_samples import BACKGROUND as BACKGROUND_ID

H200, GTX280 = load_machine("h200").simt, load_machine("gtx280").simt
TREE = squares(  # of two urPatches, of two sizes
    (0, 2, 0, 0), (0, 2, 1, 0), (0, 2, 0, 1), (0, 2, 1, 1), (0, 1, 1, 0), (0, 1, 0, 1), (0, 1, 1, 1),
    (1, 1, 0, 0), (1, 1, 1, 1),
)  # fmt: skip


def teapot(machine="h200", **options):
    return simulate("teapot", machine=machine, width=160, height=120, **options)


def two_patches():
    return np.concatenate([flat(), flat(height=0.2)])


@pytest.mark.parametrize("side", GRID_SIDES)
def test_vertices_of_a_larger_grid_are_those_of_a_slow_evaluation(side):
    points = flat()
    points[..., 2] += np.random.default_rng(3).uniform(-0.3, 0.3, (1, 16)).astype(np.float32)
    entries, matrix = [(0, 0, 0, 0), (0, 3, 5, 2)], VIEW.matrix(*SIZE)
    grids = dice(points, squares(*entries), matrix, *SIZE, H200, side=side).outputs
    slow = [naive_patches.grid(points[p], level, i, j, matrix, *SIZE, side) for p, level, i, j in entries]
    assert np.abs(grids.vertices[..., :3] - np.array(slow)).max() < 1e-3
    assert (grids.boxes[:, 2:] == grids.vertices[..., :2].max(axis=1)).all()


@pytest.mark.parametrize("side", GRID_SIDES)
def test_neighbours_of_larger_grids_have_the_same_vertices_along_their_edge(side):
    whole = dice(flat(), squares((0, 1, 0, 0), (0, 1, 1, 0)), VIEW.matrix(*SIZE), *SIZE, H200, side=side).outputs
    left, right = whole.vertices.reshape(2, side, side, 4)
    assert left[:, -1].tobytes() == right[:, 0].tobytes()


@pytest.mark.parametrize("side", [5, 7, 13])
@pytest.mark.parametrize(("tile", "spp"), [(4, 1), (8, 4)])
def test_the_raster_of_larger_grids_is_that_of_every_thread_run_by_itself(side, tile, spp):
    random = np.random.default_rng(5)
    place = np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1).reshape(-1, 2) / (side - 1)
    vertices = np.zeros((4, side**2, 4), np.float32)
    vertices[..., :2] = (
        random.uniform([-3, -3], [WIDTH, HEIGHT], (4, 1, 2)) + 9 * place + random.uniform(0, 0.3, (4, side**2, 2))
    )
    vertices[..., 2] = random.uniform(0.1, 0.9, (4, side**2))
    vertices.view(np.uint32)[..., 3] = random.integers(0, 2**24, (4, side**2)) | 0xFF000000
    image, depth, _, works, tiles, lists = drawn(vertices, tile, spp=spp, bound=12)
    slow = naive_raster(vertices, lists, tile, tiles.columns, WIDTH, HEIGHT, round(spp**0.5), 32, True, side)
    assert np.array_equal(image, slow[0])
    assert np.array_equal(depth, slow[1])
    for name in slow[2][0]:
        assert works[0].table[:, TileRasterEvent[name]].tolist() == [event[name] for event in slow[2]], name


@pytest.mark.parametrize(("side", "grids", "together"), [(5, 10, 2), (7, 5, 1), (13, 1, 1)])
def test_a_block_holds_as_many_grids_as_it_has_threads_for(side, grids, together):
    work = dice_work(np.zeros(23, np.int32), 1, False, H200, side)
    assert work.table[0, DiceEvent.PATCHES] == grids
    assert work.total(DiceEvent.VERTEX_LANES) == 23 * side**2
    raster = teapot(grid=side, bound=8.0).frame.works[-1]
    vertex_bytes = next(stream.bytes for stream in raster.streams if stream.buffer == "grids")
    lists = simulate("teapot", machine="h200", width=160, height=120, grid=side, bound=8.0).frame.facts[
        "patches_written"
    ]
    assert vertex_bytes >= lists * side**2 * 16
    assert raster.shared_bytes == together * side**2 * 16 + 4


@pytest.mark.parametrize("machine", ["gtx280", "h200"])
@pytest.mark.parametrize("options", [{}, {"grid": 7, "bound": 8.0}, {"tile": 16, "bound": 8.0}])
@pytest.mark.parametrize("shading", ["shared", "visible"])
def test_the_picture_is_that_of_grids_shaded_by_themselves(shading, options, machine):
    plain, other = teapot(machine, **options), teapot(machine, shading=shading, **options)
    assert np.array_equal(plain.image, other.image)
    assert np.array_equal(plain.depth, other.depth)
    assert other.frame.facts["shaded_vertices"] < 0.9 * plain.frame.facts["shaded_vertices"]


def test_shading_late_draws_a_texture_and_counts_without_a_picture():
    texture = np.random.default_rng(1).integers(0, 256, (8, 8, 3), dtype=np.uint8)
    assert np.array_equal(teapot(texture=texture).image, teapot(texture=texture, shading="visible").image)
    drawn, counted = teapot(shading="visible"), teapot(shading="visible", picture=False)
    assert drawn.counts == counted.counts


def test_grids_that_no_pixel_sees_are_not_shaded():
    near, far = flat(height=0.5), flat()
    far[..., 2] -= 0.5
    hidden = Scene("two squares", Patches(np.concatenate([far, near])))
    top = np.diag([2.0, 2.0, -0.5, 1.0])  # the larger height in front
    run = {"machine": "h200", "width": 64, "height": 64, "camera": top, "shading": "visible"}
    both, one = simulate(hidden, **run), simulate(Scene("one square", Patches(near)), **run)
    assert both.frame.facts["shaded_vertices"] == one.frame.facts["shaded_vertices"] > 0
    assert both.frame.facts["subpatches"] == 2 * one.frame.facts["subpatches"]


def naive_links(subpatches):
    """Neighbours by a dictionary."""
    entries = list(zip(*(array.tolist() for array in subpatches[:4]), strict=True))
    found = {entry: n for n, entry in enumerate(entries)}
    return [[found.get((p, level, i - u, j - v), -1) for u, v in NEIGHBOURS] for p, level, i, j in entries]


@pytest.mark.parametrize("simt", [H200, GTX280])
def test_neighbours_are_those_that_a_dictionary_finds(simt):
    links, works, _ = link_grids(TREE, simt)
    assert links.before.tolist() == naive_links(TREE)
    back = [(int(n), m) for m, row in enumerate(links.before) for n in row if n >= 0]
    assert sorted(back) == sorted((n, int(m)) for n, row in enumerate(links.after) for m in row if m >= 0)
    assert works[1].total(LinkEvent.LINKS) == len(back)
    assert works[0].total(LinkEvent.PROBES) >= len(TREE.patch)


def test_a_table_half_empty_needs_few_probes():
    run = teapot(shading="shared")
    number = run.frame.facts["subpatches"]
    fill, find = (work for work in run.frame.works if work.stage == "link_grids")
    assert fill.total(LinkEvent.PROBES) < 1.5 * number  # linear probing, at most half full
    assert find.total(LinkEvent.PROBES) < 3 * 2.5 * number


@pytest.mark.parametrize("side", [4, 7])
def test_shared_vertices_are_the_same_bits_and_none_is_missing(side):
    links = link_grids(TREE, H200).outputs
    size = (VIEW.matrix(*SIZE), *SIZE, H200)
    shared, (work, _), facts = dice_shared(two_patches(), TREE, links, *size, side=side)
    alone = dice(two_patches(), TREE, *size, side=side).outputs
    assert shared.vertices.tobytes() == alone.vertices.tobytes()
    assert facts["shaded_vertices"] == work.total(SharedVertexEvent.VERTEX_LANES) == own_vertices(links, side).sum()
    copied = len(TREE.patch) * side**2 - facts["shaded_vertices"]
    assert work.total(SharedVertexEvent.COPY_LANES) >= copied  # a vertex on both edges comes from two neighbours


@pytest.mark.parametrize("level", [1, 3])
@pytest.mark.parametrize("side", [4, 5])
def test_of_one_size_no_vertex_is_shaded_twice(level, side):
    """The ratio of the paper, (side / (side - 1))**2, is 1 but for the outline."""
    n = 1 << level
    sheet = squares(*((0, level, i, j) for j in range(n) for i in range(n)))
    own = own_vertices(link_grids(sheet, H200).outputs, side)
    assert own.sum() == ((side - 1) * n + 1) ** 2


@pytest.mark.parametrize(("way", "ratio"), [(0, 16 / 9), (1, 25 / 16), (2, 49 / 36), (3, 169 / 144)])
def test_the_published_ratios_are_exact(way, ratio):
    run = teapot(**redundant_shading.WAYS[way].options)
    assert run.counts["dice.VERTEX_LANES"] / redundant_shading.diced_quads(run) == ratio


def test_a_dearer_shader_makes_shading_less_pay_sooner_or_later():
    plain, visible = teapot(), teapot(shading="visible")
    gains = [redundant_shading.with_shader(plain, n) - redundant_shading.with_shader(visible, n) for n in (0, 1e4, 1e5)]
    assert gains == sorted(gains)
    assert gains[-1] > 0
    assert redundant_shading.with_shader(plain, 0) == pytest.approx(plain.milliseconds)


@pytest.mark.parametrize(
    "options",
    [{"grid": 7, "hybrid": True}, {"grid": 5, "edges": "loaded"}, {"shading": "shared", "snap_edges": True},
     {"shading": "visible", "spp": 4}],
)  # fmt: skip
def test_what_does_not_go_together_is_refused(options):
    with pytest.raises(TilestampError, match=r"^(grid|shading)"):
        MicropolygonOptions(**options)


def test_blending_loads_the_four_vertices_of_each_quad_and_marking_stores_a_word_a_grid():
    ids = drawn(some_grids(200), ids=True)[0]
    seen = ids != BACKGROUND_ID
    warps = np.split(ids.reshape(-1), range(32, ids.size, 32))
    for offsets, size, bytes_a_record in (([0, 1, 4, 5], 16, 1), ([0], 4, 16)):
        work = pixel_work("kernel", ids, 4, np.array(offsets), 200, H200)
        sectors = sum(
            len({(int(i) + o) // bytes_a_record * size // 32 for i in warp[warp != BACKGROUND_ID]})
            for warp in warps
            for o in offsets
        )
        pixels = sum(-(-len(warp) * 4 // 32) for warp in warps)
        own = (PixelEvent.LOAD_TRANSACTIONS, PixelEvent.STORE_TRANSACTIONS)
        assert sum(work.total(event) for event in own) == sectors + pixels * (2 if len(offsets) > 1 else 1)
        assert work.total(PixelEvent.SEEN_LANES) == seen.sum()
