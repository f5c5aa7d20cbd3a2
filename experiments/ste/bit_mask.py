"""Yao et al. 2012: STE of subdivided models with and without the bit mask, over level and screen size.

The paper gives neither screen size nor level (but 7 rounds for the cube) nor view: bigguy below 3 % without the mask,
+30 % with it, the cube by a factor 3. So the curve over level and size is drawn, and where the claims hold is marked.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from tilestamp.experiments.harness.result import Cell, Figure, Result, reported
from tilestamp.experiments.ste.readings import WANTED, Reading, as_table, readings, said
from tilestamp.experiments.ste.setting import Model, bigguy, cube, mean_area
from tilestamp.models.simt import Simt
from tilestamp.reports.plots import lines
from tilestamp.reports.ste_plots import heat_maps, wrong_pixels
from tilestamp.simulator.stages.fatahalian2009.across_polygons import across_polygons
from tilestamp.simulator.stages.fatahalian2009.micropolygon_samples import Samples, new_samples, picture
from tilestamp.simulator.stages.fatahalian2009.micropolygons import Micropolygons
from tilestamp.simulator.stages.fatahalian2009.sample_positions import sample_positions
from tilestamp.simulator.stages.fatahalian2009.stamps import stamp_shape
from tilestamp.simulator.stages.fatahalian2009.stamps_count import count_tests
from tilestamp.simulator.stages.yao2011.bit_mask import KINDS, BitMaskEvent, MaskKind, bit_mask

QUESTION = "Does the bit mask raise the hit rate by as much as published?"
SLOW = True  # with what it needs compiled, more than the first run should take

HEIGHTS = (96, 192, 384, 768)  # windows of 4:3
LEVELS = {"bigguy": (2, 3, 4), "cube": (5, 6, 7)}
PAPER_STE = 3.0  # % and less, bigguy without the mask
REPORTED = (
    ("ste", "STE without the mask", "%"),
    ("gain", "gain, plain mask", "x"),
    ("gain_depth", "gain, depth mask (exact)", "x"),
    ("wrong_pixels", "wrong pixels, plain mask", "pixels"),
    ("wrong_pixels_facing", "wrong pixels, facing mask", "pixels"),
)
SHOWN = (4, 768)  # level and height of the pictures
SOURCE = "Yao et al. 2012, section 3 (published/yao2011/claims.csv)"


def run(progress: Callable[[str], None]) -> Result:
    """Measure both models at every level and size."""
    rows, models = [], {"bigguy": bigguy(), "cube": cube()}
    for key, model in models.items():
        for level in LEVELS[key]:
            for height in HEIGHTS:
                progress(f"{model.name}, level {level}, {height * 4 // 3}x{height}")
                rows.append({"model": key, "level": level, "height": height, **_measure(model, level, height)})
    table = pd.DataFrame(rows)
    figures = [
        Figure("gain", lambda path: _plot(table, path, "gain", "STE with the mask / without", "The mask's gain")),
        Figure(
            "ste", lambda path: _plot(table, path, "ste", "STE without the mask [%]", "STE, 1x1 stamp, 1x1 samples")
        ),
        *_pictures(models["bigguy"]),
    ]
    progress("readings of the claims")
    found = readings(models)
    warnings = [model.warning for model in models.values() if model.warning]
    return Result(
        name="ste/bit_mask",
        title="Bit mask filtering",
        source=SOURCE,
        cells=[*_cells(table), *_reading_cells(found)],
        answer=_answer(table),
        figures=figures,
        notes=[*_notes(table), *said(found)],
        warnings=warnings,
        tables={"runs": table, "readings": as_table(found)},
    )


def _answer(table: pd.DataFrame) -> str:
    """The gains of each model beside what is published."""
    gains = {key: table.gain[table.model == key] for key in WANTED}
    said = [
        f"{key} gains {gain.min():.2f} to {gain.max():.2f} (published: {WANTED[key]:g})" for key, gain in gains.items()
    ]
    return f"In sequence, by level and size: {'; '.join(said)}."


def _measure(model: Model, level: int, height: int) -> dict[str, Any]:
    """One model at one level and size: STE without, with each mask (in sequence), and wrong pixels."""
    width = height * 4 // 3
    polygons = model.on_screen(level, width, height)
    offsets = sample_positions(1)
    plain = count_tests(polygons, width, height, offsets, stamp_shape(1, "box"))
    exact = new_samples(width, height, offsets)
    across_polygons(polygons, exact, "in-order", Simt())
    row = {"triangles": len(polygons.patch), "area": mean_area(polygons), "ste": 100 * plain.ste}
    row["covered_pixels"] = int((exact.polygon >= 0).sum())
    for kind in KINDS:
        samples, tests, hits = _masked(polygons, width, height, kind)
        suffix = "" if kind == "plain" else f"_{kind}"
        row[f"gain{suffix}"] = hits / tests / plain.ste
        row[f"wrong_pixels{suffix}"] = int((samples.polygon != exact.polygon).sum())
    return row


def _masked(polygons: Micropolygons, width: int, height: int, kind: MaskKind) -> tuple[Samples, int, int]:
    samples = new_samples(width, height, sample_positions(1))
    work = bit_mask(polygons, samples, kind, 1, Simt()).works[0]
    return samples, work.total(BitMaskEvent.SAMPLE_TESTS), work.total(BitMaskEvent.SAMPLE_HITS)


def _cells(table: pd.DataFrame) -> list[Cell]:
    """Compare the claims at the configuration nearest under 3 %, and the cube at 7 rounds in every window."""
    cells = []
    rows = table.to_dict("records")
    under = [row for row in rows if row["model"] == "bigguy" and row["ste"] < PAPER_STE]
    for near in sorted(under, key=lambda row: -row["ste"])[:1]:
        place, frame = f"bigguy level {near['level']}, height {near['height']}", f"bigguy {near['height']}"
        cells.append(reported(place, "STE without the mask (published: below 3)", "%", near["ste"], frame=frame))
        cells.append(Cell(place, "gain", "x", published=WANTED["bigguy"], ours=near["gain"], aim=0.1, frame=frame))
    for row in rows:
        if row["model"] == "cube" and row["level"] == 7:
            place = f"cube 7 rounds, height {row['height']}"
            cells.append(Cell(place, "gain", "x", published=WANTED["cube"], ours=row["gain"], aim=0.1))
    for row in rows:
        place, frame = f"{row['model']} level {row['level']}, height {row['height']}", f"{row['model']} {row['height']}"
        cells += [reported(place, name, unit, float(row[column]), frame=frame) for column, name, unit in REPORTED]
    return cells


def _reading_cells(found: list[Reading]) -> list[Cell]:
    """Every reading's gain at the setting that comes nearest to the claim."""
    return [
        reported(
            f"reading: {reading.name}",
            f"{model}, gain nearest to {wanted:g}",
            "x",
            min(getattr(reading, model), key=lambda gain: abs(gain - wanted)),
            frame=model,
        )
        for reading in found
        for model, wanted in WANTED.items()
    ]


def _notes(table: pd.DataFrame) -> list[str]:
    """Where the claims hold, and what exactness costs."""
    notes = ["Screen size, level and view are not published: the cells are at a fitted three-quarter view."]
    for key, wanted in WANTED.items():
        rows = table[table.model == key]
        holds = rows[np.abs(rows.gain / wanted - 1) < 0.1]
        places = ", ".join(f"level {r.level} at height {r.height} ({r.area:.3g} px)" for r in holds.itertuples())
        span = f"{rows.gain.min():.2f} to {rows.gain.max():.2f}"
        notes.append(f"{key}: gains of {span}; within 10 % of the published {wanted:g}: {places or 'nowhere'}.")
    notes.append(
        "Of the boxes of one layer at a pixel, the one that hits comes half way on average, so a mask in sequence"
        " spares half of the tests: a gain of 2 at most (derived). The published 3 needs one of the readings below."
    )
    exact = "yes" if not table.wrong_pixels_depth.any() else "NO"
    worst = 100 * (table.wrong_pixels / table.covered_pixels).max()
    notes.append(
        f"The depth mask is exact everywhere: {exact}. The plain mask errs in at most {worst:.2f} % of pixels."
    )
    notes.append(
        f"Mean gains: plain {table.gain.mean():.2f}, facing {table.gain_facing.mean():.2f},"
        f" depth {table.gain_depth.mean():.2f}: what exactness gives up."
    )
    return notes


def _plot(table: pd.DataFrame, path: Path, column: str, label: str, title: str) -> None:
    shown = table.assign(line=table.model + " level " + table.level.astype(str))
    lines(
        shown, path, x="area", y=column, by="line", title=title, x_label="mean triangle area [pixels]", y_label=label,
        log_x=True,
    )  # fmt: skip


def _pictures(model: Model) -> list[Figure]:
    """Draw the paper's Figure 1, and the wrong pixels in red."""
    level, height = SHOWN
    width = height * 4 // 3
    polygons = model.on_screen(level, width, height)
    exact = new_samples(width, height, sample_positions(1))
    across_polygons(polygons, exact, "in-order", Simt())
    masked = _masked(polygons, width, height, "plain")[0]
    maps = {"without the mask": exact.tests, "with the mask": masked.tests}
    wrong = (masked.polygon != exact.polygon).reshape(height, width)
    title = f"{model.name}, level {level}: {int(wrong.sum())} pixels that the plain mask gets wrong"
    return [
        Figure("tests", lambda path: heat_maps(maps, path, title="Sample tests per pixel", unit="tests a pixel")),
        Figure("wrong", lambda path: wrong_pixels(picture(masked, polygons), wrong, path, title=title)),
    ]
