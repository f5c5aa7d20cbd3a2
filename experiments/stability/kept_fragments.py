"""Four fragments a pixel: what Zhang's ROP loses of more layers (Zhang 2025, stage 9).

A pixel keeps four covered fragments in shared memory and sorts those; the original does not check for more. Here the
first four found are kept: the list has the newest first. Cure: no limit, as many rounds as the longest list needs.
"""

from functools import cache, partial

import numpy as np
import pandas as pd

from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Figure, Result
from tilestamp.experiments.stability.boundary import Boundary, atlas_result, bisect
from tilestamp.experiments.stability.layers import layered
from tilestamp.reports.plots import lines
from tilestamp.simulator.run import Run
from tilestamp.simulator.simulation import simulate
from tilestamp.simulator.stages.zhang2025.pixel_shader import FRAGMENT_OUT_BYTES, OVERDRAW
from tilestamp.simulator.stages.zhang2025.rop import KEPT

QUESTION = "How many layers do four fragments a pixel stand for?"
SLOW = True  # the kernels of this pipeline are compiled for nothing else in the first run

SIZE = 64  # pixels a side
CELLS = 4
LAYERS = (1, 2, 3, 4, 5, 6, 8, 12)
ORDERS = {"oit": 5, "api": 0}  # and seed of the warps: api at its worst, back to front, where early z rejects nothing
OPACITY = 0.5
MACHINE = "rtx3080"


@cache
def frame(layers: int, order: str, limit: int = KEPT) -> Run:
    """Draw the layers, transparent where the order is ``oit``."""
    opacity = OPACITY if order == "oit" else 1.0
    scene = layered(layers, CELLS, ORDERS[order], opacity)
    return simulate(scene, "binned", MACHINE, width=SIZE, height=SIZE, order=order, fragments_a_pixel=limit)


def lost(layers: int, order: str) -> tuple[int, int]:
    """Fragments beyond the limit, and pixels of another colour."""
    made, whole = frame(layers, order), frame(layers, order, 0)
    wrong = int((made.image != whole.image).any(axis=2).sum())
    return int(made.frame.facts["fragments lost beyond the kept ones"]), wrong


def boundary(order: str) -> tuple[float | None, float | None]:
    """Layers that are drawn right, and layers that are not."""
    return bisect(lambda layers: lost(int(layers), order)[1] > 0, LAYERS[0], LAYERS[-1], scale="integer")


def beyond_the_stream(layers: int) -> int:
    """Fragments that the stream between pixel shader and ROP has no room for in the original; here it grows."""
    return int(frame(layers, "oit").frame.facts["fragments beyond the stream's room"])


def stream_boundary() -> tuple[float | None, float | None]:
    """Layers whose fragments fit the stream, and layers whose do not."""
    return bisect(lambda layers: beyond_the_stream(int(layers)) > 0, LAYERS[0], LAYERS[-1], scale="integer")


def run(progress: Progress) -> Result:
    """Add layers."""
    rows = []
    for layers in LAYERS:
        progress(f"stability/kept_fragments: {layers} layers")
        for order in ORDERS:
            fragments, pixels = lost(layers, order)
            times = (frame(layers, order, limit).milliseconds for limit in (KEPT, 0))
            rows.append((layers, order, fragments, 100 * pixels / SIZE**2, *times))
    table = pd.DataFrame(rows, columns=["layers", "order", "fragments lost", "wrong", "four_ms", "all_ms"])
    boundaries = [_boundary(table, order) for order in ORDERS]
    exceed = f"{beyond_the_stream(LAYERS[-1])} fragments at {LAYERS[-1]} layers exceed its room of {OVERDRAW} a pixel"
    about = f"{exceed} (a quad takes four)", "let it grow, as here", f"{4 * FRAGMENT_OUT_BYTES} bytes a quad"
    boundaries.append(Boundary("binned, fragment stream", "layers over the screen", "", *stream_boundary(), *about))
    figures = [Figure("wrong", partial(
        lines, table, x="layers", y="wrong", by="order", title=f"Pixels that lack a layer with {KEPT} fragments kept",
        x_label="layers over a pixel", y_label="pixels [%]",
    ))]  # fmt: skip
    return atlas_result(
        "stability/kept_fragments", "Four fragments a pixel", boundaries, figures, [], {"layers": table}
    )


def _boundary(table: pd.DataFrame, order: str) -> Boundary:
    rows = table[table.order == order]
    last = rows.iloc[-1]
    wrong = f"layers are missing: {np.round(last.wrong):.0f} % of the pixels at {last.layers} layers"
    times = f"{last.all_ms:.4g} ms instead of {last.four_ms:.4g} on {MACHINE} at {last.layers} layers"
    about = wrong, "keep all fragments", f"{times}, more shared memory not counted"
    return Boundary(f"binned, order {order}", "layers over a pixel", "", *boundary(order), *about)
