"""Transparent layers beyond what a method has room for: fixed lists and k-buffers in CudaRaster's ROP.

Layers over the whole screen, nearest first or farthest first. Right is what lists without a bound make of them; a
method has broken where a byte is off by more than its own rounding. Cure: linked lists.
"""

from functools import cache, partial
from typing import Any

import numpy as np
import pandas as pd

from tilestamp.experiments.exploration.transparent_scenes import stack
from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Figure, Result
from tilestamp.experiments.stability.boundary import Boundary, atlas_result, bisect
from tilestamp.reports.plots import lines
from tilestamp.simulator.run import Run
from tilestamp.simulator.simulation import simulate

QUESTION = "How many transparent layers do fixed lists and k-buffers stand for, and in which order?"
SIZE, MACHINE = 32, "gtx480"
LAYERS = (1, 2, 3, 4, 5, 6, 8, 10, 12, 16)
ROUNDING = 2  # steps of a byte: blending in bytes rounds once a layer, and is off by 1 here
ROOM = 4
METHODS: dict[str, dict[str, Any]] = {
    f"fixed lists of {ROOM}": {"lists": "fixed", "room": ROOM},
    f"fixed lists of {2 * ROOM}": {"lists": "fixed", "room": 2 * ROOM},
    f"k-buffer of {ROOM}": {"blend": "k-buffer", "layers": ROOM},
    f"k-buffer of {2 * ROOM}": {"blend": "k-buffer", "layers": 2 * ROOM},
    "over": {},
}
EXACT: dict[str, Any] = {"lists": "linked"}


@cache
def _frame(layers: int, front_first: bool, **_: Any) -> Run:
    return draw(layers, EXACT, front_first=front_first)


def draw(layers: int, options: dict[str, Any], *, front_first: bool) -> Run:
    """Draw the layers."""
    scene = stack(SIZE, layers, front_first=front_first)
    return simulate(
        scene, "cudaraster", MACHINE, width=SIZE, height=SIZE, mode="blend", cull_backfaces=False, **options
    )


def off(layers: int, method: str, *, front_first: bool) -> int:
    """Steps that the worst byte is off."""
    made = draw(layers, METHODS[method], front_first=front_first)
    exact = _frame(layers, front_first).image
    return int(np.abs(made.image.astype(int) - exact.astype(int)).max())


def boundary(method: str, *, front_first: bool) -> tuple[float | None, float | None]:
    """Layers that are drawn right, and layers that are not."""
    return bisect(
        lambda layers: off(int(layers), method, front_first=front_first) > ROUNDING, LAYERS[0], LAYERS[-1],
        scale="integer",
    )  # fmt: skip


def run(progress: Progress) -> Result:
    """Add layers, in both orders."""
    progress("stability/bounded_layers")
    orders = {"nearest first": True, "farthest first": False}
    rows = [
        (f"{method}, {order}", layers, off(layers, method, front_first=first))
        for order, first in orders.items()
        for method in METHODS
        for layers in LAYERS
    ]
    table = pd.DataFrame(rows, columns=["method", "layers", "off"])
    found = [_boundary(table, method, order, first) for method in METHODS for order, first in orders.items()]
    figures = [Figure("off", partial(
        lines, table, x="layers", y="off", by="method", title="Transparent layers: what bounded methods make of them",
        x_label="layers over a pixel", y_label="worst byte [of 255]",
    ))]  # fmt: skip
    title = "Transparent layers beyond fixed lists and k-buffers"
    return atlas_result("stability/bounded_layers", title, found, figures, [], {"layers": table})


def _boundary(table: pd.DataFrame, method: str, order: str, front_first: bool) -> Boundary:
    worst = table[table["method"] == f"{method}, {order}"].iloc[-1]
    own, lists = (draw(LAYERS[-1], options, front_first=front_first) for options in (METHODS[method], EXACT))
    name, ends = f"cudaraster, {method}, {order}", boundary(method, front_first=front_first)
    wrong = f"colours are wrong: up to {worst.off} of 255 at {worst.layers} layers"
    cost = (
        f"{lists.milliseconds:.4g} ms instead of {own.milliseconds:.4g} on {MACHINE} at {LAYERS[-1]} layers, and "
        f"{lists.frame.facts['list_bytes'] / SIZE**2:.0f} bytes a pixel"
    )
    return Boundary(name, "transparent layers over a pixel", "", *ends, wrong, "linked lists", cost)
