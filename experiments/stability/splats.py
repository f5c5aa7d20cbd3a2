"""Splats by tile lists: where the published rules show wrong pictures, or none (Kerbl et al. 2023).

A few Gaussians in front of a camera that looks along z (y down), in the published arithmetic: squares of three sigmas
that end before the Gaussian does, order by the depths of centres, a near plane that is no plane, lists that outgrow 32
bits, determinants that round to zero, and one thread for however many tiles.
"""

from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Figure, Result
from tilestamp.experiments.stability.boundary import Boundary, atlas_result, bisect
from tilestamp.models.simt import Simt
from tilestamp.reports.plots import lines
from tilestamp.simulator.run import Run
from tilestamp.simulator.scenes.pinhole import PinholeCamera
from tilestamp.simulator.scenes.scene import Scene
from tilestamp.simulator.scenes.splat_view import perspective
from tilestamp.simulator.simulation import simulate
from tilestamp.simulator.stages.kerbl2023.project import project
from tilestamp.simulator.stages.kerbl2023.tiles import tiles_of

QUESTION = "Where do splats by tile lists show a wrong picture, or none?"
MACHINE = "h200"
SIDE = 128  # pixels
UPRIGHT = (1.0, 0.0, 0.0, 0.0)
TURNED = (0.5, 0.0, 0.0, 0.5)  # no unit: its rows are exact, and along the diagonal
STEP = 1.0 / 255  # of a byte: a difference that shows
LARGEST = 2**31  # pairs that 32-bit offsets count
OPACITIES = (0.1, 0.2, 0.3, 0.35, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)


def drawn(
    means: ArrayLike,
    scales: ArrayLike,
    opacities: ArrayLike,
    turn: float = 0.0,
    side: int = SIDE,
    rotation: ArrayLike = UPRIGHT,
    **options: Any,
) -> Run:
    """Gaussians that are red, green, red... seen along z by a camera that is turned to the side by some degrees."""
    means = np.atleast_2d(np.asarray(means))
    count = len(means)
    colours = np.eye(3)[np.arange(count) % 2]
    rotations = np.tile(rotation, (count, 1))
    scene = Scene.from_splats(
        means, np.broadcast_to(scales, (count, 3)), rotations, np.broadcast_to(opacities, count), colours
    )
    view, angle = np.eye(4), np.radians(turn)
    view[[0, 0, 2, 2], [0, 2, 0, 2]] = np.cos(angle), -np.sin(angle), np.sin(angle), np.cos(angle)
    camera = PinholeCamera(perspective(view, 1.0, 1.0))
    return simulate(scene, "splat", MACHINE, width=side, height=side, camera=camera, **options)


def difference(one: Run, other: Run) -> float:
    """Largest difference of a channel."""
    return float(np.abs(one.frame.buffers["colours"] - other.frame.buffers["colours"]).max())


def cut(opacity: float, tile: int = 4) -> float:
    """What the square leaves out of one Gaussian, as the largest difference of a channel.

    Its deviation is 32 pixels, and its square ends where a tile does.
    """
    one = [(1 / 256, 1 / 256, 2.0)], 0.2499, opacity, 0.0, 512
    square, whole = (drawn(*one, tile=tile, bound=bound, fidelity="counts") for bound in ("square", "box"))
    return difference(square, whole)


def pops(sigmas: float, order: str = "tile") -> bool:
    """Whether two Gaussians of one depth, some deviations apart, jump as the camera turns by 0.01 degrees."""
    means = [(-0.05 * sigmas, 0.0, 2.0), (0.05 * sigmas, 0.0, 2.0)]
    left, right = (
        drawn(means, 0.1, 0.9, turn, bound="box", order=order, fidelity="counts") for turn in (-0.005, 0.005)
    )
    return difference(left, right) > STEP


def sorting(order: str) -> float:
    """Milliseconds of the frame of two Gaussians that pop."""
    return drawn([(-0.15, 0.0, 2.0), (0.15, 0.0, 2.0)], 0.1, 0.9, bound="box", order=order).milliseconds


def lost_near(depth: float) -> bool:
    """Whether a Gaussian on the line of sight is not drawn."""
    return not drawn([(0.0, 0.0, depth)], 0.02, 1.0, fidelity="counts").counts["project.VISIBLE"]


def overflows(count: float) -> bool:
    """Whether so many Gaussians over all of 1920x1080 have more pairs than offsets count, with tiles of 4."""
    scene = Scene.from_splats([(0.0, 0.0, 2.0)], [[9.0] * 3], [UPRIGHT], [1.0], [[1.0] * 3])
    assert scene.splats is not None  # noqa: S101 - made of some
    camera, tiles = perspective(np.eye(4), 1.0, 0.5625), tiles_of(1920, 1080, 4, 4)
    one = project(scene.splats, camera, tiles, Simt(), counting=False).outputs.tiles
    return int(count) * int(one[0]) >= LARGEST


def vanishes(power: float) -> bool:
    """Whether a sliver on the diagonal, 2 to some power long and without width, is lost to a determinant of zero."""
    long = (2.0**power, 0.0, 0.0)
    run = drawn([(0.0, 0.0, 2.0)], long, 1.0, rotation=TURNED, fidelity="counts")
    return run.counts["project.CULLED_DETERMINANT"] > 0


def waits(scale: float, bound: str = "square") -> float:
    """Share of a frame of 512x512, tiles of 4, that duplication takes where one Gaussian among 256 has some scale."""
    means = np.random.default_rng(1).uniform((-1.0, -1.0, 2.0), (1.0, 1.0, 3.0), (256, 3))
    scales = np.full((256, 1), 0.01)
    scales[0] = scale
    run = drawn(means, scales, 0.5, side=512, tile=4, bound=bound)
    return float(run.stages.loc["duplicate", "milliseconds"]) / run.milliseconds


def run(progress: Progress) -> Result:
    """Turn each until it breaks."""
    progress("stability/splats: opacities")
    rows = [{"tile": f"{tile}x{tile}", "opacity": o, "cut": cut(o, tile)} for tile in (4, 16) for o in OPACITIES]
    table = pd.DataFrame(rows)
    progress("stability/splats: boundaries")
    figures = [Figure("cut", partial(
        lines, table, x="opacity", y="cut", by="tile", title="What a square of three sigmas leaves out of one Gaussian",
        x_label="opacity", y_label="largest difference of a channel",
    ))]  # fmt: skip
    return atlas_result("stability/splats", "Splats by tile lists", boundaries(), figures, (), {"cut": table})


def boundaries() -> list[Boundary]:
    """All rows."""
    whole, square = (drawn([(0.0, 0.0, 2.0)], 0.22, 1.0, tile=8, bound=b).milliseconds for b in ("ellipse", "square"))
    return [
        Boundary(
            "splat, lists by square", "opacity", "", *bisect(lambda o: cut(o) > 1e-4, 0.05, 1.0),
            "the square ends where alpha is above 1/255: tiles beyond do not show it, the picture depends on the tile",
            "bound=ellipse", f"{whole - square:+.4f} ms on {MACHINE} for one Gaussian",
        ),
        Boundary(
            "splat, order by centres", "distance", "sigmas", *bisect(pops, 12.0, 0.5),
            "two Gaussians change places at once as the camera turns: the picture jumps",
            "order=pixel", f"{sorting('pixel') - sorting('tile'):+.4f} ms on {MACHINE} for the two, which jump no more",
        ),
        Boundary(
            "splat, near plane", "depth", "", *bisect(lost_near, 1.0, 0.05),
            "what has its centre nearer than 0.2 is not drawn, however large it is", "a scene of larger units", "none",
        ),
        Boundary(
            "splat, offsets of 32 bits", "Gaussians over the screen", "", *bisect(overflows, 1, 10**6, scale="integer"),
            "offsets of pairs wrap around with tiles of 4 at 1920x1080", "tile=16", "none: a sixteenth of the pairs",
        ),
        Boundary(
            "splat, slivers", "log2 of the length", "", *bisect(vanishes, 0, 24, scale="integer"),
            "what a pixel adds is lost in rounding, the determinant is exactly zero, and the sliver is not drawn",
            "a width of a hundredth of the length", "none",
        ),
        Boundary(
            "splat, one thread a Gaussian", "scale", "", *bisect(lambda s: waits(s) > 0.5, 0.01, 10.0, tolerance=0.05),
            f"one thread writes its tiles one after another: duplication is {waits(10.0):.0%} of the frame at scale 10",
            "bound=box", f"{waits(10.0, 'box'):.0%} of the frame at scale 10 all the same: its tiles remain",
        ),
    ]  # fmt: skip
