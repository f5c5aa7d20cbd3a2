"""Scenes of the slides that cannot be had, generated to their published statistics, each drawn once.

What the slides publish is kept: the number of triangles, the share that is visible, and the mean pixels of a visible
triangle at 1024x768. What they do not is **assumed**: areas are log-normal (sigma 2, cut where a triangle would cover a
quarter of the viewport), positions uniform, depths random, shapes equilateral, what is not visible faces away;
triangles come in Morton order of their places, out of order by as much as fills Buddha's bin queues (fitted); no
vertex is shared. FreePipe depends on the largest triangles, so its times above all are those of the assumption.
"""

import os
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tilestamp.experiments.harness.published import published
from tilestamp.models.errors import TilestampError
from tilestamp.models.fitted import Fitted
from tilestamp.models.remembered import remembered
from tilestamp.simulator.run import Run
from tilestamp.simulator.scenes import Scene
from tilestamp.simulator.simulation import simulate

MACHINE = "gtx480"
PIPELINES = ("hardware", "cudaraster", "freepipe")
SIZES = ((512, 384), (1024, 768), (2048, 1536))
VARIABLE = "TILESTAMP_SLIDES"  # "all": San Miguel, and three sizes
SIGMA = 2.0  # of the logarithm of areas: assumed
LARGEST_SHARE = 0.25  # of the viewport
DISORDER = Fitted(  # of places when triangles are ordered, half viewports
    "laine2011: disorder of generated triangles",
    0.1,
    ("buddha (generated) * | laine2011-memory | buddha | bin queues",),
    chosen=True,
)
COUNTED = {  # scenes whose triangles were taken from the setup data of slides-memory.csv
    name: f"{name} (generated) * | laine2011-memory | {name} | setup data" for name in ("sanmiguel", "juarez")
}
ASSUMED_VISIBLE = 31.0  # percent, where the slides do not say: the mean of the other three
REFERENCE_PIXELS = 1024 * 768
SKIPPED = "sanmiguel"  # 5.4 million triangles, unless all is asked for


class Statistics(NamedTuple):
    """A scene as published."""

    name: str
    triangles: int
    visible: float  # percent
    pixels: float  # of a visible triangle
    assumed: bool  # the visible share


def everything() -> bool:
    """Whether all scenes and sizes are asked for, by the environment variable TILESTAMP_SLIDES.

    Raises
    ------
    TilestampError
        Another value than "all".
    """
    asked = os.environ.get(VARIABLE, "")
    if asked not in ("", "all"):
        raise TilestampError(f"{VARIABLE} is {asked!r}; the only value is 'all'")
    return bool(asked)


def scenes() -> list[Statistics]:
    """Scenes to draw."""
    return [scene for scene in statistics() if everything() or scene.name != SKIPPED]


def sizes() -> list[tuple[int, int]]:
    """Sizes to draw."""
    return [size for size in SIZES if everything() or size == SIZES[1]]


def statistics() -> list[Statistics]:
    """All scenes of the slides."""
    table = published(__file__, "slides-scenes")
    return [
        Statistics(
            str(row.scene),
            _triangles(str(row.scene), int(row.triangles)),
            ASSUMED_VISIBLE if np.isnan(row.visible_percent) else float(row.visible_percent),
            float(row.pixels_per_triangle),
            bool(np.isnan(row.visible_percent)),
        )
        for row in table.itertuples()
    ]


def _triangles(name: str, count: int) -> int:
    """Triangles as published, or as they were taken from a cell of another table."""
    if name not in COUNTED:
        return count
    number = Fitted(f"laine2011: triangles of {name}", float(count), (COUNTED[name],), chosen=True)
    return round(number.on(frame_name(name)))


def frame_name(name: str, width: int = 1024, height: int = 768) -> str:
    """The frame of a generated scene, as fitted numbers name it."""
    return f"{name} (generated) {width}x{height}"


def generate(scene: Statistics, seed: int = 1) -> Scene:
    """Make a clip-space scene with the statistics of ``scene``."""
    random = np.random.default_rng(seed)
    centre = random.uniform(-1.0, 1.0, (scene.triangles, 2))
    scattered = centre + DISORDER.on(frame_name(scene.name)) * random.standard_normal(centre.shape)
    centre = centre[np.argsort(_morton(np.clip(scattered, -1.0, 1.0)), kind="stable")]
    area = _areas(random, scene)
    turn = random.uniform(0.0, 2.0 * np.pi, scene.triangles)
    facing = np.where(random.random(scene.triangles) * 100.0 < scene.visible, 1.0, -1.0)
    radius = np.sqrt(area * 4.0 / (3.0 * np.sqrt(3.0)))  # of the corners, pixels at 1024x768
    angle = turn[:, None] + facing[:, None] * np.arange(3) * (2.0 * np.pi / 3.0)
    corner = np.ones((scene.triangles, 3, 4), np.float32)
    corner[..., 0] = centre[:, None, 0] + radius[:, None] * np.cos(angle) * (2.0 / 1024)
    corner[..., 1] = centre[:, None, 1] + radius[:, None] * np.sin(angle) * (2.0 / 768)
    corner[..., 2] = random.uniform(-0.9, 0.9, scene.triangles)[:, None]
    triangles = np.arange(3 * scene.triangles, dtype=np.int32).reshape(-1, 3)
    return Scene.from_clip_space(corner.reshape(-1, 4), triangles, f"{scene.name} (generated)")


def _areas(random: np.random.Generator, scene: Statistics) -> NDArray[np.float64]:
    """Log-normal areas in pixels, cut, and scaled to the mean."""
    shape = np.exp(SIGMA * random.standard_normal(scene.triangles))
    area: NDArray[np.float64] = shape * (scene.pixels / shape.mean())
    for _ in range(3):  # the cut lowers the mean
        area = np.minimum(area, LARGEST_SHARE * REFERENCE_PIXELS)
        area *= scene.pixels / area.mean()
    return area


def _morton(points: NDArray[np.float64]) -> NDArray[np.int64]:
    """Interleave ten bits of each coordinate in [-1, 1]."""
    cells = ((points + 1.0) * 511.5).astype(np.int64)
    code = np.zeros(len(points), np.int64)
    for bit in range(10):
        code |= (cells[:, 0] >> bit & 1) << (2 * bit) | (cells[:, 1] >> bit & 1) << (2 * bit + 1)
    return code


@remembered
def made(name: str) -> Scene:
    """The generated scene of a name of the slides."""
    return generate(next(scene for scene in statistics() if scene.name == name))


@remembered
def draw(name: str, pipeline: str, width: int, height: int) -> Run:
    """Draw a generated scene once."""
    return simulate(made(name), pipeline, MACHINE, width=width, height=height)


def warning() -> str:
    """Say that the scenes are not the authors'."""
    return (
        "GENERATED SCENES, not the authors': triangles, visible share and pixels a triangle as published; the spread "
        f"of areas (log-normal, sigma {SIGMA:g}) and all places are assumed, and FreePipe's times depend on that spread"
    )
