"""The fixed-function pipe: picture and items."""

import numpy as np
import pytest

from tests.test_freepipe import LARGE, TINY, flat
from tilestamp.models.errors import TilestampError
from tilestamp.models.machine import load_machine
from tilestamp.models.price import price
from tilestamp.models.simt import Simt
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.pipelines.hardware import HardwareOptions
from tilestamp.simulator.pipelines.hardware import hardware as pipeline
from tilestamp.simulator.reference.coverage import exact_visibility
from tilestamp.simulator.scenes.scene import Mesh, Scene
from tilestamp.simulator.stages.hardware import band_of, hardware, hardware_grids
from tilestamp.simulator.stages.liu2010.freepipe_triangle import make_pieces


@pytest.mark.parametrize("name", ["bunny", "nearclip5k", "edges_512"])
def test_coverage_at_four_bits_is_cudarasters(shared, name):
    data, gpu = (np.load(shared / f"silicon/ids/{name}_{part}.npz") for part in ("input", "512"))
    frame, _, _ = hardware(
        data["positions"], data["triangles"], 512, 384, cull_backfaces=False, bits=4, guard_band=False
    )
    assert np.array_equal(frame.ids >= 0, gpu["id"] > 0)
    assert np.count_nonzero(frame.ids != gpu["id"].astype(int) - 1) <= 2  # depths that float32 cannot tell apart


def test_a_pixel_triangle_touches_one_quad():
    _, (work,), facts = hardware(*flat(TINY), 64, 64)
    assert (work.items["quads"], work.items["z"], work.items["samples"]) == (1, 1, 1)
    assert facts["quad_efficiency"] == 0.25


def test_a_square_of_quads_is_touched_twice_along_its_diagonal():
    frame, (work,), _ = hardware(*flat([(0, 0), (8, 0), (0, 8), (0, 8), (8, 0), (8, 8)]), 64, 64)
    assert work.items["z"] == 64 == np.count_nonzero(frame.ids >= 0)
    assert work.items["quads"] == 16 + 4


def _clip_space(*corners):
    return np.array(corners, np.float32), np.arange(len(corners), dtype=np.int32).reshape(-1, 3)


OVERSIZED = _clip_space((-1, -1, 0, 1), (3, -1, 0, 1), (-1, 3, 0, 1))
TWO = _clip_space((-1, -1, 0, 1), (1, -1, 0, 1), (1, 1, 0, 1), (-1, -1, 0, 1), (1, 1, 0, 1), (-1, 1, 0, 1))


@pytest.mark.parametrize(("mesh", "quads"), [(OVERSIZED, 32 * 32), (TWO, 32 * 32 + 32)])
def test_a_triangle_that_leaves_the_screen_stays_whole(mesh, quads):
    frame, (work,), _ = hardware(*mesh, 64, 64)
    assert (work.items["quads"], np.count_nonzero(frame.ids < 0)) == (quads, 0)


def test_without_the_guard_band_both_pieces_count_the_quads_of_their_seam():
    _, (work,), _ = hardware(*OVERSIZED, 64, 64, guard_band=False)
    assert work.items["quads"] == 32 * 32 + 32


@pytest.mark.parametrize(("reach", "whole"), [(1022.9, True), (1023.1, False)])
def test_the_guard_band_ends_32767_pixels_from_the_origin(reach, whole):
    """1022.97 half sides of 64 pixels beyond the centre."""
    mesh = _clip_space((-1, -1, 0, 1), (reach, -1, 0, 1), (-1, reach, 0, 1))
    pieces = make_pieces(*mesh, 64, 64, 8, band_of(64, 64))
    assert (pieces.first[-1] == 1) == whole


def test_what_reaches_behind_the_eye_is_clipped_at_the_near_plane_and_drawn_right():
    floor = np.array([(-2, -1, -0.5, -0.5), (2, -1, -0.5, -0.5), (2, 2, 0.5, 4), (-2, 2, 0.5, 4)], np.float32)
    triangles = np.array([(0, 1, 2), (0, 2, 3)], np.int32)
    frame, _, _ = hardware(floor, triangles, 64, 64, cull_backfaces=False)
    assert np.array_equal(frame.ids >= 0, exact_visibility(floor, triangles, 64, 64).hits[::-1] > 0)


def test_hidden_pixels_are_tested_and_not_written():
    near, far = flat(LARGE, -0.5)[0], flat(LARGE, 0.5)[0]
    _, (work,), _ = hardware(np.vstack([near, far]), np.arange(6, dtype=np.int32).reshape(2, 3), 64, 64)
    assert work.items["z"] == 2 * work.items["samples"] == 2 * work.items["pixels"]


def test_of_equal_depths_the_first_stays():
    frame, _, _ = hardware(*flat(LARGE * 2), 64, 64)
    assert set(frame.ids[frame.ids >= 0]) == {0}


def test_what_turns_away_is_culled_only_when_asked():
    positions, triangles = flat(LARGE)
    away = triangles[:, ::-1].copy()
    assert hardware(positions, away, 64, 64).works[0].items["culled"] == 1
    assert hardware(positions, away, 64, 64, cull_backfaces=False).works[0].items["culled"] == 0


def test_what_lies_between_pixel_centres_is_culled():
    _, (work,), _ = hardware(*flat([(1.6, 1.6), (2.4, 1.6), (1.6, 2.4)]), 64, 64)
    assert (work.items["culled"], work.items["quads"]) == (1, 0)


def test_a_grid_is_drawn_as_two_triangles_a_quad_without_holes_or_double_hits():
    x, y = np.meshgrid(np.linspace(-1, 1, 5), np.linspace(-1, 1, 4))
    grid = np.stack([x, y, 0 * x, 1 + 0 * x], axis=-1)[None].astype(np.float32)
    frame, (work,), _ = hardware_grids(grid, 33, 21)
    assert (work.items["primitives"], work.items["z"]) == (24, 33 * 21)
    assert sorted(set(frame.ids.ravel())) == list(range(12))
    assert frame.ids[0, 0] == 0


@pytest.mark.parametrize("bits", [4, 6, 8])
def test_a_fan_has_no_hole_at_any_precision(bits):
    angle = np.linspace(0, 2 * np.pi, 40)[:-1]
    rim = np.column_stack([0.9 * np.cos(angle), 0.9 * np.sin(angle), 0 * angle, 1 + 0 * angle])
    positions = np.vstack([[0.013, 0.007, 0, 1], rim]).astype(np.float32)
    triangles = np.array([(0, 1 + i, 1 + (i + 1) % 39) for i in range(39)], np.int32)
    frame, (work,), _ = hardware(positions, triangles, 100, 80, bits=bits)
    assert work.items["z"] == np.count_nonzero(frame.ids >= 0)


def test_the_machine_file_prices_every_item():
    _, (work,), _ = hardware(*flat(LARGE), 64, 64)
    (timing,) = price([work.launch()], load_machine("gtx480"))
    assert timing.milliseconds > 0
    assert set(work.items) <= set(timing.term_cycles)


def test_the_pipeline_puts_the_top_row_first():
    positions, triangles = flat([(0, 0), (64, 0), (0, 20)])
    scene = Scene("low", mesh=Mesh(positions, triangles, clip_space=True))
    frame = pipeline(scene, np.eye(4), 64, 64, Simt(), HardwareOptions(), Executor())
    assert (frame.triangle_ids[-1, 0], frame.triangle_ids[0, 0]) == (0, -1)
    assert frame.works[0].stage == "hardware"


@pytest.mark.parametrize(("depth_format", "seen"), [("fixed16", 0), ("fixed24", 1), ("fixed32", 1), ("float32", 1)])
def test_sixteen_bits_cannot_tell_two_depths_that_the_others_can(depth_format, seen):
    far, near = flat(LARGE, 0.25)[0], flat(LARGE, 0.25 - 2.0**-18)[0]
    both = np.vstack([far, near])
    frame, (work,), _ = hardware(both, np.arange(6, dtype=np.int32).reshape(2, 3), 64, 64, depth_format=depth_format)
    assert set(frame.ids[frame.ids >= 0]) == {seen}
    assert work.streams[2].bytes == work.items["z"] * (2 if depth_format == "fixed16" else 4)


def test_depth_is_kept_in_units_of_its_format():
    kept = {
        name: hardware(*flat(LARGE, 0.5), 64, 64, depth_format=name)[0].depth.min()
        for name in ("fixed16", "fixed24", "fixed32", "float32")
    }
    assert kept["fixed16"] == round(0.75 * 65535)
    assert kept["fixed24"] == pytest.approx(0.75 * 16777215, abs=1)
    assert kept["fixed32"] == pytest.approx(0.75 * 2**32, abs=256)
    assert np.uint32(kept["float32"]).view(np.float32) == 0.75


@pytest.mark.parametrize("size", [(0, 5), (20000, 5)])
def test_sizes_that_cannot_be_are_refused(size):
    with pytest.raises(TilestampError, match="hardware"):
        hardware(*flat(TINY), *size)
