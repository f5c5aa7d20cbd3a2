"""One frame on machines that nobody built: SMs, clock and bandwidth of a GTX 280, each from half to twice what it has.

The frame is executed once; each machine only prices it. The page has a slider for each number.
"""

from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Chart, Figure, Result, reported
from tilestamp.experiments.studies_shipped.finding import WHAT_IF, finding
from tilestamp.reports.heatmap import heat_map
from tilestamp.reports.picture import picture
from tilestamp.simulator.run import Run
from tilestamp.simulator.simulation import simulate

QUESTION = "What would more SMs, a faster clock or more bandwidth do to a frame, stage by stage?"
SCENE, PIPELINE, MACHINE, SIZE = "teapot", "micropolygon", "gtx280", (800, 600)
NUMBERS = {"SMs": "sm.count", "clock": "sm.clock_mhz", "bandwidth": "memory.dram_gb_per_s"}
UNITS = {"SMs": "", "clock": " MHz", "bandwidth": " GB/s"}
FACTORS = (0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0)
MAP = "tests"
WHAT = f"{SCENE} by {PIPELINE} on a {MACHINE.upper()}, {SIZE[0]}x{SIZE[1]}"


def run(progress: Progress) -> Result:
    """Execute one frame, and price it on a grid of machines."""
    progress(f"studies_shipped/what_if: {SCENE}, {len(FACTORS) ** len(NUMBERS)} machines")
    made = simulate(SCENE, PIPELINE, MACHINE, width=SIZE[0], height=SIZE[1])
    grid = priced(made)
    times = grid.groupby(list(NUMBERS))["milliseconds"].sum()
    now, doubled = float(times[1.0, 1.0, 1.0]), twice(times)
    cells = [reported("as it was", "frame", "ms", now)]
    cells += [reported(f"twice the {name}", "frame", "ms", ms) for name, ms in doubled.items()]
    figures = [
        Figure("picture", partial(picture, made.image, title=f"Picture: {WHAT}")),
        Figure("heat-map", partial(_draw_map, made)),
    ]
    tables = {"grid": grid, "tiles": tiles(made)}
    title = f"One frame on machines that nobody built: {WHAT}"
    return finding("what_if", title, cells, figures, notes(now, doubled), tables, [WHAT_IF], charts(made))


def priced(made: Run) -> pd.DataFrame:
    """Milliseconds of each stage on each machine, and the term that holds in the longest launch of the stage."""
    factors = pd.DataFrame(product(FACTORS, repeat=len(NUMBERS)), columns=list(NUMBERS))
    numbers = {number: factors[name] * made.machine.number(number) for name, number in NUMBERS.items()}
    numbers[NUMBERS["SMs"]] = numbers[NUMBERS["SMs"]].round().astype(int)
    prices = made.prices(numbers)
    parts = []
    for stage in dict.fromkeys(prices.stages):
        mine = np.flatnonzero(np.array(prices.stages) == stage)
        longest = mine[prices.milliseconds[:, mine].argmax(axis=1)]
        bound = prices.bounds[np.arange(len(factors)), longest]
        total = prices.milliseconds[:, mine].sum(axis=1).round(4)
        parts.append(factors.assign(stage=stage, milliseconds=total, bound=bound))
    return pd.concat(parts, ignore_index=True)


def twice(times: "pd.Series[float]") -> dict[str, float]:
    """Milliseconds of the frame with each number doubled alone, and with all."""
    alone = {name: tuple(2.0 if other == name else 1.0 for other in NUMBERS) for name in NUMBERS}
    return {name: float(times[at]) for name, at in {**alone, "all three": (2.0, 2.0, 2.0)}.items()}


def tiles(made: Run) -> pd.DataFrame:
    """Sample tests of each tile that has any; rows count from the top of the screen."""
    counts = made.frame.maps[MAP]
    y, x = np.nonzero(counts)
    rows = len(counts) - 1 - y if made.frame.tiles_from_below else y
    return pd.DataFrame({"x": x, "y": rows, MAP: counts[y, x].astype(int)})


def notes(now: float, doubled: dict[str, float]) -> list[str]:
    """Say what each number does when it is doubled."""
    told = ", ".join(f"{name} {ms / now - 1:+.0%}" for name, ms in doubled.items())
    return [
        f"The frame takes {now:.1f} ms; twice as much of one number changes that by: {told}.",
        "Latencies, atomic units, launch costs and all else stay a GTX 280's: assumed.",
    ]


def charts(made: Run) -> list[Chart]:
    """Sliders over the grid, and the map of tiles."""
    has = {name: f"{made.machine.number(number):g}{UNITS[name]}" for name, number in NUMBERS.items()}
    sliders = {name: f"{name}, times {value}" for name, value in has.items()}
    bars = {"sliders": sliders, "bar": "stage", "value": "milliseconds", "color": "bound", "unit": "ms"}
    return [
        Chart(
            name="sliders", kind="sliders", table="grid", of=bars,
            title="Time of each stage on the machine of the sliders, and the term that bounds it; ticks: a GTX 280.",
            alt=f"Bars: milliseconds of each stage of {WHAT}, with sliders for SMs, clock and bandwidth.",
        ),
        Chart(
            name="tiles", kind="tiles", table="tiles", of=_map(made),
            title="Sample tests in each tile of 8x8 pixels: brightest where sub-patches lie on top of each other.",
            alt=f"Map of {WHAT}: sample tests in each tile, with a slider from which number on tiles are shown.",
        ),
    ]  # fmt: skip


def _map(made: Run) -> dict[str, Any]:
    rows, columns = made.frame.maps[MAP].shape
    return {"x": "x", "y": "y", "value": MAP, "size": (columns, rows)}


def _draw_map(made: Run, path: Path) -> None:
    heat_map(
        made.frame.maps[MAP], path, title=f"Sample tests a tile: {WHAT}", unit="sample tests a tile", size=SIZE,
        tile=made.frame.tile, from_below=made.frame.tiles_from_below,
    )  # fmt: skip
