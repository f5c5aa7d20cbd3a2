"""Why 16x16? The frame of splats by tile size, list rule, scene, screen and GPU.

Modelled frames of all GPUs; beside those of the H200 what was measured there (``silicon/splat``). Garden and a larger
level of playbot are looked for on the scene search path; where they are not, the embedded level of playbot is drawn.
"""

from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd

from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Cell, Figure, Result
from tilestamp.experiments.silicon.splat_inputs import MEASURED, PIPELINE, TIMED
from tilestamp.experiments.splats.executed import executed
from tilestamp.experiments.splats.host import frame_ms
from tilestamp.models.errors import TilestampError
from tilestamp.reports.plots import lines
from tilestamp.simulator.scenes.library import load_scene
from tilestamp.simulator.scenes.scene import Scene

QUESTION = "Why 16x16 tiles, and not 8 or 32?"
SLOW = True  # draws every scene by every rule on four GPUs

SOURCE = "The question: graphdeco-inria/gaussian-splatting, issue 1103; answered there by 'generally faster'"
MACHINES = ("titanrtx", "a100", "h200", "mi300x")
MEASURED_ON = "h200"
EMBEDDED = "playbot"
SCENES = {EMBEDDED: "playbot, 2 k", "playbot/2": "playbot, 125 k", "garden1": "garden, 112 k"}
FILES = {"playbot/2": "playbot125k", "garden1": "garden1"}  # of measurements
RULES = {"square": "square", "ellipse": "tight"}  # ours, and the variant that was measured
TILES: tuple[int, ...] = (8, 16, 32)
SCREENS = ((1920, 1080), (980, 545))
CLEAR = 0.1


def run(progress: Progress) -> Result:
    """Draw all of them."""
    scenes, missing = scenes_here()
    rows = on_each(scenes, MACHINES, frames, progress)
    table = pd.DataFrame(rows).merge(measured(), how="left", on=["scene", "machine", "width", "rule", "tile"])
    best = winners(table)
    return Result(
        name="splats-tile_size",
        title="Frames of splats by tile size",
        source=SOURCE,
        cells=list(_cells(table)),
        answer=_answer(best),
        figures=list(_figures(table)),
        notes=[_won(row) for row in best.to_dict("records")],
        warnings=missing,
        tables={"frames": table, "fastest": best},
    )


def on_each(
    scenes: dict[str, Scene],
    machines: Iterable[str],
    frames: Callable[[str, Scene, str], Iterable[dict[str, Any]]],
    progress: Progress,
) -> list[dict[str, Any]]:
    """Rows of the frames of all scenes on all machines."""
    rows: list[dict[str, Any]] = []
    for name, scene in scenes.items():
        for machine in machines:
            progress(f"{name} on {machine}")
            rows += frames(name, scene, machine)
    return rows


def scenes_here() -> tuple[dict[str, Scene], list[str]]:
    """Scenes that are here, and what is not."""
    found, missing = {}, []
    for name in SCENES:
        try:
            found[name] = load_scene(name)
        except TilestampError as error:
            missing.append(f"{name} is left out: {error}")
    if len(found) > 1:
        del found[EMBEDDED]
    return found, missing


def frames(name: str, scene: Scene, machine: str) -> Iterator[dict[str, Any]]:
    """Milliseconds of each frame of one scene on one GPU."""
    for width, height in SCREENS if machine == MEASURED_ON else SCREENS[:1]:
        for rule in RULES:
            for tile in TILES:
                frame = executed(scene, machine, width=width, height=height, tile=tile, bound=rule, picture=False)
                counts = frame.counts
                yield {
                    "scene": name, "machine": machine, "width": width, "rule": rule, "tile": tile,
                    "ms": frame_ms(frame), "blend_ms": float(frame.stages.milliseconds["blend"]),
                    "sort_ms": float(frame.stages.milliseconds["sort"]), "pairs": counts["duplicate.PAIRS"],
                    "efficiency": counts["blend.BLENDED"] / max(1, counts["blend.EVALUATIONS"]),
                }  # fmt: skip


def measured() -> pd.DataFrame:
    """Milliseconds of the frames that were measured."""
    found = []
    for scene, file in FILES.items():
        table = pd.read_csv(MEASURED / f"{file}.csv.gz")
        table = table[(table.kernel == PIPELINE) & table.source.isin(TIMED) & table.metric.str.contains("span")]
        for rule, variant in RULES.items():
            for tile in TILES:
                rows = table[(table.variant == variant) & (table.tile == f"{tile}x{tile}")]
                for width, group in rows.groupby("W"):
                    place = {"scene": scene, "machine": MEASURED_ON, "width": width, "rule": rule, "tile": tile}
                    found.append(place | {"measured": group.value.mean() / 1e3})
    return pd.DataFrame(found)


def winners(table: pd.DataFrame) -> pd.DataFrame:
    """The fastest tile of each scene, screen, rule and GPU, and how much longer 16x16 takes."""
    rows = []
    for place, group in table.groupby(["scene", "width", "rule", "machine"], sort=False):
        times = group.set_index("tile").ms
        best = times.idxmin()
        names = dict(zip(("scene", "width", "rule", "machine"), place, strict=True))
        rows.append(names | {"tile": best, "ms": times[best], "lost by 16x16": times[16] / times[best] - 1.0})
    return pd.DataFrame(rows)


def _answer(best: pd.DataFrame) -> str:
    """Where 16x16 is the best, and where not."""
    square, exact = (best[(best.rule == rule) & (best.width == SCREENS[0][0])] for rule in RULES)
    return (
        f"With the published square lists 16x16 is the fastest, or within {CLEAR:.0%} of it, in "
        f"{int((square['lost by 16x16'] <= CLEAR).sum())} of {len(square)} cases at {SCREENS[0][0]} pixels; with exact "
        f"lists in {int((exact['lost by 16x16'] <= CLEAR).sum())} of {len(exact)}: there 8x8 wins "
        f"{int((exact.tile == 8).sum())}."
    )


def _won(row: dict[str, Any]) -> str:
    return (
        f"{SCENES[row['scene']]}, {row['width']} pixels, {row['rule']} lists, {row['machine']}: {row['tile']}x"
        f"{row['tile']}, {row['ms']:.2f} ms; 16x16 takes {row['lost by 16x16']:.0%} more."
    )


def _cells(table: pd.DataFrame) -> Iterator[Cell]:
    for row in table.dropna(subset=["measured"]).to_dict("records"):
        label = f"{row['scene']} {row['width']} {row['rule']}"
        yield Cell(label, f"tile {row['tile']}", "ms", published=row["measured"], ours=row["ms"], aim=0.2, frame=label)


def _figures(table: pd.DataFrame) -> Iterator[Figure]:
    """By scene and rule on the H200, beside what was measured; and by GPU."""
    wide = table[table.width == SCREENS[0][0]]
    ours = wide[wide.machine == MEASURED_ON]
    label = [f"{SCENES[scene]}, {rule}" for scene, rule in zip(ours.scene, ours.rule, strict=True)]
    yield Figure("h200", partial(_draw, ours.assign(label=label), "measured", "Frames of splats on an H200, 1920x1080"))
    for rule in RULES:
        rows = wide[(wide.rule == rule) & (wide.scene == wide.scene.iloc[-1])]
        title = f"{SCENES[rows.scene.iloc[0]]}, {rule} lists, 1920x1080"
        yield Figure(f"gpus-{rule}", partial(_draw, rows.assign(label=rows.machine), None, title))


def _draw(rows: pd.DataFrame, known: str | None, title: str, path: Path) -> None:
    lines(
        rows, path, x="tile", y="ms", by="label", title=title, x_label="pixels on a side of a tile",
        y_label="ms a frame", published=known, log_x=True, log_y=True,
    )  # fmt: skip
