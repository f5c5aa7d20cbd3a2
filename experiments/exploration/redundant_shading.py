"""Redundant shading: larger grids, vertices that neighbours share, and shading after visibility, priced.

"Tessellating into 4x4 grids introduces a lot of redundant shading for the edge vertices" (Eisenacher & Loop 2010,
section 5): 16 vertices are shaded for 9 quads. Larger grids have fewer edge vertices but lie in more tiles; neighbours
can share them, for a search; and what is hidden need not be shaded, for a second pass over what is not. The paper's
shader is a Phong light on a checker: how much dearer must a shader be until a road pays?
"""

import math
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from tilestamp.experiments.exploration.ways import MACHINES, SIZE, Way, megabytes, milliseconds, other_pixels
from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Cell, Figure, Result, Status, reported
from tilestamp.experiments.studies_shipped.finding import finding
from tilestamp.models.events import MachineEvent
from tilestamp.models.launch import Launch
from tilestamp.models.price import price
from tilestamp.reports.heatmap import heat_map
from tilestamp.reports.plots import lines
from tilestamp.simulator.run import Run
from tilestamp.simulator.work import Work

QUESTION = "What do larger grids, shared vertices and shading after visibility save, and from which shader on?"
SLOW = True  # runs when it is named: tilestamp reproduce exploration
QUAD = 4 / 3  # pixels a side of a quad at most: a bound of 4 and three quads
WAYS = (
    Way("4x4 (published)", {"bound": 3 * QUAD}),
    Way("5x5", {"grid": 5, "bound": 4 * QUAD}),
    Way("7x7", {"grid": 7, "bound": 6 * QUAD}),
    Way("13x13", {"grid": 13, "bound": 12 * QUAD}),
    Way("4x4, shared", {"bound": 3 * QUAD, "shading": "shared"}),
    Way("4x4, visible", {"bound": 3 * QUAD, "shading": "visible"}),
    Way("7x7, visible", {"grid": 7, "bound": 6 * QUAD, "shading": "visible"}),
)
SHADERS = (0, 100, 300, 1000, 3000, 10000, 30000)  # further instructions for each vertex shaded
PAPERS = 322  # of the mix: instructions of the paper's shader, evaluation of the vertex included
SHADING = ("dice", "dice_shared")  # kernels that shade, but for the variant of dice that evaluates positions alone
PUBLISHED = {"4x4 (published)": 16 / 9, "5x5": 25 / 16}  # vertices shaded a quad


def run(progress: Progress) -> Result:
    """Draw the teapot in every way, and price it with shaders of growing cost."""
    rows: list[dict[str, Any]] = []
    for way in WAYS:
        progress(f"exploration/redundant_shading: {way.name}")
        rows += [_row(way, machine) for machine in MACHINES]
    table = pd.DataFrame(rows)
    costs = pd.DataFrame([row for way in WAYS for machine in MACHINES for row in _costs(way, machine)])
    pays = {(way.name, machine): pays_from(costs, way.name, machine) for way in WAYS[1:] for machine in MACHINES}
    figures = [Figure(f"shaders-{m}", partial(_plot, costs[costs.machine == m], m)) for m in MACHINES]
    cover = WAYS[0].run(MACHINES[1]).frame.maps["overdraw"]
    shown = "Micropolygons that cover a pixel: all but one are shaded for nothing"
    figures.append(Figure("hidden", lambda path: heat_map(cover, path, title=shown, unit="micropolygons", size=SIZE)))
    title = f"Redundant shading: the teapot at {SIZE[0]}x{SIZE[1]}, quads of {QUAD:.2f} pixels"
    tables = {"ways": table, "shaders": costs}
    return finding(
        "redundant_shading", title, _cells(table, pays), figures, _notes(table, pays), tables, folder="exploration"
    )


def _row(way: Way, machine: str) -> dict[str, Any]:
    run = way.run(machine)
    quads = diced_quads(run)
    return {
        "way": way.name,
        "machine": machine,
        "shaded": run.frame.facts["shaded_vertices"],
        "a_quad": run.frame.facts["shaded_vertices"] / quads,
        "megabytes": megabytes(run),
        "shading_ms": milliseconds(run, ("link_grids", "dice", "shade_visible")),
        "raster_ms": milliseconds(run, ("bucket_count", "bucket_scan", "bucket_write", "tile_raster")),
        "ms": run.milliseconds,
        "other_pixels": other_pixels(run, WAYS[0].run(machine)),
    }


def diced_quads(run: Run) -> int:
    """Quads of all grids of a frame."""
    return int(run.frame.facts["subpatches"] * (run.options["grid"] - 1) ** 2)


def _costs(way: Way, machine: str) -> list[dict[str, Any]]:
    """Time of a frame for each cost of the shader."""
    run = way.run(machine)
    return [{"way": way.name, "machine": machine, "shader": extra, "ms": with_shader(run, extra)} for extra in SHADERS]


def with_shader(run: Run, extra: float) -> float:
    """Milliseconds of a frame whose shader takes ``extra`` further multiply-adds, in chains half as long."""
    launches = [
        _dearer(launch, work, extra)
        if isinstance(work, Work) and isinstance(launch, Launch) and _shades(work)
        else launch
        for work, launch in zip(run.frame.works, run.launches, strict=True)
    ]
    return float(sum(timing.milliseconds for timing in price(launches, run.machine)))


def _shades(work: Work) -> bool:
    return work.kernel in SHADING and work.variant != "positions"


def _dearer(launch: Launch, work: Work, extra: float) -> Launch:
    """A launch with more arithmetic in each warp that shades; the warps of a block run it side by side."""
    events = np.array(launch.events)
    events[:, MachineEvent.FP32] += extra * work.table[:, work.events["VERTEX_WARPS"]]
    events[:, MachineEvent.LANES] += extra * work.table[:, work.events["VERTEX_LANES"]]
    events[:, MachineEvent.CHAIN_ALU] += extra / 2
    return replace(launch, events=events)


def pays_from(costs: pd.DataFrame, way: str, machine: str) -> float:
    """Further instructions a vertex from which a way is faster than the published one; infinite if never here."""
    of_machine = costs[costs.machine == machine]
    ours, base = (of_machine[of_machine.way == name].ms.to_numpy() for name in (way, WAYS[0].name))
    gain = base - ours
    if gain[0] >= 0:
        return 0.0
    above = np.flatnonzero(gain >= 0)
    if not len(above):
        return float("inf")
    k = above[0]
    return float(SHADERS[k - 1] + (SHADERS[k] - SHADERS[k - 1]) * -gain[k - 1] / (gain[k] - gain[k - 1]))


def _cells(table: pd.DataFrame, pays: dict[tuple[str, str], float]) -> list[Cell]:
    """What is published of ratios, and all else as reported."""
    first = table[table.machine == MACHINES[0]]
    cells = [_ratio(row.way, row.a_quad) for row in first.itertuples()]
    cells += [reported(row.way, "buffers", "MB", row.megabytes) for row in first.itertuples()]
    for name, column in (("frame", "ms"), ("shading", "shading_ms")):
        cells += [reported(r["way"], f"{name}, {r['machine']}", "ms", r[column]) for r in table.to_dict("records")]
    unit = "instructions a vertex"
    return cells + [reported(way, f"pays from, {machine}", unit, _when(n)) for (way, machine), n in pays.items()]


def _ratio(way: str, ours: float) -> Cell:
    """Vertices shaded a quad: the paper has two of them."""
    published = PUBLISHED.get(way)
    status: Status = "reported" if published is None else "reproduced"
    return Cell(way, "vertices shaded a quad", "", published=published, ours=ours, status=status)


def _notes(table: pd.DataFrame, pays: dict[tuple[str, str], float]) -> list[str]:
    """The answer, and what it rests on."""
    ratio = table[table.machine == MACHINES[0]].set_index("way").a_quad
    same = table[(table.other_pixels == 0) & (table.way != WAYS[0].name)].way.unique()
    answer = (
        f"4x4 grids shade {ratio['4x4 (published)']:.2f} vertices a quad and 5x5 {ratio['5x5']:.4f}, as published;"
        f" shared vertices leave {ratio['4x4, shared']:.2f}, and what is seen needs {ratio['4x4, visible']:.2f}."
    )
    for machine in MACHINES:
        soonest, way = min((pays[way.name, machine], way.name) for way in WAYS[1:])
        answer += f" On {machine} {way} is the first that pays: it {_pays(soonest)}."
    return [
        answer,
        *(_on(machine, table[table.machine == machine].set_index("way"), pays) for machine in MACHINES),
        f"The picture of the published way bit for bit: {'; '.join(same)}.",
        "Counts and pictures are executed. Prices of the further kernels are derived by hand, and none was measured.",
    ]


def _on(machine: str, rows: pd.DataFrame, pays: dict[tuple[str, str], float]) -> str:
    base = rows.loc[WAYS[0].name]
    return (
        f"On {machine} shading is {100 * base.shading_ms / base.ms:.0f} % of the published way's frame; "
        + "; ".join(
            f"{way.name} takes {100 * (rows.ms[way.name] / base.ms - 1):+.1f} % and {_pays(pays[way.name, machine])}"
            for way in WAYS[1:]
        )
    )


def _when(pays: float) -> float | str:
    return "never here" if math.isinf(pays) else pays


def _pays(pays: float) -> str:
    """From which shader on a way pays, in words."""
    if pays == 0:
        return "pays with any shader"
    return "never pays here" if math.isinf(pays) else f"pays from {pays:.0f} further instructions a vertex"


def _plot(costs: pd.DataFrame, machine: str, path: Path) -> None:
    base = costs[costs.way == WAYS[0].name].set_index("shader").ms
    ratio = costs.assign(ratio=[ms / base[extra] for ms, extra in zip(costs.ms, costs.shader, strict=True)])
    lines(
        ratio.assign(shader=ratio.shader + PAPERS), path, x="shader", y="ratio", by="way", log_x=True,
        title=f"Frame time over that of the published way, by cost of the shader, {machine}",
        x_label="instructions for each vertex", y_label="time over published",
    )  # fmt: skip
