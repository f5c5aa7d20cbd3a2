"""Projection of splats: Gaussians that are large for their distance, and needles (Kerbl et al. 2023).

A Gaussian is projected by the derivative at its centre: one as large as its distance is no ellipse on screen. And the
determinant of a long needle's covariance is a difference of large numbers in float32.
"""

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Figure, Result
from tilestamp.experiments.stability.boundary import Boundary, atlas_result, bisect
from tilestamp.experiments.stability.splats import SIDE, UPRIGHT, drawn
from tilestamp.reports.plots import lines

QUESTION = "How large and how slender may a Gaussian be?"
OFF = 1.0  # pixels of the half-width at three sigmas
SLENDER = 0.1  # relative error of the determinant
SIZES = (0.02, 0.05, 0.1, 0.2, 0.3)  # standard deviation over distance
LENGTHS = (30.0, 30000.0)  # pixels
FILTER = 0.3  # square pixels that are added to each variance
DIAGONAL = (np.cos(np.pi / 8), 0.0, 0.0, np.sin(np.pi / 8))


def conic(mean: ArrayLike, scale: ArrayLike, rotation: ArrayLike = UPRIGHT) -> tuple[float, float, float]:
    """Inverse covariance of a single Gaussian on the screen: xx, xy, yy."""
    frame = drawn(np.atleast_2d(np.asarray(mean)), scale, 0.9, rotation=rotation, fidelity="counts").frame
    xx, xy, yy, _ = frame.buffers["conics"][0].tolist()
    return xx, xy, yy


def width_error(size: float) -> float:
    """Pixels by which half the width of a ball at three sigmas differs from its outline, at 20 degrees."""
    x, z = 0.36, 1.0
    xx, xy, yy = conic((x, 0.0, z), size)
    variance = yy / (xx * yy - xy * xy) - FILTER
    direction, spread = np.arctan2(x, z), np.arcsin(3 * size / np.hypot(x, z))
    outline = (np.tan(direction + spread) - np.tan(direction - spread)) / 2 * SIDE / 2
    return abs(3 * float(np.sqrt(variance)) - float(outline))


def determinant_error(length: float) -> float:
    """Relative error of the determinant of a diagonal needle of so many pixels; infinite where it is not positive."""
    xx, xy, yy = conic((0.0, 0.0, 10.0), (length / SIDE * 2 * 10.0, 1e-6, 1e-6), DIAGONAL)
    if not (xx + yy > 0 and xx * yy > xy * xy):
        return np.inf
    determinant = (length**2 + 2 * FILTER) / (xx + yy)  # the trace of the inverse is the trace over it
    return abs(determinant / (FILTER * (length**2 + FILTER)) - 1)


def run(progress: Progress) -> Result:
    """Bisect both."""
    progress("stability/splat_shapes: large, slender")
    large = bisect(lambda size: width_error(size) > OFF, SIZES[0], SIZES[-1])
    needle = bisect(lambda length: determinant_error(length) > SLENDER, *LENGTHS)
    table = pd.DataFrame({"size": SIZES, "error": [width_error(size) for size in SIZES]})
    boundaries = [
        Boundary(
            "splat, projection at the centre", "standard deviation / distance", "", *large,
            "the ellipse is not where the Gaussian is seen", "splitting it", "not measured here",
        ),
        Boundary(
            "splat, determinant in float32", "length of a needle", "pixels", *needle,
            "the conic has cancelled: alphas along the needle are wrong, or it is not drawn", "splitting it",
            "not measured here",
        ),
    ]  # fmt: skip
    figure = Figure(
        "size",
        lambda path: lines(
            table.assign(method="projection at the centre"), path, x="size", y="error", by="method",
            title="A ball at 20 degrees: its ellipse beside its outline", x_label="standard deviation / distance",
            y_label=f"error of half the width [pixels of {SIDE}]",
        ),
    )  # fmt: skip
    note = f"{SIDE}x{SIDE} pixels of 90 degrees; wrong: a width by {OFF:g} pixel, a determinant by {SLENDER:.0%}."
    title = "Shapes of splats: large and slender"
    return atlas_result("stability/splat_shapes", title, boundaries, [figure], [note], {"size": table})
