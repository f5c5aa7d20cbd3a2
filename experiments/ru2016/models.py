"""Ru 2016, tiles against primitives: eight models, tiled with and without culling, and per primitive."""

from collections.abc import Callable
from typing import Any

import pandas as pd

from tilestamp.experiments.harness.cell_bars import cell_bars
from tilestamp.experiments.harness.result import Cell, Result, Status
from tilestamp.experiments.ru2016.setting import (
    DEGREE_VIEW,
    INTEROP,
    MODELS_TILE,
    RADIAN_VIEW,
    SOURCE,
    draw,
    frame_ms,
    frame_name,
    missing,
    published,
    waits_ms,
)
from tilestamp.simulator.run import Run

QUESTION = "Are tiles faster than one thread a triangle?"
SLOW = True  # with what it needs compiled, more than the first run should take

METHODS: dict[str, tuple[str, dict[str, Any]]] = {
    "tile_ms": ("tiled", {"tile": MODELS_TILE, "capacity": "original"}),
    "tile_without_culling_ms": ("tiled", {"tile": MODELS_TILE, "capacity": "original", "cull_backfaces": False}),
    "per_primitive_ms": ("per-primitive", {}),
}
AIM = 0.5
TIE = 0.05  # published times as near as this have no winner
VIEWED = ("triangle", "box", "CesiumMilkTruck", "flower")  # also drawn with 45 degrees
FIGURE = cell_bars(
    "times",
    lambda cell: cell.unit == "ms",
    "Eight models, three ways (GT 750M)",
    "ms",
    lambda cell: f"{cell.row} {cell.column}".replace("_", " "),
)


def run(progress: Callable[[str], None]) -> Result:
    """Draw every model three times."""
    table = published("models").set_index("model")
    runs: dict[str, dict[str, Run]] = {}
    for name in map(str, table.index):
        progress(name)
        frames = {c: draw(name, pipeline, **options) for c, (pipeline, options) in METHODS.items()}
        runs[name] = {column: frame for column, frame in frames.items() if frame is not None}
    absent = [name for name, frames in runs.items() if not frames]
    cells = [
        Cell(
            name, column.removesuffix("_ms"), "ms", published=float(table[column][name]), ours=frame_ms(frame),
            aim=AIM, frame=frame_name(name),
        )
        for name, frames in runs.items()
        for column, frame in frames.items()
    ]  # fmt: skip
    cells += [_winner(name, table.loc[name], frames) for name, frames in runs.items() if frames]
    progress("the other view")
    tables = {"views": _views(), "breakdown": _breakdown(runs)}
    notes = [*_notes(runs, tables["breakdown"]), _view_note(cells, tables["views"], table)]
    title = "Tiles against primitives"
    answer = _answer(cells)
    warnings = missing(absent)
    return Result(
        "ru2016-models", title, SOURCE, cells, answer, figures=[FIGURE], notes=notes, warnings=warnings, tables=tables
    )


def _answer(cells: list[Cell]) -> str:
    """Models that tiles draw faster."""
    winners = [cell for cell in cells if cell.column == "faster"]
    tiles = [sum(getattr(cell, name) == "tiles" for cell in winners) for name in ("ours", "published")]
    return f"By the model on {tiles[0]} of {len(winners)} models, as published on {tiles[1]}."


def _winner(name: str, asked: "pd.Series[float]", frames: dict[str, Run]) -> Cell:
    """Compare which method is faster with culling; a tie where his times are equal."""
    tie = abs(asked["tile_ms"] / asked["per_primitive_ms"] - 1.0) < TIE
    his = "tie" if tie else "tiles" if asked["tile_ms"] < asked["per_primitive_ms"] else "primitives"
    ours = "tiles" if frame_ms(frames["tile_ms"]) < frame_ms(frames["per_primitive_ms"]) else "primitives"
    status: Status = "reported" if tie else "predicted"
    made_of = ((name, "tile"), (name, "per_primitive"))
    return Cell(name, "faster", "", published=his, ours=ours, status=status, frame=frame_name(name), of=made_of)


def _notes(runs: dict[str, dict[str, Run]], breakdown: pd.DataFrame) -> list[str]:
    """Say what was fitted and what is a hypothesis, and what the floor is made of."""
    floor = breakdown[(breakdown.model == "triangle") & (breakdown.method == "tile")].iloc[0]
    parts = [(column.removesuffix("_ms"), floor[column]) for column in breakdown if column.endswith("_ms")]
    listed = ", ".join(f"{name} {ms:.2f}" for name, ms in parts if name != "frame" and ms > 0.005)
    stores = runs["triangle"]["tile_ms"].stages.loc["tiled_raster"]
    return [
        (
            f"The floor of 5.3 ms, on one triangle, in ms: {listed}. Most of the kernels' time is the raster writing "
            f"empty fragments: 56-byte structures stored word by word, {stores.store_transactions / 1e6:.1f} million "
            "segments. Per primitive there is no such store, but fragments and depth are cleared."
        ),
        (
            f"Hypotheses: 45 taken as radians, {RADIAN_VIEW:.1f} degrees; 16x16 tiles; models not turned. He turned "
            "and zoomed by mouse, and says nowhere how: his times see more of flower and box than ours do."
        ),
        (
            "One thread a triangle is bound by its longest thread: a hit waits for w, for the old depth, and for each "
            "attribute behind the stores of the one before."
        ),
    ]


def _view_note(cells: list[Cell], views: pd.DataFrame, table: pd.DataFrame) -> str:
    """Compare the two readings of his camera on the models that are drawn with both."""
    errors = [
        abs(c.ours / float(c.published) - 1.0)
        for c in cells
        if c.row in VIEWED and isinstance(c.ours, float) and c.published
    ]
    other = [abs(row.frame_ms / table[f"{row.method}_ms"][row.model] - 1.0) for row in views.itertuples()]
    return (
        f"The angle was chosen between two readings of his source. On {', '.join(VIEWED)} the mean error is "
        f"{100 * sum(errors) / len(errors):.0f} % at {RADIAN_VIEW:.1f} degrees and "
        f"{100 * sum(other) / len(other):.0f} % at {DEGREE_VIEW:g} (views.csv)."
    )


def _breakdown(runs: dict[str, dict[str, Run]]) -> pd.DataFrame:
    """Where each frame's time goes."""
    rows = [
        {
            "model": name,
            "method": column.removesuffix("_ms"),
            "frame_ms": frame_ms(frame),
            "waits_ms": waits_ms(frame),
            "interop_ms": INTEROP.value,
            **{f"{stage}_ms": float(ms) for stage, ms in frame.stages.milliseconds.items()},
        }
        for name, frames in runs.items()
        for column, frame in frames.items()
    ]
    return pd.DataFrame(rows)


def _views() -> pd.DataFrame:
    """Frame times by the angle that his camera may have had."""
    rows = []
    for name in VIEWED:
        for column, (pipeline, options) in METHODS.items():
            frame = draw(name, pipeline, fov_degrees=DEGREE_VIEW, **options)
            if frame is not None:
                method = column.removesuffix("_ms")
                rows.append({"model": name, "method": method, "fov": DEGREE_VIEW, "frame_ms": frame_ms(frame)})
    return pd.DataFrame(rows)
