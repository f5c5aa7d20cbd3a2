"""Collapsed patch edges: normals at a pole (the teapot's lid; Eisenacher & Loop 2010 is silent).

Where an edge of a patch is one point, its tangent is zero and there is no normal; dicing borrows one a little inside of
the patch. Where the edge is only nearly a point, its control points differ by a few roundings: the tangent is noise,
and so is the normal. Cure: weld such control points once a model, so that the edge is collapsed indeed.
"""

from functools import cache, partial

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Figure, Result
from tilestamp.experiments.stability.boundary import Boundary, atlas_result, bisect, bracket
from tilestamp.experiments.stability.patch_frames import Split, simt_of
from tilestamp.reports.plots import lines
from tilestamp.simulator.scenes import load_scene
from tilestamp.simulator.scenes.camera import LookAt
from tilestamp.simulator.stages.eisenacher2010.bound_and_split import bound_and_split
from tilestamp.simulator.stages.eisenacher2010.dice import dice

QUESTION = "How short may a patch's edge be before the normal at it is wrong?"
SIZE = 128  # pixels a side
LENGTHS = tuple(10.0 ** (-k / 2) for k in range(4, 21))  # of the edge, in radii of the dome
ARC = 0.5522847  # control points of a quarter circle
TURN = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]  # along no axis
CENTRE = np.array([3.3, 2.7, 1.1])  # of the dome, in radii: away from the origin, where float32 is finer
WELD = 1e-5  # radii within which control points of an edge are one
WRONG = 8  # levels of 255
WHITE = np.full((2, 2, 3), 255, np.uint8)
MACHINE = "gtx280"


def dome(length: float, *, welded: bool = False) -> NDArray[np.float32]:
    """An eighth of a sphere, (1, 16, 4), whose edge at the pole has a radius of ``length``."""
    profile = np.array([[length, 1.0], [ARC, 1.0], [1.0, ARC], [1.0, 0.0]])  # radius and height, the pole first
    around = np.array([[1, 0], [1, ARC], [ARC, 1], [0, 1]])
    points = np.ones((4, 4, 4))
    points[..., :2] = profile[None, :, :1] * around[:, None]
    points[..., 2] = profile[:, 1]
    points[..., :3] = points[..., :3] @ TURN.T + CENTRE
    made = points.reshape(1, 16, 4).astype(np.float32)
    return weld(made, WELD) if welded else made


def weld(points: NDArray[np.float32], distance: float) -> NDArray[np.float32]:
    """Make the control points of an edge one where all lie within ``distance`` of the first."""
    made = points.copy()
    for patch in made:
        for edge in (patch[0:4], patch[12:16], patch[0::4], patch[3::4]):
            if (np.linalg.norm(edge[:, :3] - edge[0, :3], axis=1) <= distance).all():
                edge[:] = edge[0]
    return made


@cache
def frame(length: float, *, welded: bool = False) -> Split:
    """Split the dome and dice it in plain white."""
    points = dome(length, welded=welded)
    view = LookAt(CENTRE + TURN @ (3, 2, 3), CENTRE + TURN @ (0.4, 0.4, 0.5), tuple(TURN[:, 2]), 30.0, 0.1, 20.0)
    matrix = view.matrix(SIZE, SIZE)
    subpatches, works, _ = bound_and_split(points, matrix, SIZE, SIZE, 4, simt_of(MACHINE))
    grids, diced, _ = dice(points, subpatches, matrix, SIZE, SIZE, simt_of(MACHINE), texture=WHITE)
    return Split(subpatches, grids, works + diced)


def pole_levels(length: float, *, welded: bool = False) -> NDArray[np.int64]:
    """Red of the vertices at the pole, and of their neighbours inside, (2, V), levels of 255."""
    made = frame(length, welded=welded)
    red = (made.grids.vertices.view(np.uint32)[made.subpatches.i == 0, :, 3] & np.uint32(255)).astype(np.int64)
    return np.stack([red[:, 0::4].ravel(), red[:, 1::4].ravel()])


def error(length: float, *, welded: bool = False) -> int:
    """How far the worst vertex at the pole is off, in levels."""
    pole, inside = pole_levels(length, welded=welded)
    return int(np.abs(pole - np.median(inside)).max())


def boundary(*, welded: bool = False) -> tuple[float | None, float | None]:
    """Length that holds, and length that breaks."""
    wrong = [error(length, welded=welded) > WRONG for length in LENGTHS]
    return bisect(lambda length: error(length, welded=welded) > WRONG, *bracket(LENGTHS, wrong), tolerance=0.1)


def run(progress: Progress) -> Result:
    """Let the edge shrink to nothing."""
    progress("stability/collapsed_edges: the pole of a dome")
    rows = [
        {"length": length, "edge": "welded" if welded else "as given", "error": error(length, welded=welded)}
        for welded in (False, True)
        for length in LENGTHS
    ]
    table = pd.DataFrame(rows)
    given = table[table.edge == "as given"]
    band = given[given.error > WRONG].length
    vertices = pole_levels(0.0).shape[1]
    off = f"vertices at the pole are up to {given.error.max()} of 255 levels off"
    about = (
        f"tangents are roundings and normals point anywhere: {off}",
        f"weld control points within {WELD:g} radii once a model",
        f"no time in the frame; {vertices} vertices of {16 * len(frame(0.0).grids.boxes)} borrow their normal",
    )
    name, parameter = "micropolygon, an edge nearly collapsed", "length of the edge"
    boundaries = [
        Boundary(name, parameter, "radii", *boundary(), *about),
        Boundary("micropolygon, edge welded", parameter, "radii", *boundary(welded=True), "normals are noise"),
    ]
    failing = f"Lengths tried that fail: {band.min():.2g} to {band.max():.2g} radii"
    notes = [f"{failing}; no length at all is {error(0.0)} levels off, for its normal is borrowed.", _teapot()]
    figures = [Figure("pole", partial(
        lines, table, x="length", y="error", by="edge",
        title="Shading at the pole of a dome, by the length of the edge there", x_label="length of the edge [radii]",
        y_label="worst vertex [levels of 255 off]", log_x=True,
    ))]  # fmt: skip
    title = "Collapsed patch edges"
    return atlas_result("stability/collapsed_edges", title, boundaries, figures, notes, {"lengths": table})


def _teapot() -> str:
    """Quads without area in a small frame of the teapot."""
    scene = load_scene("teapot")
    assert scene.patches is not None  # noqa: S101 - it is made of patches
    matrix = scene.views["default"].matrix(320, 240)
    subpatches, _, _ = bound_and_split(scene.patches.points, matrix, 320, 240, 4, simt_of(MACHINE))
    grids, _, _ = dice(scene.patches.points, subpatches, matrix, 320, 240, simt_of(MACHINE))
    x, y = (grids.vertices[:, :, axis].reshape(-1, 4, 4).astype(np.float64) for axis in (0, 1))
    width, height = ((c[:, 1:, 1:] - c[:, :-1, :-1], c[:, 1:, :-1] - c[:, :-1, 1:]) for c in (x, y))
    area = width[0] * height[1] - width[1] * height[0]
    corners = [[d[:, 1:] == d[:, :-1], d[:, :, 1:] == d[:, :, :-1]] for d in (x, y)]
    pointed = int((corners[0][0] & corners[1][0]).sum() + (corners[0][1] & corners[1][1]).sum())
    return (
        f"The teapot at 320x240: {int((area == 0).sum())} of {area.size} quads have no area, and {pointed} have two"
        " vertices in one place."
    )
