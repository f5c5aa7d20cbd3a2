"""The experiments on sample test efficiency, on small inputs: they find what they say, and the pipelines run."""

import numpy as np
import pytest

from tilestamp.experiments.ste import algorithms, aspect, bit_mask, blur, closed_form, eisenacher, lockstep, readings
from tilestamp.experiments.ste.setting import cube, mean_area, random_polygons, student
from tilestamp.models.simt import Simt
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.pipelines import load_pipeline, options_type, pipeline_options
from tilestamp.simulator.scenes import load_scene, read_camera
from tilestamp.simulator.stages.fatahalian2009.micropolygons import Micropolygons


@pytest.mark.parametrize(
    ("shape", "area", "stamp", "touch", "percent"),
    [
        ("square", 1.0, 1, "polygon", 22.0),
        ("square", 1.0, 1, "box", 19.3),
        ("square", 2.0, 8, "box", 2.08),
        ("triangle", 10.0, 4, "box", 13.6),
        ("triangle", 0.25, 2, "polygon", 3.5),
    ],
)
def test_the_closed_form_is_the_stored_table(shape, area, stamp, touch, percent):
    assert 100 * closed_form.expected(shape, area, stamp, touch) == pytest.approx(percent, rel=0.02)


def test_measured_ste_agrees_with_the_closed_form(monkeypatch):
    monkeypatch.setattr(closed_form, "POLYGONS", 500)
    cells = closed_form._cells("triangle", 2.0)
    assert all(cell["inside_together"] for cell in cells)
    assert len(cells) == 8


@pytest.mark.parametrize(("probability", "quantile"), [(0.975, 2.0227), (0.9995, 3.5581)])
def test_students_quantiles_are_those_of_the_tables(probability, quantile):
    assert student(probability, 39) == pytest.approx(quantile, rel=1e-3)


@pytest.mark.parametrize("shape", ["square", "triangle"])
def test_random_polygons_have_their_area(shape):
    assert mean_area(random_polygons(shape, 2.5, 100, 1)) == pytest.approx(2.5, rel=1e-3)


def test_two_percent_of_an_8x8_stamp_is_a_square_of_two_pixels():
    assert eisenacher._area_at(0.02) == pytest.approx(1.92, abs=0.1)


def test_the_mask_gains_fewer_points_on_narrow_polygons():
    assert aspect._measure(1.0, 32)["points"] < aspect._measure(1.0, 1)["points"]


def test_interleaving_wins_at_long_motion_and_not_without():
    cost = {way: {r["algorithm"]: r["cost"] for r in blur._measure(way, 0.0)} for way in (0.0, 64.0)}
    assert cost[64.0]["interleaved 256"] < cost[64.0]["interval"]
    assert cost[0.0]["interleaved 256"] > cost[0.0]["interval"]


def test_patches_of_squares_have_their_area_and_their_patches():
    polygons = algorithms.patches_of_squares(8.0)
    assert mean_area(polygons) == pytest.approx(8.0, rel=1e-2)
    assert (np.bincount(polygons.patch) == algorithms.GRID**2).all()


def test_time_of_every_algorithm_has_a_bound(monkeypatch):
    monkeypatch.setattr(algorithms, "MOST_POLYGONS", 2000)
    polygons = algorithms.patches_of_squares(1.0)
    rows = [algorithms._timed(polygons, 1.0, name, "gtx480") for name in algorithms.ALGORITHMS]
    assert all(row["ns"] > 0 and row["bound"] for row in rows)


def test_a_subdivided_cube_fits_its_window():
    polygons = cube().on_screen(3, 64, 48)
    assert polygons.vertices[..., 0].min() > 0
    assert polygons.vertices[..., 0].max() < 64
    assert len(polygons.patch) == 2 * 6 * 4**3


def draw(name, **options):
    scene = load_scene("teapot")
    matrix = read_camera("default", scene).matrix(80, 60)
    return load_pipeline(name)(scene, matrix, 80, 60, Simt(), pipeline_options(name, options), Executor())


def test_exact_pipelines_draw_the_same_picture():
    frames = [
        draw("stamps", stamp=2, touch="polygon"),
        draw("across-polygons", packing="repacked"),
        draw("bit-mask", mask="depth"),
    ]
    for frame in frames[1:]:
        assert (frame.maps["micropolygons"] == frames[0].maps["micropolygons"]).all()
        assert (frame.image == frames[0].image).all()


def test_the_plain_mask_says_how_many_pixels_are_wrong():
    plain, exact = draw("bit-mask"), draw("across-polygons")
    wrong = int((plain.maps["micropolygons"] != exact.maps["micropolygons"]).sum())
    assert plain.facts["wrong_pixels"] == wrong > 0


@pytest.mark.parametrize("name", ["stamps", "across-polygons", "bit-mask"])
def test_every_pipeline_takes_samples_from_a_file(name):
    assert {"spp", "positions", "edge"} <= set(options_type(name).__struct_fields__)


def test_a_lane_of_lockstep_waits_for_the_longest_and_repacking_fills_it():
    one, many = np.float32([[0, 0], [1, 0], [1, 1], [0, 1]]), np.float32([[0, 0], [8, 0], [8, 8], [0, 8]])
    corners = np.stack([many + 0.25 if k % 4 == 0 else one * 0.5 + 0.25 for k in range(256)])
    vertices = np.concatenate([corners, np.zeros((256, 4, 1), np.float32)], axis=2)
    polygons = Micropolygons(vertices, np.zeros(256, np.int32), np.zeros(256, np.uint8))
    waiting = lockstep.utilisation(polygons, "in-order", 4, 16, 16)
    assert waiting == pytest.approx(100 * (81 + 3) / (4 * 81))
    assert lockstep.utilisation(polygons, "repacked", 4, 16, 16) > 1.5 * waiting


def test_the_paper_s_own_reading_is_the_gain_of_the_experiment():
    gain = bit_mask._measure(cube(), 4, 48)["gain"]
    assert readings.gains(cube(), 4, 48)[f"hits a test, {readings.EACH}"] == pytest.approx(gain)


def test_useful_hits_are_the_same_with_and_without_a_mask():
    """So that their rate rises as tests fall, and the most under one mask, which the back of a cube shares."""
    found = readings.gains(cube(), 4, 48)
    assert found[f"useful hits a test, {readings.ONE}"] > 1.3 * found[f"useful hits a test, {readings.EACH}"]


def test_half_of_a_tiny_cube_s_faces_face_the_eye():
    polygons = cube().on_screen(2, 48, 36)
    front = readings._faces_eye(polygons)
    assert 0.3 < front.mean() < 0.7
    depth = polygons.vertices[..., 2].mean(axis=1)
    assert depth[front].mean() < depth[~front].mean()


def test_a_reading_says_both_only_where_it_reproduces_both():
    both, one = readings.Reading("a", [1.0, 1.3], [3.1]), readings.Reading("b", [1.31], [2.0])
    assert readings.said([both, one])[:3] == [
        "Readings that reproduce both +30 % and a factor of 3: a.",
        "Readings that reproduce bigguy's 1.3: a; b.",
        "Readings that reproduce cube's 3: a.",
    ]
    assert readings.as_table([both, one])["cube_reproduced"].tolist() == [True, False]
