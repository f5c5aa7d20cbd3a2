"""Long and narrow polygons: the bit mask's gain falls with the aspect ratio (Yao et al. 2012, section 3).

One flat patch of equal rectangles, turned by 20 random angles; the area of a rectangle stays, its sides change.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd

from experiments.result import Cell, Figure, Result
from models.simt import Simt
from reports.plots import lines
from simulator.stages.bit_mask import BitMaskEvent, bit_mask
from simulator.stages.micropolygon_samples import new_samples
from simulator.stages.micropolygons import Micropolygons
from simulator.stages.sample_positions import sample_positions
from simulator.stages.stamps import stamp_shape
from simulator.stages.stamps_count import count_tests

ASPECTS = (1, 2, 4, 8, 16, 32)
AREAS = (0.1, 0.5, 2.0)  # pixels
PATCH = 64.0  # pixels a side
PIXELS = 128
TURNS = 20


def run(progress: Callable[[str], None]) -> Result:
    """Sweep aspect ratio and area."""
    rows = []
    for area in AREAS:
        progress(f"rectangles of {area} pixels")
        rows += [{"area": area, "aspect": aspect, **_measure(area, aspect)} for aspect in ASPECTS]
    table = pd.DataFrame(rows)
    cells = [Cell(f"{row['area']:g} px, {row['aspect']}:1", "gain", "x", None, row["gain"], "reported") for row in rows]
    notes = [
        f"{area:g} px: gain {g.gain.iloc[0]:.2f} at 1:1, {g.gain.iloc[-1]:.2f} at {ASPECTS[-1]}:1."
        for area, g in table.groupby("area")
    ]
    figure = Figure("aspect", lambda path: _plot(table, path))
    source = "Yao et al. 2012, section 3: the gain is limited for long or narrow triangles"
    return Result("ste/aspect", "The mask on narrow polygons", source, cells, [figure], notes, [], {"runs": table})


def _measure(area: float, aspect: int) -> dict[str, float]:
    """Mean gain over the turns."""
    long, short = np.sqrt(area * aspect), np.sqrt(area / aspect)
    offsets = sample_positions(1)
    tests, hits, plain, covered = 0, 0, 0, 0
    for angle in np.random.default_rng(11).random(TURNS) * np.pi:
        polygons = _patch(long, short, angle)
        count = count_tests(polygons, PIXELS, PIXELS, offsets, stamp_shape(1, "box"))
        work = bit_mask(polygons, new_samples(PIXELS, PIXELS, offsets), "plain", 1, Simt())
        plain, covered = plain + count.tests, covered + count.hits
        tests += work.total(BitMaskEvent.SAMPLE_TESTS)
        hits += work.total(BitMaskEvent.SAMPLE_HITS)
    return {"ste": covered / plain, "ste_masked": hits / tests, "gain": (hits / tests) / (covered / plain)}


def _patch(long: float, short: float, angle: float) -> Micropolygons:
    """Lay a patch of rectangles, row by row, turned about the middle of the screen."""
    across, down = max(1, round(PATCH / long)), max(1, round(PATCH / short))
    at = np.stack(np.meshgrid(np.arange(across), np.arange(down)), axis=-1).reshape(-1, 1, 2)
    corners = (at + np.array([[0, 0], [1, 0], [1, 1], [0, 1]])) * [long, short] - [across * long / 2, down * short / 2]
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    flat = corners @ turn + PIXELS / 2
    vertices = np.concatenate([flat, np.full((*flat.shape[:2], 1), 0.5)], axis=2).astype(np.float32)
    return Micropolygons(vertices, np.zeros(len(flat), np.int32), np.zeros(len(flat), np.uint8))


def _plot(table: pd.DataFrame, path: Any) -> None:
    lines(
        table.assign(line=table.area.map("{:g} pixels".format)),
        path,
        x="aspect",
        y="gain",
        by="line",
        title="The mask's gain by aspect ratio",
        x_label="length : width",
        y_label="STE with the mask / without",
        log_x=True,
    )
