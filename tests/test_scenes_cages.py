"""Cages: Catmull-Clark refinement against the naive one, and patches that are exact where a cage is regular."""

import numpy as np
import pytest

from tests import naive_scenes
from tilestamp.models.errors import TilestampError
from tilestamp.simulator.scenes.approximate_catmull_clark import patches_from_cage
from tilestamp.simulator.scenes.library import DATA
from tilestamp.simulator.scenes.quad_cage import Cage, read_cage, refine

CUBE = [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]


def cage(positions, faces):
    sizes = np.array([len(face) for face in faces])
    return Cage(np.array(positions, dtype=np.float64), np.concatenate([np.array(face) for face in faces]), sizes)


def grid(rows, columns, rng, *, closed):
    """Build a sheet of quads, or a torus where ``closed``: vertices at random."""
    positions = rng.normal(size=(rows * columns, 3))
    last = (rows, columns) if closed else (rows - 1, columns - 1)
    faces = [
        [
            i * columns + j,
            i * columns + (j + 1) % columns,
            (i + 1) % rows * columns + (j + 1) % columns,
            (i + 1) % rows * columns + j,
        ]
        for i in range(last[0])
        for j in range(last[1])
    ]
    return positions, faces


def house(rng):
    """Build an open box of five sides with a triangle, a pentagon and quads: every kind of vertex."""
    faces = [[0, 3, 2, 1], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7], [4, 5, 8], [5, 6, 9, 10, 8]]
    return rng.normal(size=(11, 3)), faces


def limit_corners(patches):
    return patches.points[:, [0, 3, 15, 12], :3].reshape(-1, 3)


@pytest.fixture
def rng():
    return np.random.default_rng(2010)


@pytest.mark.parametrize("shape", ["cube", "house", "sheet"])
def test_refinement_is_catmull_and_clarks(shape, rng):
    shapes = {"cube": (rng.normal(size=(8, 3)), CUBE), "house": house(rng), "sheet": grid(3, 4, rng, closed=False)}
    positions, faces = shapes[shape]
    refined = refine(cage(positions, faces))
    wanted, quads = naive_scenes.catmull_clark(positions.tolist(), faces)
    assert refined.corners.reshape(-1, 4).tolist() == quads
    np.testing.assert_allclose(refined.positions, wanted, atol=1e-12)


def test_a_torus_of_quads_is_its_bspline(rng):
    positions, faces = grid(5, 6, rng, closed=True)
    patches = patches_from_cage(cage(positions, faces)).points.reshape(5, 6, 4, 4, 4)
    points = positions.reshape(5, 6, 3)
    for i, j, u, v in [(0, 0, 0.3, 0.7), (2, 3, 0.0, 0.0), (4, 5, 0.9, 0.1), (3, 5, 1.0, 0.5)]:
        net = [[points[(i + a - 1) % 5, (j + b - 1) % 6] for b in range(4)] for a in range(4)]
        wanted = naive_scenes.surface_point(net, naive_scenes.bspline(v), naive_scenes.bspline(u))
        bernstein = naive_scenes.bernstein(v), naive_scenes.bernstein(u)
        np.testing.assert_allclose(naive_scenes.surface_point(patches[i, j], *bernstein), [*wanted, 1], atol=2e-6)


def test_a_sheet_is_the_bspline_of_its_mirrored_border(rng):
    positions, faces = grid(4, 5, rng, closed=False)
    patches = patches_from_cage(cage(positions, faces)).points.reshape(3, 4, 4, 4, 4)
    inner = positions.reshape(4, 5, 3)
    columns = np.concatenate([2 * inner[:1] - inner[1:2], inner, 2 * inner[-1:] - inner[-2:-1]])
    points = np.concatenate(
        [2 * columns[:, :1] - columns[:, 1:2], columns, 2 * columns[:, -1:] - columns[:, -2:-1]], axis=1
    )
    for i, j, u, v in [(0, 0, 0.0, 0.0), (0, 0, 0.4, 0.6), (2, 3, 1.0, 1.0), (1, 0, 0.2, 0.9), (2, 1, 0.5, 1.0)]:
        wanted = naive_scenes.surface_point(
            points[i : i + 4, j : j + 4], naive_scenes.bspline(v), naive_scenes.bspline(u)
        )
        bernstein = naive_scenes.bernstein(v), naive_scenes.bernstein(u)
        np.testing.assert_allclose(naive_scenes.surface_point(patches[i, j], *bernstein), [*wanted, 1], atol=2e-6)


@pytest.mark.parametrize("shape", ["cube", "torus", "sheet", "box with a lid missing"])
def test_patch_corners_are_limit_positions_which_refinement_leaves_alone(shape, rng):
    shapes = {
        "cube": (rng.normal(size=(8, 3)), CUBE),
        "torus": grid(3, 4, rng, closed=True),
        "sheet": grid(3, 4, rng, closed=False),
        "box with a lid missing": (rng.normal(size=(8, 3)), CUBE[:-1]),
    }
    coarse = cage(*shapes[shape])
    fine = refine(coarse)
    limits = limit_corners(patches_from_cage(fine)).reshape(-1, 4, 3)[:, 0]  # the first corner is the old vertex
    np.testing.assert_allclose(limit_corners(patches_from_cage(coarse)), limits, atol=2e-6)


def test_other_faces_than_quads_are_refined_once(rng):
    coarse = cage(*house(rng))
    assert np.array_equal(patches_from_cage(coarse).points, patches_from_cage(refine(coarse)).points)


@pytest.mark.parametrize("turned", [False, True])
def test_a_closed_cage_has_no_gap_between_patches(turned, rng):
    """Every boundary curve occurs twice, equal to the bit, also where neighbours wind against each other."""
    positions, faces = rng.normal(size=(8, 3)), [list(face) for face in CUBE]
    if turned:
        faces[2].reverse()
    points = patches_from_cage(refine(cage(positions, faces))).points.reshape(-1, 4, 4, 4)
    curves = {}
    for net in points:
        for curve in (net[0], net[:, 3], net[3], net[:, 0]):
            key = min(curve.tobytes(), curve[::-1].tobytes())
            curves[key] = curves.get(key, 0) + 1
    assert set(curves.values()) == {2}


def test_where_three_faces_meet_at_an_edge_the_surface_is_creased(rng):
    """The crease's ends have three rims each, so the surface passes through them."""
    positions = rng.normal(size=(8, 3))
    book = cage(positions, [[0, 1, 3, 2], [0, 1, 5, 4], [0, 1, 7, 6]])
    patches = patches_from_cage(book).points.reshape(-1, 4, 4, 4)
    np.testing.assert_allclose(patches[:, 0, [0, 3], :3], np.tile(positions[:2], (3, 1, 1)), rtol=1e-6)


def test_the_embedded_cage_is_closed():
    spot = read_cage(DATA / "spot_control_mesh.obj")
    assert not spot.boundary_edges.any()


def test_a_face_that_is_folded_is_named(tmp_path):
    path = tmp_path / "folded.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\nf 1 2 2 3\n")
    with pytest.raises(TilestampError, match="face 2 names the same vertex twice"):
        read_cage(path)
