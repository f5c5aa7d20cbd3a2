"""Fixed tile lists: a tenth of the triangles a tile, unchecked (Ru 2016, "Tile-based rasterization").

Each tile's list has room for all triangles of a model of at most 100, else for a tenth of them. What is appended
beyond is lost here (in the original it overwrites the next tile's list). Cure: count, scan, fill.
"""

from functools import cache, partial

import numpy as np
import pandas as pd

from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Figure, Result
from tilestamp.experiments.stability.boundary import Boundary, atlas_result, bisect
from tilestamp.experiments.stability.layers import VIEW
from tilestamp.reports.plots import lines
from tilestamp.simulator.run import Run
from tilestamp.simulator.scenes.scene import Mesh, Scene
from tilestamp.simulator.simulation import simulate

QUESTION = "When do Ru's tile lists overflow?"
SLOW = True  # the kernels of this pipeline are compiled for nothing else in the first run

SIZE = 128  # pixels a side
PIXEL = 2 * 5 * np.tan(np.radians(15)) / SIZE  # of the screen, in model units at z = 0
MODEL = 1000  # triangles
SHARES = (0.01, 0.02, 0.05, 0.08, 0.1, 0.12, 0.15, 0.2, 0.3, 0.5)
COUNTS = (16, 400)  # triangles, all in one tile
MACHINE = "gt750m"  # Ru's


def model(count: int, crowd: int) -> Scene:
    """``crowd`` triangles over one tile, each nearer than the one before; the others spread over the screen."""
    corners = np.zeros((count, 3, 2))
    corners[:crowd] = np.array([[1, 1], [6, 1], [1, 6]]) + np.random.default_rng(3).uniform(0, 1, (crowd, 1, 2))
    places = 8 * np.stack(np.divmod(np.arange(count - crowd) % 128, 16), axis=1) - 64  # in the other half
    corners[crowd:] = places[:, None] + np.array([[1, 1], [6, 1], [1, 6]])
    positions = np.ones((count, 3, 4), np.float32)
    positions[:, :, :2] = corners * PIXEL
    positions[:, :, 2] = 1e-4 * np.arange(count)[:, None]
    triangles = np.arange(3 * count, dtype=np.int32).reshape(-1, 3)
    return Scene(
        f"{crowd} of {count} in a tile", mesh=Mesh(positions.reshape(-1, 4), triangles), views={"default": VIEW}
    )


@cache
def frame(count: int, crowd: int, capacity: str = "original") -> Run:
    """Draw with the original's room, or with room counted first."""
    return simulate(model(count, crowd), "tiled", MACHINE, width=SIZE, height=SIZE, capacity=capacity)


def lost(count: int, crowd: int) -> tuple[int, int]:
    """Entries without room, and pixels that show another triangle."""
    made, whole = frame(count, crowd), frame(count, crowd, "safe")
    assert made.triangle_ids is not None  # noqa: S101 - it draws triangles
    wrong = int((made.triangle_ids != whole.triangle_ids).sum())
    return int(made.frame.facts["list entries lost by overflow"]), wrong


def share_boundary() -> tuple[float | None, float | None]:
    """Share of a model in one tile that fits, and that does not."""
    found = bisect(lambda crowd: lost(MODEL, int(crowd))[0] > 0, SHARES[0] * MODEL, SHARES[-1] * MODEL, scale="integer")
    holds, breaks = (None if value is None else value / MODEL for value in found)
    return holds, breaks


def count_boundary() -> tuple[float | None, float | None]:
    """Triangles, all in one tile, that fit, and that do not."""
    return bisect(lambda count: lost(int(count), int(count))[0] > 0, *COUNTS, scale="integer")


def run(progress: Progress) -> Result:
    """Crowd one tile."""
    rows = []
    for share in SHARES:
        progress(f"stability/tile_lists: {share:.0%} in one tile")
        entries, pixels = lost(MODEL, round(share * MODEL))
        rows.append({"share": share, "entries lost": entries, "wrong pixels": pixels})
    table = pd.DataFrame(rows)
    calm = round(SHARES[0] * MODEL)
    fixed, safe = frame(MODEL, calm).milliseconds, frame(MODEL, calm, "safe").milliseconds
    cost = f"{safe:.4g} ms instead of {fixed:.4g} on {MACHINE} where nothing overflows"
    small = lost(101, 101)
    most = f"{rows[-1]['entries lost']} entries and {rows[-1]['wrong pixels']} of 64 pixels at {SHARES[-1]:.0%}"
    falls = f"room falls from all to a tenth of them: {small[0]} entries and {small[1]} pixels are lost at 101"
    boundaries = [
        Boundary("tiled, original lists", parameter, "", *ends, wrong, "count, scan, fill (capacity safe)", cost)
        for parameter, ends, wrong in (
            (f"share of {MODEL} triangles in one tile", share_boundary(), f"triangles are lost: {most}"),
            ("triangles, all in one tile", count_boundary(), falls),
        )
    ]
    figures = [Figure("lost", partial(
        lines, table.melt("share", var_name="what", value_name="count"), x="share", y="count", by="what",
        title=f"What Ru's fixed lists lose, {MODEL} triangles", x_label="share of the triangles in one tile",
        y_label="entries, pixels",
    ))]  # fmt: skip
    return atlas_result("stability/tile_lists", "Fixed tile lists", boundaries, figures, [], {"shares": table})
