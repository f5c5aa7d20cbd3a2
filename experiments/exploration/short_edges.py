"""Edge equations in 16 bits: what they spare in memory and traffic, and which samples come out wrong.

Eisenacher & Loop 2010 compute edge equations in every thread, and call "computing edge equations during dicing and
loading edge-equations" a promising trade-off (section 3.3). They are twelve floats a quad; in 16 bits half of that. The
teapot says what it costs, and a sheet that covers every sample once says what is lost: holes, and samples twice.
"""

from functools import cache
from pathlib import Path
from typing import Any

import pandas as pd

from tilestamp.experiments.exploration.ways import MACHINES, SIZE, Way, other_pixels
from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Figure, Result, reported
from tilestamp.experiments.stability.patch_frames import flat_patch
from tilestamp.experiments.studies_shipped.finding import finding
from tilestamp.reports.plots import lines
from tilestamp.reports.ste_plots import wrong_pixels
from tilestamp.simulator.scenes.scene import Patches, Scene

QUESTION = "What do edge equations in 16 bits spare, and how many samples come out wrong?"
SLOW = True  # runs when it is named: tilestamp reproduce exploration
EDGES = ("computed", "loaded", "half", "fixed", "snapped")
BOUNDS = (4.0, 8.0)  # pixels: the paper's
GRID_BYTES = {"computed": 0, "loaded": 432, "half": 216, "fixed": 220, "snapped": 216}  # beside the vertices
SHEET = Scene(
    "a sheet", Patches(flat_patch([[[-1.1, -1.3, 0.1], [1.2, -1.05, 0.2]], [[-1.4, 1.1, 0.3], [1.1, 1.5, 0.0]]]))
)
SHEET_SIZE = (320, 240)  # pixels
RASTER = "tile_raster"


SURE = (
    "Coverage is evaluated with the rounded terms, exactly; which pixels differ is executed. Prices of the conversion"
    " are derived by hand; those of loaded floats on the H200 leave the set-up of edges in; storing equations while"
    " dicing is charged to none of them."
)


@cache
def teapot(edges: str, bound: float) -> Way:
    """The teapot."""
    return Way(f"teapot, {edges}", {"edges": edges, "bound": bound})


@cache
def sheet(edges: str, bound: float) -> Way:
    """A sheet that covers the screen."""
    return Way(f"sheet, {edges}", {"edges": edges, "bound": bound}, SHEET, SHEET_SIZE)


def run(progress: Progress) -> Result:
    """Draw both with each kind of equations at each bound."""
    rows = []
    for bound in BOUNDS:
        progress(f"exploration/short_edges: bound {bound:g}")
        rows += [_row(edges, bound, machine) for edges in EDGES for machine in MACHINES]
    table = pd.DataFrame(rows)
    shown = BOUNDS[-1]
    plain, half = (teapot(edges, shown).run("h200") for edges in ("computed", "half"))
    wrong = (plain.image != half.image).any(axis=2)
    title = f"{int(wrong.sum())} pixels come out otherwise with equations of halves, bound {shown:g}"
    figures = [
        Figure("wrong", lambda path: _plot(table[table.machine == "h200"], path)),
        Figure("picture", lambda path: wrong_pixels(half.image, wrong, path, title=title)),
    ]
    columns = (("ms", "ms"), ("load_mb", "MB"), ("wrong", "pixels"), ("holes", "samples"), ("twice", "samples"))
    cells = [
        reported(f"{row['edges']}, bound {row['bound']:g}", f"{column}, {row['machine']}", unit, row[column])
        for row in table.to_dict("records")
        for column, unit in columns
    ]
    title = f"Edge equations in 16 bits: the teapot at {SIZE[0]}x{SIZE[1]}, a sheet at {SHEET_SIZE[0]}x{SHEET_SIZE[1]}"
    return finding("short_edges", title, cells, figures, _notes(table), {"edges": table}, folder="exploration")


def _row(edges: str, bound: float, machine: str) -> dict[str, Any]:
    run, cover = teapot(edges, bound).run(machine), sheet(edges, bound).run(machine).frame.maps["overdraw"]
    return {
        "edges": edges,
        "bound": bound,
        "machine": machine,
        "grid_bytes": GRID_BYTES[edges],
        "load_mb": run.counts[f"{RASTER}.LOAD_BYTES"] / 1e6,
        "raster_ms": float(run.stages["milliseconds"][RASTER]),
        "ms": run.milliseconds,
        "wrong": other_pixels(run, teapot("computed", bound).run(machine)),
        "holes": int((cover == 0).sum()),
        "twice": int((cover > 1).sum()),
    }


def _notes(table: pd.DataFrame) -> list[str]:
    """What is spared, what it costs in samples, and whether it pays."""
    at = table[(table.machine == "h200") & (table.bound == BOUNDS[0])].set_index("edges")
    pixels, samples = SIZE[0] * SIZE[1], SHEET_SIZE[0] * SHEET_SIZE[1]
    part = 100 * at.load_mb["half"] / at.load_mb["loaded"]
    answer = (
        f"At a bound of {BOUNDS[0]:g} equations of 16 bits take {part:.0f} % of the loads of those of 32; of {pixels}"
        f" pixels {at.wrong['fixed']} come out otherwise with whole numbers, {at.wrong['half']} with halves,"
        f" {at.wrong['snapped']} with snapped vertices. {_fastest(table)}"
    )
    times = "; ".join(
        f"{machine} "
        + ", ".join(
            f"{name} {row.ms:.4g}"
            for name, row in table[(table.machine == machine) & (table.bound == BOUNDS[0])]
            .set_index("edges")
            .iterrows()
        )
        for machine in MACHINES
    )
    lost = "; ".join(f"{name} {at.holes[name]} and {at.twice[name]}" for name in EDGES)
    return [
        answer,
        f"Frames in ms, bound {BOUNDS[0]:g}: {times}.",
        f"Of {samples} samples under a sheet that covers each once, holes and samples twice: {lost}.",
        SURE,
    ]


def _fastest(table: pd.DataFrame) -> str:
    """Whether any equations that are loaded are faster than computed ones."""
    plain = table[table.edges == "computed"].set_index(["machine", "bound"]).ms
    gain = [plain[row.machine, row.bound] / row.ms for row in table.itertuples() if row.edges != "computed"]
    how = "All that are loaded are slower than" if max(gain) < 1 else "Some that are loaded are faster than"
    return f"{how} computed ones: {min(gain):.3f} to {max(gain):.3f} times as fast."


def _plot(table: pd.DataFrame, path: Path) -> None:
    lines(
        table[table.edges != "computed"], path, x="bound", y="wrong", by="edges", log_x=True,
        title="Pixels that differ from those of computed equations", x_label="bound [pixels]", y_label="pixels",
    )  # fmt: skip
