"""Rational patches with weights near zero: parameters that crowd at an edge (Eisenacher & Loop 2010, section 1).

Where the control points of one edge weigh little, nearly all of the surface lies at parameters close to that edge's:
sub-patches there must be as small as the weight, and the depth limit drops them. Cure: other weights for the same
surface, column k times ``alpha**k``, so that both ends move equally fast; once a model, before any frame.
"""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Figure, Result
from tilestamp.experiments.stability.boundary import Boundary, atlas_result, bisect
from tilestamp.experiments.stability.patch_frames import Split, draw, flat_patch, milliseconds, split
from tilestamp.reports.plots import lines

QUESTION = "How small may a weight be before a rational patch is diced badly?"
SIZE = 40  # pixels a side of the screen
SQUARE = 0.8  # side of the patch over the screen's
WEIGHTS = tuple(10.0**-k for k in range(7))
DEPTHS = (7, 9, 11)  # halvings at most: 14 would take minutes, for all sub-patches are split along the edge too
TOLERANCE = 0.1  # of a boundary, relative
CURES = ("as given", "balanced")


def patch(weight: float, *, balanced: bool = False) -> NDArray[np.float32]:
    """A flat square, (1, 16, 4), the edge u = 0 with another weight than the rest."""
    points = flat_patch([[[x * SQUARE, y * SQUARE, 0] for x in (-1, 1)] for y in (-1, 1)]).astype(np.float64)
    column = np.array([weight, 1.0, 1.0, 1.0])
    if balanced:
        column = balance(column)
    weighted: NDArray[np.float32] = (points.reshape(1, 4, 4, 4) * column[:, None]).astype(np.float32)
    return weighted.reshape(1, 16, 4)


def balance(weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Weights (4,) of the same cubic that leaves both ends equally fast; the largest is 1."""
    alpha = np.sqrt(weights[2] / weights[3] * weights[0] / weights[1])
    scaled: NDArray[np.float64] = weights * alpha ** np.arange(4)
    scaled /= scaled.max()
    return scaled


@cache
def frame(weight: float, depth: int = DEPTHS[-1], *, balanced: bool = False) -> Split:
    """Split and dice the square."""
    return split(patch(weight, balanced=balanced), np.eye(4), SIZE, SIZE, max_depth=depth)


@cache
def missing(weight: float, depth: int = DEPTHS[-1], *, balanced: bool = False) -> int:
    """Pixels of the square that are not drawn."""
    whole, made = frame(1.0).grids, frame(weight, depth, balanced=balanced).grids
    return int((draw(whole, SIZE, SIZE).hits > 0).sum() - (draw(made, SIZE, SIZE).hits > 0).sum())


def boundary(depth: int = DEPTHS[-1], *, balanced: bool = False) -> tuple[float | None, float | None]:
    """Weight that holds, and weight that breaks."""
    return bisect(
        lambda weight: missing(weight, depth, balanced=balanced) > 0, WEIGHTS[0], WEIGHTS[-1], tolerance=TOLERANCE
    )


def run(progress: Progress) -> Result:
    """Take weight from one edge."""
    progress("stability/rational_weights: one edge lighter and lighter")
    rows = [_row(weight, cure) for cure in CURES for weight in WEIGHTS]
    table = pd.DataFrame(rows)
    boundaries = [_boundary(table, cure) for cure in CURES]
    for depth in DEPTHS[:-1]:
        name = f"micropolygon, at most {depth} halvings"
        boundaries.append(Boundary(name, "weight of one edge", "", *boundary(depth), "sub-patches are dropped"))
    shown = [table[(table.cure == cure) & (table.weight == WEIGHTS[3])].iloc[0] for cure in CURES]
    counts = ", ".join(f"{row.subpatches} sub-patches of up to {row.depth} halvings {row.cure}" for row in shown)
    even = f"{rows[0]['subpatches']} of up to {rows[0]['depth']} with equal weights"
    notes = [f"At a weight of {WEIGHTS[3]:g} the square takes {counts}; {even}."]
    figures = [
        Figure("missing", lambda path: _plot(table, path, "percent", "pixels of the square that are missing [%]")),
        Figure("subpatches", lambda path: _plot(table, path, "subpatches", "sub-patches")),
    ]
    title = "Rational weights near zero"
    return atlas_result("stability/rational_weights", title, boundaries, figures, notes, {"weights": table})


def _row(weight: float, cure: str) -> dict[str, float | str]:
    made = frame(weight, balanced=cure == "balanced")
    lost = missing(weight, balanced=cure == "balanced")
    return {
        "weight": weight,
        "cure": cure,
        "subpatches": len(made.subpatches.patch),
        "depth": int(made.subpatches.level.max()),
        "dropped": made.given_up,
        "missing": lost,
        "percent": 100 * lost / (SIZE * SQUARE) ** 2,
        "ms": milliseconds(made.works),
    }


def _boundary(table: pd.DataFrame, cure: str) -> Boundary:
    rows = table[table.cure == cure]
    plain, cured = (table[(table.cure == c) & (table.weight == 1)].iloc[0].ms for c in CURES)
    given = cure == "as given"
    name = f"micropolygon, at most {DEPTHS[-1]} halvings, weights {cure}"
    wrong = f"sub-patches at that edge are dropped at the depth limit, up to {rows.percent.max():.0f} % of the square"
    found = Boundary(name, "weight of one edge", "", *boundary(balanced=not given), wrong)
    cost = f"no time in the frame: {cured:.4g} ms of bound and split and dicing, {plain:.4g} as given"
    return replace(found, cure="balance the weights once a model", cost=cost) if given else found


def _plot(table: pd.DataFrame, path: Path, column: str, label: str) -> None:
    lines(
        table, path, x="weight", y=column, by="cure", title="A flat square whose one edge weighs less",
        x_label="weight of the edge (the others: 1)", y_label=label, log_x=True,
    )  # fmt: skip
