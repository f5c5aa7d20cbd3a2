"""Order of splats by the depth of their centres: where one passes another, the picture jumps (Kerbl et al. 2023).

Two discs that cross, as seen from straight in front, have centres at one depth. The least turn of the camera puts one
before the other as a whole, though each is in front in its own half: the picture pops. In the limit of no turn nothing
should change.
"""

from collections.abc import Callable

import numpy as np
import pandas as pd

from tilestamp.experiments.harness.result import Figure, Result
from tilestamp.experiments.stability.boundary import Boundary, atlas_result, bisect
from tilestamp.experiments.stability.splat_scenes import draw, gaussians
from tilestamp.reports.plots import lines
from tilestamp.simulator.scenes.scene import Scene

QUESTION = "From which opacity on does a picture of splats pop as the camera turns?"
OPACITIES = (0.02, 0.05, 0.1, 0.2, 0.4, 0.7, 0.99)
TURN = 1e-5  # radians to each side
STEP = 4 / 255  # of a channel: more than this is seen
TILTS = (0.0, 15.0, 45.0)  # degrees
DISTANCE, SIZE, THICKNESS = 4.0, 0.6, 0.02


def discs(opacity: float, tilt: float) -> Scene:
    """A red disc and a green one, turned about the vertical by ``tilt`` degrees to either side; side by side."""
    half = np.radians(tilt) / 2
    rotations = [[np.cos(half), 0, s * np.sin(half), 0] for s in (1, -1)]
    means = [[-0.25, 0, DISTANCE], [0.25, 0, DISTANCE]]
    return gaussians(means, (SIZE, SIZE, THICKNESS), opacity, [[1, 0, 0], [0, 1, 0]], rotations)


def jump(opacity: float, tilt: float) -> float:
    """Largest change of a channel from a turn of the camera that moves nothing by a thousandth of a pixel."""
    scene = discs(opacity, tilt)
    left, right = (draw(scene, yaw).frame.buffers["colours"] for yaw in (-TURN, TURN))
    return float(np.abs(left - right).max())


def run(progress: Callable[[str], None]) -> Result:
    """Sweep the opacity by tilt, and bisect."""
    rows, boundaries = [], []
    for tilt in TILTS:
        progress(f"splat order: tilt {tilt:g}")
        swept = [jump(opacity, tilt) for opacity in OPACITIES]
        rows += [
            {"tilt": f"tilt {tilt:g} degrees", "opacity": o, "jump": 255 * x}
            for o, x in zip(OPACITIES, swept, strict=True)
        ]
        found = bisect(lambda opacity, tilt=tilt: jump(opacity, tilt) > STEP, OPACITIES[0], OPACITIES[-1])  # type: ignore[misc]
        words = "the picture pops where one centre passes the other in depth"
        boundaries.append(Boundary(f"centre depth, tilt {tilt:g} degrees", "opacity", "", *found, words))
    table = pd.DataFrame(rows)
    figure = Figure(
        "jump",
        lambda path: lines(
            table, path, x="opacity", y="jump", by="tilt", title="Popping: two crossing discs, no turn to speak of",
            x_label="opacity of both", y_label="largest jump of a channel [1/255]",
        ),
    )  # fmt: skip
    note = f"The camera turns by {2 * TURN:g} radians; a jump of a channel by over {255 * STEP:.0f}/255 counts as seen."
    title = "Order by centre depth: popping as the camera turns"
    return atlas_result("stability/splat_order", title, boundaries, [figure], [note], {"jump": table})
