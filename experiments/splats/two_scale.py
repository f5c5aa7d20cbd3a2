"""Do two scales pay? Lists of macro tiles, blended by tiles in batches (HiGS), against lists of tiles.

Published are frames of an A100 (five trained scenes at 1080p) by the original, gsplat, Speedy-Splat and HiGS, and how
much a frame of HiGS and of others grows from 1080p to 4K. Their scenes are not here: ours are smaller, and HiGS's half
precision and segmented sort are not modelled. All cells are predicted.
"""

from collections.abc import Iterator
from typing import Any

import pandas as pd

from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Cell, Result
from tilestamp.experiments.splats.executed import executed
from tilestamp.experiments.splats.host import frame_ms
from tilestamp.experiments.splats.tile_size import SCENES, on_each, scenes_here
from tilestamp.simulator.scenes.scene import Scene

QUESTION = "Do two scales pay: macro tiles to sort, small tiles to blend?"
SLOW = True  # draws every scene at 4K on three GPUs

TITLE = "Frames of splats by one scale and by two"
SOURCE = "caizefan34/3dgs-renderer-benchmark (A100); Pajak, Bisson & Lima 2026, HiGS, arXiv 2606.00352 (1080p to 4K)"
MACHINES = ("titanrtx", "a100", "h200")
SCREENS = {"1080p": (1920, 1080), "4K": (3840, 2160)}
AIM = 0.2
ORIGINAL, EXACT, SMALL, TWO, WIDE = "squares, 16", "exact, 16", "exact, 8", "two scales, 8", "two scales, 16"
ROADS: dict[str, dict[str, Any]] = {
    ORIGINAL: {"tile": 16},
    EXACT: {"tile": 16, "bound": "ellipse"},
    SMALL: {"tile": 8, "bound": "ellipse"},
    TWO: {"tile": 8, "bound": "ellipse", "two_scale": True},
    WIDE: {"tile": 16, "bound": "ellipse", "two_scale": True},
}
RATIOS = {"gsplat packed": (EXACT, 241.6 / 122.9), "Speedy-Splat": (EXACT, 293.0 / 122.9), "HiGS": (TWO, 696.9 / 122.9)}
GROWTH = {"HiGS": (TWO, 1.6), "others": (EXACT, 2.8)}
PUBLISHED_ON = "a100"  # the ratios; the growth is published without a GPU that is here


def run(progress: Progress) -> Result:
    """Draw all of them."""
    scenes, missing = scenes_here()
    rows = on_each(scenes, MACHINES, frames, progress)
    table = pd.DataFrame(rows)
    cells = list(_cells(table))
    answer = _answer(table)
    notes = list(_notes(table))
    tables = {"frames": table}
    return Result("splats-two_scale", TITLE, SOURCE, cells, answer, notes=notes, warnings=missing, tables=tables)


def frames(
    name: str, scene: Scene, machine: str, screens: dict[str, tuple[int, int]] = SCREENS
) -> Iterator[dict[str, Any]]:
    """Milliseconds of each frame of one scene on one GPU."""
    for screen, (width, height) in screens.items():
        for road, options in ROADS.items():
            run = executed(scene, machine, width=width, height=height, picture=False, **options)
            stages = run.stages.milliseconds
            yield {
                "scene": name, "machine": machine, "screen": screen, "road": road, "ms": frame_ms(run),
                "lists_ms": float(stages.drop("blend").sum()), "blend_ms": float(stages["blend"]),
                "pairs": run.counts["duplicate.PAIRS"], "evaluations": run.counts["blend.EVALUATIONS"],
            }  # fmt: skip


def times(table: pd.DataFrame, screen: str, values: str = "ms") -> pd.DataFrame:
    """Milliseconds by scene and GPU, a column a road."""
    rows = table[table.screen == screen]
    return rows.pivot_table(index=["scene", "machine"], columns="road", values=values, sort=False)


def _cells(table: pd.DataFrame) -> Iterator[Cell]:
    small, large = (times(table, screen) for screen in SCREENS)
    for scene, machine in small.index:
        if machine != PUBLISHED_ON:
            continue
        one, four = small.loc[(scene, machine)], large.loc[(scene, machine)]
        for who, (road, published) in RATIOS.items():
            ours = one[ORIGINAL] / one[road]
            yield Cell(scene, f"{who} : original", "times faster", published=published, ours=ours, aim=AIM, frame=scene)
        for who, (road, published) in GROWTH.items():
            ours = four[road] / one[road]
            yield Cell(
                scene, f"{who}, 4K : 1080p", "times longer", published=published, ours=ours, aim=AIM, frame=scene
            )


def _answer(table: pd.DataFrame) -> str:
    gains = pd.concat([best_of_one(times(table, screen)) for screen in SCREENS])
    lists = pd.concat([by_lists_alone(table, screen) for screen in SCREENS])
    return (
        f"Two scales at tiles of 8 beat the better of exact lists at 8 and at 16 in {int((gains > 1).sum())} of "
        f"{len(gains)} frames, {gains.min():.2f} to {gains.max():.2f} times as fast; {lists.min():.2f} to "
        f"{lists.max():.2f} times if blending, priced by hand, took as long as by lists of tiles of 8."
    )


def by_lists_alone(table: pd.DataFrame, screen: str) -> "pd.Series[float]":
    """As ``best_of_one``, with the blending of lists of tiles of 8 in place of that of two scales."""
    wide, blend = times(table, screen), times(table, screen, "blend_ms")
    return best_of_one(wide.assign(**{TWO: wide[TWO] - blend[TWO] + blend[SMALL]}))


def best_of_one(wide: pd.DataFrame) -> "pd.Series[float]":
    """How many times as fast two scales are as the better tile of exact lists."""
    return wide[[EXACT, SMALL]].min(axis=1) / wide[TWO]


def _notes(table: pd.DataFrame) -> Iterator[str]:
    for screen in SCREENS:
        for (scene, machine), gain in best_of_one(times(table, screen)).items():
            row = times(table, screen).loc[(scene, machine)]
            each = ", ".join(f"{road} {row[road]:.2f}" for road in ROADS)
            yield f"{SCENES[scene]}, {screen}, {machine}: {each} ms; two scales are {gain:.2f} times as fast."
