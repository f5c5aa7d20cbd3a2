"""Seconds saved against error by sampling, from 32 patches to 5 M triangles: full runs beside runs with an error.

Set TILESTAMP_SAMPLED=long for the large scenes (minutes): killeroo and bigguy cut to 2 pixels, meshes up to 5 M
triangles. Seconds are CPU seconds of all threads, executing and pricing, the least of some runs; the clock is this
computer's, so they differ from run to run.
"""

import os
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Cell, Figure, Result
from tilestamp.models.errors import TilestampError
from tilestamp.reports.sampling_plot import sampling_plot
from tilestamp.simulator.run import Run
from tilestamp.simulator.sampling.executor import PAYS
from tilestamp.simulator.scenes.library import load_scene, with_views
from tilestamp.simulator.scenes.scene import Mesh, Scene
from tilestamp.simulator.simulation import simulate

if TYPE_CHECKING:
    from pathlib import Path

    import pandas as pd

QUESTION = "How much simulation time does sampling save, and at what error?"
VARIABLE = "TILESTAMP_SAMPLED"
ERRORS = (0.1, 0.03, 0.01)
SEED = 1
REPEATS = 2  # of each run: the quicker counts
AIM_PRIMITIVES, AIM_ERROR, AIM_SHARE = 100_000, 0.01, 0.1
NUMBERS = ("milliseconds", "instructions", "sample_tests", "sample_hits")


@dataclass(frozen=True)
class Case:
    """One scene as it is drawn."""

    name: str
    scene: Callable[[], Scene]
    pipeline: str
    machine: str
    options: dict[str, Any] = field(default_factory=dict)


def torus(triangles: int) -> Scene:
    """Make a wavy torus of about so many triangles, row by row; it stands for scans that are not at hand."""
    columns = int(np.sqrt(triangles))
    rows = triangles // (2 * columns)
    u, v = np.meshgrid(*(np.linspace(0, 2 * np.pi, n, endpoint=False) for n in (columns, rows)))
    radius = 0.35 * (1 + 0.15 * np.sin(12 * u) * np.sin(9 * v) + 0.03 * np.sin(97 * u + 31 * v))
    away = 1 + radius * np.cos(v)
    height = radius * np.sin(v) + 0.2 * np.sin(2 * u)
    points = np.stack([away * np.cos(u), height, away * np.sin(u), np.ones_like(u)], axis=-1).astype(np.float32)
    i, j = np.arange(rows)[:, None], np.arange(columns)[None]
    a, b = i * columns + j, i * columns + (j + 1) % columns
    c, d = (i + 1) % rows * columns + j, (i + 1) % rows * columns + (j + 1) % columns
    corners = np.stack([a, c, b, b, c, d], axis=-1).reshape(-1, 3).astype(np.int32)
    return with_views(Scene(f"torus of {len(corners)} triangles", mesh=Mesh(points.reshape(-1, 4), corners)))


def cases() -> list[Case]:
    """Scenes of the short version, and of the long one."""
    short = [
        Case("teapot, bound 4", lambda: load_scene("teapot"), "micropolygon", "gtx280", {"width": 640, "height": 480}),
        Case("torus 20 k", lambda: torus(20_000), "cudaraster", "gtx480", {"width": 640, "height": 480}),
        Case("torus 200 k", lambda: torus(200_000), "cudaraster", "gtx480"),
    ]
    if os.environ.get(VARIABLE) != "long":
        return short
    large = {"width": 1600, "height": 1200, "bound": 2}
    patches = [
        Case(f"{name}, bound 2", partial(load_scene, name), "micropolygon", "gtx280", large)
        for name in ("teapot", "bigguy", "killeroo")
    ]
    scans = [Case(name, partial(load_scene, name), "cudaraster", "gtx480") for name in ("dragon_100k", "buddha_100k")]
    meshes = [Case(f"torus {n} M", partial(torus, n * 1_000_000), "cudaraster", "gtx480") for n in (1, 5)]
    return [*short, *patches, *scans, *meshes]


def run(progress: Progress) -> Result:
    """Run every scene in full and with each error."""
    import pandas as pd

    rows: list[dict[str, Any]] = []
    warnings: list[str] = []
    for case in cases():
        progress(f"frontier/sampled: {case.name}")
        try:
            scene = case.scene()
        except TilestampError as missing:
            warnings.append(f"{case.name} was left out: {missing}")
            continue
        rows += _rows(case, scene)
    table = pd.DataFrame(rows)
    return Result(
        name="frontier-sampled",
        title="What sampling saves: CPU seconds against the error of the frame's numbers",
        source="Full runs of this simulator on this computer",
        cells=_cells(table),
        answer=_answer(table),
        figures=[Figure("seconds-against-error", lambda path: _draw(table, path))],
        notes=_notes(table),
        warnings=warnings,
        tables={"runs": table},
    )


def _answer(table: "pd.DataFrame") -> str:
    """Share and error of each error that is asked for, over the scenes that were sampled."""
    sampled = table[table.sampled].groupby("error_asked", sort=False)
    said = [
        f"{rows.share_of_full.median():.0%} at {rows.milliseconds_error.mean():.2%} (asked: {asked:.0%})"
        for asked, rows in sampled
    ]
    if not said:
        return f"None here: no frame of {table.scene.nunique()} scenes takes long enough for a sample to save anything."
    return f"Median share of a full run, and mean error of a frame's time: {'; '.join(said)}."


def _rows(case: Case, scene: Scene) -> list[dict[str, Any]]:
    """One scene: the full run, then each error beside it."""
    simulate(scene, case.pipeline, case.machine, error=ERRORS[0], **{**case.options, "width": 64, "height": 48})
    full, full_seconds = _timed(case, scene)
    found = []
    for error in ERRORS:
        part, seconds = _timed(case, scene, error=error, seed=SEED)
        row = {
            "scene": case.name,
            "pipeline": case.pipeline,
            "primitives": _primitives(full),
            "error_asked": error,
            "full_cpu_seconds": full_seconds,
            "cpu_seconds": seconds,
            "share_of_full": seconds / full_seconds,
            "sampled": bool(part.sampled),
        }
        for name in NUMBERS:
            known, ours = full.intervals["frame", name].value, part.intervals["frame", name]
            row[f"{name}_error"] = abs(ours.value / known - 1)
            row[f"{name}_half_width"] = ours.relative
        found.append(row)
    return found


def _timed(case: Case, scene: Scene, **options: Any) -> tuple[Run, float]:
    """Simulate and price; the least CPU seconds."""
    best = float("inf")
    for _ in range(REPEATS):
        start = time.process_time()
        made = simulate(scene, case.pipeline, case.machine, **case.options, **options)
        _ = made.intervals
        best = min(best, time.process_time() - start)
    return made, best


def _primitives(full: Run) -> int:
    """Triangles set up, or sub-patches diced."""
    counts = full.counts
    return counts.get("dice.PATCHES", 0) or counts["triangle_setup.TRIANGLE_LANES"]


def _cells(table: "pd.DataFrame") -> list[Cell]:
    cells = []
    for row in table.itertuples():
        name = f"{row.scene} ({row.primitives:,})"
        asked = f"error {row.error_asked:g}"
        cells += [
            Cell(
                name,
                f"{asked}: seconds",
                "of full",
                published=None,
                ours=round(row.share_of_full, 3),
                status="reported",
            ),
            Cell(
                name,
                f"{asked}: actual",
                "%",
                published=None,
                ours=round(100 * row.milliseconds_error, 3),
                status="reported",
            ),
            Cell(
                name,
                f"{asked}: half-width",
                "%",
                published=None,
                ours=round(100 * row.milliseconds_half_width, 3),
                status="reported",
            ),
        ]
    return cells


def _notes(table: "pd.DataFrame") -> list[str]:
    aimed = table[(table.primitives >= AIM_PRIMITIVES) & (table.error_asked == AIM_ERROR)]
    reached = aimed[(aimed.share_of_full <= AIM_SHARE) & (aimed.milliseconds_error <= AIM_ERROR)]
    held = table[table.sampled]
    inside = [(held[f"{n}_error"] <= held[f"{n}_half_width"] + 1e-9).mean() for n in NUMBERS] if len(held) else [1.0]
    return [
        (
            f"Aim: 1 % error in a tenth of the full run's CPU seconds above 100 k primitives. Reached by "
            f"{len(reached)} of {len(aimed)} scenes; shares of the full run: "
            + ", ".join(f"{row.scene} {row.share_of_full:.2f}" for row in aimed.itertuples())
            + "."
        ),
        (
            "Only the last stage is sampled, whose outputs nothing but the picture needs: sub-patches are split, diced "
            "and bucketed, triangles set up, binned and listed in full; and the launches are priced unit by unit."
        ),
        f"Intervals of the four numbers of the frame that held the full run's value: {100 * np.mean(inside):.0f} %.",
        (
            f"Frames whose last stage takes less than about {PAYS:g} seconds run in full: a sample would cost more. "
            "The run that costs most takes "
            f"{table.share_of_full.max():.2f} of the full one's time."
        ),
    ]


def _draw(table: "pd.DataFrame", path: "Path") -> None:
    sampling_plot(table, path, aim=(AIM_ERROR, AIM_SHARE))
