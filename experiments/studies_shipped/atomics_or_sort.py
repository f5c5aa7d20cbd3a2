"""Atomics against sort as conflicts grow: FreePipe and CudaRaster draw the same triangles in more and more layers.

FreePipe has an atomic for each fragment, on the frame buffer, or only for those that are nearer than what it reads
there first. CudaRaster sorts triangles to tiles, in which each pixel has one owner. As many triangles of one size lie
at random in squares of fewer and fewer pixels.
"""

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Figure, Result, reported
from tilestamp.experiments.questions.best import Boundary, boundaries
from tilestamp.experiments.studies.study import Study
from tilestamp.experiments.studies_shipped.finding import finding, table_of
from tilestamp.reports.plots import lines
from tilestamp.simulator.scenes import Scene

QUESTION = "At how many layers do atomics lose to sorting?"
SLOW = True  # runs when it is named: tilestamp reproduce studies
MACHINES = ("gtx480", "gtx680", "gtx1080", "h200")
TRIANGLES, LEG = 1 << 15, 8.0  # each of LEG x LEG / 2 pixels
SIZE = 1024  # pixels of a side of the screen
SIDES = (1024, 512, 256, 128, 64, 32)  # of the square that they lie in
SORT = "sort"
METHODS = {
    "atomics": {"pipeline": "freepipe"},
    "atomics after a look": {"pipeline": "freepipe", "early": True},
    SORT: {"pipeline": "cudaraster"},
}


def run(progress: Progress) -> Result:
    """Price both on each machine, for each number of layers."""
    scenes = {f"{layers(side):g}": {"scene": piled(side)} for side in SIDES}
    study = Study(
        title="atomics or sort",
        fixed={"size": f"{SIZE}x{SIZE}"},
        grid={"layers": scenes, "method": METHODS, "machine": list(MACHINES)},
        record=("milliseconds", "bound"),
    )
    table = table_of(study, progress)
    table = table.assign(layers=table["layers"].astype(float))
    crossings = boundaries(table, "method", "layers", ["machine"])
    cells = [
        reported(f"{row.machine}, {row.layers:g} layers", row.method, "ms", row.milliseconds)
        for row in table.itertuples()
    ]
    figure = Figure("layers", partial(_draw, table))
    title = f"Atomics against sort: {TRIANGLES:,} triangles of {LEG * LEG / 2:g} pixels in ever more layers"
    return finding("atomics_or_sort", title, cells, [figure], notes(table, crossings), {"times": table})


def layers(side: int) -> float:
    """Triangles over a pixel of the square, in the mean."""
    return TRIANGLES * LEG * LEG / 2 / side**2


def piled(side: int) -> Scene:
    """Right triangles at random places and depths in a square in the middle of the screen."""
    random = np.random.default_rng(5)
    room = max(side - LEG, 1.0)
    corner = (SIZE - side) / 2 + random.random((TRIANGLES, 1, 2)) * room
    pixels = corner + np.array([[0.0, 0.0], [LEG, 0.0], [0.0, LEG]])
    positions = np.ones((TRIANGLES, 3, 4))
    positions[..., :2] = pixels * 2 / SIZE - 1
    positions[..., 2] = random.random((TRIANGLES, 1)) * 1.8 - 0.9
    order = np.arange(3 * TRIANGLES, dtype=np.int32).reshape(-1, 3)
    return Scene.from_clip_space(positions.reshape(-1, 4).astype(np.float32), order, f"pile in {side} px")


def notes(table: pd.DataFrame, crossings: list[Boundary]) -> list[str]:
    """Say which is faster where, and what more layers cost each."""
    return [_machine(str(machine), rows, crossings) for machine, rows in table.groupby("machine", sort=False)]


def _machine(machine: str, rows: pd.DataFrame, crossings: list[Boundary]) -> str:
    mine = [cross for cross in crossings if cross.place["machine"] == machine]
    where = "; ".join(f"{one.before} is faster up to {one.at:.3g} layers, then {one.after}" for one in mine)
    fewest = rows[rows["layers"] == rows["layers"].min()].set_index("method")["milliseconds"]
    grown = "; ".join(_grown(rows[rows["method"] == name], name) for name in METHODS)
    return (
        f"{machine}: {where or f'{fewest.idxmin()} is faster throughout'}. From the fewest to the most layers {grown}."
    )


def _grown(rows: pd.DataFrame, name: str) -> str:
    first, last = rows.loc[rows["layers"].idxmin()], rows.loc[rows["layers"].idxmax()]
    ratio = last["milliseconds"] / first["milliseconds"]
    return f"{name} takes {ratio:.2g} times as long ({first['bound']}, then {last['bound']})"


def _draw(table: pd.DataFrame, path: Path) -> None:
    times = table.pivot_table("milliseconds", ["machine", "layers"], "method", sort=False)
    ratios = times.drop(columns=SORT).div(times[SORT], axis=0)
    ratio = ratios.reset_index().melt(["machine", "layers"], var_name="method", value_name="ratio")
    lines(
        ratio.assign(line=ratio["machine"] + ", " + ratio["method"]), path, x="layers", y="ratio", by="line",
        log_x=True, log_y=True, title="FreePipe (atomics) against CudaRaster (sort): below 1 atomics are faster",
        x_label="triangles over a pixel", y_label="time with atomics / with sort",
    )  # fmt: skip
