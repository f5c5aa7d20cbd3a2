"""What executing a part of a frame could save: seconds against error, from 10 k to 20 M primitives.

tilestamp executes every frame in full. Two samplers, each better than one that could be built, are priced beside it:

- tiles in part: all stages but the last run in full, and of its tiles a share. It pays the full run's CPU seconds less
  what that share of the last stage saves; to draw the sample, to say how sure it is and to foretell the other tiles is
  free.
- numbers in part: one pass over the boxes of all triangles (``sampled_boxes``), and a share of everything else that is
  executed. What those stages count beside the tiles is known for nothing.

The error is that of the frame's time where each tile that did not run does what a tile with a list of nearly its
length did. Set TILESTAMP_SAMPLED=long for the large scenes (minutes). Seconds are CPU seconds of all threads, the least
of some rounds in which all are measured by turns.
"""

import os
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import numpy as np
import pandas as pd

from tilestamp.experiments.frontier.sampled_boxes import boxes
from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Cell, Chart, Figure, Result, reported
from tilestamp.models.errors import TilestampError
from tilestamp.models.machine import load_machine
from tilestamp.reports.plots import lines
from tilestamp.reports.sampling_plot import sampling_plot
from tilestamp.simulator.executor import Executor
from tilestamp.simulator.frame import Frame
from tilestamp.simulator.pipelines import load_pipeline, pipeline_options
from tilestamp.simulator.run import Run
from tilestamp.simulator.scenes.library import load_scene, with_views
from tilestamp.simulator.scenes.scene import Mesh, Scene
from tilestamp.simulator.stage import StageResult
from tilestamp.simulator.stages.laine2011.triangle_setup import MAX_SUBTRIANGLES
from tilestamp.simulator.work import Work

QUESTION = "Could executing a part of each frame save time?"
VARIABLE = "TILESTAMP_SAMPLED"
RATES = (0.01, 0.03, 0.1, 0.3)
SEEDS, ROUNDS = 5, 3
TILES, NUMBERS = "tiles in part", "numbers in part"
LISTED = {"tile_raster": "GRIDS", "fine_raster": "ENTRY_LANES"}  # what is known of a tile before it is drawn
AIMS = ((1_000_000, 0.2), (5_000_000, 0.1))  # share of the full run at 1 %, above so many primitives

P = ParamSpec("P")
T = TypeVar("T")


@dataclass(frozen=True)
class Case:
    """One scene as it is drawn."""

    name: str
    scene: Callable[[], Scene]
    pipeline: str
    machine: str
    options: dict[str, Any] = field(default_factory=dict)
    size: tuple[int, int] = (1600, 1200)


class Timed(Executor):
    """Notes the CPU seconds of the last stage."""

    seconds = 0.0

    def __call__(self, stage: Callable[P, StageResult[T]], *inputs: P.args, **options: P.kwargs) -> StageResult[T]:
        """Run a stage against the clock; where a frame has several draws, the last stages add up."""
        start = time.process_time()
        result = super().__call__(stage, *inputs, **options)
        if stage.__name__ in LISTED:
            self.seconds += time.process_time() - start
        return result


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

    def mesh(million: float) -> Case:
        options = {"batches": 1 + int(million * 1e6) // MAX_SUBTRIANGLES}  # a draw takes no more
        return Case(f"torus {million:g} M", partial(torus, int(million * 1e6)), "cudaraster", "gtx480", options)

    def patches(name: str, bound: float, spp: int = 1) -> Case:
        about = f"{name}, bound {bound:g}" + (f", {spp} samples" if spp > 1 else "")
        return Case(about, partial(load_scene, name), "micropolygon", "gtx280", {"bound": bound, "spp": spp})

    short = [mesh(0.01), mesh(0.1), mesh(1), patches("teapot", 4), patches("teapot", 4, 16)]
    if os.environ.get(VARIABLE) != "long":
        return short
    return [*short, mesh(5), mesh(20), *(patches("killeroo", *each) for each in ((4,), (1,), (4, 16)))]


CHART = Chart(
    name="runs", kind="front", table="runs", title="Seconds that a part of a frame takes at least, against its error.",
    alt="Scatter plot: CPU seconds over the mean error of the frame's time; a colour a scene.",
    of={"x": "cpu_seconds", "y": "error", "color": "scene", "label": "method",
        "titles": ["CPU seconds, at least", "mean error of the frame's time"]},
)  # fmt: skip


def run(progress: Progress) -> Result:
    """Run every scene in full, and price its parts."""
    rows: list[dict[str, Any]] = []
    warnings: list[str] = []
    for case in cases():
        progress(f"frontier/sampled: {case.name}")
        try:
            scene = case.scene()
        except TilestampError as missing:
            warnings.append(f"{case.name} was left out: {missing}")
            continue
        rows += rows_of(case, scene)
    table = pd.DataFrame(rows)
    return Result(
        name="frontier-sampled",
        title="What executing a part of a frame could save: CPU seconds against the error of its time",
        source="Full runs of this simulator on this computer",
        cells=_cells(table),
        answer=_answer(table),
        figures=[
            Figure("seconds-against-error", lambda path: sampling_plot(table, path)),
            Figure("share-by-size", lambda path: _draw_shares(table, path)),
        ],
        charts=[CHART],
        notes=_notes(table),
        warnings=warnings,
        tables={"runs": table},
    )


def rows_of(case: Case, scene: Scene) -> list[dict[str, Any]]:
    """One scene: its full run, and both samplers at each rate."""
    machine, (width, height) = load_machine(case.machine), case.size
    matrix = scene.views["default"].matrix(width, height)
    chosen, draw = pipeline_options(case.pipeline, case.options), load_pipeline(case.pipeline)
    best = dict.fromkeys(("cpu", "wall", "last", "pricing", "boxes"), float("inf"))
    for _ in range(ROUNDS + 1):  # the first one compiles
        execute, clocks = Timed(picture=False), [(time.process_time(), time.perf_counter())]
        frame = draw(scene, matrix, width, height, machine.simt, chosen, execute)
        clocks.append((time.process_time(), time.perf_counter()))
        full = Run(scene.name, case.pipeline, machine, width, height, "schedule", {}, frame)
        _ = full.milliseconds
        clocks.append((time.process_time(), time.perf_counter()))
        if case.pipeline == "cudaraster" and scene.mesh is not None:
            boxes(scene.mesh, matrix, width, height, RATES[0])
        cpu, wall = np.array(clocks).T
        found = (cpu[2] - cpu[0], wall[2] - wall[0], execute.seconds, cpu[2] - cpu[1], time.process_time() - cpu[2])
        best = {name: min(best[name], float(value)) for (name, value) in zip(best, found, strict=True)}
    about = {
        "scene": case.name,
        "pipeline": case.pipeline,
        "primitives": _primitives(full),
        "full_cpu_seconds": best["cpu"],
    }
    about |= {"full_seconds": best["wall"], "last_stage_seconds": best["last"], "boxes_seconds": best["boxes"]}
    rows = []
    for rate in RATES:
        error = float(np.mean([error_of(full, rate, seed) for seed in range(SEEDS)]))
        costs = {TILES: best["cpu"] - (1 - rate) * best["last"]}
        if case.pipeline == "cudaraster":
            costs[NUMBERS] = best["boxes"] + rate * (best["cpu"] - best["pricing"]) + best["pricing"]
        rows += [
            {**about, "method": method, "rate": rate, "cpu_seconds": cost, "share": cost / best["cpu"], "error": error}
            for method, cost in costs.items()
        ]
    return rows


def error_of(full: Run, rate: float, seed: int) -> float:
    """Error of the frame's time, had only a share of the tiles of each last stage been drawn."""
    works = [
        _drawn(work, rate, seed) if isinstance(work, Work) and work.stage in LISTED else work
        for work in full.frame.works
    ]
    return abs(replace(full, frame=Frame.numbers(works, {})).milliseconds / full.milliseconds - 1)


def _drawn(work: Work, rate: float, seed: int) -> Work:
    """Draw every so many tiles in the order of their lists; the others do what the nearest of them does."""
    order = np.argsort(work.table[:, work.events[LISTED[work.stage]]], kind="stable")
    first = np.random.default_rng(seed).random()
    drawn = (np.arange(first, max(len(order) * rate, 1), 1) / rate).astype(np.int64)
    nearest = drawn[np.searchsorted((drawn[1:] + drawn[:-1]) / 2, np.arange(len(order)))]
    table = np.empty_like(work.table)
    table[order] = work.table[order[nearest]]
    return replace(work, table=table)


def _primitives(full: Run) -> int:
    """Triangles set up, or sub-patches diced."""
    counts = full.counts
    return counts.get("dice.PATCHES", 0) or counts["triangle_setup.TRIANGLE_LANES"]


def _cells(table: pd.DataFrame) -> list[Cell]:
    numbers = {"share of the full run": ("share", "of full", 1), "error": ("error", "%", 100)}
    return [
        reported(
            f"{row['scene']} ({row['primitives']:,})",
            f"{row['method']}, {row['rate']:.0%}: {column}",
            unit,
            round(scale * row[name], 4),
        )
        for row in table.to_dict("records")
        for column, (name, unit, scale) in numbers.items()
    ]


def _answer(table: pd.DataFrame) -> str:
    """What the least part costs."""
    said = [
        f"{method}: {rows.share.min():.0%} to {rows.share.max():.0%} of the full run's CPU seconds at {RATES[0]:.0%}"
        for method, rows in table[table.rate == RATES[0]].groupby("method", sort=False)
    ]
    full = table.full_cpu_seconds.max()
    return f"At the very best, {'; '.join(said)}; the dearest of these frames takes {full:.2g} CPU seconds in full."


def _notes(table: pd.DataFrame) -> list[str]:
    least = table[table.rate == RATES[0]]
    once = least.drop_duplicates("scene")
    bound = least[least.method == NUMBERS]
    return [
        "Full runs: "
        + "; ".join(f"{r.scene} {r.full_cpu_seconds:.3f} CPU s, {r.full_seconds:.3f} s" for r in once.itertuples())
        + ".",
        f"{TILES} at {RATES[0]:.0%}, of the full run: "
        + ", ".join(f"{r.scene} {r.share:.2f}" for r in least[least.method == TILES].itertuples())
        + ".",
        f"{NUMBERS} at {RATES[0]:.0%}, of the full run (aims: "
        + ", ".join(f"{share:g} above {size // 1_000_000} M" for size, share in AIMS)
        + "): "
        + ", ".join(f"{r.scene} {r.share:.3f}" for r in bound.itertuples())
        + "; the passes over all boxes alone "
        + ", ".join(f"{r.boxes_seconds / r.full_cpu_seconds:.3f}" for r in bound.itertuples())
        + ".",
    ]


def _draw_shares(table: pd.DataFrame, path: Path) -> None:
    lines(
        table[(table.rate == RATES[0]) & (table.pipeline == "cudaraster")], path, x="primitives", y="share",
        by="method", title=f"Least cost of a {RATES[0]:.0%} sample, cudaraster", x_label="triangles",
        y_label="CPU seconds over those of the full run", log_x=True,
        said=[(size, share, f"aim: {share:g}") for size, share in AIMS],
    )  # fmt: skip
