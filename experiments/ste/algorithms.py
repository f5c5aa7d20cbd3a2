"""Stamps, lanes across polygons and bit masks in modelled time: which wins at which area, and what bounds each.

Patches of 16 x 16 squares at random places and rotations: a million pixels of polygons or 100,000 polygons, the less
of the two. Instruction mixes are assumed (counted by hand), so differences of some ten percent say nothing.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pandas as pd

from tilestamp.experiments.harness.result import Figure, Result, reported
from tilestamp.models.errors import TilestampError
from tilestamp.models.machine import load_machine
from tilestamp.models.price import price
from tilestamp.models.simt import Simt
from tilestamp.reports.plots import lines
from tilestamp.simulator.mix import load_mix
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.fatahalian2009.across_polygons import across_polygons
from tilestamp.simulator.stages.fatahalian2009.micropolygon_samples import Samples, new_samples
from tilestamp.simulator.stages.fatahalian2009.micropolygons import Micropolygons
from tilestamp.simulator.stages.fatahalian2009.sample_positions import sample_positions
from tilestamp.simulator.stages.fatahalian2009.stamps import stamp_shape, stamps
from tilestamp.simulator.stages.yao2011.bit_mask import bit_mask

QUESTION = "Which algorithm for testing samples is the fastest, at which area?"
SLOW = True  # with what it needs compiled, more than the first run should take

MACHINES = ("gtx280", "gtx480", "h200")
AREAS = (0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 64.0)
GRID = 16  # squares along a patch
WIDTH, HEIGHT = 1024, 768
MOST_POLYGONS = 100_000
MOST_PIXELS = 1_000_000.0

Draw = Callable[[Micropolygons, Samples, Simt], StageResult[Samples]]
ALGORITHMS: dict[str, tuple[str, Draw]] = {  # what: pipeline of its mix, and how it is drawn
    "stamps 1x1": ("stamps", lambda p, s, simt: stamps(p, s, stamp_shape(1, "box"), simt)),
    "stamps 8x8": ("stamps", lambda p, s, simt: stamps(p, s, stamp_shape(8, "box"), simt)),
    "across, in order": ("across-polygons", lambda p, s, simt: across_polygons(p, s, "in-order", simt)),
    "across, sorted": ("across-polygons", lambda p, s, simt: across_polygons(p, s, "sorted", simt)),
    "across, repacked": ("across-polygons", lambda p, s, simt: across_polygons(p, s, "repacked", simt)),
    "bit mask": ("bit-mask", lambda p, s, simt: bit_mask(p, s, "plain", simt.warp, simt)),
    "bit mask, exact": ("bit-mask", lambda p, s, simt: bit_mask(p, s, "depth", simt.warp, simt)),
}


def run(progress: Callable[[str], None]) -> Result:
    """Draw every area by every algorithm for each machine, and price it."""
    rows: list[dict[str, Any]] = []
    for area in AREAS:
        polygons = patches_of_squares(area)
        for machine in MACHINES:
            progress(f"squares of {area:g} pixels on {machine}")
            rows += [_timed(polygons, area, name, machine) for name in ALGORITHMS]
    table = pd.DataFrame(rows)
    cells = [
        reported(f"{r['machine']}, {r['area']:g} px", f"{r['algorithm']} ({r['bound']})", "ns a polygon", r["ns"])
        for r in rows
    ]
    figures = [_figure(table, machine) for machine in MACHINES]
    notes = [*_winners(table), "All mixes are assumed: counted by hand on the kernels' CUDA form."]
    source = "No published times: modelled"
    answer = _answer(table)
    tables = {"runs": table}
    return Result(
        "ste/algorithms", "Which algorithm wins", source, cells, answer, figures=figures, notes=notes, tables=tables
    )


def patches_of_squares(area: float, seed: int = 21) -> Micropolygons:
    """Patches of squares of one area, flat, each at its own place, rotation and depth."""
    count = int(min(MOST_POLYGONS, MOST_PIXELS / area)) // GRID**2
    rng = np.random.default_rng(seed)
    side = np.sqrt(area)
    at = np.stack(np.meshgrid(np.arange(GRID), np.arange(GRID)), axis=-1).reshape(-1, 1, 2) - GRID / 2
    corners = ((at + np.array([[0, 0], [1, 0], [1, 1], [0, 1]])) * side).reshape(1, -1, 2)
    angle = rng.random((count, 1)) * 2 * np.pi
    x = corners[..., 0] * np.cos(angle) - corners[..., 1] * np.sin(angle) + rng.random((count, 1)) * WIDTH
    y = corners[..., 0] * np.sin(angle) + corners[..., 1] * np.cos(angle) + rng.random((count, 1)) * HEIGHT
    z = np.broadcast_to(rng.random((count, 1)), x.shape)
    vertices = np.stack([x, y, z], axis=-1).reshape(-1, 4, 3).astype(np.float32)
    patch = np.repeat(np.arange(count, dtype=np.int32), GRID**2)
    return Micropolygons(vertices, patch, np.full(len(patch), 160, np.uint8))


def _timed(polygons: Micropolygons, area: float, name: str, machine_name: str) -> dict[str, Any]:
    """One algorithm on one machine: time, bound, STE and SIMD efficiency."""
    machine = load_machine(machine_name)
    pipeline, draw = ALGORITHMS[name]
    work = draw(polygons, new_samples(WIDTH, HEIGHT, sample_positions(1)), machine.simt).works[0]
    launch = load_mix(pipeline, machine.compute_capability).launch(work, machine.sm.warp_size)
    timing = price([launch], machine)[0]
    counts = work.counts()
    if counts["SAMPLE_TESTS"] == 0:
        raise TilestampError(f"squares of {area} pixels give no sample to test")
    return {
        "machine": machine_name,
        "area": area,
        "algorithm": name,
        "ns": 1e6 * timing.milliseconds / len(polygons.patch),
        "bound": timing.bound,
        "ste": 100 * counts["SAMPLE_HITS"] / counts["SAMPLE_TESTS"],
        "test_simd_efficiency": counts["SAMPLE_TESTS"] / (machine.sm.warp_size * counts["TEST_WARPS"]),
    }


def _winners(table: pd.DataFrame) -> list[str]:
    """Name the fastest exact algorithm, and the fastest of all, at each area."""
    notes = []
    for machine, rows in table.groupby("machine", sort=False):
        best = rows.loc[rows.groupby("area")["ns"].idxmin()]
        won = ", ".join(f"{r['area']:g} px {r['algorithm']} ({r['bound']})" for r in best.to_dict("records"))
        notes.append(f"{machine}, fastest: {won}.")
    return notes


def _answer(table: pd.DataFrame) -> str:
    """The winner on the smallest and on the largest polygons of each machine."""
    best = table.loc[table.groupby(["machine", "area"], sort=False)["ns"].idxmin()]
    said = []
    for machine, rows in best.groupby("machine", sort=False):
        ends = [rows.loc[rows.area == area].iloc[0] for area in (rows.area.min(), rows.area.max())]
        said.append(f"on the {machine} " + " and ".join(f"{end.algorithm} at {end.area:g} px" for end in ends))
    return f"Modelled: {'; '.join(said)}."


def _figure(table: pd.DataFrame, machine: str) -> Figure:
    rows = table[table.machine == machine]
    plot = partial(lines, rows, x="area", y="ns", by="algorithm", x_label="area [pixels]", y_label="ns a polygon")
    return Figure(machine, partial(plot, title=f"Modelled time of a square on {machine}", log_x=True, log_y=True))
