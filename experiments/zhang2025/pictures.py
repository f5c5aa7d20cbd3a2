"""Features off and on, side by side: perspective, filtering, ambient occlusion, transparency, the write race."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.experiments.harness.result import Cell, Figure, Result, reported
from tilestamp.models.errors import TilestampError
from tilestamp.models.machine import load_machine
from tilestamp.reports.style import figure
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.frame import Frame
from tilestamp.simulator.pipelines import load_pipeline, pipeline_options
from tilestamp.simulator.scenes.camera import LookAt
from tilestamp.simulator.scenes.library import load_scene

QUESTION = "What does each feature change in the picture?"
SLOW = True  # with what it needs compiled, more than the first run should take

SCENE = "CesiumMilkTruck"
SIZE = 512  # pixels
CAMERA = LookAt((3.2, 2.2, 4.2), (0.0, 1.2, 0.0), fov_degrees=45.0)
PAIRS: dict[str, tuple[str, str, dict[str, Any], dict[str, Any]]] = {
    "perspective correction": ("tiled", "ga104", {"perspective": False}, {"perspective": True}),
    "bilinear filtering": ("tiled", "ga104", {"texture_filter": "nearest"}, {"texture_filter": "bilinear"}),
    "trilinear filtering": ("binned", "ga104", {"texture_filter": "bilinear"}, {"texture_filter": "trilinear"}),
    "ambient occlusion": ("tiled", "ga104", {"ssao": False}, {"ssao": True}),
    "transparency": ("binned", "ga104", {}, {"order": "oit", "opacity": 0.5, "cull_backfaces": False}),
    "depth without steps": ("binned", "ga104", {"fragment_depth": "stepped"}, {"fragment_depth": "direct"}),
    "protected writes": ("per-primitive", "ga104", {"race": True}, {"race": False}),
}


def run(progress: Callable[[str], None]) -> Result:
    """Draw the truck with each feature off and on."""
    source = "Ru 2016 and Zhang 2025, pictures without figures"
    try:
        scene = load_scene(SCENE)
    except TilestampError as error:
        warnings = [str(error)]
        return Result("zhang2025-pictures", "Features off and on", source, [], warnings=warnings)
    matrix = CAMERA.matrix(SIZE, SIZE)
    cells, figures = [], []
    for name, (pipeline, machine, off, on) in PAIRS.items():
        progress(name)
        simt = load_machine(machine).simt
        draw = partial(load_pipeline(pipeline), scene, matrix, SIZE, SIZE, simt)
        frames = [draw(pipeline_options(pipeline, given), Executor()) for given in (off, on)]
        cells += _difference(name, *frames)
        figures.append(Figure(name.replace(" ", "_"), _side_by_side(name, frames[0].image, frames[1].image)))
    notes = ["Root mean square difference of 8-bit values over the picture, and the share of pixels that change."]
    return Result(
        "zhang2025-pictures", "Features off and on", source, cells, figures=figures, notes=notes, answer=_answer(cells)
    )


def _answer(cells: list[Cell]) -> str:
    """The pixels that each feature changes."""
    return f"Of the pixels: {', '.join(f'{c.row} {float(c.ours):.0f} %' for c in cells if c.unit == '%')}."


def _difference(name: str, off: Frame, on: Frame) -> list[Cell]:
    """How much a feature changes the picture."""
    change = on.image.astype(np.float64) - off.image.astype(np.float64)
    rms = float(np.sqrt((change**2).mean()))
    share = float((change != 0.0).any(axis=2).mean())
    return [
        reported(name, "RMS difference", "of 255", rms),
        reported(name, "pixels that change", "%", 100.0 * share),
    ]


def _side_by_side(name: str, off: NDArray[np.uint8], on: NDArray[np.uint8]) -> Callable[[Path], None]:
    """Make a figure with both pictures."""

    def draw(path: Path) -> None:
        with figure(path, f"{name}: off, on", figsize=(9.6, 5.0)) as axes:
            axes.imshow(np.concatenate([off, on], axis=1))
            axes.axis("off")

    return draw
