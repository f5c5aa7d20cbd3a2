"""Ru 2016, features on and off: bilinear filtering, and ambient occlusion whose cost does not depend on the scene."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd

from tilestamp.experiments.harness.result import Cell, Result
from tilestamp.experiments.ru2016.setting import MODELS_TILE, SOURCE, draw, frame_name, missing, published
from tilestamp.simulator.run import Run

QUESTION = "What do bilinear filtering and ambient occlusion cost?"
SLOW = True  # with what it needs compiled, more than the first run should take

FILTERS = ("bilinear", "nearest")
OCCLUSION = ("ambient_occlusion", "occlusion_blur")
SAME = 0.01  # of the larger


def run(progress: Callable[[str], None]) -> Result:
    """Draw each model with a feature on and off."""
    table = published("features")
    cells: list[Cell] = []
    absent: list[str] = []
    for row in table[table.feature == "bilinear_vs_nearest"].to_dict("records"):
        name = str(row["model"])
        progress(f"filters {name}")
        frames = [_tiled(name, texture_filter=texture_filter) for texture_filter in FILTERS]
        if frames[0] is None or frames[1] is None:
            absent.append(name)
            continue
        asked = float(row["on_ms"]) - float(row["off_ms"])
        ours = frames[0].milliseconds - frames[1].milliseconds
        cells.append(
            Cell(name, "bilinear - nearest", "ms", published=asked, ours=ours, aim=1.0, frame=frame_name(name))
        )
    occlusion = table[table.feature == "ssao"]
    speed = _speed(occlusion)
    costs: list[float] = []
    for row in occlusion.to_dict("records"):
        name = str(row["model"])
        progress(f"ssao {name}")
        frame = _tiled(name, ssao=True)
        if frame is None:
            absent.append(name)
            continue
        costs.append(float(frame.stages.milliseconds[list(OCCLUSION)].sum()))
        asked = float(row["on_ms"]) - float(row["off_ms"])
        ours = costs[-1] / speed
        cells.append(Cell(name, "ssao: on - off", "ms", published=asked, ours=ours, aim=0.5, frame=frame_name(name)))
    if costs:
        same = max(costs) - min(costs) < SAME * max(costs)
        made_of = tuple((cell.row, cell.column) for cell in cells if cell.column == "ssao: on - off")
        said = "no" if same else "yes"
        cells.append(Cell("all models", "ssao: cost depends on the scene", "", published="no", ours=said, of=made_of))
    notes = _notes(costs, speed)
    title = "Filtering and ambient occlusion"
    answer = _answer(cells)
    warnings = missing(absent)
    return Result("ru2016-features", title, SOURCE, cells, answer, notes=notes, warnings=warnings)


def _answer(cells: list[Cell]) -> str:
    """What each feature adds to a frame."""
    said = []
    for what, column in (("bilinear filtering", "bilinear - nearest"), ("ambient occlusion", "ssao: on - off")):
        added = [float(cell.ours) for cell in cells if cell.column == column]
        if added:
            said.append(f"{what} adds {min(added):.2f} to {max(added):.2f} ms")
    return f"By the model {' and '.join(said)}." if said else ""


def _tiled(name: str, **options: Any) -> Run | None:
    return draw(name, "tiled", tile=MODELS_TILE, capacity="original", **options)


def _speed(occlusion: pd.DataFrame) -> float:
    """How much faster than the GT 750M the GPU of his occlusion figures was: from his own times without it."""
    models = published("models").set_index("model").tile_ms
    ratios = models[occlusion.model].to_numpy() / occlusion.off_ms.to_numpy()
    return float(np.exp(np.log(ratios).mean()))


def _notes(costs: list[float], speed: float) -> list[str]:
    notes = [
        (
            "Filters: twelve byte loads instead of three, each divided by 255, and a blend cost what is shown; nothing "
            "else in his shading kernel changes. His duck with nearest texels takes 5.4 ms, 0.1 more than one triangle "
            "without any texture and 0.4 less than the smaller, plain cow: more than the filter differs in his runs."
        ),
    ]
    if costs:
        notes.append(
            f"Ambient occlusion and its blur take {min(costs):.2f} to {max(costs):.2f} ms on the GT 750M over the "
            "models: they are launched over the window, whatever stands there. His build of it was made for sm_61, "
            f"which a GT 750M cannot run; by his own times without occlusion that GPU was {speed:.1f} times as fast "
            "(geometric mean of four models, derived), and by that our times are divided: a hypothesis."
        )
    return notes
