"""Depth planes at grazing angles: how steep a plane may be before its depth at a sample is wrong.

A triangle spans most of the depth range over fewer and fewer pixels. A method that snaps corners keeps their depth, so
a sample's depth is off by the slope times the snap; one that forms its plane from screen coordinates loses last bits.
Compared is the depth of every covered sample with the exact one, in steps of 16 bits.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from tilestamp.experiments.harness.result import Figure, Result
from tilestamp.experiments.stability.boundary import Boundary, atlas_result, bisect, bracket
from tilestamp.experiments.stability.methods import MACHINE, barycentric_cover, draw, plane_edges, quantized
from tilestamp.reports.plots import lines
from tilestamp.simulator.reference.coverage import exact_visibility
from tilestamp.simulator.scenes.scene import Scene

QUESTION = "How steep may a plane be before its depth at a sample is wrong?"
SIZE = 64  # pixels
BASE, TALLEST = 40.0, 48.0  # pixels
SPAN = 0.9  # of the depth range, at most, across a triangle
WRONG = 2.0**-16  # of the depth range: a step of 16 bits
SLOPES = tuple(2.0**k for k in range(-18, 3, 2))  # of the depth range a pixel
TRIANGLES = 4
FINER = 3  # times the resolution keeps every pixel's centre
Depths = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]


def run(progress: Callable[[str], None]) -> Result:
    """Tilt triangles until their depth is a step of 16 bits off."""
    rows, boundaries = [], []
    for name, depths in METHODS.items():
        progress(f"grazing planes: {name}")
        swept = [error(depths, slope) for slope in SLOPES]
        rows += [{"method": name, "slope": slope, "error": e} for slope, e in zip(SLOPES, swept, strict=True)]
        found = boundary(depths, bracket(SLOPES, [e > WRONG for e in swept]))
        snaps = "pixel" in name
        wrong = "depth is more than a step of 16 bits off: " + ("corners snap" if snaps else "planes lose low bits")
        cure = "finer steps" if snaps else "a plane about the triangle's own place"
        cost = _cost_of_finer() if name == COARSE else ""
        boundaries.append(Boundary(name, "slope of depth", "of the range a pixel", *found, wrong, cure, cost))
    table = pd.DataFrame(rows)
    figure = Figure("grazing", partial(
        lines, table[table.error > 0].assign(error=table.error / WRONG), x="slope", y="error", by="method",
        title="Depth of steep planes: largest error at a covered sample",
        x_label="slope of depth [of the depth range a pixel]", y_label="error of depth [steps of 16 bits]", log_x=True,
        log_y=True,
    ))  # fmt: skip
    title = "Depth planes at grazing angles"
    return atlas_result("stability/grazing", title, boundaries, [figure], [_worst(table)], {"error": table})


def triangles(slope: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Corners (T, 3, 2) in pixels and depths (T, 3) of the range, as steep as asked for."""
    rng = np.random.default_rng(9)
    height = min(TALLEST, SPAN / slope)
    angle = rng.random(TRIANGLES) * 2 * np.pi
    along, up = (np.stack([np.cos(a), np.sin(a)], axis=-1)[:, None] for a in (angle, angle + np.pi / 2))
    local = np.array([[-BASE / 2, 0], [BASE / 2, 0], [3.0, height]]) - [0, height / 3]
    middle = SIZE / 2 + rng.random((TRIANGLES, 1, 2))
    points = quantized(middle + local[:, :1] * along + local[:, 1:] * up)
    depths = 0.05 + np.array([0, 0, slope * height]) + np.zeros((TRIANGLES, 1))
    return points, np.round(depths * 2**20) / 2**20


def scene_of(points: NDArray[np.float64], depths: NDArray[np.float64], size: int) -> Scene:
    """One triangle in clip space."""
    positions = np.ones((3, 4))
    positions[:, :2] = points * 2 / size - 1
    positions[:, 2] = 2 * depths - 1
    return Scene.from_clip_space(positions, [[0, 1, 2]])


def error(method: Depths, slope: float) -> float:
    """Largest error of depth at a sample that the method covers, of the depth range."""
    worst = 0.0
    for points, depths in zip(*triangles(slope), strict=True):
        mesh = scene_of(points, depths, SIZE).mesh
        assert mesh is not None  # noqa: S101 - it was made of one
        right = exact_visibility(mesh.positions, mesh.triangles, SIZE, SIZE).depth / 2 + 0.5
        ours = method(points, depths)
        both = np.isfinite(right) & np.isfinite(ours)
        worst = max(worst, float(abs(right - ours)[both].max(initial=0.0)))
    return worst


def boundary(method: Depths, ends: tuple[float, float] = (SLOPES[0], SLOPES[-1])) -> tuple[float | None, float | None]:
    """Slope that holds and slope that breaks."""
    return bisect(lambda slope: error(method, slope) > WRONG, *ends, tolerance=0.1)


def by_pipeline(pipeline: str, base: float, scale: float, finer: int = 1, **options: Any) -> Depths:
    """Depth by a whole pipeline that keeps ``base + scale * z``, z from -1 to 1; of the range, from the top row."""

    def depth(points: NDArray[np.float64], depths: NDArray[np.float64]) -> NDArray[np.float64]:
        scene = scene_of(points * finer, depths, SIZE * finer)
        run = draw(scene, pipeline, SIZE * finer, cull_backfaces=False, **options)
        assert run.triangle_ids is not None  # noqa: S101 - all pipelines of triangles give them
        unit = (run.depth.astype(np.float64) - base) / scale / 2 + 0.5
        shown: NDArray[np.float64] = np.where(run.triangle_ids >= 0, unit, np.nan)[
            finer // 2 :: finer, finer // 2 :: finer
        ]
        return shown

    return depth


def by_barycentrics(points: NDArray[np.float64], depths: NDArray[np.float64]) -> NDArray[np.float64]:
    """Depth as ``tiled`` has it: float32 barycentrics times float32 depths."""
    screen = np.ones((3, 4), np.float32)
    screen[:, :2] = points * [1, -1] + [0, SIZE]
    screen[:, 2] = depths
    count, depth = np.zeros((SIZE, SIZE), np.int64), np.ones((SIZE, SIZE), np.float32)
    barycentric_cover(screen, np.array([[0, 1, 2]], np.int32), count, depth)
    return np.where(count > 0, depth.astype(np.float64), np.nan)


def by_plane(points: NDArray[np.float64], depths: NDArray[np.float64]) -> NDArray[np.float64]:
    """Depth as ``binned`` has it: a float32 plane over the screen, where a sample lies in the triangle."""
    edges = plane_edges(points[None].astype(np.float32))[0]
    z = depths.astype(np.float32)
    plane = (edges[0] * z[0] + edges[1] * z[1] + edges[2] * z[2]) / edges[:, 2].sum(dtype=np.float32)
    centre = np.arange(SIZE, dtype=np.float32) + np.float32(0.5)
    depth = plane[0] * centre[None, :] + plane[1] * centre[::-1, None] + plane[2]
    wide: NDArray[np.float64] = depth.astype(np.float64)
    return wide


COARSE = "cudaraster: corners to 1/16 pixel"
FIXED = 2.0**32 - 256  # a depth of 1 in freepipe's and the hardware's 32 bits
CUDARASTER = (2.0**31, 2147465984.0)  # a depth of 0, and half the depth range
METHODS: dict[str, Depths] = {
    COARSE: by_pipeline("cudaraster", *CUDARASTER),
    "hardware: corners to 1/256 pixel": by_pipeline("hardware", FIXED / 2, FIXED / 2),
    "tiled: float32 barycentrics": by_barycentrics,
    "binned: float32 plane over the screen": by_plane,
}


def _cost_of_finer() -> str:
    """Draw three times finer."""
    _, breaks = boundary(by_pipeline("cudaraster", *CUDARASTER, finer=FINER))
    points, depths = (a[0] for a in triangles(SLOPES[0]))
    plain, fine = (
        draw(scene_of(points * k, depths, SIZE * k), "cudaraster", SIZE * k, cull_backfaces=False).milliseconds
        for k in (1, FINER)
    )
    return (
        f"drawn at {FINER} times the resolution it breaks at {breaks:.2g}, for {fine / plain:.2f} times the modelled"
        f" time: {plain:.4f} to {fine:.4f} ms on the {MACHINE}, {SIZE} x {SIZE} pixels"
    )


def _worst(table: pd.DataFrame) -> str:
    worst = table.groupby("method", sort=False).error.max()
    return (
        "Largest error of depth at a covered sample: "
        + "; ".join(f"{n} {e:.2g} of the range" for n, e in worst.items())
        + "."
    )
