"""One-pixel holes: a depth that is evaluated twice, rounded otherwise the second time, and compared as an integer.

Zhang (2025, "Limitation & Failure Case") reports holes of one pixel in release builds and suspects the conversion of
float depth to unsigned. Early z puts the least integer depth of a pixel into the depth buffer; the fragment's depth is
evaluated again for the ROP, which drops what is greater than the buffer. In the public source's first version the
second evaluation steps three pixels of a quad from the fourth (``zhang2025.depth``): where it comes out
larger, the pixel keeps no fragment at all. The same happens where a compiler contracts a multiplication and an addition
in one of two equal expressions (assumed, for comparison).

The source's later version subtracts 0.0001 in the second evaluation: a slack. What it costs is order: surfaces closer
than the slack are drawn in the order of their triangles.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from tilestamp.experiments.harness.result import Figure, Result
from tilestamp.experiments.stability.boundary import Boundary, atlas_result, bisect, bracket
from tilestamp.experiments.stability.methods import MACHINE, machine
from tilestamp.models.kernel import kernel
from tilestamp.reports.plots import lines
from tilestamp.simulator.stages.laine2011.exact import fma
from tilestamp.simulator.stages.zhang2025.depth import DEPTH_STEPS, FRAGMENT_DEPTHS, depth_24_bit, fragment_depth
from tilestamp.simulator.stages.zhang2025.triangle_setup import evaluate

QUESTION = "When does a depth that is computed twice leave holes?"
SIZE = 64  # pixels
PLANES = 16  # directions in which the plane rises
RANGES = tuple(2.0**-k for k in range(31, 0, -2))  # depth across the screen, of a depth range of 1
MIDDLES = (0.06, 0.25, 0.74)  # depth of the screen's middle
MIDDLE = 0.74  # where perspective puts most of a scene: far
WRONG = 0.001  # share of the pixels from which we say that it breaks
PAIRS = 16  # of planes, a little apart, that must all keep their order
PUBLISHED_SLACK = 1e-4  # of the depth range, in the original's source
PUBLISHED_STEPS = round(PUBLISHED_SLACK * float(DEPTH_STEPS))
TILT = 0.05  # depth across the screen of the pair of planes
FULL_HD = 1920 * 1080
WORD = 4  # bytes
STEPPED, CONTRACTED = FRAGMENT_DEPTHS["stepped"], -1
WAYS = {"stepped in its quad": STEPPED, "contracted": CONTRACTED}
_HALF = np.float32(0.5)


def run(progress: Callable[[str], None]) -> Result:
    """Tilt a plane at several depths; find the tilt of the holes, and the slack that closes all."""
    progress("depth evaluated twice")
    table = pd.DataFrame(
        [
            {"second": name, "middle": middle, "range": reach, "holes": holes(reach, middle, way=way)}
            for name, way in WAYS.items()
            for middle in MIDDLES
            for reach in RANGES
        ]
    )
    slack = needed_slack()
    tilts = [_tilt(name, way) for name, way in WAYS.items()]
    orders = [_order(steps, name) for steps, name in ((0, ""), (slack, ""), (PUBLISHED_STEPS, ", as published"))]
    figure = Figure("holes", lambda path: _plot(table, path))
    title = "One-pixel holes from integer depth"
    return atlas_result(
        "stability/depth_twice", title, [*tilts, *orders], [figure], _notes(table, slack), {"holes": table}
    )


def _tilt(name: str, way: int) -> Boundary:
    """A row of the atlas: from which tilt a plane has holes."""
    wrong, cure = f"one pixel in {1 / WRONG:.0f} stays empty", f"a slack of {needed_slack(way)} steps of 24 bits"
    cost = "what a slack costs is order, see its row"
    method, parameter = f"binned, second depth {name}", "depth across the screen"
    return Boundary(method, parameter, "of the range", *boundary(way), wrong, cure, cost)


@kernel(error_model="numpy")
def _evaluate_twice(planes: Any, way: Any, first: Any, second: Any) -> None:
    """Integer depths (H, W) over the pixels: as early z has them, and as the ROP gets them ``way``."""
    a, b, c = planes[0]
    for y in range(first.shape[0]):
        for x in range(first.shape[1]):
            px, py = np.float32(x) + _HALF, np.float32(y) + _HALF
            first[y, x] = depth_24_bit(evaluate(planes[0], px, py))
            if way == CONTRACTED:
                second[y, x] = depth_24_bit(fma(a, px, b * py) + c)
            else:
                second[y, x] = fragment_depth(planes, x, y, way)


def twice(reach: float, middle: float, way: int) -> NDArray[np.int64]:
    """Steps by which the second evaluation lies farther, (PLANES, SIZE, SIZE); negative is nearer."""
    rng = np.random.default_rng(5)
    depth = np.zeros((2, PLANES, SIZE, SIZE), np.int64)
    for k, angle in enumerate(rng.random(PLANES) * 2 * np.pi):
        slope = reach / SIZE * np.array([np.cos(angle), np.sin(angle)]) / np.abs([np.cos(angle), np.sin(angle)]).sum()
        plane = np.array([[*slope, middle - slope.sum() * SIZE / 2]], np.float32)
        _evaluate_twice(plane, way, depth[0, k], depth[1, k])
    later: NDArray[np.int64] = depth[1] - depth[0]
    return later


def holes(reach: float, middle: float = MIDDLE, slack: int = 0, way: int = STEPPED) -> float:
    """Share of the pixels that lose their only fragment."""
    return float((twice(reach, middle, way) > slack).mean())


def needed_slack(way: int = STEPPED) -> int:
    """Least slack, in steps, that closes every hole at any tilt and depth tried."""
    return int(max(twice(reach, middle, way).max() for reach in RANGES for middle in MIDDLES))


def boundary(way: int = STEPPED) -> tuple[float | None, float | None]:
    """Depth across the screen with few holes and with many."""
    swept = [holes(reach, way=way) > WRONG for reach in RANGES]
    return bisect(lambda reach: holes(reach, way=way) > WRONG, *bracket(RANGES, swept), tolerance=0.05)


def loses_order(separation: float, slack: int) -> bool:
    """Whether a farther plane, drawn later, passes the depth test somewhere against a nearer one."""
    near, far = np.empty((2, SIZE, SIZE), np.int64), np.empty((2, SIZE, SIZE), np.int64)
    slope = TILT / SIZE / 2
    for middle in MIDDLE + np.random.default_rng(6).random(PAIRS) * 1e-6:
        for depth, at in ((near, middle), (far, middle + separation)):
            _evaluate_twice(np.array([[slope, slope, at - slope * SIZE]], np.float32), STEPPED, *depth)
        if (far[1] - slack <= near[0]).any():
            return True
    return False


def order_boundary(slack: int) -> tuple[float | None, float | None]:
    """Separation that keeps the order and separation that loses it."""
    return bisect(lambda separation: loses_order(separation, slack), 0.1, 1e-9, tolerance=0.02)


def _order(slack: int, name: str) -> Boundary:
    """A row of the atlas: what a slack costs."""
    return Boundary(
        f"binned, slack of {slack} steps{name}", "separation of surfaces", "of the range", *order_boundary(slack),
        "the surface behind is drawn where its triangle comes later",
        "the first depth carried along, and no slack" if slack else "more bits", _carrying_cost() if slack else "",
    )  # fmt: skip


def _carrying_cost() -> str:
    """Price a word more in each fragment, written once and read once."""
    memory = machine().memory
    milliseconds = 2 * WORD * FULL_HD / (memory.dram_gb_per_s * memory.dram_efficiency * 1e6)
    return f"a word a fragment more is {milliseconds:.4f} ms of the {MACHINE}'s bandwidth for a screen of 1920 x 1080"


def _notes(table: pd.DataFrame, slack: int) -> list[str]:
    stepped = table[table.second == next(iter(WAYS))]
    at = stepped[stepped.range == RANGES[-1]].set_index("middle").holes
    lost = (
        f"Stepped, the flattest plane tried with a hole spans {stepped[stepped.holes > 0].range.min():.2g} of the depth"
        f" range; one that spans {RANGES[-1]:g} of it across {SIZE} x {SIZE} pixels loses {at.min():.2%} to"
        f" {at.max():.2%} of its pixels, by the depth of its middle ({at.idxmin():g} and {at.idxmax():g});"
        f" {PLANES} directions each."
    )
    needed = (
        f"Stepped, the second depth lies at most {slack} steps of 24 bits behind the first; the source's slack of"
        f" {PUBLISHED_SLACK:g} is {PUBLISHED_STEPS} steps."
    )
    return [lost, needed]


def _plot(table: pd.DataFrame, path: Path) -> None:
    """Draw the share of holes by tilt, a line a depth."""
    drawn = (table.holes > 0) & ((table.second == next(iter(WAYS))) | (table.middle == MIDDLE))
    line = table.second + table.middle.map(", middle at depth {:g}".format)
    lines(
        table[drawn].assign(line=line, holes=100 * table.holes), path, x="range", y="holes", by="line",
        title="Pixels of a tilted plane that stay empty: depth evaluated twice, in 24 bits",
        x_label=f"depth across {SIZE} pixels [of the depth range]", y_label="empty pixels [%]", log_x=True, log_y=True,
    )  # fmt: skip
