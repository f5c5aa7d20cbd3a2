"""Catmull-Clark subdivision: the naive version, limits, borders, creases, and cages that are none."""

import math

import numpy as np
import pytest

from tests.naive_ste import catmull_clark
from tilestamp.models.errors import TilestampError
from tilestamp.simulator.scenes.catmull_clark import limit_positions, subdivide, surface_of
from tilestamp.simulator.scenes.quad_cage import Cage, refine

CUBE = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
CUBE_FACES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
TENT = [(0, 0, 0), (3, 0, 1), (5, 2, 0), (3, 4, 2), (0, 4, 0), (1, 2, 5), (6, 5, 1)]
TENT_FACES = [(0, 1, 5), (1, 2, 3, 5), (3, 4, 5), (0, 5, 4), (2, 6, 3)]


def cage(points, faces):
    return Cage(np.array(points, float), np.concatenate(faces).astype(np.int64), np.array([len(f) for f in faces]))


def corners(surface):
    return surface.positions[surface.quads]


@pytest.mark.parametrize(("points", "faces"), [(CUBE, CUBE_FACES), (TENT, TENT_FACES), (TENT, TENT_FACES[:4])])
def test_a_step_is_the_naive_step(points, faces):
    """Closed quads; triangles, quads and borders; a border with an inner triangle fan."""
    np.testing.assert_allclose(
        corners(subdivide(surface_of(cage(points, faces)), 1)), catmull_clark(points, faces), atol=1e-12
    )


@pytest.mark.parametrize("sharpness", [math.inf, 2.0, 0.375])
def test_creases_are_the_naive_creases(sharpness):
    ring = [(0, 1), (1, 3), (3, 2), (2, 0)]
    surface = surface_of(cage(CUBE, CUBE_FACES), ring, [sharpness] * 4)
    naive = catmull_clark(CUBE, CUBE_FACES, {frozenset(e): sharpness for e in ring})
    np.testing.assert_allclose(corners(subdivide(surface, 1)), naive, atol=1e-12)


def test_two_sharp_edges_that_meet_a_third_make_a_corner():
    edges = [(0, 1), (0, 2), (0, 4)]
    surface = subdivide(surface_of(cage(CUBE, CUBE_FACES), edges, [math.inf] * 3), 3)
    assert (surface.positions == CUBE[0]).all(axis=1).any()


def test_a_crease_softens_step_by_step():
    surface = subdivide(surface_of(cage(CUBE, CUBE_FACES), [(0, 1)], [1.5]), 1)
    assert sorted(surface.sharpness[surface.sharpness > 0].tolist()) == [0.5, 0.5]


def test_steps_agree_with_the_step_of_the_cage_reader():
    ours = subdivide(surface_of(cage(TENT, TENT_FACES)), 2)
    theirs = refine(refine(cage(TENT, TENT_FACES)))
    theirs = theirs.positions[theirs.corners].reshape(-1, 4, 3)
    key = lambda quads: sorted(np.round(quads.mean(axis=1), 9).tolist())  # noqa: E731
    assert key(corners(ours)) == key(theirs)


def test_limits_do_not_move_under_subdivision():
    once = subdivide(surface_of(cage(TENT, TENT_FACES)), 1)
    further = subdivide(once, 3)
    np.testing.assert_allclose(limit_positions(further)[: len(once.positions)], limit_positions(once), atol=1e-12)


def test_vertices_converge_to_their_limits():
    surface = surface_of(cage(CUBE, CUBE_FACES))
    far = [np.abs(s.positions - limit_positions(s)).max() for s in (subdivide(surface, n) for n in (2, 4, 6))]
    assert far[1] < far[0] / 10
    assert far[2] < far[1] / 10


def test_the_limit_of_a_cube_corner_is_known():
    """(9 P + 4 * sum E + sum F) / 24 of a corner of the cube of edge 2: half the corner... times one."""
    assert limit_positions(surface_of(cage(CUBE, CUBE_FACES)))[0].tolist() == [-0.5, -0.5, -0.5]


def test_a_cube_of_seven_rounds_has_98304_quads_of_its_six_faces():
    surface = subdivide(surface_of(cage(CUBE, CUBE_FACES)), 7)
    assert len(surface.quads) == 98304
    assert np.bincount(surface.cage_face).tolist() == [16384] * 6


def test_bigguy_comes_from_the_cage_reader(shared):
    from tilestamp.simulator.scenes.quad_cage import read_cage

    surface = subdivide(surface_of(read_cage(shared / "scenes" / "cages" / "bigguy.obj")), 2)
    assert len(surface.quads) == 1450 * 16


def test_every_edge_of_a_closed_surface_has_two_faces():
    surface = subdivide(surface_of(cage(CUBE, CUBE_FACES)), 3)
    quads = surface.quads
    ends = np.sort(np.stack([quads, np.roll(quads, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    assert (np.sort(surface.edges[surface.corner_edges], axis=1) == ends).all()
    assert (np.bincount(surface.corner_edges) == 2).all()


def test_isolated_vertices_are_dropped():
    surface = surface_of(cage([(9, 9, 9), *CUBE], [tuple(v + 1 for v in f) for f in CUBE_FACES]))
    assert len(surface.positions) == 8


def test_a_face_wound_against_its_neighbours_is_turned_round():
    wrong = [CUBE_FACES[0], *[f[::-1] for f in CUBE_FACES[1:3]], *CUBE_FACES[3:]]
    right = subdivide(surface_of(cage(CUBE, CUBE_FACES)), 1)
    mended = subdivide(surface_of(cage(CUBE, wrong)), 1)
    normal = lambda q: np.cross(q[:, 2] - q[:, 0], q[:, 3] - q[:, 1])  # noqa: E731
    outward = lambda s: np.sign((normal(corners(s)) * corners(s).mean(axis=1)).sum(axis=1))  # noqa: E731
    assert outward(mended).tolist() == outward(right).tolist()


def test_zero_area_faces_stay_zero_area():
    points = [(0, 0, 0), (1, 0, 0), (1, 0, 0), (0, 0, 0)]
    assert np.isfinite(corners(subdivide(surface_of(cage(points, [(0, 1, 2, 3)])), 3))).all()


@pytest.mark.parametrize(
    ("points", "faces", "sentence"),
    [
        (CUBE, [*CUBE_FACES, (0, 1, 5)], "3 faces of the cage meet at the edge"),
        (CUBE, [(0, 1)], "has 2 corners"),
        (CUBE, [(0, 1, 3, 1)], "the same vertex twice"),
        (CUBE, [(0, 1, 9)], "beyond its 8 vertices"),
        ([(0, 0, math.nan), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)], "NaN"),
        (CUBE, [(0, 1, 3, 2), (2, 3, 4, 5), (4, 5, 1, 0)], "one-sided"),
    ],
)
def test_what_is_no_surface_is_named_in_a_sentence(points, faces, sentence):
    with pytest.raises(TilestampError, match=sentence):
        surface_of(cage(points, faces))


def test_a_crease_must_be_an_edge():
    with pytest.raises(TilestampError, match="crease 1-8 is no edge"):
        surface_of(cage(CUBE, CUBE_FACES), [(0, 7)], [1.0])


def test_too_many_levels_are_refused():
    with pytest.raises(TilestampError, match="level 20"):
        subdivide(surface_of(cage(CUBE, CUBE_FACES)), 20)
