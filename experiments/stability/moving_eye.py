"""Triangles that come nearer while the shutter is open, up to and through the eye: who still draws them.

Corners of interval and interleaved move in straight lines on screen, from where they are projected to at its opening to
where they are at its closing: at the same pace, however the eye comes nearer; and they have no end on screen where they
reach the eye's plane. Corners of stochastic move in homogeneous coordinates. Compared is each sample's triangle with
that by float64 and without bounds, which is that of fractions (``tests/test_stochastic.py``).
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from tilestamp.experiments.harness.result import Figure, Result
from tilestamp.experiments.stability.boundary import Boundary, atlas_result, bisect, bracket
from tilestamp.experiments.stability.methods import machine
from tilestamp.reports.plots import lines
from tilestamp.simulator.simulation import simulate
from tilestamp.simulator.stages.fatahalian2009.motion import MovingMicropolygons, blur_samples, stratified_pattern
from tilestamp.simulator.stages.fatahalian2009.motion_interval import intervals_of, motion_interval
from tilestamp.simulator.stages.stochastic.bounds import visit_tiles
from tilestamp.simulator.stages.stochastic.sample_raster import sample_raster
from tilestamp.simulator.stages.stochastic.tile_lists import MovingLists, moving_lists
from tilestamp.simulator.stages.stochastic.triangles import Lens, moving_triangles

SLOW = True  # with what it needs compiled, more than the first run should take
QUESTION = "How far may a triangle come towards the eye while the shutter is open?"
SIZE, TILE, SPP = 64, 8, 4
TRIANGLES = 24
NEAR, FAR = 0.01, 10.0
WRONG = 0.01  # share of the covered samples from which we say that it breaks
WAYS = (0.01, 0.03, 0.1, 0.3, 0.6, 0.9, 1.0, 1.2, 2.0)  # of the nearest corner's distance
PATTERN = stratified_pattern(SPP, tile=8)
PINHOLE, LENS = Lens(0.0, 1.0), Lens(4.0, 1.5)


class Ends(NamedTuple):
    """Corners (T, 3, 4) in homogeneous pixels at the opening and the closing of the shutter."""

    start: NDArray[np.float32]
    end: NDArray[np.float32]


def approaching(way: float) -> Ends:
    """Triangles at distances of 1 to 2 that all come nearer by ``way``."""
    rng = np.random.default_rng(4)
    places = np.concatenate([rng.uniform(-1, 1, (TRIANGLES, 1, 2)) + rng.uniform(-0.5, 0.5, (TRIANGLES, 3, 2)),
                             rng.uniform(1, 2, (TRIANGLES, 3, 1))], axis=-1)  # fmt: skip
    return Ends(_homogeneous(places), _homogeneous(places - [0, 0, way]))


def _homogeneous(places: NDArray[np.float64]) -> NDArray[np.float32]:
    w = places[..., 2:]
    z = (w * (FAR + NEAR) - 2 * FAR * NEAR) / (FAR - NEAR)
    return np.concatenate([SIZE / 2 * (w + places[..., :2]), z, w], axis=-1).astype(np.float32)


def seen(ends: Ends, lens: Lens, *, exact: bool) -> NDArray[np.int32]:
    """Triangle of each sample by stochastic: in float32 with bounds, or in float64 without any."""
    triangles = moving_triangles(*ends, lens, double=exact)
    tiles = (SIZE // TILE) ** 2
    every = np.tile(np.arange(TRIANGLES, dtype=np.int32), tiles)
    lists = MovingLists(np.arange(tiles + 1) * TRIANGLES, every, np.full(len(every), (1 << SPP) - 1))
    if not exact:
        visits = visit_tiles(triangles, intervals_of(PATTERN), SPP, SIZE, SIZE, TILE)
        lists = moving_lists(visits, tiles, machine().simt).outputs
    samples = blur_samples(SIZE, SIZE, PATTERN)
    return sample_raster(triangles, lists, PATTERN, samples, machine().simt, tile=TILE).outputs.polygon


def seen_on_screen(ends: Ends, lens: Lens) -> NDArray[np.int32]:
    """Triangle of each sample by interval; what has no end on screen is left out."""
    w = np.stack([ends.start[..., 3], ends.end[..., 3]])
    drawn = np.flatnonzero((w > NEAR).all(axis=(0, 2)))
    places = [corners[drawn, :, :3] / corners[drawn, :, 3:] for corners in ends]
    blur = lens.aperture * np.abs(1 - lens.focus / ends.start[drawn, :, 3])
    moving = MovingMicropolygons(places[0], places[1], blur.astype(np.float32))
    samples = blur_samples(SIZE, SIZE, PATTERN)
    polygon = motion_interval(moving, PATTERN, samples, machine().simt).outputs.polygon
    return np.where(polygon >= 0, np.append(drawn, -1)[polygon], -1).astype(np.int32)


METHODS: dict[str, tuple[Lens, Callable[[Ends, Lens], NDArray[np.int32]]]] = {
    "interval: straight lines on screen": (PINHOLE, seen_on_screen),
    "stochastic: homogeneous corners, float32": (PINHOLE, lambda ends, lens: seen(ends, lens, exact=False)),
    "stochastic: the same through a lens": (LENS, lambda ends, lens: seen(ends, lens, exact=False)),
}


def wrong(name: str, way: float) -> float:
    """Samples that see another triangle than the exact one, of those that see any."""
    lens, method = METHODS[name]
    ends = approaching(way)
    right = seen(ends, lens, exact=True)
    return float((method(ends, lens) != right).sum() / (right >= 0).sum())


def run(progress: Callable[[str], None]) -> Result:
    """Come nearer by each method; bisect."""
    rows, boundaries = [], []
    for name in METHODS:
        progress(f"towards the eye: {name}")
        swept = [wrong(name, way) for way in WAYS]
        rows += [{"method": name, "way": way, "wrong": share} for way, share in zip(WAYS, swept, strict=True)]
        found = boundary(name, bracket(WAYS, [share > WRONG for share in swept]))
        words = f"more than {WRONG:.0%} of the covered samples see another triangle: pace on screen is not even"
        cure = "corners that move in homogeneous coordinates"
        cost = _cost() if found[1] else ""
        boundaries.append(Boundary(name, "way", "of the nearest corner's distance", *found, words, cure, cost))
    table = pd.DataFrame(rows)
    figure = Figure(
        "moving_eye",
        lambda path: lines(
            table.assign(wrong=100 * table.wrong), path, x="way", y="wrong", by="method",
            title="Triangles that come nearer: samples that see another triangle",
            x_label="way while the shutter is open [of the nearest corner's distance]", y_label="samples [%]",
            log_x=True,
        ),
    )  # fmt: skip
    worst = table.groupby("method", sort=False).wrong.max()
    note = "Most samples wrong: " + ", ".join(f"{name} {100 * share:.2g} %" for name, share in worst.items()) + "."
    title = "Triangles that come towards the eye while the shutter is open"
    return atlas_result("stability/moving_eye", title, boundaries, [figure], [note], {"wrong": table})


def boundary(name: str, ends: tuple[float, float] = (WAYS[0], WAYS[-1])) -> tuple[float | None, float | None]:
    """Way that holds, and way that breaks."""
    return bisect(lambda way: wrong(name, way) > WRONG, *ends, tolerance=0.05)


def _cost() -> str:
    """Time of both pipelines for a frame that moves on screen alone."""
    frame: dict[str, Any] = {
        "machine": machine().name,
        "width": 128,
        "height": 96,
        "edge": 8.0,
        "triangles": True,
        "lens": 0.0,
    }
    plain, cure = (simulate("teapot", pipeline, **frame).milliseconds for pipeline in ("interval", "stochastic"))
    return (
        f"teapot 128x96, polygons of 8 pixels, on the {frame['machine']}: {cure / plain:.2g} times the interval's time"
    )
