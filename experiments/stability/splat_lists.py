"""Lists of splats: what the published square leaves out, and how many entries its 32-bit sums hold (Kerbl et al. 2023).

A Gaussian is listed in the tiles of a square of three standard deviations. Where it is opaque its alpha is still over
1/255 there: a pixel then shows it or not by the tile that it is in.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd

from tilestamp.experiments.harness.result import Figure, Result
from tilestamp.experiments.stability.boundary import Boundary, atlas_result, bisect
from tilestamp.experiments.stability.splat_scenes import MACHINE, TAN, draw, gaussians
from tilestamp.reports.plots import lines
from tilestamp.simulator.scenes.scene import Scene

QUESTION = "From which opacity on do the lists of the square rule cut what can be seen?"
TILES = (4, 8, 16, 32)
OPACITIES = (0.1, 0.2, 0.3, 0.34, 0.36, 0.4, 0.5, 0.7, 0.99)
WRONG = 0.5 / 255  # of a channel: half of a step of an 8-bit picture
SIGMA = 6.0  # pixels
LARGEST = 2**32 - 1  # the sums of list lengths are unsigned 32-bit numbers
SIDES = {"1920x1080": (1920, 1080), "3840x2160": (3840, 2160)}


def dots(opacity: float) -> Scene:
    """White Gaussians of SIGMA pixels, at 16 places of the tiles' raster, far from each other."""
    j, i = (n.ravel() for n in np.mgrid[:4, :4])
    pixels = np.stack([32 * i + 16 + 2.1 * j, 32 * j + 16 + 1.9 * i], 1) * 2 + 0.5
    depth = 10.0
    xy = (pixels / 128 - 1) * TAN * depth
    return gaussians(np.column_stack([xy, np.full(16, depth)]), SIGMA / 128 * TAN * depth, opacity, 1.0)


def lost(opacity: float, tile: int) -> float:
    """Largest difference of a channel between the lists of the square and those of the ellipse."""
    square, ellipse = (
        draw(dots(opacity), pixels=256, tile=tile, bound=bound).frame.buffers["colours"]
        for bound in ("square", "ellipse")
    )
    return float(np.abs(square - ellipse).max())


def overflow(width: int, height: int, tile: int = 16) -> int:
    """Gaussians that fill the screen, of which one more would wrap the sum of the list lengths."""
    return LARGEST // (-(-width // tile) * -(-height // tile))


def run(progress: Callable[[str], None]) -> Result:
    """Sweep the opacity by tile size, and bisect."""
    rows, boundaries = [], []
    for tile in TILES:
        progress(f"splat lists: tile {tile}")
        swept = [lost(opacity, tile) for opacity in OPACITIES]
        rows += [{"tile": f"tile {tile}", "opacity": o, "lost": 255 * x} for o, x in zip(OPACITIES, swept, strict=True)]
        boundaries.append(_cut(tile))
    for name, size in SIDES.items():
        most = float(overflow(*size))
        words = "the sum of the list lengths wraps at 2^32: pairs overwrite each other"
        cure = "64-bit sums (16 bytes a tile and Gaussian would be 64 GB before)"
        boundaries.append(Boundary(f"{name}, tile 16", "screen-filling Gaussians", "", most, most + 1, words, cure))
    table = pd.DataFrame(rows)
    figure = Figure(
        "lost",
        lambda path: lines(
            table, path, x="opacity", y="lost", by="tile", title="What the square of three sigmas cuts, by opacity",
            x_label="opacity of the Gaussian", y_label="largest error of a channel [1/255]",
        ),
    )  # fmt: skip
    derived = "exp(-4.5) times the opacity is over 1/255 from 0.353 on. Lists of full screens are computed, not drawn."
    title = "Lists of splats: the square of three sigmas, and sums of 32 bits"
    return atlas_result("stability/splat_lists", title, boundaries, [figure], [derived], {"lost": table})


def _cut(tile: int) -> Boundary:
    found = bisect(lambda opacity: lost(opacity, tile) > WRONG, OPACITIES[0], OPACITIES[-1], scale="linear")
    options: dict[str, Any] = {"pixels": 256, "tile": tile}
    times = [draw(dots(0.9), **options, bound=bound).milliseconds for bound in ("ellipse", "square")]
    words = "visible alphas are cut at tile borders: the picture depends on the tile size"
    cost = f"{times[0] / times[1]:.2g} times the time of the square's on the {MACHINE}"
    return Boundary(f"square rule, tile {tile}", "opacity", "", *found, words, "bound=ellipse", cost)
