"""FreePipe's two half words: colours that no triangle has (Liu et al. 2010).

Without a 64-bit atomic a fragment is two words, each of 20 bits of depth and half of the colour, and each finds its own
minimum. Where two fragments have the same 20 bits, one can win the upper half and the other the lower. A minimum asks
for no order, so every run shows the same wrong colour.
"""

from functools import cache, partial

import numpy as np
import pandas as pd

from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Figure, Result
from tilestamp.experiments.stability.boundary import Boundary, atlas_result, bisect
from tilestamp.reports.plots import lines
from tilestamp.simulator.run import Run
from tilestamp.simulator.scenes.scene import Mesh, Scene
from tilestamp.simulator.simulation import simulate

QUESTION = "When does FreePipe show colours that no triangle has?"
SIZE = 128  # pixels a side
GAPS = tuple(2.0**-k for k in range(12, 25))  # NDC depth between the two layers
TILT = 0.1  # NDC depth from one side of the screen to the other: all last bits occur
MACHINE = "gtx480"
COLORS = ((1.0, 0.0, 0.5, 1.0), (0.9, 0.9, 0.1, 1.0))  # each has one smaller half


@cache
def frame(gap: float, packing: str) -> Run:
    """Two tilted sheets of two colours, ``gap`` apart."""
    corners = np.array([[-1, -1], [1, -1], [-1, 1], [1, 1]])
    positions = np.ones((8, 4), np.float32)
    for sheet in range(2):
        positions[4 * sheet : 4 * sheet + 4, :2] = corners
        positions[4 * sheet : 4 * sheet + 4, 2] = TILT / 2 * corners[:, 0] + gap * sheet
    one = np.array([[0, 1, 2], [1, 3, 2]])
    triangles = np.concatenate([one, one + 4]).astype(np.int32)
    mesh = Mesh(positions, triangles, np.repeat(COLORS, 4, axis=0).astype(np.float32), clip_space=True)
    return simulate(Scene("two sheets", mesh=mesh), "freepipe", MACHINE, width=SIZE, height=SIZE, packing=packing)


def mixed_pixels(gap: float, packing: str = "32") -> int:
    """Pixels whose colour no triangle has."""
    return int(frame(gap, packing).frame.facts["mixed_pixels"])


def boundary(packing: str = "32") -> tuple[float | None, float | None]:
    """Gap that holds, and gap that breaks."""
    return bisect(lambda gap: mixed_pixels(gap, packing) > 0, GAPS[0], GAPS[-1], tolerance=0.02)


def run(progress: Progress) -> Result:
    """Bring the sheets together."""
    progress("stability/half_words: two sheets")
    rows = [
        {"gap": gap, "packing": f"{packing} bits", "mixed": 100 * mixed_pixels(gap, packing) / SIZE**2}
        for packing in ("32", "64")
        for gap in GAPS
    ]
    table = pd.DataFrame(rows)
    halves, whole = (frame(GAPS[0], packing).milliseconds for packing in ("32", "64"))
    cost = f"{whole:.4g} ms instead of {halves:.4g} on {MACHINE}"
    boundaries = []
    for packing, *cure in (("32", "one 64-bit atomicMin", cost), ("64",)):
        worst = table[table.packing == f"{packing} bits"].mixed.max()
        about = f"halves of two colours meet: {worst:.0f} % of the pixels at worst", *cure
        name, ends = f"freepipe, packing {packing}", boundary(packing)
        boundaries.append(Boundary(name, "distance of two sheets", "NDC depth", *ends, *about))
    notes = [f"One step of the 20-bit depth is {2 * 2.0**-20:.3g} of NDC depth."]
    figures = [Figure("mixed", partial(
        lines, table, x="gap", y="mixed", by="packing", title="Pixels with a colour that no triangle has",
        x_label="distance of two sheets [NDC depth]", y_label="pixels [%]", log_x=True,
    ))]  # fmt: skip
    return atlas_result("stability/half_words", "FreePipe's half words", boundaries, figures, notes, {"gaps": table})
