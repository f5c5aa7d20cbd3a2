"""The bit mask on folded patches: it supposes that no sample is covered twice (Yao et al. 2012, section 2).

A strip is bent along its middle and turned. Where its later half lies in front of its earlier half, the mask has
filtered the samples that should have shown it. A mask for each facing mends folds that show their back, a mask that
looks at depth mends all.
"""

from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Figure, Result
from tilestamp.experiments.stability.boundary import Boundary, atlas_result, bisect
from tilestamp.experiments.stability.patch_frames import milliseconds, simt_of
from tilestamp.reports.maps import value_maps
from tilestamp.reports.plots import lines
from tilestamp.simulator.stages.fatahalian2009.across_polygons import across_polygons
from tilestamp.simulator.stages.fatahalian2009.micropolygon_samples import Samples, new_samples
from tilestamp.simulator.stages.fatahalian2009.micropolygons import Micropolygons
from tilestamp.simulator.stages.fatahalian2009.sample_positions import sample_positions
from tilestamp.simulator.stages.yao2011.bit_mask import MaskKind, bit_mask
from tilestamp.simulator.work import Work

QUESTION = "When does the bit mask lose samples of a folded patch?"
SLOW = True  # the kernels of the bit mask take longer to compile than all else of the atlas

KINDS: tuple[MaskKind, ...] = ("plain", "facing", "depth")
SIDE = 64  # pixels of the screen
CELLS = 40  # micropolygons along and across the strip, a pixel each
FOLDS = (0, 30, 60, 80, 85, 90, 95, 100, 120, 150, 170)  # degrees
TURNS = (0, 15, 30, 45, 60, 75)  # degrees, around the fold
MACHINE = "gtx280"


def strip(fold: float, turn: float) -> Micropolygons:
    """A square strip, folded by ``fold`` degrees about its middle and turned about the fold, as one patch.

    The second half comes towards the viewer.
    """
    s = np.linspace(-CELLS / 2, CELLS / 2, CELLS + 1)
    first, second = np.radians(turn), np.radians(turn + fold)
    x = np.where(s < 0, s * np.cos(first), s * np.cos(second))
    z = np.where(s < 0, s * np.sin(first), s * np.sin(second))
    grid = np.empty((CELLS + 1, CELLS + 1, 3))
    grid[..., 0] = SIDE / 2 + x + 0.21
    grid[..., 1] = (SIDE / 2 + s + 0.37)[:, None]
    grid[..., 2] = 0.5 - z / (4 * CELLS)
    quads = np.stack([grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]], axis=2).reshape(-1, 4, 3)
    count = len(quads)
    return Micropolygons(quads.astype(np.float32), np.zeros(count, np.int32), np.full(count, 128, np.uint8))


@cache
def exact(fold: float, turn: float) -> tuple[NDArray[np.int32], Work]:
    """Nearest micropolygon of each pixel, without a mask, and the work of that."""
    samples = _samples()
    work = across_polygons(strip(fold, turn), samples, "in-order", simt_of(MACHINE)).works[0]
    return samples.polygon, work


@cache
def masked(fold: float, turn: float, kind: MaskKind) -> tuple[NDArray[np.int32], Work]:
    """The same under a mask, and its work."""
    samples = _samples()
    work = bit_mask(strip(fold, turn), samples, kind, simt_of(MACHINE).warp, simt_of(MACHINE)).works[0]
    return samples.polygon, work


def wrong_share(fold: float, turn: float = 0.0, kind: MaskKind = "plain") -> float:
    """Share of covered pixels that show another micropolygon; ties of equal depth do not count."""
    truth = exact(fold, turn)[0]
    return float((masked(fold, turn, kind)[0] != truth).sum() / (truth >= 0).sum())


def boundary(turn: float, kind: MaskKind = "plain") -> tuple[float | None, float | None]:
    """Fold that holds, and fold that breaks."""
    return bisect(
        lambda fold: wrong_share(fold, turn, kind) > 0.01, FOLDS[0], FOLDS[-1], scale="linear", tolerance=0.005
    )


def _samples() -> Samples:
    return new_samples(SIDE, SIDE, sample_positions(1))


def run(progress: Progress) -> Result:
    """Fold the strip, seen from several sides, under each mask."""
    rows = []
    for turn in TURNS:
        progress(f"stability/folds: turned by {turn} degrees")
        rows += [
            {"turn": turn, "fold": fold, "mask": kind, "wrong": wrong_share(fold, turn, kind)}
            for kind in KINDS
            for fold in FOLDS
        ]
    table = pd.DataFrame(rows)
    boundaries = [_boundary(turn, "plain") for turn in TURNS] + [_boundary(0, kind) for kind in ("facing", "depth")]
    figures = [
        Figure("wrong", lambda path: _plot(table, path)),
        Figure("maps", lambda path: _draw_maps(table, path)),
    ]
    return atlas_result(
        "stability/folds", "Bit mask on folded patches", boundaries, figures, _notes(), {"folds": table}
    )


def _draw_maps(table: pd.DataFrame, path: Path) -> None:
    maps = {
        f"{kind} mask": table[table["mask"] == kind].pivot_table(index="turn", columns="fold", values="wrong")
        for kind in KINDS
    }
    title = "Wrong pixels of a folded patch"
    unit = "share of covered pixels"
    value_maps(maps, path, title=title, unit=unit, x_label="fold [degrees]", y_label="turn [degrees]")


def _boundary(turn: float, kind: MaskKind) -> Boundary:
    worst = max(wrong_share(fold, turn, kind) for fold in FOLDS)
    plain, deep = (milliseconds([masked(0, turn, k)[1]], MACHINE, "bit-mask") for k in ("plain", "depth"))
    method = f"bit mask ({kind}), turned by {turn:g} degrees"
    wrong = f"up to {100 * worst:.0f} % of the covered pixels show the wrong side"
    cure = "a mask that looks at depth" if kind == "plain" else ""
    cost = f"{deep:.4g} ms instead of {plain:.4g} for the flat patch on {MACHINE}" if kind == "plain" else ""
    return Boundary(method, "fold", "degrees", *boundary(turn, kind), wrong, cure, cost)


def _notes() -> list[str]:
    """What the masks cost on the most folded patch."""
    fold = FOLDS[-1]
    ways: list[tuple[str, Work, str]] = [(kind, masked(fold, 0, kind)[1], "bit-mask") for kind in KINDS]
    ways.append(("no mask", exact(fold, 0)[1], "across-polygons"))
    costs = [
        f"{milliseconds([work], MACHINE, pipeline):.4g} ms and {work.counts()['SAMPLE_TESTS']} tests ({name})"
        for name, work, pipeline in ways
    ]
    one = f"one patch of {CELLS**2} micropolygons, which one warp draws under a mask"
    return [f"Folded by {fold} degrees, {one}, takes " + ", ".join(costs) + "."]


def _plot(table: pd.DataFrame, path: Path) -> None:
    shown = table[table.turn == 0]
    lines(
        shown.assign(percent=100 * shown.wrong), path, x="fold", y="percent", by="mask",
        title="Wrong pixels of a folded patch seen face on", x_label="fold [degrees]",
        y_label="covered pixels that are wrong [%]",
    )  # fmt: skip
