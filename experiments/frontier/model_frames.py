"""Frames whose time is known: what the frontier of the model is measured on.

None of these times was fitted: mixes were on the killeroo at 1600x1200, on other areas of the sweep and, for the H200,
on the teapot at 512x512 with a bound of 4.
"""

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tilestamp.experiments.eisenacher2010.frames import model, overhead_ms, stand_in_warnings
from tilestamp.experiments.harness.published import published
from tilestamp.experiments.laine2011 import sweep
from tilestamp.experiments.silicon.seen_scenes import SEEN
from tilestamp.experiments.validation.back_end import cameras
from tilestamp.experiments.validation.quantities import TIME_METRIC
from tilestamp.experiments.validation.stored import MICROPOLYGON, read
from tilestamp.simulator.run import Run
from tilestamp.simulator.scenes import Scene, load_scene
from tilestamp.simulator.simulation import simulate

VARIABLE = "TILESTAMP_FRONTIER"  # "long" for the long grid
EISENACHER = (("teapot", 512), ("killeroo", 512), ("bigguy", 1600))
EISENACHER_LONG = (*EISENACHER, ("bigguy", 512), ("teapot", 1600))
AREAS, AREAS_LONG = (0.5,), (0.5, 4.0, 16.0)  # pixels a triangle, none of them fitted
H200, H200_LONG = ("teapot_512x512_bb8",), ("teapot_512x512_bb8", "teapot_1600x1200_bb4", "teapot_1600x1200_bb8")
TILE = 8


@dataclass(frozen=True)
class Timed:
    """A frame, how to simulate it, and how long it took elsewhere.

    Parameters
    ----------
    name : str
    scene, pipeline, machine, arguments
        Of ``tilestamp.simulator.simulate``.
    milliseconds_of : callable
        What is compared, of a run.
    known_ms : float
        Published or measured.
    kind : {"published", "measured"}
    """

    name: str
    scene: Scene
    pipeline: str
    machine: str
    arguments: dict[str, Any]
    milliseconds_of: Callable[[Run], float]
    known_ms: float
    kind: str

    def simulate(self) -> Run:
        """Execute it, without a picture."""
        return simulate(self.scene, self.pipeline, self.machine, picture=False, **self.arguments)

    def warm_up(self) -> None:
        """Compile its kernels on a small frame."""
        small = self.arguments | {"width": 64, "height": 48, "camera": None}
        self.milliseconds_of(simulate("teapot", self.pipeline, self.machine, picture=False, **small))


def is_long() -> bool:
    """Whether the long grid is asked for."""
    return os.environ.get(VARIABLE, "") == "long"


def frames() -> list[Timed]:
    """Frames of the grid asked for."""
    return [*_eisenacher(), *_laine(), *_h200()]


def warnings() -> list[str]:
    """Say which frames are of stand-ins or missing."""
    chosen = EISENACHER_LONG if is_long() else EISENACHER
    return stand_in_warnings(*dict.fromkeys(name for name, _ in chosen))


def _eisenacher() -> Iterator[Timed]:
    """Table 2 of Eisenacher & Loop, bounding box 4, 1 sample a pixel."""
    table = published(str(Path(sweep.__file__).parents[1] / "eisenacher2010" / "table2"), "table2")
    for name, width in EISENACHER_LONG if is_long() else EISENACHER:
        row = table[(table.model == name) & (table.width == width) & (table.bounding_box == 4)].iloc[0]
        options = {"width": width, "height": int(row.height), "tile": TILE, "bound": 4, "bound_rule": "pixel_extent"}
        about = f"{name} {width}x{row.height}, GTX 280"
        known = float(row.ms_1spp)
        yield Timed(about, model(name), "micropolygon", "gtx280", options, _with_overhead, known, "published")


def _with_overhead(run: Run) -> float:
    return run.milliseconds + overhead_ms(run)


def _laine() -> Iterator[Timed]:
    """Some areas of Figure 5 of Laine & Karras."""
    for area in AREAS_LONG if is_long() else AREAS:
        scene = Scene.sweep(area, sweep.WIDTH, sweep.HEIGHT)
        assert scene.mesh is not None  # noqa: S101 - a sweep is a mesh
        known = sum(sweep.published_ns()[area, stage] for stage in sweep.STAGES) * len(scene.mesh.triangles) * 1e-6
        options = {"width": sweep.WIDTH, "height": sweep.HEIGHT, "camera": np.eye(4), "mode": "color"}
        about = f"sweep {area:g} px, GTX 480"
        yield Timed(about, scene, "cudaraster", sweep.MACHINE, options, _stages(*sweep.STAGES), known, "published")


def _h200() -> Iterator[Timed]:
    """The tile raster of some scenes, as it was measured on an H200."""
    measured = read(SEEN / MICROPOLYGON)
    for scene in H200_LONG if is_long() else H200:
        camera = cameras(SEEN)[scene]
        options = {"width": camera["width"], "height": camera["height"], "camera": np.array(camera["model_to_clip"])}
        options |= {"tile": TILE, "bound": camera["bound_pixels"]}
        about = f"{scene}, tile raster, H200"
        known = measured[scene, camera["width"], TILE, 1, "k_raster", TIME_METRIC] * 1e-3
        shown = load_scene(camera["model"])
        yield Timed(about, shown, "micropolygon", "h200", options, _stages("tile_raster"), known, "measured")


def _stages(*names: str) -> Callable[[Run], float]:
    return lambda run: sum(t.milliseconds for t in run.timings if t.stage in names)
