"""Under a guard band: holes where one of two neighbours is clipped and the other is not (Laine & Karras 2011, setup).

CudaRaster 1.1 leaves a triangle whole whose snapped corners span at most 32767 sixteenths of a pixel, and clips any
other at the **borders of the screen**. The corners that clipping makes are rounded to 1/16 pixel, off the line of the
edge that they were cut from; the neighbour keeps the whole edge, and a sample between the two lines is nobody's. The
original's rules are exact (its specification, step 2 and 3 of triangle setup), so the holes are its own. Without the
band both triangles of an edge that leaves the screen are cut, at the same point; a pipe that clips at the band's own
borders (``hardware``) cuts an edge for both of its triangles or for neither.

An edge crosses the screen; the triangle on its left is small, the one on its right reaches far out or before the near
plane. All corners are multiples of 1/16 pixel, and all other edges lie off the screen: whatever is not drawn is a hole.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Result
from tilestamp.experiments.stability.boundary import Boundary, Scale, atlas_result, bisect
from tilestamp.experiments.stability.clipping import PIPELINES, by_pipeline
from tilestamp.experiments.stability.methods import MACHINE, draw
from tilestamp.simulator.scenes.camera import LookAt
from tilestamp.simulator.scenes.scene import Scene

QUESTION = "When does clipping one of two neighbours leave holes between them?"
SIZE = 64  # pixels
SUBPIXELS = 16
EDGES = 16  # shared edges, within 20 degrees of the vertical
HALF_EDGE, SMALL, FAR = 150.0, 200.0, 500.0  # pixels: half an edge, the small triangle, the one before the near plane
VIEWS = 160  # from inside a closed box
COST_SIZE, COST_CUTS, COST_VIEWS = 512, 32, 10
TRIANGLES = np.array([[0, 1, 2], [1, 0, 3]], np.int32)


class Case(NamedTuple):
    """How the large neighbour comes to be clipped."""

    parameter: str
    unit: str
    corner: Callable[[NDArray[np.float64], float], list[float]]  # its far corner: x, y in pixels from the centre, z
    ends: tuple[float, float]
    scale: Scale


def _far_out(edge: NDArray[np.float64], span: float) -> list[float]:
    """Coordinates span so many sub-pixels, x and y taken together as the original takes them."""
    return [edge.min() + span / SUBPIXELS, 0.0, 0.0]


def _before_near(_: NDArray[np.float64], planes: float) -> list[float]:
    return [FAR, 0.0, -planes]


CASES = {
    "far out": Case("span of one of two neighbours", "1/16 pixel", _far_out, (2.0**13, 2.0**20), "integer"),
    "near plane": Case("depth of a corner of one of two neighbours", "near planes", _before_near, (0.5, 2.0), "linear"),
}
METHODS = {
    "cudaraster 1.1": PIPELINES["cudaraster 1.1"],
    "cudaraster of nvdiffrast, guard_band on": by_pipeline("cudaraster", release="nvdiffrast", guard_band=True),
    "cudaraster 1.1, guard_band off": by_pipeline("cudaraster", guard_band=False, cull_backfaces=False),
    "cudaraster of nvdiffrast": PIPELINES["cudaraster of nvdiffrast"],
    **{name: PIPELINES[name] for name in ("freepipe", "hardware", "binned")},
}
CURE = "guard_band=False: clip whatever leaves the screen"
BANDS: dict[str, dict[str, bool]] = {"on": {}, "off": {"guard_band": False}}


def neighbours(case: Case, value: float) -> list[Scene]:
    """Make the pairs of triangles of all edges."""
    scenes = []
    for angle in np.radians(np.linspace(70.0, 110.0, EDGES)):
        along = np.array([np.cos(angle), np.sin(angle)])
        across = np.array([along[1], -along[0]])
        edge = np.round(np.array([-HALF_EDGE * along, HALF_EDGE * along]) * SUBPIXELS) / SUBPIXELS
        small = np.round(-SMALL * across * SUBPIXELS) / SUBPIXELS
        x, y, z = case.corner(edge, value)
        positions = np.array([[*edge[0], 0, 1], [*edge[1], 0, 1], [*small, 0, 1], [x, y, z, 1]])
        positions[:, :2] /= SIZE / 2
        scenes.append(Scene.from_clip_space(positions, TRIANGLES))
    return scenes


def holes(method: str, case: Case, value: float) -> int:
    """Pixels that neither triangle draws, of all edges."""
    return sum(int(np.count_nonzero(~METHODS[method](scene))) for scene in neighbours(case, value))


def boundary(method: str, case: Case) -> tuple[float | None, float | None]:
    """Value that holds, and value that breaks."""
    return bisect(lambda value: holes(method, case, value) > 0, *case.ends, scale=case.scale)


def box(cuts: int) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Vertices and triangles of a closed box, each face cut into squares."""
    across, along = np.meshgrid(np.linspace(-1, 1, cuts + 1), np.linspace(-1, 1, cuts + 1))
    faces = [
        np.roll(np.stack([np.full_like(across, side), across, along], axis=-1), axis, axis=-1).reshape(-1, 3)
        for axis in range(3)
        for side in (-1.0, 1.0)
    ]
    corner = np.arange((cuts + 1) ** 2).reshape(cuts + 1, -1)
    a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, :-1], corner[1:, 1:]
    face = np.stack([a, b, c, c, b, d], axis=-1).reshape(-1, 3)
    triangles = [face + i * corner.size for i in range(len(faces))]
    return np.concatenate(faces), np.concatenate(triangles).astype(np.int32)


def views(count: int, cuts: int, seed: int = 1) -> list[Scene]:
    """Stand at random places inside the box and look in random directions."""
    random, scenes = np.random.default_rng(seed), []
    points, triangles = box(cuts)
    for _ in range(count):
        eye, ahead = random.uniform(-0.9, 0.9, 3), random.normal(size=3)
        up = random.normal(size=3)
        matrix = LookAt(tuple(eye), tuple(eye + ahead), tuple(up), 60.0, 0.01, 10.0).matrix(SIZE, SIZE)
        scenes.append(Scene.from_clip_space(np.c_[points, np.ones(len(points))] @ matrix.T, triangles))
    return scenes


def run(progress: Progress) -> Result:
    """Find where each method begins to leave holes; look around in a closed box."""
    boundaries, cost = [], box_cost()
    for title, case in CASES.items():
        for method in METHODS:
            progress(f"stability/guard_band: {title}, {method}")
            boundaries.append(_row(method, case, cost))
    progress(f"stability/guard_band: {VIEWS} views of a box from inside")
    table = inside_box()
    notes = [
        f"{VIEWS} views of a closed box from inside, {SIZE}x{SIZE} pixels: "
        + "; ".join(f"{row.method}: {row.pixels} holes in {row.views} views" for row in table.itertuples())
        + "."
    ]
    title = "Under a guard band: one neighbour clipped, the other whole"
    return atlas_result("stability/guard_band", title, boundaries, [], notes, {"box": table})


def _row(method: str, case: Case, cost: str) -> Boundary:
    """One row of the atlas; the cure and its cost where something breaks."""
    holds, breaks = boundary(method, case)
    if breaks is None:
        return Boundary(method, case.parameter, case.unit, holds, None, "holes")
    wrong = f"the shared edge has holes: {holes(method, case, breaks)} pixels of {EDGES} edges"
    return Boundary(method, case.parameter, case.unit, holds, breaks, wrong, CURE, cost)


def inside_box() -> pd.DataFrame:
    """Holes of each method: views that have any, and pixels."""
    rows = []
    scenes = views(VIEWS // 2, 1) + views(VIEWS // 2, 2)
    for method, mask in METHODS.items():
        missing = np.array([np.count_nonzero(~mask(scene)) for scene in scenes])
        rows.append({"method": method, "views": int((missing > 0).sum()), "pixels": int(missing.sum())})
    return pd.DataFrame(rows)


def box_cost() -> str:
    """What clipping everything adds to the frame of a finely cut box."""
    total, setup = {}, {}
    scenes = views(COST_VIEWS, COST_CUTS)
    for band, option in BANDS.items():
        runs = [draw(scene, "cudaraster", COST_SIZE, cull_backfaces=False, **option) for scene in scenes]
        total[band] = sum(run.milliseconds for run in runs)
        setup[band] = sum(float(run.stages.loc["triangle_setup", "milliseconds"]) for run in runs)
    return (
        f"setup {100 * (setup['off'] / setup['on'] - 1):+.1f} %, frame {100 * (total['off'] / total['on'] - 1):+.1f} %"
        f" of {total['on'] / COST_VIEWS:.3g} ms, a box of {12 * COST_CUTS**2} triangles from inside, "
        f"{COST_SIZE}x{COST_SIZE} on the {MACHINE}"
    )
