"""Larger than the screen, at the eye, before the near plane: who clips, who drops, who breaks.

Each case is a parallelogram of two triangles in clip space, compared sample by sample with exact visibility, which
needs no clipping at all.
"""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from tilestamp.experiments.harness.result import Figure, Result
from tilestamp.experiments.stability.boundary import Boundary, Scale, atlas_result, bisect, bracket
from tilestamp.experiments.stability.methods import MACHINE, barycentric_cover, draw, machine, plane_cover, stamp_cover
from tilestamp.reports.maps import value_maps
from tilestamp.simulator.reference.coverage import exact_visibility
from tilestamp.simulator.run import Run
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.scenes.textured_mesh import geometry
from tilestamp.simulator.stages.fatahalian2009.micropolygon_cover import new_setup
from tilestamp.simulator.stages.fatahalian2009.micropolygons import from_mesh
from tilestamp.simulator.stages.ru2016.vertex_shading import primitive_assembly, vertex_shading
from tilestamp.simulator.stages.zhang2025.clip_polygon import MOST_VERTICES, clip_polygon, outcode

QUESTION = "What becomes of triangles that are larger than the screen, or reach the eye or the near plane?"
SIZE = 64  # pixels
WRONG = 0.01  # share of the screen from which we say that it breaks
BRIGHTEST = 0.1  # share of wrong pixels in the map
TURN = np.radians(25.0)
TWO_TRIANGLES = np.array([[0, 1, 2], [2, 1, 3]], np.int32)
Corners = NDArray[np.float64]  # (4, 4) clip positions of (0, 0), (1, 0), (0, 1), (1, 1)


class Case(NamedTuple):
    """A way to leave the comfortable part of clip space, by one number."""

    parameter: str
    unit: str
    steps: tuple[float, ...]  # gentle to hard
    scale: Scale
    shapes: Callable[[float], list[Corners]]
    words: tuple[tuple[str, str], ...]  # what goes wrong and its cure: with clipping, in tiled, in stamps


def run(progress: Callable[[str], None]) -> Result:
    """Push each case by each pipeline until it breaks."""
    rows, boundaries, costs = [], [], _clipping_costs()
    for title, case in CASES.items():
        progress(f"clipping: {title}")
        for name in PIPELINES:
            swept = [wrong(name, case, value) for value in case.steps]
            rows += [
                {"case": title, "pipeline": name, "value": value, "wrong": share}
                for value, share in zip(case.steps, swept, strict=True)
            ]
            found = boundary(name, case, bracket(case.steps, [share > WRONG for share in swept]))
            wrong_words, cure = case.words[WITHOUT_CLIPPING.get(name, 0)]
            cost = costs[0].rstrip(".") if cure == CLIP else ""
            boundaries.append(Boundary(name, f"{title}: {case.parameter}", case.unit, *found, wrong_words, cure, cost))
    table = pd.DataFrame(rows)
    figure = Figure("clipping", lambda path: _plot(table, path))
    title = "Larger than the screen, at the eye, before the near plane"
    return atlas_result("stability/clipping", title, boundaries, [figure], costs, {"wrong": table})


def _parallelogram(origin: ArrayLike, across: ArrayLike, along: ArrayLike) -> Corners:
    o, a, b = (np.asarray(v, np.float64) for v in (origin, across, along))
    return np.stack([o, o + a, o + b, o + a + b])


def _large(screens: float) -> list[Corners]:
    """A square of so many screens a side, turned: an outer edge across the middle, then the seam across it."""
    a = 2 * screens * np.array([np.cos(TURN), np.sin(TURN), 0, 0])
    b = 2 * screens * np.array([-np.sin(TURN), np.cos(TURN), 0, 0])
    middle = np.array([0.013, 0.007, 0, 1])
    return [_parallelogram(middle - a / 2, a, b), _parallelogram(middle - a / 2 - b / 2, a, b)]


def _floor(w: float) -> list[Corners]:
    """A floor that runs from depth 4 towards the eye until ``w``, or past it."""
    return [_parallelogram([-2, -1, 0, w], [4, 0, 0, 0], [0, 3, 0, 4 - w])]


def _near(z: float) -> list[Corners]:
    """A wall that leans towards the eye, its lower edge at ``z`` where the near plane is at -1."""
    return [_parallelogram([-0.9, -0.9, -z, 1], [1.8, 0.1, 0, 0], [0.1, 1.8, z + 0.5, 0])]


CLIP = "clipping"
ROUNDED = "edges move: the corners that clipping makes are rounded", "a mesh cut finer"
UNCLIPPED = "edges move: float32 differences of far corners", CLIP
DROPPED = "the triangle is dropped whole", CLIP
DRAWN = "what lies before the near plane is drawn", "a test of depth against it, sample by sample"
WITHOUT_CLIPPING = {"tiled, per-primitive": 1, "stamps": 2}
CASES = {
    "larger than the screen": Case(
        "side", "screens", tuple(4.0**k for k in range(13)), "log", _large, (ROUNDED, UNCLIPPED, DROPPED)
    ),
    "towards the eye's plane": Case(
        "nearest w", "", tuple(4.0**-k for k in range(13)), "log", _floor, (ROUNDED, UNCLIPPED, DROPPED)
    ),
    "behind the eye": Case(
        "w behind it", "", (-0.5, *(4.0**k for k in range(-2, 9))), "linear", lambda w: _floor(-w),
        (ROUNDED, DROPPED, DROPPED)
    ),
    "before the near plane": Case(
        "depth", "near planes", tuple(0.25 * k for k in range(13)), "linear", _near,
        (ROUNDED, DRAWN, DRAWN),
    ),
}  # fmt: skip


def by_pipeline(pipeline: str, **options: Any) -> Callable[[Scene], NDArray[np.bool_]]:
    """Pixels that a whole pipeline draws."""

    def mask(scene: Scene) -> NDArray[np.bool_]:
        ids = draw(scene, pipeline, SIZE, **options).triangle_ids
        assert ids is not None  # noqa: S101 - all pipelines of triangles give them
        return ids >= 0

    return mask


def as_tiled(scene: Scene) -> NDArray[np.bool_]:
    """Pixels of ``tiled`` and ``per-primitive``: no clipping; what has a corner behind the eye is dropped."""
    mesh, simt = geometry(scene), machine().simt
    vertices, _, _ = vertex_shading(mesh, np.eye(4), SIZE, SIZE, simt)
    drawable, _, _ = primitive_assembly(mesh, vertices, simt)
    count = np.zeros((SIZE, SIZE), np.int64)
    barycentric_cover(vertices.screen, mesh.triangles[drawable], count, np.ones((SIZE, SIZE), np.float32))
    return count > 0


def as_binned(scene: Scene) -> NDArray[np.bool_]:
    """Pixels of ``binned``: whole vertices clipped by six planes in float32, then planes over the screen."""
    assert scene.mesh is not None  # noqa: S101 - it was made of one
    pieces = []
    for triangle in scene.mesh.positions[scene.mesh.triangles]:
        polygon = np.zeros((MOST_VERTICES, 4), np.float32)
        polygon[:3] = triangle
        a, b, c = (outcode(v) for v in triangle)
        count = 0 if a & b & c else 3
        if count and a | b | c:
            count = clip_polygon.py_func(polygon, np.empty_like(polygon), 3)  # compiled, it takes ten seconds
        half = np.float32(0.5)
        screen = (polygon[:count, :2] / polygon[:count, 3:] + np.float32(1)) * half * np.float32(SIZE)
        pieces += [screen[[0, j, j + 1]] for j in range(1, count - 1)]
    if not pieces:
        return np.zeros((SIZE, SIZE), bool)
    return plane_cover(np.stack(pieces), SIZE).mask[::-1]


def as_stamps(scene: Scene) -> NDArray[np.bool_]:
    """Pixels of ``stamps``: double precision and no clipping; what reaches the eye or far off the screen is dropped."""
    assert scene.mesh is not None  # noqa: S101 - it was made of one
    count = np.zeros((SIZE, SIZE), np.int64)
    stamp_cover(from_mesh(scene.mesh, np.eye(4), SIZE, SIZE).vertices, *new_setup(), count)
    return count > 0


PIPELINES: dict[str, Callable[[Scene], NDArray[np.bool_]]] = {
    "cudaraster 1.1": by_pipeline("cudaraster", cull_backfaces=False),
    "cudaraster of nvdiffrast": by_pipeline("cudaraster", release="nvdiffrast"),
    "freepipe": by_pipeline("freepipe", counting=False),
    "hardware": by_pipeline("hardware", cull_backfaces=False),
    "tiled, per-primitive": as_tiled,
    "binned": as_binned,
    "stamps": as_stamps,
}


def wrong(name: str, case: Case, value: float) -> float:
    """Share of the screen's pixels that are not what exact visibility says, the worst of the case's shapes."""
    shares = []
    for corners in case.shapes(value):
        scene = Scene.from_clip_space(corners, TWO_TRIANGLES)
        assert scene.mesh is not None  # noqa: S101 - it was made of one
        right = exact_visibility(scene.mesh.positions, TWO_TRIANGLES, SIZE, SIZE).hits > 0
        shares.append(float((PIPELINES[name](scene) != right).mean()))
    return max(shares)


def boundary(name: str, case: Case, ends: tuple[float, float]) -> tuple[float | None, float | None]:
    """Value that holds and value that breaks."""
    tolerance = 0.05 if case.scale == "log" else 0.001
    return bisect(lambda value: wrong(name, case, value) > WRONG, *ends, scale=case.scale, tolerance=tolerance)


def clips(release: str, screens: float) -> bool:
    """Whether cudaraster's setup clips a square of so many screens."""
    return _large_run(release, screens).counts["triangle_setup.CLIP_LANES"] > 0


def _large_run(release: str, screens: float) -> Run:
    scene = Scene.from_clip_space(_large(screens)[0], TWO_TRIANGLES)
    return draw(scene, "cudaraster", SIZE, release=release, cull_backfaces=False)


def _clipping_costs() -> list[str]:
    """From where cudaraster clips, and what that adds to its setup."""
    notes = []
    for release in ("1.1", "nvdiffrast"):
        within, beyond = bisect(partial(clips, release), 0.25, 4096.0, tolerance=0.01)
        if within is None or beyond is None:
            continue
        before, after = (
            float(_large_run(release, value).stages.loc["triangle_setup", "milliseconds"]) for value in (within, beyond)
        )
        notes.append(
            f"cudaraster, release {release}, clips a square from {beyond:.3g} screens a side ({SIZE} x {SIZE} pixels);"
            f" its setup of two triangles takes {before:.5f} ms just below and {after:.5f} ms there on the {MACHINE}."
        )
    return notes


def _plot(table: pd.DataFrame, path: Path) -> None:
    """Draw a map a case: value by pipeline."""
    maps = {}
    for title, group in table.groupby("case", sort=False):
        case = CASES[str(title)]
        grid = group.pivot_table(index="pipeline", columns="value", values="wrong", sort=False)
        grid.columns = pd.Index([f"{value:.3g}" for value in grid.columns])
        maps[f"{title}: {case.parameter} {case.unit and f'[{case.unit}]'}"] = grid
    title, unit = "Who clips, who drops, who breaks", "wrong pixels / pixels"
    value_maps(maps, path, title=title, unit=unit, x_label="", y_label="", top=BRIGHTEST)
