"""The frontier of the methods: its scenes, its measures of error, its sentences."""

import numpy as np
import pandas as pd
import pytest

from tilestamp import simulate
from tilestamp.experiments.frontier.methods_notes import notes
from tilestamp.experiments.frontier.methods_scenes import lattice, sheets
from tilestamp.experiments.frontier.methods_truth import shown_offset
from tilestamp.experiments.frontier.methods_variants import ALL_TRIANGLES, Variant
from tilestamp.experiments.frontier.picture_error import depth_errors, flip, pixel_errors
from tilestamp.simulator.reference.coverage import (
    Visible,
    exact_visibility,
    homogeneous_corners,
    screen_corners,
    visibility,
)
from tilestamp.simulator.stages.depth_format import DEPTHS
from tilestamp.simulator.stages.laine2011.coverage import SAMPLE_COLUMN

WIDTH, HEIGHT = 48, 32
SHEETS = sheets(20.0, WIDTH, HEIGHT)
CORNERS, DEEP = screen_corners(
    np.array(
        [
            [(0, 0, 0.0), (9, 0, 0.0), (0, 9, 0.0)],  # the surface in front
            [(0, 0, 0.5), (9, 0, 0.5), (0, 9, 0.5)],  # one clearly behind
            [(0, 0, 1e-5), (9, 0, 1e-5), (0, 9, 1e-5)],  # one as good as in the front
        ]
    ),
    4,
    1,
)


def seen(ids):
    """Truth that sees these triangles at their depths."""
    depth = np.array([0.0, 0.5, 1e-5, np.inf])[ids]
    return Visible(np.array([ids], np.int32), depth[None], np.ones((1, len(ids)), np.int32))


@pytest.mark.parametrize("area", [0.3, 7.0, 300.0])
def test_a_sheet_covers_every_sample_once(area):
    mesh = sheets(area, WIDTH, HEIGHT, count=1).mesh
    assert (exact_visibility(mesh.positions, mesh.triangles, WIDTH, HEIGHT).hits == 1).all()


@pytest.mark.parametrize("area", [0.3, 7.0])
def test_triangles_of_a_sheet_have_the_mean_area(area):
    mesh = sheets(area, 96, 64, count=1).mesh
    corners, _ = homogeneous_corners(mesh.positions, mesh.triangles, 96, 64)
    x, y = np.moveaxis(corners[..., :2] / corners[..., 2:] / 2, 2, 0)
    twice = (x[:, 1] - x[:, 0]) * (y[:, 2] - y[:, 0]) - (y[:, 1] - y[:, 0]) * (x[:, 2] - x[:, 0])
    assert np.abs(twice / 2).mean() == pytest.approx(area, rel=0.05)


def test_edges_of_the_lattice_run_through_samples():
    """Moved by a hair the exact picture changes: samples lay on edges."""
    subject = lattice()
    corners, depths = homogeneous_corners(
        subject.scene.mesh.positions, subject.scene.mesh.triangles, subject.width, subject.height
    )
    here, beside = (
        visibility(corners, depths, subject.width, subject.height, offset=(x, 0.5)) for x in (0.5, 0.5 - 1e-9)
    )
    assert (here.hits == 1).all()
    assert (here.ids != beside.ids).any()


def test_fixed_point_hits_every_sample_of_the_lattice_once():
    subject = lattice()
    run = simulate(subject.scene, "hardware", "h200", width=subject.width, height=subject.height, cull_backfaces=False)
    assert run.counts["hardware.SAMPLE_HITS"] == subject.width * subject.height


def test_more_sub_pixel_bits_leave_fewer_wrong_pixels():
    mesh = SHEETS.mesh
    truth = exact_visibility(mesh.positions, mesh.triangles, WIDTH, HEIGHT)
    made = homogeneous_corners(mesh.positions, mesh.triangles, WIDTH, HEIGHT)
    wrong = [
        pixel_errors(
            simulate(
                SHEETS, "hardware", "h200", width=WIDTH, height=HEIGHT, bits=bits, cull_backfaces=False
            ).triangle_ids,
            truth,
            *made,
        ).wrong
        for bits in (4, 8)
    ]
    assert wrong[0] > wrong[1]


def test_what_shines_through_is_a_hole():
    errors = pixel_errors(np.array([[1, -1, 0, 0]], np.int32), seen([0, 0, 0, 0]), CORNERS, DEEP)
    assert errors == (0.5, 0.5, 0.0)


def test_what_is_drawn_where_nothing_is_spills():
    errors = pixel_errors(np.array([[0, 0, -1, -1]], np.int32), seen([3, 1, 3, 3]), CORNERS, DEEP)
    assert errors.spills == 0.5


def test_a_neighbour_at_the_same_depth_is_wrong_but_no_hole():
    assert pixel_errors(np.array([[2, 0, 0, 0]], np.int32), seen([0] * 4), CORNERS, DEEP) == (0.25, 0.0, 0.0)


@pytest.mark.parametrize("name", DEPTHS)
def test_a_depth_one_step_off_is_one_unit_off(name):
    z = np.array([0.25])
    scale = float(DEPTHS[name].scale)
    kept = 0.625 * scale if scale else float(np.float32(0.625).view(np.uint32))
    errors = [depth_errors("hardware", {"depth_format": name}, np.array([kept + step]), z)[0] for step in (0, 1)]
    assert errors == pytest.approx([0.0, 1.0])


@pytest.mark.parametrize(
    ("pipeline", "options", "kept"),
    [
        ("cudaraster", {}, 2147483648.0),
        ("freepipe", {}, 2147483520.0),
        ("tiled", {}, np.float32(0.5)),
        ("binned", {}, 0.5),
    ],
)
def test_the_middle_of_the_depth_range_is_kept_without_error(pipeline, options, kept):
    assert depth_errors(pipeline, options, np.array([kept]), np.zeros(1))[0] == 0.0


def test_the_true_picture_has_no_flip():
    picture = np.random.default_rng(0).integers(0, 256, (16, 16, 3), dtype=np.uint8)
    assert flip(picture / 255.0, picture) == pytest.approx(0.0, abs=1e-6)
    assert flip(picture / 255.0, picture[::-1].copy()) > 0.1


@pytest.mark.parametrize("variant", [v for v in ALL_TRIANGLES if v.pipeline == "cudaraster"], ids=lambda v: v.label)
def test_the_sample_shown_is_the_nearest_to_the_centre(variant):
    x, y = shown_offset(variant)
    samples = variant.options["msaa"]
    columns = SAMPLE_COLUMN[samples.bit_length() - 1, :samples]
    far = [np.hypot((c + 0.5) / samples - 0.5, (r + 0.5) / samples - 0.5) for r, c in enumerate(columns)]
    assert np.hypot(x - 0.5, y - 0.5) == pytest.approx(min(far))


def test_stamps_show_their_first_sample():
    assert shown_offset(Variant("stamps", "", {"spp": 4})) == (0.375, 0.125)


def test_a_pipeline_that_is_never_on_a_front_is_named_with_what_beats_it():
    rows = [("good", 1.0, 0.1, True), ("poor", 2.0, 0.2, False)]
    table = pd.DataFrame(
        [
            {"scene": "10 px", "machine": "h200", "pipeline": name, "method": name, "ms": ms, "flip": error,
             "fixed_function": False, "software_front_flip": front, "front_flip": front, "wrong": error,
             "holes": 0.0, "spills": 0.0,
             "depth_median_ulp": 1.0, "depth_worst_ulp": 2.0}
            for name, ms, error, front in rows
        ]
    )  # fmt: skip
    doubles = pd.DataFrame([{"method": "good", "samples": 9, "covered": 9, "double_hits": 0}])
    said = " ".join(notes(table, doubles))
    assert "Dominated on h200 in every scene: poor" in said
    assert "it meets good" in said
