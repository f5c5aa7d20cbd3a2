"""Displacement that carries a sub-patch out of its four tiles (Eisenacher & Loop 2010, sections 3.1 and 5).

"A threshold smaller than the tile size guarantees that a sub-patch covers at most four adjacent tiles": of the surface
that was bounded. Vertices displaced while dicing may lie further apart, and what reaches a third tile is not drawn
there. Cures: more slots a patch, so many as the displaced box can touch; or a bound that leaves room for displacement.
"""

from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd

from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Figure, Result
from tilestamp.experiments.stability.boundary import Boundary, atlas_result, bisect
from tilestamp.experiments.stability.patch_frames import Drawn, draw, flat_patch, milliseconds, split
from tilestamp.reports.plots import lines
from tilestamp.reports.ste_plots import wrong_pixels
from tilestamp.simulator.stages.eisenacher2010.dice import Grids
from tilestamp.simulator.work import Work

QUESTION = "How far may displacement move a sub-patch before it leaves its tiles?"
WIDTH, HEIGHT = 192, 144  # pixels
WAVE = 6.0  # pixels from bump to bump
BOUNDS = (2.0, 4.0, 8.0)  # pixels
TILE = 8
AMPLITUDES = (0.5, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0)  # pixels up and down
SHOWN = (4.0, 4.0)  # bound and amplitude of the picture
FILL = 0.98 * 16 * 8.0  # pixels a side of the square: halved, a little less than each bound
PLANE = flat_patch([[[x * FILL / WIDTH, y * FILL / HEIGHT, 0] for x in (-1, 1)] for y in (-1, 1)])
VIEW = np.eye(4)  # clip space


@cache
def grids(bound: float) -> tuple[Grids, tuple[Work, ...]]:
    """Dice the plane, not yet displaced."""
    made = split(PLANE, VIEW, WIDTH, HEIGHT, bound=bound)
    return made.grids, tuple(made.works)


def displaced(bound: float, amplitude: float) -> Grids:
    """Move vertices up and down the screen by bumps of ``amplitude`` pixels."""
    vertices = grids(bound)[0].vertices.copy()
    x, y = vertices[:, :, 0].astype(np.float64), vertices[:, :, 1].astype(np.float64)
    turn = 2 * np.pi / WAVE
    vertices[:, :, 1] += (amplitude * np.sin(turn * x) * np.sin(turn * y)).astype(np.float32)
    low, high = vertices[:, :, :2].min(axis=1), vertices[:, :, :2].max(axis=1)
    return Grids(vertices, np.concatenate([low, high], axis=1))


@cache
def frame(bound: float, amplitude: float, *, wide: bool = False) -> Drawn:
    """Draw; ``wide`` with the slots that the displaced box may need, else the published four."""
    room = bound + 2 * amplitude if wide else min(bound, TILE)
    return draw(displaced(bound, amplitude), WIDTH, HEIGHT, tile=TILE, bound=room)


def lost(bound: float, amplitude: float) -> tuple[int, int]:
    """Quads' samples, and pixels, that four slots lose."""
    short = frame(bound, amplitude, wide=True).hits - frame(bound, amplitude).hits
    return int(short.sum()), int((short > 0).sum())


def boundary(bound: float) -> tuple[float | None, float | None]:
    """Amplitude that holds, and amplitude that breaks."""
    return bisect(
        lambda amplitude: lost(bound, amplitude)[1] > 0, AMPLITUDES[0], AMPLITUDES[-1], scale="linear", tolerance=0.02
    )


def run(progress: Progress) -> Result:
    """Sweep amplitude at each bound."""
    rows = []
    for bound in BOUNDS:
        progress(f"stability/displacement: bound {bound:g}")
        rows += [_row(bound, amplitude) for amplitude in AMPLITUDES]
    table = pd.DataFrame(rows)
    boundaries = [_boundary(table, bound) for bound in BOUNDS]
    wrong = frame(*SHOWN, wide=True).hits > frame(*SHOWN).hits
    title = f"{int(wrong.sum())} pixels lose a quad: bound {SHOWN[0]:g}, {SHOWN[1]:g} pixels of displacement"
    figures = [
        Figure("lost", lambda path: _plot(table, path)),
        Figure("picture", lambda path: wrong_pixels(frame(*SHOWN).image, wrong, path, title=title)),
    ]
    heading = "Displacement out of the four tiles of a sub-patch"
    return atlas_result("stability/displacement", heading, boundaries, figures, _notes(table), {"amplitudes": table})


def _row(bound: float, amplitude: float) -> dict[str, float]:
    samples, pixels = lost(bound, amplitude)
    narrow, wide = (milliseconds(frame(bound, amplitude, wide=w).works) for w in (False, True))
    return {
        "bound": bound,
        "amplitude": amplitude,
        "lost_samples": samples,
        "lost_pixels": pixels,
        "four_slots_ms": narrow,
        "wide_slots_ms": wide,
    }


def _boundary(table: pd.DataFrame, bound: float) -> Boundary:
    rows = table[table.bound == bound]
    worst = rows.iloc[-1]
    method, height = f"micropolygon, bound {bound:g}, tiles of {TILE}", f"{worst.amplitude:g} pixels"
    wrong = f"quads are missing in the third tile: {worst.lost_pixels:.0f} of {WIDTH * HEIGHT} pixels at {height}"
    cure = "as many slots a patch as the displaced box can touch"
    cost = f"bucketing and raster of {height} {worst.wide_slots_ms:.3g} ms instead of {worst.four_slots_ms:.3g}"
    return Boundary(method, "displacement", "pixels", *boundary(bound), wrong, cure, cost)


def _notes(table: pd.DataFrame) -> list[str]:
    """Price of slots that nothing needs, and of a smaller bound."""
    spared = table[(table.lost_pixels == 0) & (table.wide_slots_ms > table.four_slots_ms)]
    more = [
        f"{100 * (r.wide_slots_ms / r.four_slots_ms - 1):.1f} % ({r.amplitude:g} at {r.bound:g})"
        for r in spared.itertuples()
    ]
    calm = table[table.amplitude == AMPLITUDES[0]]
    front = {bound: milliseconds(grids(bound)[1]) for bound in BOUNDS}
    back = {row.bound: row.four_slots_ms for row in calm.itertuples()}
    whole = {bound: front[bound] + back[bound] for bound in BOUNDS}
    return [
        "Where four slots would do, slots for all that the displacement (pixels, at bound) could need cost "
        + (", ".join(more) or "nothing")
        + " of bucketing and raster.",
        "The other cure, a smaller bound: the whole frame takes "
        + ", ".join(f"{whole[bound]:.3g} ms at {bound:g} pixels" for bound in BOUNDS)
        + ".",
    ]


def _plot(table: pd.DataFrame, path: Path) -> None:
    lines(
        table.assign(line=table.bound.map(lambda bound: f"bound {bound:g} pixels")), path, x="amplitude",
        y="lost_pixels", by="line", title=f"Pixels that lose a quad, tiles of {TILE}, {WIDTH}x{HEIGHT}",
        x_label="displacement [pixels]", y_label="pixels",
    )  # fmt: skip
