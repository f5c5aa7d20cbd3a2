"""Cracks and displacement: what pictures without cracks cost against their error, and displacement whose bounds hold.

"Cracks resulting from adaptive subdivision need to be taken care of, and displacement mapping [...] is difficult with
the tiny tiles" (Eisenacher & Loop 2010, section 5). The atlas says where each breaks (``stability/cracks``,
``stability/displacement``); here both have a place between time and picture error.
"""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from tilestamp.experiments.exploration.ways import MACHINES, SIZE, Way
from tilestamp.experiments.frontier.picture_error import flip
from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Figure, Result, reported
from tilestamp.experiments.stability.cracks import CURES, SEEDS, Cure, crack_pixels, frame, front_end, snapped
from tilestamp.experiments.stability.patch_frames import MACHINE, milliseconds
from tilestamp.experiments.studies_shipped.finding import finding
from tilestamp.models.errors import TilestampError
from tilestamp.reports.picture import picture
from tilestamp.reports.plots import lines

QUESTION = "What does a picture without cracks cost against its error, and what do bounds cost that displacement keeps?"
SLOW = True  # runs when it is named: tilestamp reproduce exploration
BOUNDS = (8.0, 16.0, 32.0)  # pixels, of sheets with cracks
TRUE_BOUND = 2.0  # pixels, of the picture that others are compared with: one depth, so without cracks
RELIEF = (127.5 + 127.5 * np.sin(np.arange(32) * 0.8)[:, None] * np.sin(np.arange(32) * 0.8)).astype(np.uint8)
HEIGHTS = (0.0, 0.01, 0.02, 0.04)  # units of the model: the teapot is 6 wide
DISPLACED_BOUNDS = (8.0, 16.0)  # pixels


SURE = (
    "FLIP is against a picture of one depth at a bound of 2. Snapping's look-ups are counted and not priced. The room"
    " for displacement is one number a frame, from its nearest patch."
)


@cache
def bumpy(height: float, bound: float) -> Way:
    """The teapot with bumps."""
    return Way(f"bumps {height:g}, bound {bound:g}", {"relief": RELIEF, "relief_height": height, "bound": bound})


def run(progress: Progress) -> Result:
    """Draw sheets with each cure of cracks, and the teapot with bumps of growing height."""
    rows = []
    for bound in BOUNDS:
        progress(f"exploration/cracks_displacement: cracks, bound {bound:g}")
        rows += [_cracked(bound, cure) for cure in CURES]
    cracks = pd.DataFrame(rows)
    progress("exploration/cracks_displacement: bumps")
    bumps = pd.DataFrame([row for bound in DISPLACED_BOUNDS for height in HEIGHTS for row in _bumps(height, bound)])
    shown = bumpy(HEIGHTS[-1], DISPLACED_BOUNDS[-1]).run(MACHINES[1])
    figures = [
        Figure("cracks", lambda path: _front(cracks, path)),
        Figure("bumps", lambda path: _cost(bumps[bumps.machine == MACHINES[1]], path)),
        Figure("picture", lambda path: picture(shown.image, path, title="Bumps on the teapot")),
    ]
    cells = [
        reported(f"{row['cure']}, bound {row['bound']:g}", column, unit, row[column])
        for row in cracks.to_dict("records")
        for column, unit in (("ms", "ms"), ("flip", ""), ("crack_pixels", "pixels"))
    ]
    cells += [
        reported(f"bumps {row['height']:g}, bound {row['bound']:g}", f"{column}, {row['machine']}", unit, row[column])
        for row in bumps.to_dict("records")
        for column, unit in (("ms", "ms"), ("sub-patches", ""), ("widest", "pixels"))
    ]
    title = f"Cracks of rough sheets, {MACHINE}; bumps on the teapot at {SIZE[0]}x{SIZE[1]}"
    tables = {"cracks": cracks, "bumps": bumps}
    return finding("cracks_displacement", title, cells, figures, _notes(cracks, bumps), tables, folder="exploration")


@cache
def _truth(seed: int) -> NDArray[np.float64]:
    return frame(TRUE_BOUND, seed, "one depth").image / 255.0


def _cracked(bound: float, cure: Cure) -> dict[str, Any]:
    """Time, picture error and crack pixels of all sheets."""
    works = [work for seed in SEEDS for work in front_end(bound, seed, one_depth=cure == "one depth").works]
    works += [work for seed in SEEDS for work in frame(bound, seed, cure).works]
    if cure == "snapped edges":
        works += [work for seed in SEEDS for work in snapped(bound, seed).works]
    return {
        "bound": bound,
        "cure": cure,
        "ms": milliseconds(works) / len(SEEDS),
        "flip": float(np.mean([flip(_truth(seed), frame(bound, seed, cure).image) for seed in SEEDS])),
        "crack_pixels": crack_pixels(bound, cure),
    }


def _bumps(height: float, bound: float) -> list[dict[str, Any]]:
    """Times of a frame with bumps; none where displacement alone exceeds the bound."""
    try:
        runs = {machine: bumpy(height, bound).run(machine) for machine in MACHINES}
    except TilestampError:
        return []
    return [
        {
            "height": height,
            "bound": bound,
            "machine": machine,
            "ms": run.milliseconds,
            "sub-patches": run.frame.facts["subpatches"],
            "widest": run.frame.facts["widest_grid"],
        }
        for machine, run in runs.items()
    ]


def _notes(cracks: pd.DataFrame, bumps: pd.DataFrame) -> list[str]:
    said = []
    for bound in BOUNDS:
        rows = cracks[cracks.bound == bound].set_index("cure")
        what = ", ".join(f"{cure} {rows.ms[cure]:.3g} ms and {rows.flip[cure]:.4f}" for cure in CURES)
        said.append(f"bound {bound:g}: {what}")
    h200 = bumps[bumps.machine == MACHINES[1]]
    calm = h200[h200.height == 0].set_index("bound").ms
    cost = "; ".join(
        f"bumps of {row.height:g} at a bound of {row.bound:g} take {row.ms / calm[row.bound]:.2f} times the frame"
        for row in h200[h200.height > 0].itertuples()
    )
    holds = "no grid is wider than its bound" if (bumps.widest <= bumps.bound).all() else "some grids are too wide"
    refused = len(HEIGHTS) * len(DISPLACED_BOUNDS) - len(h200)
    return [
        f"Time and FLIP, with cracks and with each cure: {'; '.join(said)}.",
        f"With room for displacement {holds}; on {MACHINES[1]} {cost}. Too high for their bound: {refused}.",
        f"{SURE} It is safe, and grids might have been {(h200.bound / h200.widest).max():.1f} times as wide at most.",
    ]


def _front(cracks: pd.DataFrame, path: Path) -> None:
    lines(
        cracks, path, x="ms", y="flip", by="cure", log_x=True, title="Rough sheets: picture error against time",
        x_label="milliseconds a sheet", y_label="FLIP",
    )  # fmt: skip


def _cost(bumps: pd.DataFrame, path: Path) -> None:
    lines(
        bumps.assign(line=bumps.bound.map(lambda bound: f"bound {bound:g}")), path, x="height", y="ms", by="line",
        title=f"Frame with bumps, {MACHINES[1]}", x_label="height of bumps [units]", y_label="milliseconds",
    )  # fmt: skip
