"""The cudaraster pipeline: picture, counters, memory, batches, and what it refuses."""

import csv

import numpy as np
import pytest

from tests import naive_cudaraster as naive
from tilestamp.models.errors import TilestampError
from tilestamp.models.simt import Simt
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.pipelines import cudaraster as module
from tilestamp.simulator.pipelines.cudaraster import CudarasterOptions, cudaraster
from tilestamp.simulator.scenes.scene import Mesh, Scene
from tilestamp.simulator.stages.laine2011.fine_raster_queue import FineRasterEvent

EYE = np.eye(4)
STAGES = ["triangle_setup", "bin_raster", "coarse_raster", "fine_raster"]


def scene(positions, triangles, **more):
    mesh = Mesh(np.asarray(positions, np.float32), np.asarray(triangles, np.int32), clip_space=True, **more)
    return Scene("test", mesh=mesh)


def soup(seed=1, count=60):
    rng = np.random.default_rng(seed)
    positions = rng.uniform(-1, 1, (3 * count, 4)) * [1, 1, 0.9, 0] + [0, 0, 0, 1]
    colors = rng.uniform(0, 1, (3 * count, 4)).astype(np.float32)
    return scene(positions, np.arange(3 * count).reshape(-1, 3), colors=colors)


def draw(what, size=(40, 30), counting=True, **options):
    return cudaraster(what, EYE, *size, Simt(), CudarasterOptions(**options), Executor(counting=counting))


def test_row_0_is_the_top_and_background_is_minus_1():
    frame = draw(scene([[-1, 0, 0, 1], [1, 0, 0, 1], [1, 3, 0, 1]], [[0, 1, 2]]))
    assert frame.triangle_ids.shape == (30, 40)
    assert frame.triangle_ids[0, 39] == 0
    assert frame.triangle_ids[29, 39] == -1
    assert frame.image[0, 39].max() > 0
    assert frame.image[29, 39].max() == 0
    assert frame.depth.dtype == np.uint32


@pytest.mark.parametrize("release", ["1.1", "nvdiffrast"])
def test_the_picture_is_the_plain_minimum(release):
    what = soup(count=12)
    frame = draw(what, (24, 20), release=release)
    ids, _ = naive.draw(what.mesh.positions, what.mesh.triangles, 24, 20, release=release)
    for j in range(20):
        for i in range(24):
            assert frame.triangle_ids[19 - j, i] == ids.get((0, j, i), -1)


def test_four_launches_bear_the_names_of_the_stages():
    assert [work.stage for work in draw(soup()).works] == STAGES


def test_model_space_goes_through_the_matrix():
    matrix = np.array([[0.5, 0, 0, 0.1], [0, 0.5, 0, 0], [0, 0, 0.5, 0], [0, 0, 0, 1.0]])
    positions = np.array([[-1, -1, 0, 1], [1, -1, 0.5, 1], [0, 1, 0, 1]], np.float32)
    model = Scene("model", mesh=Mesh(positions, np.array([[0, 1, 2]], np.int32)))
    frame = cudaraster(model, matrix, 40, 30, Simt(), CudarasterOptions(), Executor())
    straight = draw(scene(positions @ matrix.T, [[0, 1, 2]]))
    assert np.array_equal(frame.triangle_ids, straight.triangle_ids)
    assert np.array_equal(frame.depth, straight.depth)


@pytest.mark.parametrize("mode", ["depth", "blend", "color"])
@pytest.mark.parametrize("msaa", [1, 4])
@pytest.mark.parametrize("batches", [2, 7])
def test_batches_give_the_picture_of_one_draw(mode, msaa, batches):
    one, many = draw(soup(), mode=mode, msaa=msaa), draw(soup(), mode=mode, msaa=msaa, batches=batches)
    assert np.array_equal(one.image, many.image)
    assert np.array_equal(one.triangle_ids, many.triangle_ids)
    assert len(many.works) == 4 * batches


def test_more_batches_than_triangles_still_draw():
    frame = draw(soup(count=3), batches=5)
    assert np.array_equal(frame.triangle_ids, draw(soup(count=3)).triangle_ids)


def test_later_batches_visit_only_tiles_with_triangles():
    works = draw(soup(count=6), (200, 200), batches=6).works
    fine = [work for work in works if work.stage == "fine_raster"]
    assert len(fine[0].table) == 25 * 25
    assert 0 < len(fine[-1].table) < 25 * 25
    assert fine[0].total(FineRasterEvent.TILE_LOADS) == 0
    assert fine[-1].total(FineRasterEvent.TILE_LOADS) == len(fine[-1].table)


def test_samples_smooth_edges():
    what = scene([[-1, -1, 0, 1], [1, -1, 0, 1], [1, 0.9, 0, 1]], [[0, 1, 2]], colors=np.ones((3, 4), np.float32))
    assert set(np.unique(draw(what).image)) == {0, 255}
    assert len(np.unique(draw(what, msaa=8).image)) > 4


def test_a_buffer_that_is_too_small_grows_and_the_frame_is_drawn_again(monkeypatch):
    monkeypatch.setattr(module.bins, "initial_capacity", lambda *_: 1)
    monkeypatch.setattr(module.tiles, "initial_capacity", lambda *_: 1)
    small = draw(soup(), (300, 300), first_frame=True)
    monkeypatch.undo()
    assert small.facts["retries"] == 2
    plain = draw(soup(), (300, 300))
    assert plain.facts["retries"] == 0
    assert np.array_equal(small.triangle_ids, plain.triangle_ids)
    assert small.facts["counters"] == plain.facts["counters"]


def test_a_first_frame_executes_the_stages_of_attempts_that_fail(monkeypatch):
    monkeypatch.setattr(module.bins, "initial_capacity", lambda *_: 1)
    monkeypatch.setattr(module.tiles, "initial_capacity", lambda *_: 1)
    later = draw(soup(), (300, 300))
    assert [work.stage for work in later.works] == [*STAGES]
    assert later.facts["retries"] == 2
    works = draw(soup(), (300, 300), first_frame=True).works
    assert [work.stage for work in works] == [*STAGES[:2], *STAGES[:3], *STAGES]
    for stage in STAGES:
        tables = [work.table for work in works if work.stage == stage]
        assert all(np.array_equal(table, tables[0]) for table in tables)


def test_counting_off_changes_no_picture():
    counted, plain = draw(soup()), draw(soup(), counting=False)
    assert np.array_equal(counted.image, plain.image)
    assert plain.facts["counters"] == {}


def test_memory_is_that_of_the_published_formulas():
    facts = draw(soup()).facts
    assert facts["memory_mb"]["setup data"] == facts["numSubtris"] * 81 / 2**20
    assert facts["memory_mb"]["bin queues"] == facts["numBinSegs"] * 2056 / 2**20
    assert facts["memory_mb"]["tile queues"] == facts["numTileSegs"] * 136 / 2**20


def test_heat_maps_have_a_cell_a_tile_with_the_top_row_first():
    frame = draw(scene([[-1, 0.5, 0, 1], [1, 0.5, 0, 1], [1, 3, 0, 1]], [[0, 1, 2]]), (64, 64))
    assert frame.maps["tile_triangles"].shape == (8, 8)
    assert frame.maps["tile_fragments"].sum() == (frame.triangle_ids >= 0).sum()
    assert frame.maps["tile_fragments"][4:].sum() == 0


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"release": "nvdiffrast", "mode": "blend"}, "nvdiffrast has mode depth"),
        ({"release": "nvdiffrast", "msaa": 4}, "msaa 1"),
        ({"copy_parameters": True}, "release 1.1 does not copy them"),
        ({"size": (4096, 100)}, "4096x100"),
    ],
)
def test_what_cannot_be_drawn_is_refused_in_a_sentence(options, sentence):
    with pytest.raises(TilestampError, match=sentence):
        draw(soup(), **options)


def test_a_scene_without_triangles_is_refused():
    with pytest.raises(TilestampError, match="no triangles"):
        draw(scene(np.zeros((3, 4)), np.zeros((0, 3))))


@pytest.mark.shared
def test_every_counter_of_the_authors_profiler_is_reported_under_its_name(shared):
    with (shared / "published" / "laine2011" / "gtx480-cuda40.csv").open() as file:
        rows = csv.DictReader(file)
        names = {row["key"] for row in rows if row["table"] == "table3" and row["column"].startswith("counters")}
    facts = draw(soup()).facts
    assert set(facts["counters"]) == names
    assert len(names) == 33


FINE = [  # section 9.2: early-z kills, empty masks, fragments, rounds, z kills, rounds with survivors
    ("bunny", "1.1", (522, 24565, 252021, 8158, 3207, 8045)),
    ("bunny", "nvdiffrast", (15733, 46189, 457742, 15217, 176668, 10059)),
    ("nearclip5k", "nvdiffrast", (0, 1132, 861318, 30340, 167699, 25468)),
]


@pytest.mark.shared
@pytest.mark.parametrize(("name", "release", "wanted"), FINE)
def test_published_totals_of_fine_raster(shared, name, release, wanted):
    with np.load(shared / "silicon" / "ids" / f"{name}_input.npz") as data:
        frame = draw(scene(data["positions"], data["triangles"]), (1024, 768), release=release)
    E = FineRasterEvent
    events = (E.EARLY_Z_KILLS, E.EMPTY_MASKS, E.FRAGMENT_LANES, E.FRAGMENT_ROUNDS, E.Z_KILLS, E.SHADE_ROUNDS)
    assert tuple(frame.works[3].total(e) for e in events) == wanted
    if release == "1.1":
        assert frame.works[3].total(E.BLEND_ROUND_LANES) == 253129
