"""Slivers by aspect ratio and orientation: from which length : width coverage differs from the exact one.

Thin isosceles triangles, 12 angles by 12 places, each laid so that a sample lies in it at a random place; wrong are
samples lost and samples gained, as a share of the samples that are exactly covered.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from tilestamp.experiments.harness.result import Figure, Result
from tilestamp.experiments.stability.boundary import Boundary, atlas_result, bisect, bracket
from tilestamp.experiments.stability.methods import (
    MACHINE,
    METHODS,
    STEPS,
    Cover,
    Method,
    draw,
    exact,
    flat_scene,
    quantized,
)
from tilestamp.reports.maps import value_maps

QUESTION = "From which length : width on do slivers lose their samples?"
ANGLES = 12  # from 0 to 90 degrees
PLACES = 12
CELL = 16  # pixels: no sliver touches another's
SIZE = 256  # pixels, a power of two, so that clip coordinates are exact; the rows above the cells stay empty
LENGTH = 12.0  # pixels
ASPECTS = tuple(4.0**k for k in range(9))
WRONG = 0.25  # share of the samples from which we say that it breaks
COARSE = next(iter(METHODS))
FINER = 3  # times the resolution keeps every pixel's centre


def run(progress: Callable[[str], None]) -> Result:
    """Sweep all methods, then bisect each."""
    rows, boundaries = [], []
    for name, method in METHODS.items():
        progress(f"slivers: {name}")
        swept = [by_angle(method, aspect) for aspect in ASPECTS]
        rows += [
            {"method": name, "aspect": aspect, "angle": 90.0 * k / ANGLES, "wrong": wrong}
            for aspect, by in zip(ASPECTS, swept, strict=True)
            for k, wrong in enumerate(by)
        ]
        ends = bracket(ASPECTS, [float(by.mean()) > WRONG for by in swept])
        boundaries.append(Boundary(name, "length : width", "", *boundary(method, ends), *_words(name)))
    progress("slivers: drawn finer")
    boundaries[0] = replace(boundaries[0], cost=_cost_of_finer())
    table = pd.DataFrame(rows)
    end = f"Given coordinates are multiples of 1/{STEPS} pixel, the width of a sliver of {LENGTH * STEPS:,.0f} : 1."
    notes = [_first_difference(table), _orientation(table), end]
    figure = Figure("slivers", lambda path: _plot(table, path))
    return atlas_result("stability/slivers", "Slivers", boundaries, [figure], notes, {"wrong": table})


def slivers(aspect: float) -> NDArray[np.float64]:
    """Corners (144, 3, 2) in pixels: a row of cells for each angle."""
    rng = np.random.default_rng(7)
    angle = np.pi / 2 * np.repeat(np.arange(ANGLES), PLACES) / ANGLES
    along = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    across = np.stack([-along[:, 1], along[:, 0]], axis=-1)
    width = LENGTH / aspect
    local = np.array([[0.0, -width / 2], [0.0, width / 2], [LENGTH, 0.0]])  # along, across
    weights = rng.dirichlet((1, 1, 1), len(angle))
    corners = local[:, :1] * along[:, None] + local[:, 1:] * across[:, None]
    row, column = np.divmod(np.arange(len(angle)), PLACES)
    sample = np.stack([column, row], axis=-1) * CELL + CELL // 2 + 0.5
    return quantized(corners + (sample - (weights[:, None] @ corners)[:, 0])[:, None])


def by_angle(method: Method, aspect: float) -> NDArray[np.float64]:
    """Wrong samples by right ones, for each angle."""
    right, ours = _exact(aspect), method(slivers(aspect), SIZE).mask
    wrong, covered = (m[: CELL * ANGLES].reshape(ANGLES, -1).sum(axis=1) for m in (right != ours, right))
    share: NDArray[np.float64] = wrong / np.maximum(covered, 1)
    return share


@cache
def _exact(aspect: float) -> NDArray[np.bool_]:
    """Remember what is right: every method is compared with it."""
    return exact(slivers(aspect), SIZE).mask


def boundary(
    method: Method, ends: tuple[float, float] = (ASPECTS[0], ASPECTS[-1])
) -> tuple[float | None, float | None]:
    """Aspect that holds and aspect that breaks."""
    return bisect(lambda aspect: float(by_angle(method, aspect).mean()) > WRONG, *ends, tolerance=0.05)


def _words(name: str) -> tuple[str, str]:
    """Say what goes wrong and what mends it."""
    wrong = f"more than {WRONG:.0%} of the samples are wrong"
    if "pixel" in name:
        return f"{wrong}: corners snap, narrow slivers vanish", "finer steps"
    return (
        f"{wrong}: edges lose their last bits",
        "edges from differences, as tiled has them" if "planes" in name else "",
    )


def _first_difference(table: pd.DataFrame) -> str:
    """At which aspect of the sweep each method first differs at all."""
    differs = table[table.wrong > 0].groupby("method", sort=False).aspect.min()
    texts = [f"{name} from {differs[name]:g} : 1" if name in differs else f"{name} never" for name in METHODS]
    return f"A single wrong sample ({ANGLES * PLACES} slivers an aspect): {'; '.join(texts)}."


def _orientation(table: pd.DataFrame) -> str:
    """Which angles are worst."""
    worst = table.groupby(["method", "angle"], sort=False).wrong.mean()
    coarse = worst[COARSE]
    low, high = coarse.idxmin(), coarse.idxmax()
    return (
        f"{COARSE}: over all aspects the best angle is {low:g} degrees ({coarse.min():.0%} wrong),"
        f" the worst {high:g} ({coarse.max():.0%})."
    )


def _cost_of_finer() -> str:
    """Draw three times finer: the centre of every pixel is a sample again, and a step is a third."""
    coarse = METHODS[COARSE]

    def finer(points: NDArray[np.float64], size: int) -> Cover:
        cover = coarse(points * FINER, size * FINER)
        return cover._replace(mask=cover.mask[FINER // 2 :: FINER, FINER // 2 :: FINER])

    _, breaks = boundary(finer)
    points = slivers(ASPECTS[1])
    plain, fine = (
        draw(flat_scene(points * k, SIZE * k), "cudaraster", SIZE * k, cull_backfaces=False).milliseconds
        for k in (1, FINER)
    )
    return (
        f"drawn at {FINER} times the resolution it breaks at {breaks:.0f} : 1, for {fine / plain:.2f} times the"
        f" modelled time: {plain:.4f} to {fine:.4f} ms on the {MACHINE}, {SIZE} x {SIZE} pixels"
    )


def _plot(table: pd.DataFrame, path: Path) -> None:
    """Draw a map a method: aspect by angle."""
    maps = {
        name: group.pivot_table(index="angle", columns="aspect", values="wrong")
        for name, group in table.groupby("method", sort=False)
    }
    value_maps(
        maps, path, title="Samples of slivers that come out wrong", unit="wrong samples / exact samples",
        x_label="length : width", y_label="angle [degrees]", log_x=True,
    )  # fmt: skip
