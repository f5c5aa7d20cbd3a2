"""Cracks between neighbours split to different depths, by bound, and two cures (Eisenacher & Loop 2010, section 5).

"Cracks resulting from adaptive subdivision need to be taken care of": the finer of two neighbours has vertices off the
straight lines that the coarser one's edge is made of. A crack pixel is background well inside of what is covered when
all sub-patches have the same depth. Cures: that same depth, or snapping the finer edge to the coarser
(``snap_edges``).
"""

from functools import cache, partial
from typing import Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Figure, Result
from tilestamp.experiments.stability.boundary import Boundary, atlas_result, bisect, bracket
from tilestamp.experiments.stability.patch_frames import MACHINE, Drawn, Split, draw, milliseconds, simt_of, split
from tilestamp.reports.plots import lines
from tilestamp.reports.ste_plots import wrong_pixels
from tilestamp.simulator.scenes.camera import LookAt
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.eisenacher2010.snap_edges import Snapped, snap_edges

QUESTION = "From which bound on are there cracks between neighbours of different depth, and which cure closes them?"
WIDTH, HEIGHT = 320, 240  # pixels
CELLS = 6  # patches along a side of the sheet
ROUGH = 0.6  # height of its control points, in patch sides
SEEDS = (2, 3)
BOUNDS = (4.0, 8.0, 16.0, 32.0, 64.0)  # pixels
INSIDE = 2  # pixels from the outline
VIEW = LookAt((0, -4.4, 3.2), (0, -0.4, 0), (0, 0, 1), 45.0, 0.1, 50.0)
SPLINE = np.array([[1, 4, 1, 0], [0, 4, 2, 0], [0, 2, 4, 0], [0, 1, 4, 1]]) / 6  # uniform B-spline to Bezier
Cure = Literal["as published", "one depth", "snapped edges"]
CURES: tuple[Cure, ...] = ("as published", "one depth", "snapped edges")


@cache
def sheet(seed: int) -> NDArray[np.float32]:
    """A rough B-spline sheet as Bezier patches that share their edges' control points, (36, 16, 4)."""
    count = CELLS + 3
    side = np.arange(count) - (count - 1) / 2
    heights = np.random.default_rng(seed).uniform(-ROUGH, ROUGH, (count, count))
    net = np.dstack([*np.meshgrid(side, side), heights])
    whole = np.ones((3 * CELLS + 1, 3 * CELLS + 1, 4), np.float32)
    for a, b in np.ndindex(CELLS, CELLS):
        block = np.einsum("kr,lc,rcd->kld", SPLINE, SPLINE, net[a : a + 4, b : b + 4])
        whole[3 * a : 3 * a + 4, 3 * b : 3 * b + 4, :3] = block
    blocks = [whole[3 * a : 3 * a + 4, 3 * b : 3 * b + 4] for a, b in np.ndindex(CELLS, CELLS)]
    return np.stack(blocks).reshape(-1, 16, 4)


@cache
def front_end(bound: float, seed: int, *, one_depth: bool = False) -> Split:
    """Split a sheet, to the bound or all to the depth of its deepest sub-patch."""
    depth = int(front_end(bound, seed).subpatches.level.max()) if one_depth else 0
    return split(sheet(seed), VIEW.matrix(WIDTH, HEIGHT), WIDTH, HEIGHT, bound=bound, min_depth=depth)


@cache
def snapped(bound: float, seed: int) -> StageResult[Snapped]:
    """Snap the finer edges of a sheet to the coarser."""
    made = front_end(bound, seed)
    return snap_edges(sheet(seed), made.subpatches, made.grids, simt_of(MACHINE))


@cache
def frame(bound: float, seed: int, cure: Cure) -> Drawn:
    """Draw a sheet."""
    grids = snapped(bound, seed).outputs.grids if cure == "snapped edges" else None
    made = front_end(bound, seed, one_depth=cure == "one depth")
    return draw(grids or made.grids, WIDTH, HEIGHT, bound=bound)


def cracks(bound: float, seed: int, cure: Cure = "as published") -> NDArray[np.bool_]:
    """Background well inside the sheet, (H, W)."""
    inside: NDArray[np.bool_] = frame(bound, seed, "one depth").hits > 0
    for _ in range(INSIDE):
        around = np.pad(inside, 1)
        inside = inside & around[:-2, 1:-1] & around[2:, 1:-1] & around[1:-1, :-2] & around[1:-1, 2:]
    crack: NDArray[np.bool_] = inside & (frame(bound, seed, cure).hits == 0)
    return crack


def crack_pixels(bound: float, cure: Cure = "as published") -> int:
    """Crack pixels of all sheets together."""
    return sum(int(cracks(bound, seed, cure).sum()) for seed in SEEDS)


def run(progress: Progress) -> Result:
    """Sweep the bound, with each cure."""
    rows = []
    for bound in BOUNDS:
        progress(f"stability/cracks: bound {bound:g}")
        rows += [_row(bound, cure) for cure in CURES]
    table = pd.DataFrame(rows)
    boundaries = [_boundary(table, cure) for cure in CURES]
    shown, seed = BOUNDS[-1], SEEDS[-1]
    wrong = cracks(shown, seed)
    title = f"{int(wrong.sum())} crack pixels at a bound of {shown:g} pixels"
    plot = partial(lines, table, x="bound", y="crack_pixels", by="cure")
    sheets = f"Crack pixels of {len(SEEDS)} rough sheets, {WIDTH}x{HEIGHT}"
    figures = [
        Figure("cracks", partial(plot, title=sheets, x_label="bound [pixels]", y_label="crack pixels", log_x=True)),
        Figure(
            "picture", lambda path: wrong_pixels(frame(shown, seed, "as published").image, wrong, path, title=title)
        ),
    ]
    return atlas_result(
        "stability/cracks", "Cracks between different depths", boundaries, figures, _notes(table), {"bounds": table}
    )


def _row(bound: float, cure: Cure) -> dict[str, float | str]:
    """Crack pixels, sub-patches and time over all sheets."""
    fronts = [front_end(bound, seed, one_depth=cure == "one depth") for seed in SEEDS]
    works = [work for front in fronts for work in front.works]
    works += [work for seed in SEEDS for work in frame(bound, seed, cure).works]
    extra = lookups = 0  # sub-patches that are diced again, for the ends of the lines
    if cure == "snapped edges":
        for seed in SEEDS:
            snap = snapped(bound, seed)
            works += snap.works
            extra += int(snap.outputs.touched.sum())
            lookups += int(snap.outputs.lookups.sum())
    return {
        "bound": bound,
        "cure": cure,
        "crack_pixels": crack_pixels(bound, cure),
        "sub-patches": sum(len(front.subpatches.patch) for front in fronts),
        "snapped": extra,
        "lookups": lookups,
        "ms": milliseconds(works),
    }


def _boundary(table: pd.DataFrame, cure: Cure) -> Boundary:
    rows = table[table.cure == cure]
    ends = bracket(list(rows.bound), [n > 0 for n in rows.crack_pixels])
    found = bisect(lambda bound: crack_pixels(bound, cure) > 0, *ends, tolerance=0.1)
    wrong = f"the background shows between sub-patches: {rows.crack_pixels.max():.0f} pixels at bound {BOUNDS[-1]:g}"
    if cure != "as published":
        return Boundary(f"micropolygon, {cure}", "bound", "pixels", *found, wrong)
    at = BOUNDS[2]
    plain, one, snap = (table[(table.bound == at) & (table.cure == c)].iloc[0] for c in CURES)
    cost = (
        f"at bound {at:g} one depth takes {one['sub-patches'] / plain['sub-patches']:.1f} times the sub-patches and "
        f"{one.ms:.3g} ms instead of {plain.ms:.3g}; snapping {snap.ms:.3g} ms for {snap.snapped:.0f} sub-patches that "
        f"are diced again, and {snap.lookups:.0f} look-ups that are not priced"
    )
    return Boundary("micropolygon", "bound", "pixels", *found, wrong, "one depth, or snapped edges", cost)


def _notes(table: pd.DataFrame) -> list[str]:
    small = table[(table.cure == "as published") & (table.bound <= 8)]
    left = {cure: int(table[table.cure == cure].crack_pixels.sum()) for cure in CURES}
    covered = sum(int((frame(BOUNDS[0], seed, "as published").hits > 0).sum()) for seed in SEEDS)
    return [
        f"At the paper's bounds, 4 and 8 pixels, {small.crack_pixels.sum()} of {2 * covered} pixels are cracks.",
        "Crack pixels at all bounds together: " + ", ".join(f"{n} {cure}" for cure, n in left.items()) + ".",
    ]
