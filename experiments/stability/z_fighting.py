"""Z-fighting by depth format: how far apart two walls must be, at each distance, for the nearer one to show.

Two parallel walls, a little turned, fill the screen at a distance and just behind it. The nearer one must win every
pixel, whichever is drawn first.
"""

from collections.abc import Callable
from functools import partial

import numpy as np
import pandas as pd

from tilestamp.experiments.harness.result import Figure, Result
from tilestamp.experiments.stability.boundary import Boundary, atlas_result, bisect
from tilestamp.experiments.stability.methods import MACHINE, draw
from tilestamp.reports.plots import lines
from tilestamp.simulator.run import Run
from tilestamp.simulator.scenes import LookAt, Scene
from tilestamp.simulator.scenes.scene import Mesh

QUESTION = "How far apart must two walls be for the nearer one to show?"
SIZE = 32  # pixels
NEAR, FAR = 0.1, 1000.0  # planes, in world units
FARTHER_NEAR = 1.0
DISTANCES = (1.0, 5.0, 25.0, 100.0, 400.0)  # world units
TOLD = 100.0  # distance of the rows of the atlas
TURN = 0.3  # depth a unit across
WRONG = 0.01  # share of the pixels from which we say that it breaks
FORMATS: dict[str, tuple[str, dict[str, str]]] = {
    "hardware, 16 bits": ("hardware", {"depth_format": "fixed16"}),
    "hardware, 24 bits": ("hardware", {"depth_format": "fixed24"}),
    "hardware, 32 bits": ("hardware", {"depth_format": "fixed32"}),
    "hardware, float32": ("hardware", {"depth_format": "float32"}),
    "cudaraster, 32 bits, integer planes": ("cudaraster", {}),
}


def run(progress: Callable[[str], None]) -> Result:
    """Bisect the separation for each format and distance."""
    rows = []
    for name in FORMATS:
        progress(f"z-fighting: {name}")
        for distance in DISTANCES:
            holds, breaks = boundary(name, distance)
            rows.append({"format": name, "distance": distance, "holds": holds, "breaks": breaks})
    table = pd.DataFrame(rows)
    told = table[table.distance == TOLD]
    boundaries = [_row(row.format, row.holds, row.breaks) for row in told.itertuples()]
    figure = Figure("separation", partial(
        lines, table, x="distance", y="breaks", by="format",
        title=f"Walls closer than this fight (near {NEAR:g}, far {FAR:g})", x_label="distance [world units]",
        y_label="separation [world units]", log_x=True, log_y=True,
    ))  # fmt: skip
    title = f"Z-fighting by depth format, near {NEAR:g}, far {FAR:g}"
    return atlas_result("stability/z_fighting", title, boundaries, [figure], _notes(table), {"separation": table})


def walls(distance: float, separation: float, *, nearer_first: bool) -> Scene:
    """Two walls, the nearer one triangles 0 and 1 or 2 and 3."""
    reach = 0.8 * distance
    corners = np.array([[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]]) * reach
    depths = (distance, distance + separation) if nearer_first else (distance + separation, distance)
    positions = np.ones((8, 4))
    for k, depth in enumerate(depths):
        positions[4 * k : 4 * k + 4, :2] = corners
        positions[4 * k : 4 * k + 4, 2] = -(depth + TURN * corners[:, 0])
    pair = np.array([[0, 1, 2], [2, 1, 3]], np.int32)
    return Scene("walls", mesh=Mesh(positions.astype(np.float32), np.concatenate([pair, pair + 4])))


def _run(name: str, distance: float, separation: float, near: float, *, nearer_first: bool) -> Run:
    pipeline, options = FORMATS[name]
    camera = LookAt((0, 0, 0), (0, 0, -1), near=near, far=FAR)
    return draw(walls(distance, separation, nearer_first=nearer_first), pipeline, SIZE, camera, **options)


def wrong(name: str, distance: float, separation: float, near: float = NEAR) -> float:
    """Share of the pixels that show the farther wall, or nothing, in the worse order."""
    shares = []
    for nearer_first in (True, False):
        ids = _run(name, distance, separation, near, nearer_first=nearer_first).triangle_ids
        assert ids is not None  # noqa: S101 - all pipelines of triangles give them
        shares.append(float((ids // 2 != (0 if nearer_first else 1)).mean()))
    return max(shares)


def boundary(name: str, distance: float, near: float = NEAR) -> tuple[float | None, float | None]:
    """Separation that keeps the walls apart and separation that does not."""
    return bisect(lambda s: wrong(name, distance, s, near) > WRONG, 0.5 * distance, 2e-8 * distance, tolerance=0.2)


def _row(name: str, holds: float | None, breaks: float | None) -> Boundary:
    parameter = f"separation at distance {TOLD:g}"
    cure = f"a near plane at {FARTHER_NEAR:g} instead of {NEAR:g}"
    return Boundary(name, parameter, "world units", holds, breaks, "the farther wall shows", cure, _gain(name))


def _gain(name: str) -> str:
    _, breaks = boundary(name, TOLD, FARTHER_NEAR)
    return f"the separation then is {breaks:.2g}; what is nearer than {FARTHER_NEAR:g} is cut off"


def _notes(table: pd.DataFrame) -> list[str]:
    """Which formats differ, and what a format costs."""
    at = table[table.distance == TOLD].set_index("format").breaks
    more = at["hardware, 24 bits"] / at["hardware, 32 bits"], at["hardware, 24 bits"] / at["hardware, float32"]
    differ = (
        f"At distance {TOLD:g}, walls in 32 bits of fixed point must be {1 / more[0]:.2g} times as far apart as in 24"
        f" bits, in float32 {1 / more[1]:.2g} times: vertices and planes are float32, whatever depth is stored in."
    )
    narrow, wide = (_run(f"hardware, {bits} bits", TOLD, 1.0, NEAR, nearer_first=False) for bits in (16, 32))
    costs = (
        f"Depth traffic of the two walls, {SIZE} x {SIZE} pixels: {_depth_bytes(narrow)} bytes in 16 bits,"
        f" {_depth_bytes(wide)} in 24 (with stencil), 32 and float32; the frame takes {narrow.milliseconds:.4f} and"
        f" {wide.milliseconds:.4f} ms on the {MACHINE}."
    )
    return [differ, costs]


def _depth_bytes(run: Run) -> int:
    return sum(int(stream.bytes) for work in run.frame.works for stream in work.streams if stream.buffer == "depth")
