"""Measurements of the published splat rasterizer on an H200, by configuration, and the scenes that they are of.

Three scenes are stored with the project (``measured/splat``, its README): their counts, times and cameras. The models
are looked for on the scene search path. ``TILESTAMP_SPLATS`` names a further folder of that form: SCENE.csv or
SCENE.csv.gz beside SCENE_scene.json.
"""

import json
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from tilestamp.models.errors import TilestampError
from tilestamp.simulator.scenes.library import load_scene
from tilestamp.simulator.scenes.scene import Scene

VARIABLE = "TILESTAMP_SPLATS"
MEASURED = Path(__file__).parent / "measured" / "splat"
FILES = {"playbot125k": "playbot/2", "playbot500k": "playbot/0"}  # on the search path; others by their own name
BOUNDS = {"square": "square", "tight": "ellipse"}  # of a variant: the rule that makes its lists
TIMED = ("cupti", "cupti_repeat2")
TIME_METRIC, SPAN_METRIC = "cupti_us_median", "cupti_span_us_median"
COUNTED = "ncu_cold"
COUNTS = "stats"
PIPELINE = "pipeline"
ByKernel = dict[tuple[str, str], float]


@dataclass(frozen=True)
class Measured:
    """One configuration as it was measured.

    Parameters
    ----------
    scene : Scene
    variant, tile : str
    width, height : int
    camera : mapping
    times : dict
        Microseconds by kernel, and of the whole frame by ``PIPELINE``, from the first start to the last end.
    counters : dict
        By kernel and hardware counter, with caches flushed.
    counts : dict
        By kernel and event, as the device counted them.
    """

    scene: Scene
    variant: str
    tile: str
    width: int
    height: int
    camera: dict[str, Any]
    times: dict[str, float]
    counters: dict[tuple[str, str], float]
    counts: dict[tuple[str, str], float]

    @property
    def options(self) -> dict[str, Any]:
        """Of the pipeline."""
        across, down = self.tile.split("x")
        return {"tile": int(across) if across == down else self.tile, "bound": BOUNDS[self.variant]}

    @property
    def label(self) -> str:
        """Screen, tile and rule."""
        return f"{self.width} {self.tile} {self.variant}"


def folders() -> list[Path]:
    """Folders of measurements: the project's, or the one that is named."""
    named = os.environ.get(VARIABLE, "")
    return [Path(named)] if named else [MEASURED]


def measured_scenes() -> tuple[list[tuple[Path, Scene]], list[str]]:
    """Measured scenes whose model is here, each with its camera file; and what is missing."""
    found, missing = [], []
    for folder in folders():
        for file in sorted(folder.glob("*_scene.json")):
            name = file.name.removesuffix("_scene.json")
            try:
                found.append((file, load_scene(FILES.get(name, name))))
            except TilestampError as error:
                missing.append(f"{name} is left out: {error}")
    return found, missing


def read_measured(file: Path, scene: Scene) -> Iterator[Measured]:
    """Each configuration of a scene."""
    name = file.name.removesuffix("_scene.json")
    cameras = json.loads(file.read_text("utf-8"))["cameras"]
    stored = file.with_name(f"{name}.csv")
    table = pd.read_csv(stored if stored.is_file() else stored.with_name(f"{name}.csv.gz"))
    for (variant, width, height, tile), rows in table.groupby(["variant", "W", "H", "tile"], sort=True):
        camera = cameras[f"{width}x{height}"]
        yield Measured(scene, variant, tile, int(width), int(height), camera, *_values(rows))


def _values(rows: pd.DataFrame) -> tuple[dict[str, float], ByKernel, ByKernel]:
    """Times, counters and counts; a time measured twice is the mean of both."""
    timed = rows[rows.source.isin(TIMED)]
    times = timed[timed.metric == TIME_METRIC].groupby("kernel").value.mean().to_dict()
    spans = timed[(timed.metric == SPAN_METRIC) & (timed.kernel == PIPELINE)].value
    if len(spans):
        times[PIPELINE] = float(spans.mean())
    counters, counts = (
        rows[rows.source == source].set_index(["kernel", "metric"]).value.to_dict() for source in (COUNTED, COUNTS)
    )
    return times, counters, counts
