"""Scenes of the slides that cannot be had, generated to their published statistics, each drawn once.

What the slides publish is kept: the number of triangles, the share that is visible (in view, and facing the camera: so
Buddha's five cameras give 34 % with a reduced mesh, for 32 published), and the mean pixels of a visible triangle at
1024x768. Areas are Pareto's; the exponent of each scene is **fitted** to FreePipe's time at one size, for its thread
with the largest triangle is what the others wait for. The rest is **assumed**: triangles crowd about the centre as
Buddha's do (standard deviation 0.45 half viewports: 0.30 across and 0.56 along, mean of its five cameras; Buddha itself
fills an ellipse), in Morton order of their places, out of order by as much as fills Buddha's bin queues (fitted); no
vertex is shared.
"""

import os
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from tilestamp.experiments.harness.cell_bars import cell_bars
from tilestamp.experiments.harness.published import published
from tilestamp.experiments.harness.result import Cell, CellFigure
from tilestamp.experiments.laine2011.heavy_tail import Places, heavy_tail_scene
from tilestamp.models.errors import TilestampError
from tilestamp.models.fitted import Fitted
from tilestamp.models.remembered import remembered
from tilestamp.simulator.run import Run
from tilestamp.simulator.scenes import Scene
from tilestamp.simulator.simulation import simulate

MACHINE = "gtx480"
PIPELINES = ("hardware", "cudaraster", "freepipe")
SIZES = ((512, 384), (1024, 768), (2048, 1536))
FAIRY, FAIRY_TRIANGLES = "fairyforest", 174117
VARIABLE = "TILESTAMP_SLIDES"  # "all": San Miguel, and three sizes
SPREAD = 0.45  # of places, half viewports
OBJECT, OBJECT_AXES = "buddha", (0.6, 1.0)
EXPONENTS = {  # of areas: the smaller, the larger is the largest triangle
    name: Fitted(
        f"laine2011: exponent of the areas of {name}",
        exponent,
        (f"{name} (generated) {size} | laine2011-slides | {name} {size} | freepipe",),
        chosen=True,
    )
    for name, exponent, size in (
        ("sanmiguel", 0.85, "512x384"),
        ("juarez", 1.467, "512x384"),
        ("stalker", 1.077, "512x384"),
        ("city", 1.055, "512x384"),
        ("buddha", 1.57, "1024x768"),  # at 512x384 its time is that of the set-up, to which a price was fitted
    )
}
EXPONENTS[FAIRY] = Fitted(
    f"laine2011: exponent of the areas of {FAIRY}",
    1.42,
    (f"{FAIRY} (generated) 1024x768 | laine2011-table2 | FairyForest | tiles a triangle",),
    chosen=True,
)
DISORDER = Fitted(  # half viewports
    "laine2011: disorder of generated triangles",
    0.1,
    ("buddha (generated) * | laine2011-memory | buddha | bin queues",),
    chosen=True,
)
COUNTED = {  # scenes whose triangles were taken from the setup data of slides-memory.csv
    name: f"{name} (generated) * | laine2011-memory | {name} | setup data" for name in ("sanmiguel", "juarez")
}
ASSUMED_VISIBLE = 31.0  # percent, where the slides do not say: the mean of the other three
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


def fairy() -> Statistics:
    """FairyForest of the authors' log, from its counters (camera 0, the only ones printed)."""
    log = published(__file__, "gtx480-cuda40")
    rows = log[(log["table"] == "table3") & (log["scene"] == "FairyForest")].set_index("key")["value"]
    visible = 100.0 - rows["TriangleSetup / Viewport cull"] - rows["TriangleSetup / Backface cull"]
    survivors = visible - rows["TriangleSetup / Between pixels cull"]
    samples = rows["TriangleSetup / Avg. samples / tri"] * survivors / visible
    return Statistics(FAIRY, FAIRY_TRIANGLES, float(visible), float(samples), assumed=False)


def _triangles(name: str, count: int) -> int:
    """Triangles as published, or as they were taken from a cell of another table."""
    if name not in COUNTED:
        return count
    number = Fitted(f"laine2011: triangles of {name}", float(count), (COUNTED[name],), chosen=True)
    return round(number.on(frame_name(name)))


def frame_name(name: str, width: int = 1024, height: int = 768) -> str:
    """The frame of a generated scene, as fitted numbers name it."""
    return f"{name} (generated) {width}x{height}"


def generate(scene: Statistics, frame: str = "") -> Scene:
    """Make a clip-space scene with the statistics of ``scene``, for a frame that numbers may have been fitted on."""
    spread = (SPREAD, SPREAD) if scene.name != OBJECT else OBJECT_AXES
    places = Places(spread, scene.name == OBJECT, DISORDER.on(frame))
    visible = round(scene.triangles * scene.visible / 100.0)
    exponent = EXPONENTS[scene.name].on(frame)
    return heavy_tail_scene(f"{scene.name} (generated)", scene.triangles, visible, scene.pixels, exponent, places)


@remembered
def draw(name: str, pipeline: str, width: int, height: int, **options: Any) -> Run:
    """Draw a generated scene once."""
    known = fairy() if name == FAIRY else next(scene for scene in statistics() if scene.name == name)
    scene = generate(known, frame_name(name, width, height))
    if pipeline == "freepipe":
        options = {"packing": "32"}  # there is no 64-bit atomicMin on 2.0
    return simulate(scene, pipeline, MACHINE, width=width, height=height, picture=False, **options)


def warning() -> str:
    """Say that the scenes are not the authors'."""
    return (
        "GENERATED SCENES, not the authors': triangles, visible share and pixels a triangle as published, the tail of "
        "areas fitted to FreePipe at one size; all places are assumed"
    )


def time_bars(name: str, of: Callable[[Cell], bool], title: str) -> CellFigure:
    """Times of frames beside the published ones."""
    title = f"{title}, generated scenes, GTX 480 (published: on the real ones)"
    return cell_bars(name, of, title, "time of a frame [ms]")
