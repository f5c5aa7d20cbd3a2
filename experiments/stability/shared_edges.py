"""Shared edges on sample positions: holes and double hits along the seams of a mesh, by pipeline.

A mesh without gaps whose corners lie on pixel centres, so that its edges run through samples, is moved off them by less
and less. Every sample inside must be hit once. A hole is a sample that no triangle takes, a double hit one that two do
(with blending or a counter, visible; with a depth test, not).
"""

from collections.abc import Callable
from functools import partial

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from tilestamp.experiments.harness.result import Figure, Result
from tilestamp.experiments.stability.boundary import Boundary, atlas_result, bisect, bracket
from tilestamp.experiments.stability.methods import METHODS, QUADS, Cover, quad_lattice, quantized
from tilestamp.reports.plots import lines

QUESTION = "How near may edges come to samples before a seam has holes or double hits?"
SIZE = 128  # pixels
CELL = 16  # pixels between the corners of the mesh
SHAKE = 3  # pixels at most that a corner is moved: slopes of all kinds, and every quad convex
OFFSETS = (*(2.0**-k for k in range(1, 17)), 0.0)  # pixels from the sample positions
DRIFT = np.array([1.0, 0.618])  # which way the mesh moves: along no edge


def run(progress: Callable[[str], None]) -> Result:
    """Move the mesh off the samples by each method; bisect where seams open or overlap."""
    rows, boundaries = [], []
    for name in METHODS:
        progress(f"shared edges: {name}")
        swept = [defects(name, offset) for offset in OFFSETS]
        rows += [
            {"method": name, "offset": offset, "holes": holes, "doubles": doubles}
            for offset, (holes, doubles) in zip(OFFSETS, swept, strict=True)
        ]
        boundaries.append(_row(name, [any(pair) for pair in swept]))
    table = pd.DataFrame(rows)
    figure = Figure("seams", partial(
        # what lies on the samples is drawn one step to the left of the rest
        lines, table.assign(offset=table.offset.where(table.offset > 0.0, OFFSETS[-2] / 4)), x="offset", y="doubles",
        by="method", title="Samples of a closed mesh that are hit twice",
        x_label="edges from samples [pixels; leftmost point: 0]", y_label="double hits", log_x=True,
    ))  # fmt: skip
    title = "Shared edges on sample positions"
    return atlas_result("stability/shared_edges", title, boundaries, [figure], _notes(table), {"defects": table})


def lattice(offset: float) -> NDArray[np.float64]:
    """Corners (R, C, 2) of a closed mesh, ``offset`` pixels off pixel centres."""
    rng = np.random.default_rng(3)
    side = np.arange(CELL, SIZE - CELL + 1, CELL)
    at = np.stack(np.meshgrid(side, side), axis=-1) + 0.5
    at[1:-1, 1:-1] += rng.integers(-SHAKE, SHAKE + 1, at[1:-1, 1:-1].shape)
    return quantized(at + offset * DRIFT)


def triangles_of(at: NDArray[np.float64]) -> NDArray[np.float64]:
    """Cut each quad of a lattice in two, (T, 3, 2)."""
    a, b, c, d = at[:-1, :-1], at[:-1, 1:], at[1:, :-1], at[1:, 1:]
    return np.stack([np.stack([a, b, c], axis=2), np.stack([c, b, d], axis=2)], axis=2).reshape(-1, 3, 2)


def cover_of(name: str, offset: float) -> Cover:
    """Draw the mesh by one method."""
    at = lattice(offset)
    return quad_lattice(at, SIZE) if name == QUADS else METHODS[name](triangles_of(at), SIZE)


def defects(name: str, offset: float) -> tuple[int, int]:
    """Holes inside the mesh, and double hits."""
    cover = cover_of(name, offset)
    inner = slice(CELL + 1, SIZE - CELL - 1)
    return int((~cover.mask[inner, inner]).sum()), cover.doubles


def boundary(name: str, failed: list[bool] | None = None) -> tuple[float | None, float | None]:
    """Distance from the samples that holds and that breaks; 0 is tried by itself."""
    failed = [any(defects(name, offset)) for offset in OFFSETS] if failed is None else failed
    if not any(failed[:-1]):
        return (OFFSETS[-2], 0.0) if failed[-1] else (0.0, None)
    return bisect(lambda offset: any(defects(name, offset)), *bracket(OFFSETS, failed), tolerance=0.05)


def _row(name: str, failed: list[bool]) -> Boundary:
    found = boundary(name, failed)
    holes, doubles = defects(name, 0.0)
    wrong = f"seams are hit twice (on the samples: {doubles} double hits, {holes} holes)"
    fewer = doubles / cover_of(name, 0.0).hits
    cost = f"an integer test and a rule have {fewer:.1%} fewer hits on this mesh, no more tests"
    return Boundary(name, "distance of edges from samples", "pixels", *found, wrong, "a fill rule", cost)


def _notes(table: pd.DataFrame) -> list[str]:
    """How many samples there are to go wrong, and how many do."""
    mesh = triangles_of(lattice(0.0))
    on = table[table.offset == 0.0].set_index("method").doubles
    texts = [f"{name} {count}" for name, count in on.items()]
    note = (
        f"{len(mesh)} triangles whose corners lie on pixel centres, {SIZE} x {SIZE} pixels: double hits"
        f" {'; '.join(texts)}; holes {table.holes.sum()} over all methods and distances."
    )
    return [note]
