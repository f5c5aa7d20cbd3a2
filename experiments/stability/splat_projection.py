"""Projection of splats: the near test at 0.2, Gaussians that are large for their distance, needles (Kerbl et al. 2023).

A Gaussian is projected by the derivative at its centre. One as large as its distance is no ellipse on screen; one whose
centre is nearer than 0.2 is dropped whole; and the determinant of a long needle's covariance is a difference of large
numbers in float32.
"""

from collections.abc import Callable

import numpy as np
import pandas as pd

from tilestamp.experiments.harness.result import Figure, Result
from tilestamp.experiments.stability.boundary import Boundary, atlas_result, bisect
from tilestamp.experiments.stability.splat_scenes import TAN, draw, gaussians
from tilestamp.reports.plots import lines

QUESTION = "How near, how large and how slender may a Gaussian be?"
PIXELS = 128
DROPPED = 0.1  # of a channel at the middle of the picture
OFF = 1.0  # pixels of the half-width at three sigmas
SLENDER = 0.1  # relative error of the determinant
SIZES = (0.02, 0.05, 0.1, 0.2, 0.3)  # standard deviation over distance
LENGTHS = (30.0, 100.0, 300.0, 1000.0, 3000.0, 10000.0, 30000.0)  # pixels


def vanishes(distance: float) -> bool:
    """Whether a Gaussian that reaches from the eye to far ahead is not drawn."""
    scene = gaussians([0, 0, distance], (0.05, 0.05, 1.0), 0.9, 1.0)
    return float(draw(scene).frame.buffers["colours"][PIXELS // 2, PIXELS // 2].max()) < DROPPED


def width_error(size: float) -> float:
    """Pixels by which half the width of a ball at three sigmas differs from its outline, at 20 degrees."""
    centre = np.array([0.36, 0.0, 1.0])
    conic = draw(gaussians(centre, size, 0.9, 1.0)).frame.buffers["conics"][0].astype(float)
    variance = np.linalg.inv([[conic[0], conic[1]], [conic[1], conic[2]]])[0, 0] - 0.3  # without the filter's own
    return abs(3 * float(np.sqrt(variance)) - _half_width(centre, 3 * size))


def _half_width(centre: "np.ndarray[tuple[int], np.dtype[np.float64]]", radius: float) -> float:
    """Half the width on screen, in pixels, of a ball around a point: its tangents in the plane y = 0."""
    direction, spread = np.arctan2(centre[0], centre[2]), np.arcsin(radius / np.hypot(centre[0], centre[2]))
    ends = np.tan(direction + spread), np.tan(direction - spread)
    return float(ends[0] - ends[1]) / 2 / TAN * PIXELS / 2


def determinant_error(length: float) -> float:
    """Relative error of the determinant of a diagonal needle of so many pixels; infinite where it is not positive."""
    needle = length / PIXELS * 2 * TAN * 10.0
    turn = [np.cos(np.pi / 8), 0.0, 0.0, np.sin(np.pi / 8)]
    frame = draw(gaussians([0.0, 0.0, 10.0], (needle, 1e-6, 1e-6), 0.9, 1.0, turn)).frame
    a, b, c, _ = frame.buffers["conics"][0].astype(float)
    exact = 0.3 * (length**2 + 0.3)
    found = (a + c) and (length**2 + 0.6) / (a + c)  # the trace of the inverse is the trace over the determinant
    return abs(found / exact - 1) if found > 0 and a * c - b * b > 0 else np.inf


def run(progress: Callable[[str], None]) -> Result:
    """Bisect all three."""
    progress("splat projection: near, large, slender")
    boundaries = [
        Boundary(
            "near test", "distance of the centre", "units", *bisect(vanishes, 1.0, 0.05),
            "a Gaussian that reaches far ahead of the eye is dropped whole", "a nearer test (gsplat: 0.01)",
        ),
        Boundary(
            "projection at the centre", "standard deviation / distance", "",
            *bisect(lambda size: width_error(size) > OFF, SIZES[0], SIZES[-1]),
            "the ellipse is not where the Gaussian is seen", "splitting it",
        ),
        Boundary(
            "determinant in float32", "length of a needle", "pixels",
            *bisect(lambda length: determinant_error(length) > SLENDER, LENGTHS[0], LENGTHS[-1]),
            "the conic has cancelled: alphas along the needle are wrong, or it is not drawn", "splitting it",
        ),
    ]  # fmt: skip
    table = pd.DataFrame({"size": SIZES, "error": [width_error(size) for size in SIZES]})
    figure = Figure(
        "size",
        lambda path: lines(
            table.assign(method="projection at the centre"), path, x="size", y="error", by="method",
            title="A ball at 20 degrees: its ellipse beside its outline", x_label="standard deviation / distance",
            y_label="error of half the width [pixels of 128]",
        ),
    )  # fmt: skip
    note = f"{PIXELS}x{PIXELS} pixels of 53 degrees; wrong: a width by {OFF:g} pixel, a determinant by {SLENDER:.0%}."
    title = "Projection of splats: near, large, slender"
    return atlas_result("stability/splat_projection", title, boundaries, [figure], [note], {"size": table})
