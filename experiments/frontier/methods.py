"""Frontier of the methods: modelled milliseconds of every pipeline against the error of its picture.

Set TILESTAMP_FRONTIER=long for all pipelines and variants (minutes: most of it is compiling).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from tilestamp.experiments.frontier.methods_notes import TIES, notes
from tilestamp.experiments.frontier.methods_scenes import (
    AREAS,
    AREAS_LONG,
    Subject,
    lattice,
    patches,
    subjects,
    textured_subject,
)
from tilestamp.experiments.frontier.methods_truth import QUICK_SIDE, Truth
from tilestamp.experiments.frontier.methods_variants import (
    ALL_PATCHES,
    ALL_TRIANGLES,
    FILTERED,
    QUICK_PATCHES,
    QUICK_TRIANGLES,
    Variant,
)
from tilestamp.experiments.frontier.model_frames import is_long
from tilestamp.experiments.frontier.pareto import pareto_front
from tilestamp.experiments.frontier.picture_error import depth_errors, pixel_errors
from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Cell, Chart, Figure, Result, reported
from tilestamp.models.errors import TilestampError
from tilestamp.reports.methods_plot import panels, side_by_side
from tilestamp.simulator.reference.picture import SIDE
from tilestamp.simulator.run import Run
from tilestamp.simulator.simulation import simulate

QUESTION = "Which method gives the best picture for its time?"
SOURCE = (
    "Truth: our own exact rasterizer (simulator/reference): rational coverage, double precision, 64 samples a "
    "pixel for the converged picture (256 in the long run). Cost: the model's milliseconds"
)
MACHINES = ("h200", "gtx480")  # today's, and one of the papers'
NO_TIME = float("nan")
MEASURES = {
    "flip": ("FLIP (0: the converged picture)", "Error that an eye sees"),
    "wrong": ("share of wrong pixels", "Pixels of a wrong triangle or patch"),
}
CHARTS = [
    Chart(
        name=error, kind="front", table="methods", title=f"{title}, against modelled time; line: what nothing beats.",
        alt=f"Scatter plot: {words} of each method over its modelled time, for a scene and a machine from lists.",
        of={"x": "ms", "y": error, "color": "pipeline", "label": "method", "front": f"front_{error}",
            "pick": {"scene": "Scene", "machine": "Machine"}, "titles": ["modelled time [ms]", words], "log_y": False},
    )
    for error, (words, title) in MEASURES.items()
]  # fmt: skip
WORST = 3  # pictures shown of those that are furthest off


@dataclass(frozen=True)
class Drawn:
    """A variant's picture of a subject, kept for the figures."""

    subject: Subject
    variant: Variant
    run: Run
    truth: Truth


def run(progress: Progress) -> Result:
    """Draw every scene by every variant, and compare."""
    rows: list[dict[str, Any]] = []
    worst: dict[str, tuple[float, Drawn]] = {}
    for subject, variants in _grid():
        progress(f"frontier/methods: {subject.name}")
        truth = Truth(subject, SIDE if is_long() else QUICK_SIDE)
        for variant in variants:
            drawn = Drawn(subject, variant, _run(subject, variant, MACHINES[0]), truth)
            row = _row(drawn)
            rows += [row | {"machine": machine, "ms": ms} for machine, ms in _milliseconds(drawn)]
            if row["flip"] > worst.get(variant.pipeline, (0.0, None))[0]:
                worst[variant.pipeline] = row["flip"], drawn
    table = pd.DataFrame(rows)
    table = _mark_fronts(table)
    doubles = _doubles(progress)
    return Result(
        name="frontier-methods",
        title="What a picture costs: modelled milliseconds of every method against the error of its picture",
        source=SOURCE,
        cells=_cells(table),
        answer=_answer(table),
        figures=_figures(table, worst),
        charts=CHARTS,
        notes=notes(table, doubles),
        tables={"methods": table, "double-hits": doubles},
    )


def _answer(table: pd.DataFrame) -> str:
    """The pipelines most often on the front of time and FLIP, with fixed function and without."""
    rows = table[(table.machine == MACHINES[0]) & table.ms.notna()]
    said = []
    for what, column in (("of all methods", "front_flip"), ("of software alone", "software_front_flip")):
        scenes = rows[rows[column]].groupby("pipeline").scene.nunique().sort_values(ascending=False)
        said.append(f"{what} {scenes.index[0]}, in {scenes.iloc[0]} of {rows.scene.nunique()} scenes")
    return f"Most often on the front of time and FLIP on the {MACHINES[0]}: {'; '.join(said)}."


def _grid() -> Iterator[tuple[Subject, list[Variant]]]:
    """Scenes, and what draws each."""
    for subject in subjects(AREAS_LONG if is_long() else AREAS):
        yield subject, ALL_TRIANGLES if is_long() else QUICK_TRIANGLES
    yield patches(), ALL_PATCHES if is_long() else QUICK_PATCHES
    yield textured_subject(), FILTERED if is_long() else [v for v in FILTERED if v.pipeline == "tiled"]


def _run(subject: Subject, variant: Variant, machine: str) -> Run:
    height = subject.height
    camera = subject.matrix
    return simulate(
        subject.scene, variant.pipeline, machine, width=subject.width, height=height, camera=camera, **variant.options
    )


def _row(drawn: Drawn) -> dict[str, Any]:
    variant, frame = drawn.variant, drawn.run.frame
    row: dict[str, Any] = {
        "scene": drawn.subject.name,
        "pipeline": variant.pipeline,
        "method": variant.label,
        "fixed_function": variant.pipeline == "hardware" or bool(variant.options.get("hybrid")),
        "flip": drawn.truth.flip(variant.pipeline, frame.image),
    }
    made = drawn.truth.geometry(variant.pipeline)
    if frame.triangle_ids is None or made.ids is None:
        return row
    seen = drawn.truth.visible(variant)
    if drawn.subject.scene.patches is not None:  # the pipeline dices otherwise than the reference: compare patches
        return row | {"wrong": float((frame.triangle_ids != np.append(made.ids, -1)[seen.ids]).mean())}
    right = (frame.triangle_ids == seen.ids) & (seen.ids >= 0)
    steps = depth_errors(variant.pipeline, variant.options, frame.depth[right], seen.depth[right])
    return row | {
        **pixel_errors(frame.triangle_ids, seen, made.corners, made.depths)._asdict(),
        "depth_median_ulp": float(np.median(steps)) if steps.size else NO_TIME,
        "depth_worst_ulp": float(steps.max()) if steps.size else NO_TIME,
    }


def _milliseconds(drawn: Drawn) -> Iterator[tuple[str, float]]:
    """Time on each machine; not a number where the machine has no instruction mix of the pipeline."""
    yield MACHINES[0], drawn.run.milliseconds
    for machine in MACHINES[1:]:
        try:
            yield machine, _run(drawn.subject, drawn.variant, machine).milliseconds
        except TilestampError:
            yield machine, NO_TIME


def _mark_fronts(table: pd.DataFrame) -> pd.DataFrame:
    """Add whether anything of a row's scene and machine beats it in both time and error, and anything in software.

    Errors are compared in steps of ``TIES``: what nobody can see is no gain.
    """
    for error in MEASURES:
        table[f"front_{error}"] = False
        table[f"software_front_{error}"] = False
        for _, rows in table.groupby(["scene", "machine"], sort=False):
            for column, kept in (("front", rows), ("software_front", rows[~rows.fixed_function])):
                steps = (kept[error] / TIES[error]).round()
                table.loc[kept.index, f"{column}_{error}"] = pareto_front(kept["ms"], steps)
    return table


def _doubles(progress: Progress) -> pd.DataFrame:
    """Hits beyond the first of each sample where every edge runs through samples, and samples without a hit."""
    subject = lattice()
    progress("frontier/methods: edges on samples")
    rows = []
    for variant in ALL_TRIANGLES if is_long() else QUICK_TRIANGLES:
        if variant.options.get("msaa", 1) > 1 or variant.options.get("spp", 1) > 1:
            continue
        drawn = _run(subject, variant, MACHINES[0])
        hits = sum(count for name, count in drawn.counts.items() if name.endswith("SAMPLE_HITS"))
        ids = drawn.triangle_ids
        covered = int((ids >= 0).sum()) if ids is not None else 0
        rows.append(
            {"method": variant.label, "samples": ids.size if ids is not None else 0, "covered": covered,
             "double_hits": hits - covered}
        )  # fmt: skip
    return pd.DataFrame(rows)


def _cells(table: pd.DataFrame) -> list[Cell]:
    """Best and cheapest of each scene on the first machine: what the front runs between."""
    cells = []
    for scene, rows in table[table.machine == MACHINES[0]].groupby("scene", sort=False):
        front = rows[rows.front_flip].sort_values("ms")
        for column, point in (("cheapest", front.iloc[0]), ("least FLIP", front.iloc[-1])):
            cells.append(reported(f"{scene}: {point.method}", f"{column}, time", "ms", float(point.ms)))
            cells.append(reported(f"{scene}: {point.method}", f"{column}, FLIP", "", float(point.flip)))
    return cells


def _figures(table: pd.DataFrame, worst: dict[str, tuple[float, Drawn]]) -> list[Figure]:
    """Fronts by machine and measure, and the pictures that are furthest off."""
    figures = [_front(table, machine, error) for machine in MACHINES for error in MEASURES]
    ranked = sorted(worst.values(), key=lambda kept: -kept[0])[:WORST]
    return figures + [Figure(f"worst-{drawn.variant.pipeline}", partial(_draw_worst, drawn)) for _, drawn in ranked]


def _front(table: pd.DataFrame, machine: str, error: str) -> Figure:
    """Time against one measure of error, a panel a scene."""
    rows = table[(table.machine == machine) & table.ms.notna() & table[error].notna()]
    rows = rows[rows.groupby("scene")[error].transform("max") > 0]  # a scene without an error has no front to show
    words, title = MEASURES[error]
    draw = partial(
        panels, rows, panel="scene", group="pipeline", x="ms", y=error, x_label="modelled time [ms]", y_label=words,
        fronts=[f"front_{error}", f"software_front_{error}"], title=f"{title} against modelled time, {machine}",
    )  # fmt: skip
    return Figure(f"{machine}-{error}", draw)


def _draw_worst(drawn: Drawn, path: Path) -> None:
    """Exact picture, the method's, and their difference."""
    truth = drawn.truth.picture(drawn.variant.pipeline)
    side_by_side(truth, drawn.run.image / 255.0, path, title=f"{drawn.variant.label}: {drawn.subject.name}")
