"""Ru 2016, features on and off: bilinear filtering, and ambient occlusion whose cost does not depend on the scene."""

from collections.abc import Callable
from typing import Any

from experiments.result import Cell, Result
from experiments.ru2016.setting import SOURCE, draw, missing, published

SLOW = True  # with what it needs compiled, more than the first run should take

OPTIONS: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "bilinear_vs_nearest": ({"texture_filter": "bilinear"}, {"texture_filter": "nearest"}),
    "ssao": ({"ssao": True}, {"ssao": False}),
}


def run(progress: Callable[[str], None]) -> Result:
    """Draw each model with a feature on and off."""
    cells: list[Cell] = []
    absent: list[str] = []
    costs: list[float] = []
    for row in published("features").to_dict("records"):
        feature, name = str(row["feature"]), str(row["model"])
        progress(f"{feature} {name}")
        frames = [draw(name, "tiled", capacity="original", **options) for options in OPTIONS[feature]]
        if frames[0] is None or frames[1] is None:
            absent.append(name)
            continue
        difference = frames[0].milliseconds - frames[1].milliseconds
        asked = float(row["on_ms"]) - float(row["off_ms"])
        cells.append(Cell(name, f"{feature}: on - off", "ms", asked, difference, aim=1.0))
        if feature == "ssao":
            costs.append(float(frames[0].stages.milliseconds.to_dict()["ambient_occlusion"]))
    notes = [
        (
            "His SSAO build was compiled for sm_61, so its figures probably come from another GPU; "
            "ours are for the GT 750M."
        ),
    ]
    if costs:
        notes.append(
            f"The kernel of ambient occlusion takes {min(costs):.2f} to {max(costs):.2f} ms over the models: it is "
            "launched over the window. Published differences: 2.2 to 3.0 ms."
        )
    return Result("ru2016-features", "Filtering and ambient occlusion", SOURCE, cells, [], notes, missing(absent))
