"""A program in CudaRaster's ROP: what it costs, and what lanes that hit one pixel cost it.

Piles of transparent triangles cover the screen. Drawn layer by layer, no two fragments of a round share a pixel; drawn
pile by pile they do, and take turns. The picture does not depend on that: it is that of the input order.
"""

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from tilestamp.experiments.exploration.transparent_scenes import confetti, piles
from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Figure, Result, reported
from tilestamp.experiments.studies_shipped.finding import finding
from tilestamp.reports.picture import picture
from tilestamp.reports.plots import lines
from tilestamp.simulator.run import Run
from tilestamp.simulator.scenes import Scene
from tilestamp.simulator.simulation import simulate

QUESTION = "What does a user's program in the ROP cost, and what do fragments of one pixel that meet in a warp?"
SLOW = True  # runs when it is named: tilestamp reproduce exploration
MACHINES = ("gtx480", "h200")
SIDE, LAYERS, LEGS = 384, 8, (2, 4, 8, 16)  # pixels, triangles at a place, pixels of a leg
PROGRAMS = ("over", "additive", "nearest", "k-buffer", "stochastic")
STAGE = "fine_raster"


def run(progress: Progress) -> Result:
    """Draw each pile in both orders by each program."""
    rows = []
    for leg in LEGS:
        progress(f"exploration/programmable_rop: triangles of {leg * leg / 2:g} pixels")
        for together in (False, True):
            scene = piles(SIDE, leg, LAYERS, together=together)
            for program in PROGRAMS:
                runs = [drawn(scene, program, machine) for machine in MACHINES]
                rows += [(leg * leg / 2, together, program, made.machine.name, *_measured(made)) for made in runs]
    columns = ["pixels", "together", "program", "machine", "steps", "occupied", "fine_ms", "ms"]
    table = pd.DataFrame(rows, columns=columns)
    cells = [
        reported(f"{row.machine}, {row.program}, {'together' if row.together else 'apart'}", f"{row.pixels:g} pixels",
                 "ms", row.fine_ms)
        for row in table.itertuples()
    ]  # fmt: skip
    ratios = conflict_ratios(table)
    figures = [
        Figure("picture", _draw_pictures),
        Figure("conflicts", partial(_draw_conflicts, ratios)),
    ]
    title = f"Programs in the ROP: {LAYERS} layers of transparent triangles, {SIDE}x{SIDE}"
    return finding(
        "programmable_rop", title, cells, figures, notes(table, ratios), {"times": table}, folder="exploration"
    )


def drawn(scene: Scene, program: str, machine: str = MACHINES[0], side: int = SIDE) -> Run:
    """One frame."""
    return simulate(
        scene, "cudaraster", machine, width=side, height=side, mode="blend", blend=program, cull_backfaces=False
    )


def _measured(made: Run) -> tuple[float, float, float, float]:
    """Steps of a round, lanes of a step, and times."""
    steps, rounds = made.counts[f"{STAGE}.ROP_STEPS"], made.counts[f"{STAGE}.SHADE_ROUNDS"]
    lanes = made.counts[f"{STAGE}.ROP_LANES"]
    return steps / rounds, lanes / steps, float(made.stages.loc[STAGE, "milliseconds"]), made.milliseconds


def conflict_ratios(table: pd.DataFrame) -> pd.DataFrame:
    """Time of fine raster pile by pile over that layer by layer."""
    times = table.pivot_table("fine_ms", ["machine", "program", "pixels"], "together", sort=False)
    return (times[True] / times[False]).rename("ratio").reset_index()


def notes(table: pd.DataFrame, ratios: pd.DataFrame) -> list[str]:
    """Answer first."""
    smallest, largest = table["pixels"].min(), table["pixels"].max()
    worst = ratios.loc[ratios["ratio"].idxmax()]
    steps = table[table["together"] & (table["program"] == PROGRAMS[0])].groupby("pixels")["steps"].mean()
    first = (
        f"Fragments of one pixel in one round cost most where triangles are small: {steps[smallest]:.2g} steps a round "
        f"at {smallest:g} pixels a triangle, {steps[largest]:.2g} at {largest:g}. Fine raster then takes up to "
        f"{worst.ratio:.2f} times as long ({worst.program}, {worst.machine})."
    )
    said = [first]
    for machine, rows in table[~table["together"]].groupby("machine", sort=False):
        times = rows.pivot_table("fine_ms", "pixels", "program", sort=False)
        over = times.div(times[PROGRAMS[0]], axis=0)
        told = ", ".join(f"{name} {over[name].min():.2f} to {over[name].max():.2f}" for name in PROGRAMS[1:])
        said.append(f"{machine}, without conflicts, fine raster over that of blending over: {told}.")
    said.append(
        "Counts are exact. Prices of programs are read from our CUDA code for 9.0 and derived by hand for 2.x; none "
        "was measured, and which lane wins a conflict is taken as the original probes it. Layers lie in 48 KB of "
        "shared memory a block: four leave room for 10 of 20 warps."
    )
    return said


def _draw_conflicts(ratios: pd.DataFrame, path: Path) -> None:
    lines(
        ratios.assign(line=ratios["machine"] + ", " + ratios["program"]), path, x="pixels", y="ratio", by="line",
        log_x=True, title="Fine raster with the fragments of a pixel together, over apart",
        x_label="pixels of a triangle", y_label="time together / apart",
    )  # fmt: skip


def _draw_pictures(path: Path) -> None:
    side = 160
    scene = confetti(side, 30, 90.0)
    images = [drawn(scene, program, side=side).image for program in PROGRAMS]
    gap = np.full((side, 4, 3), 255, np.uint8)
    row = np.concatenate([part for image in images for part in (image, gap)][:-1], axis=1)
    picture(row, path, title="Programs: " + ", ".join(PROGRAMS))
