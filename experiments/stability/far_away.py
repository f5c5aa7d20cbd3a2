"""Coordinates far from the origin: how far a model and its camera can move together before the picture changes.

The same sphere before the same camera, both moved by the same distance. World coordinates in float32 lose their low
bits, and a float32 matrix loses them again where the eye's place cancels against the vertex's.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from tilestamp.experiments.harness.result import Figure, Result
from tilestamp.experiments.stability.boundary import Boundary, atlas_result, bisect, bracket
from tilestamp.experiments.stability.methods import MACHINE, draw
from tilestamp.reports.plots import lines
from tilestamp.simulator.reference.coverage import exact_coverage
from tilestamp.simulator.scenes import LookAt, Scene
from tilestamp.simulator.scenes.scene import Mesh, Patches
from tilestamp.simulator.stages.fatahalian2009.micropolygons import from_mesh

QUESTION = "How far from the origin may a model be before its picture changes?"
SIZE = 64  # pixels
AROUND, DOWN = 24, 12  # quads of the sphere
WRONG = 0.01  # share of the drawn pixels from which we say that it breaks
DISTANCES = tuple(4.0**k for k in range(14))  # in radii of the sphere
SAME = 0.5  # largest difference of a pixel that counts as none
DEPTHS = (0.64, 0.83)  # of the patch
EYE = np.array([1.5, 1.0, 2.5])  # from the sphere's centre, in radii
AWAY = np.array([1.0, 0.6, 0.3])  # direction of the move
WORDS = f"more than {WRONG:.0%} of the pixels change: positions lose their low bits"
CURE = "coordinates of the model's own, and a matrix put together in double precision"
Picture = Callable[[float], NDArray[Any]]


def run(progress: Callable[[str], None]) -> Result:
    """Move the scene away for each way to transform it; bisect."""
    rows, boundaries = [], []
    for name in PICTURES:
        progress(f"far from the origin: {name}")
        swept = [wrong(name, distance) for distance in DISTANCES]
        rows += [{"method": name, "distance": d, "wrong": w} for d, w in zip(DISTANCES, swept, strict=True)]
        found = boundary(name, bracket(DISTANCES, [w > WRONG for w in swept]))
        boundaries.append(Boundary(name, "distance", "radii", *found, WORDS, CURE))
    boundaries[0] = replace(boundaries[0], cost=_cost())
    table = pd.DataFrame(rows)
    figure = Figure("far", partial(
        lines, table.assign(wrong=100 * table.wrong), x="distance", y="wrong", by="method",
        title="Pixels that change when model and camera move away together",
        x_label="distance from the origin [radii of the model]", y_label="pixels that change [%]", log_x=True,
    ))  # fmt: skip
    at = table[(table.wrong > 0) & (table.distance > 0)].groupby("method", sort=False).distance.min()
    note = (
        "The first distance tried with a wrong pixel: " + ", ".join(f"{n} {d:,.0f} radii" for n, d in at.items()) + "."
    )
    title = "Coordinates far from the origin"
    return atlas_result("stability/far_away", title, boundaries, [figure], [note], {"wrong": table})


def camera(distance: float) -> LookAt:
    """Look at the sphere from the same side, wherever it is."""
    moved = distance * AWAY
    return LookAt(tuple(moved + EYE), tuple(moved), near=0.5, far=10.0)


def sphere(distance: float) -> Scene:
    """Make the sphere, its world coordinates rounded to float32 as a mesh stores them."""
    u, v = np.arange(AROUND) / AROUND * 2 * np.pi, (np.arange(DOWN + 1) / DOWN - 0.5) * np.pi
    at = np.stack(
        [np.outer(np.cos(v), np.cos(u)), np.outer(np.sin(v), np.ones(AROUND)), np.outer(np.cos(v), np.sin(u))], axis=-1
    )
    positions = np.ones((at.size // 3, 4), np.float32)
    positions[:, :3] = at.reshape(-1, 3) + distance * AWAY
    row, column = np.meshgrid(np.arange(DOWN), np.arange(AROUND), indexing="ij")
    a, b = row * AROUND + column, row * AROUND + (column + 1) % AROUND
    c, d = a + AROUND, b + AROUND
    pairs = np.stack([np.stack([a, c, b], axis=-1), np.stack([b, c, d], axis=-1)], axis=2)
    return Scene("sphere", mesh=Mesh(positions, pairs.reshape(-1, 3).astype(np.int32)))


def _by_pipeline(pipeline: str) -> Picture:
    """Triangle ids of a pipeline that transforms in float32."""

    def picture(distance: float) -> NDArray[Any]:
        run = draw(sphere(distance), pipeline, SIZE, camera(distance), cull_backfaces=False)
        assert run.triangle_ids is not None  # noqa: S101 - all pipelines of triangles give them
        return run.triangle_ids

    return picture


def _in_double(distance: float) -> NDArray[Any]:
    """Triangle ids where float32 world coordinates go through a double-precision matrix, as in ``stamps``."""
    mesh = sphere(distance).mesh
    assert mesh is not None  # noqa: S101 - a sphere is one
    polygons = from_mesh(mesh, camera(distance).matrix(SIZE, SIZE), SIZE, SIZE)
    corners = polygons.vertices.astype(np.float64)
    return exact_coverage(corners[..., :2], SIZE, SIZE, depths=2 * corners[..., 2] - 1).ids


def _patch(distance: float) -> NDArray[Any]:
    """Depth of a curved patch in hundredths of its range, twice over: a micropolygon picture has no ids."""
    row, column = np.divmod(np.arange(16), 4)
    hill = np.isin(np.arange(16), (5, 6, 9, 10))
    points = np.ones((1, 16, 4), np.float32)
    points[0, :, :3] = np.stack([column / 1.5 - 1, row / 1.5 - 1, 1.5 * hill], axis=-1) + distance * AWAY
    depth = draw(Scene("hill", patches=Patches(points)), "micropolygon", SIZE, camera(distance)).depth
    low, high = DEPTHS
    shown: NDArray[Any] = np.where(depth < 1, 50 * (depth - low) / (high - low), -100)
    return shown


def own_matrix(distance: float) -> NDArray[np.float64]:
    """Give the matrix from the sphere's own coordinates to the clip space of the camera far away."""
    move = np.eye(4)
    move[:3, 3] = distance * AWAY
    return camera(distance).matrix(SIZE, SIZE) @ move


def centred(distance: float) -> NDArray[Any]:
    """Draw the cure: the sphere in its own coordinates, and a matrix that is put together in double precision."""
    run = draw(sphere(0.0), "cudaraster", SIZE, own_matrix(distance), cull_backfaces=False)
    assert run.triangle_ids is not None  # noqa: S101 - all pipelines of triangles give them
    return run.triangle_ids


PICTURES: dict[str, Picture] = {
    "cudaraster: float32 world and matrix": _by_pipeline("cudaraster"),
    "hardware: float32 world and matrix": _by_pipeline("hardware"),
    "micropolygon: float32 world and matrix": _patch,
    "stamps: float32 world, double matrix": _in_double,
    "cudaraster: own coordinates, matrix from doubles": centred,
}


@cache
def _at_origin(name: str) -> NDArray[Any]:
    return PICTURES[name](0.0)


def wrong(name: str, distance: float) -> float:
    """Share of the drawn pixels that differ from the picture at the origin."""
    right, ours = _at_origin(name), PICTURES[name](distance)
    drawn = (right >= 0) | (ours >= 0)
    return float(((abs(right - ours) > SAME) & drawn).sum() / drawn.sum())


def boundary(name: str, ends: tuple[float, float] = (DISTANCES[0], DISTANCES[-1])) -> tuple[float | None, float | None]:
    """Distance that holds and distance that breaks."""
    return bisect(lambda distance: wrong(name, distance) > WRONG, *ends, tolerance=0.05)


def _cost(distance: float = DISTANCES[-1]) -> str:
    """Price the cure: the same kernels, another matrix."""
    world = draw(sphere(distance), "cudaraster", SIZE, camera(distance)).milliseconds
    own = draw(sphere(0.0), "cudaraster", SIZE, camera(0.0)).milliseconds
    near = draw(sphere(0.0), "cudaraster", SIZE, own_matrix(distance)).milliseconds
    return (
        f"{near:.4f} ms on the {MACHINE}, as at the origin ({own:.4f} ms); uncured, {world:.4f} ms for a wrong picture"
    )
