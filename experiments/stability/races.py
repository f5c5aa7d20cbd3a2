"""Unordered writes: a fragment written after its depth, unprotected (Ru 2016), over many orders of the warps.

Between a thread's atomicMin and its write another thread may put a nearer depth and write first: the farther fragment
is left standing. The same frame is drawn in many orders of its warps, each a possible run of the machine; the map
shows in what share of the runs a pixel is wrong.
"""

from functools import cache, partial
from itertools import pairwise

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Figure, Result
from tilestamp.experiments.stability.boundary import Boundary, atlas_result, bisect
from tilestamp.experiments.stability.layers import layered
from tilestamp.reports.heatmap import heat_map
from tilestamp.reports.plots import lines
from tilestamp.simulator.run import Run
from tilestamp.simulator.simulation import simulate

QUESTION = "From how many layers on do unordered writes leave wrong pixels?"
SLOW = True  # the kernels of this pipeline are compiled for nothing else in the first run

SIZE = 96  # pixels a side
CELLS = 16  # 512 triangles a layer, 36 pixels each on screen
LAYERS = (1, 2, 3, 4, 6, 8, 12, 16)
SEEDS = 25
EDGES = 0.001  # share of pixels on edges: two triangles of a warp there are as near but for rounding, and race in step
SHOWN = 8  # layers of the map
MACHINE = "gt750m"  # Ru's


@cache
def frame(layers: int, seed: int) -> Run:
    """Draw the layers in one order of the warps."""
    return simulate(layered(layers, CELLS, seed), "per-primitive", MACHINE, width=SIZE, height=SIZE)


@cache
def wrong(layers: int, seed: int) -> NDArray[np.bool_]:
    """Pixels that show a triangle that is not the nearest."""
    return frame(layers, seed).frame.maps["pixels wrong by the race"] > 0


def wrong_runs(layers: int, seeds: int = SEEDS) -> NDArray[np.float64]:
    """Share of the runs in which each pixel is wrong."""
    shares: NDArray[np.float64] = np.mean([wrong(layers, seed) for seed in range(1, seeds + 1)], axis=0)
    return shares


def boundary(seeds: int = SEEDS) -> tuple[float | None, float | None]:
    """Layers that go wrong at edges at most, and layers that do elsewhere."""
    return bisect(
        lambda layers: bool(wrong_runs(int(layers), seeds).mean() > EDGES), LAYERS[0], LAYERS[-1], scale="integer"
    )


def run(progress: Progress) -> Result:
    """Draw more and more layers in many orders."""
    rows = []
    for layers in LAYERS:
        progress(f"stability/races: {layers} layers, {SEEDS} orders")
        percent = [100 * float(wrong(layers, seed).mean()) for seed in range(1, SEEDS + 1)]
        spread = {"worst run": max(percent), "mean": float(np.mean(percent)), "best run": min(percent)}
        rows += [{"layers": layers, "runs": name, "wrong": share} for name, share in spread.items()]
    table = pd.DataFrame(rows)
    shares = wrong_runs(SHOWN)
    safe = simulate(layered(SHOWN, CELLS), "tiled", MACHINE, width=SIZE, height=SIZE)
    ever, always = 100 * float((shares > 0).mean()), 100 * float((shares == 1).mean())
    fault = f"with {SHOWN} layers {ever:.0f} % of the pixels are wrong in one of {SEEDS} runs, {always:.2f} % in all"
    cure = "a block a tile, depth and colour in registers (pipeline tiled)"
    cost = f"{safe.milliseconds:.4g} ms instead of {frame(SHOWN, 0).milliseconds:.4g} on {MACHINE}"
    found = Boundary("per-primitive", "layers over a pixel", "", *boundary(), fault, cure, cost)
    title = f"Share of {SEEDS} runs in which a pixel is wrong, {SHOWN} layers"
    map_ = partial(heat_map, shares, title=title, unit="share of the runs", size=(SIZE, SIZE))
    title = f"Pixels left wrong by unprotected writes, {SEEDS} orders of the warps"
    by_layers = partial(lines, table, x="layers", y="wrong", by="runs", title=title)
    by_layers = partial(by_layers, x_label="layers over a pixel", y_label="pixels that are wrong [%]")
    figures = [Figure("map", map_), Figure("layers", by_layers)]
    notes = [
        f"Between two runs of {SHOWN} layers {_between():.2f} % of the pixels differ on average.",
        "How many rounds a write may be late (1 to 3) is assumed; with another number the shares change, not the cure.",
    ]
    return atlas_result("stability/races", "Unordered writes", [found], figures, notes, {"layers": table})


def _between() -> float:
    """Mean share of pixels in which a run differs from the next, percent."""
    runs = [wrong(SHOWN, seed) for seed in range(1, SEEDS + 1)]
    return 100 * float(np.mean([(a != b).mean() for a, b in pairwise(runs)]))
