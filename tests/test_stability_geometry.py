"""The stability atlas, rows of geometry: each test pins a boundary by the value that holds and the one that breaks."""

import pytest

from tilestamp.experiments.stability import (
    clipping,
    depth_twice,
    far_away,
    grazing,
    guard_band,
    methods,
    shared_edges,
    slivers,
    z_fighting,
)
from tilestamp.simulator.scenes.scene import Scene


@pytest.mark.parametrize(
    ("method", "holds", "breaks"),
    [
        ("cudaraster, freepipe: 1/16 pixel", 78.0, 92.0),
        ("hardware: 1/256 pixel", 1700.0, 2000.0),
        ("stamps: 1/4096 pixel", 25_000.0, 32_000.0),
        ("binned: float32 edge planes", 52_000.0, 62_000.0),
    ],
)
def test_slivers_lose_a_quarter_of_their_samples_at_this_aspect(method, holds, breaks):
    assert slivers.by_angle(methods.METHODS[method], holds).mean() <= slivers.WRONG
    assert slivers.by_angle(methods.METHODS[method], breaks).mean() > slivers.WRONG


@pytest.mark.parametrize("method", ["tiled, per-primitive: float32 barycentrics", methods.QUADS])
def test_float32_differences_keep_the_thinnest_slivers(method):
    assert slivers.by_angle(methods.METHODS[method], slivers.ASPECTS[-1]).mean() <= slivers.WRONG


def test_every_sliver_is_given_without_rounding():
    points = slivers.slivers(slivers.ASPECTS[-1])
    clip = points * 2 / slivers.SIZE - 1
    assert (points.astype("f4") == points).all()
    assert (clip.astype("f4") == clip).all()


@pytest.mark.parametrize("method", list(methods.METHODS)[:3])
@pytest.mark.parametrize("offset", [0.0, 2.0**-16, 0.5])
def test_a_fill_rule_in_whole_numbers_hits_every_sample_of_a_seam_once(method, offset):
    assert shared_edges.defects(method, offset) == (0, 0)


@pytest.mark.parametrize("method", [list(methods.METHODS)[3], methods.QUADS])
def test_seams_exactly_on_samples_are_hit_twice_without_a_rule(method):
    assert shared_edges.defects(method, 2.0**-16) == (0, 0)
    holes, doubles = shared_edges.defects(method, 0.0)
    assert holes == 0
    assert doubles > 200


def test_planes_from_screen_coordinates_hit_a_seam_twice_that_lies_beside_the_samples():
    assert shared_edges.defects("binned: float32 edge planes", 0.00055) == (0, 0)
    assert shared_edges.defects("binned: float32 edge planes", 0.00044)[1] > 0


def test_float32_worlds_reach_ten_thousand_radii():
    assert far_away.wrong("cudaraster: float32 world and matrix", 4096.0) <= far_away.WRONG
    assert far_away.wrong("cudaraster: float32 world and matrix", 32_768.0) > far_away.WRONG


def test_a_model_in_its_own_coordinates_looks_the_same_anywhere():
    assert far_away.wrong("cudaraster: own coordinates, matrix from doubles", 2.0**26) == 0.0


@pytest.mark.parametrize(
    ("pipeline", "case", "holds", "breaks"),
    [
        ("cudaraster 1.1", "larger than the screen", 200_000.0, 262_144.0),
        ("stamps", "larger than the screen", 2000.0, 2500.0),
        ("stamps", "towards the eye's plane", 0.00055, 0.00045),
        ("tiled, per-primitive", "towards the eye's plane", 1e-5, 6e-8),
        ("tiled, per-primitive", "behind the eye", -0.01, 0.01),
        ("stamps", "behind the eye", -0.01, 0.01),
        ("stamps", "before the near plane", 1.0, 1.05),
    ],
)
def test_what_is_not_clipped_breaks_here(pipeline, case, holds, breaks):
    assert clipping.wrong(pipeline, clipping.CASES[case], holds) <= clipping.WRONG
    assert clipping.wrong(pipeline, clipping.CASES[case], breaks) > clipping.WRONG


@pytest.mark.parametrize("pipeline", ["cudaraster 1.1", "freepipe", "hardware", "binned"])
def test_clippers_survive_corners_far_behind_the_eye(pipeline):
    assert clipping.wrong(pipeline, clipping.CASES["behind the eye"], 65_536.0) <= clipping.WRONG


def test_the_guard_band_of_1_1_is_what_nvdiffrast_has_not():
    assert not clipping.clips("1.1", 20.0)
    assert clipping.clips("1.1", 21.0)
    assert clipping.clips("nvdiffrast", 0.5)


@pytest.mark.parametrize("method", ["cudaraster 1.1", "cudaraster of nvdiffrast, guard_band on"])
@pytest.mark.parametrize(("case", "holds", "breaks"), [("far out", 32_767, 32_768), ("near plane", 0.99, 1.01)])
def test_a_clipped_triangle_leaves_holes_beside_a_whole_one(method, case, holds, breaks):
    assert guard_band.holes(method, guard_band.CASES[case], holds) == 0
    assert guard_band.holes(method, guard_band.CASES[case], breaks) == 2


@pytest.mark.parametrize("method", list(guard_band.METHODS)[2:])
@pytest.mark.parametrize(("case", "hardest"), [("far out", 2**20), ("near plane", 1.01)])
def test_who_cuts_an_edge_for_both_its_triangles_or_for_neither_leaves_no_hole(method, case, hardest):
    assert guard_band.holes(method, guard_band.CASES[case], hardest) == 0


def test_a_surface_past_the_near_plane_has_a_hole_under_the_guard_band_only():
    """Two triangles of one surface, found by looking about; the original's rules leave the pixel out too."""
    corners = [
        (0.29132724, -0.22290927, 0.0325895, 0.05254693),
        (-1.0835345, 0.59996146, -1.165537, -1.1443821),
        (-0.9314631, 0.01087255, 1.5994446, 1.617836),
        (-2.3063247, 0.8337433, 0.40131807, 0.42090696),
    ]
    scene = Scene.from_clip_space(corners, [(0, 1, 3), (0, 3, 2)])
    band, none = (
        methods.draw(scene, "cudaraster", 64, cull_backfaces=False, guard_band=on).triangle_ids for on in (True, False)
    )
    assert (band[51, 3], none[51, 3]) == (-1, 1)


@pytest.mark.parametrize(
    ("way", "holds", "breaks"), [(depth_twice.STEPPED, 1e-9, 1e-7), (depth_twice.CONTRACTED, 0.01, 0.02)]
)
def test_a_depth_evaluated_twice_leaves_holes_in_a_tilted_plane(way, holds, breaks):
    assert depth_twice.holes(holds, way=way) <= depth_twice.WRONG
    assert depth_twice.holes(breaks, way=way) > depth_twice.WRONG


@pytest.mark.parametrize(("way", "slack"), [(depth_twice.STEPPED, 2), (depth_twice.CONTRACTED, 1)])
def test_a_slack_of_a_step_or_two_closes_every_hole(way, slack):
    assert depth_twice.holes(0.5, slack=slack - 1, way=way) > 0.0
    assert depth_twice.holes(0.5, slack=slack, way=way) == 0.0


@pytest.mark.parametrize(("slack", "holds", "breaks"), [(0, 1.2e-7, 5e-8), (2, 3e-7, 1.5e-7), (1678, 1.02e-4, 1e-4)])
def test_a_slack_loses_the_order_of_surfaces_closer_than_it(slack, holds, breaks):
    assert not depth_twice.loses_order(holds, slack)
    assert depth_twice.loses_order(breaks, slack)


@pytest.mark.parametrize(
    ("method", "holds", "breaks"),
    [(grazing.COARSE, 0.00044, 0.0005), ("hardware: corners to 1/256 pixel", 0.0075, 0.009)],
)
def test_a_snapped_corner_puts_a_steep_plane_a_step_of_16_bits_off(method, holds, breaks):
    assert grazing.error(grazing.METHODS[method], holds) <= grazing.WRONG
    assert grazing.error(grazing.METHODS[method], breaks) > grazing.WRONG


@pytest.mark.parametrize(
    ("name", "holds", "breaks"),
    [
        ("hardware, 16 bits", 1.6, 1.2),
        ("hardware, 24 bits", 0.016, 0.006),
        ("hardware, float32", 0.016, 0.006),
        ("cudaraster, 32 bits, integer planes", 0.008, 0.002),
    ],
)
def test_walls_at_distance_100_fight_below_this_separation(name, holds, breaks):
    assert z_fighting.wrong(name, 100.0, holds) <= z_fighting.WRONG
    assert z_fighting.wrong(name, 100.0, breaks) > z_fighting.WRONG


@pytest.mark.parametrize("cover", [methods.barycentrics, methods.edge_planes, methods.stamp, methods.quads])
def test_the_small_kernels_of_the_atlas_agree_with_exact_coverage_on_fat_triangles(cover):
    points = methods.quantized([[[3.2, 4.1], [50.7, 9.3], [20.4, 55.6]], [[60.3, 2.2], [61.9, 40.8], [40.1, 33.7]]])
    assert (cover(points, 64).mask == methods.exact(points, 64).mask).all()


@pytest.mark.parametrize(
    ("cover", "pipeline", "options"),
    [
        (methods.barycentrics, "tiled", {"cull_backfaces": False}),
        (methods.barycentrics, "per-primitive", {}),
        (methods.edge_planes, "binned", {"cull_backfaces": False}),
    ],
)
def test_the_small_kernels_of_the_atlas_cover_what_their_pipelines_cover(cover, pipeline, options):
    points = shared_edges.triangles_of(shared_edges.lattice(0.0))[:40] / 2 + [0.0, 3e-5]
    run = methods.draw(methods.flat_scene(points, 64), pipeline, 64, **options)
    assert ((run.triangle_ids[::-1] >= 0) == cover(points, 64).mask).all()
