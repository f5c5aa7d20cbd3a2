"""Merged quads at a crease: from which fold on a pixel that two triangles share shows that one of them was not shaded.

A mesh of pixel-sized triangles is folded along a line through the screen; triangles on either side of it have the light
of their own normal. Quads of neighbours are merged before they are shaded, so that a pixel on the crease has one side's
colour where its samples would mix both. Wrong is a pixel off by more than a sixteenth of the range.
"""

from collections.abc import Callable
from functools import partial

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from tilestamp.experiments.exploration.quad_merging import BUFFER, PIXEL_SIZED, SIDE, mesh
from tilestamp.experiments.harness.result import Figure, Result
from tilestamp.experiments.stability.boundary import Boundary, atlas_result, bisect
from tilestamp.models.machine import load_machine
from tilestamp.reports.plots import lines
from tilestamp.simulator.stages.fatahalian2009.micropolygon_samples import new_samples, picture
from tilestamp.simulator.stages.fatahalian2009.micropolygons import LIGHT, Micropolygons
from tilestamp.simulator.stages.fatahalian2009.sample_positions import sample_positions
from tilestamp.simulator.stages.fatahalian2010.quad_shading import QuadEvent, quad_shading

QUESTION = "How sharp may a crease be before merged quads show on it?"
SLOW = True  # with what it needs compiled, more than the first run should take
SAMPLES = (1, 4, 16)
FOLDS = (0.5, 2.0, 5.0, 10.0, 20.0, 40.0, 80.0)  # degrees between the normals of the two sides
WRONG = 16  # of 255
SLOPE = 0.3  # of the crease: across for each pixel down


def run(progress: Callable[[str], None]) -> Result:
    """Fold the mesh more and more, at some samples a pixel."""
    rows, boundaries = [], []
    for spp in SAMPLES:
        progress(f"merged quads: {spp} samples")
        rows += [
            {"samples": f"{spp} sample{'s' if spp > 1 else ''} a pixel", "fold": fold, "off": _off(fold, spp)}
            for fold in FOLDS
        ]
        boundaries.append(
            Boundary(
                f"quads merged, {spp} sample{'s' if spp > 1 else ''}", "fold", "degrees", *boundary(spp),
                f"pixels of a crease are off by more than {WRONG} of 255: they have the colour of one side",
                "shade quads without merging", _cost(spp),
            )
        )  # fmt: skip
    table = pd.DataFrame(rows)
    figure = Figure("creases", partial(
        lines, table, x="fold", y="off", by="samples", title="Merged quads at a crease",
        x_label="fold [degrees between the normals]", y_label="most that a pixel is off [of 255]", log_x=True,
    ))  # fmt: skip
    note = f"Folded by {FOLDS[-1]:g} degrees: {'; '.join(_most(table))}."
    return atlas_result(
        "stability/merged_quads", "Merged quads at a crease", boundaries, [figure], [note], {"off": table}
    )


def folded(fold: float) -> Micropolygons:
    """A mesh whose two sides face apart by so many degrees."""
    polygons = mesh(PIXEL_SIZED)
    middle = polygons.vertices[..., :2].mean(axis=1) - SIDE / 2
    half = np.radians(fold) / 2 * np.where(middle[:, 0] > SLOPE * middle[:, 1], 1.0, -1.0)
    normals = np.stack([np.sin(half), 0 * half, np.cos(half)], axis=1)
    return polygons._replace(shade=np.round(40 + 200 * np.abs(normals @ LIGHT)).astype(np.uint8))


def pictures(fold: float, spp: int) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """With the colour of each sample's own triangle, and as merged quads are shaded."""
    polygons, samples = folded(fold), new_samples(SIDE, SIDE, sample_positions(spp))
    seen = quad_shading(polygons, samples, BUFFER, load_machine("h200").simt).outputs.seen
    return picture(samples, polygons), picture(samples._replace(polygon=seen), polygons)


def boundary(spp: int) -> tuple[float | None, float | None]:
    """Fold that holds and fold that breaks, degrees."""
    return bisect(lambda fold: _off(fold, spp) > WRONG, FOLDS[0], FOLDS[-1], tolerance=0.03)


def _off(fold: float, spp: int) -> int:
    """The most that a pixel is off."""
    plain, merged = pictures(fold, spp)
    return int(np.abs(plain.astype(np.int64) - merged).max())


def _most(table: pd.DataFrame) -> list[str]:
    worst = table[table.fold == FOLDS[-1]]
    return [f"with {row.samples} one is off by up to {row.off} of 255" for row in worst.itertuples()]


def _cost(spp: int) -> str:
    """Shading without merging, as a multiple."""
    counts = []
    for entries in (0, BUFFER):
        samples = new_samples(SIDE, SIDE, sample_positions(spp))
        work = quad_shading(mesh(PIXEL_SIZED), samples, entries, load_machine("h200").simt).works[0]
        counts.append(work.total(QuadEvent.SHADED_QUADS))
    return f"{counts[0] / counts[1]:.1f} times the shading at triangles of {PIXEL_SIZED:g} pixels"
