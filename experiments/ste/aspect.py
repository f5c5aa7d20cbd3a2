"""Long and narrow polygons: what the bit mask gains by aspect ratio (Yao et al. 2012, section 3).

One flat patch of equal rectangles, turned by 8 random angles; the area of a rectangle stays, its sides change.
The mask is used in sequence, and with a warp of 32 polygons in flight that do not see each other's hits.
"""

from collections.abc import Callable
from functools import partial

import numpy as np
import pandas as pd

from tilestamp.experiments.harness.result import Figure, Result, reported
from tilestamp.models.simt import Simt
from tilestamp.reports.plots import lines
from tilestamp.simulator.stages.fatahalian2009.micropolygon_samples import new_samples
from tilestamp.simulator.stages.fatahalian2009.micropolygons import Micropolygons
from tilestamp.simulator.stages.fatahalian2009.sample_positions import sample_positions
from tilestamp.simulator.stages.fatahalian2009.stamps import stamp_shape
from tilestamp.simulator.stages.fatahalian2009.stamps_count import count_tests
from tilestamp.simulator.stages.yao2011.bit_mask import BitMaskEvent, bit_mask

QUESTION = "What does the bit mask gain on long and narrow polygons?"
SLOW = True  # with what it needs compiled, more than the first run should take

ASPECTS = (1, 2, 4, 8, 16, 32)
AREAS = (0.25, 1.0, 4.0)  # pixels
PATCH = 64.0  # pixels a side
PIXELS = 128
TURNS = 8
COLUMNS = (
    ("ste", "STE without the mask", "%"),
    ("gain", "gain in sequence", "x"),
    ("gain_warp", "gain, 32 in flight", "x"),
    ("points", "STE gained in sequence", "points"),
)


def run(progress: Callable[[str], None]) -> Result:
    """Sweep aspect ratio and area."""
    rows = []
    for area in AREAS:
        progress(f"rectangles of {area} pixels")
        rows += [{"area": area, "aspect": aspect, **_measure(area, aspect)} for aspect in ASPECTS]
    table = pd.DataFrame(rows)
    cells = [
        reported(f"{row['area']:g} px, {row['aspect']}:1", name, unit, row[column])
        for row in rows
        for column, name, unit in COLUMNS
    ]
    notes = [
        f"{area:g} px, 1:1 to {ASPECTS[-1]}:1: relative gain {g.gain.iloc[0]:.2f} to {g.gain.iloc[-1]:.2f} in sequence,"
        f" {g.gain_warp.iloc[0]:.2f} to {g.gain_warp.iloc[-1]:.2f} with a warp in flight; points of STE gained"
        f" {g.points.iloc[0]:.1f} to {g.points.iloc[-1]:.1f}."
        for area, g in table.groupby("area")
    ]
    figure = Figure("aspect", partial(
        lines, table.assign(line=table.area.map("{:g} pixels".format)), x="aspect", y="points", by="line",
        title="Points of STE that the mask gains, by aspect ratio", x_label="length : width",
        y_label="STE with the mask - without [points]", log_x=True,
    ))  # fmt: skip
    source = "Yao et al. 2012, section 3: the gain is limited for long or narrow triangles"
    title = "The mask on narrow polygons"
    answer = (
        f"At {ASPECTS[-1]}:1 between {table.gain[table.aspect == ASPECTS[-1]].min():.2f} and "
        f"{table.gain[table.aspect == ASPECTS[-1]].max():.2f} times the efficiency, by area; at 1:1 between "
        f"{table.gain[table.aspect == 1].min():.2f} and {table.gain[table.aspect == 1].max():.2f} times."
    )
    return Result("ste/aspect", title, source, cells, answer, figures=[figure], notes=notes, tables={"runs": table})


def _measure(area: float, aspect: int) -> dict[str, float]:
    """Mean gain over the turns."""
    long, short = np.sqrt(area * aspect), np.sqrt(area / aspect)
    offsets = sample_positions(1)
    plain = covered = 0
    masked = np.zeros((2, 2))  # in sequence, a warp in flight: tests, hits
    for angle in np.random.default_rng(11).random(TURNS) * np.pi:
        polygons = _patch(long, short, angle)
        count = count_tests(polygons, PIXELS, PIXELS, offsets, stamp_shape(1, "box"))
        plain, covered = plain + count.tests, covered + count.hits
        for row, lanes in enumerate((1, Simt().warp)):
            work = bit_mask(polygons, new_samples(PIXELS, PIXELS, offsets), "plain", lanes, Simt()).works[0]
            masked[row] += work.total(BitMaskEvent.SAMPLE_TESTS), work.total(BitMaskEvent.SAMPLE_HITS)
    ste = covered / plain
    in_sequence, in_flight = masked[:, 1] / masked[:, 0]
    points = 100 * (in_sequence - ste)
    return {"ste": 100 * ste, "gain": in_sequence / ste, "gain_warp": in_flight / ste, "points": points}


def _patch(long: float, short: float, angle: float) -> Micropolygons:
    """Lay a patch of rectangles, row by row, turned about the middle of the screen."""
    across, down = max(1, round(PATCH / long)), max(1, round(PATCH / short))
    at = np.stack(np.meshgrid(np.arange(across), np.arange(down)), axis=-1).reshape(-1, 1, 2)
    corners = (at + np.array([[0, 0], [1, 0], [1, 1], [0, 1]])) * [long, short] - [across * long / 2, down * short / 2]
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    flat = corners @ turn + PIXELS / 2
    vertices = np.concatenate([flat, np.full((*flat.shape[:2], 1), 0.5)], axis=2).astype(np.float32)
    return Micropolygons(vertices, np.zeros(len(flat), np.int32), np.zeros(len(flat), np.uint8))
