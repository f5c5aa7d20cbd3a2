"""A design better than an H200 for CudaRaster at equal area proxy: what else the same area could be spent on.

One number a step is made larger or smaller, the one that gains most, and L2 or more SMs take the area that it leaves,
or give what is missing. Clock, bandwidths and all else stay. The proxy: experiments/studies/area.py, all assumed.
"""

import math
from collections.abc import Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from tilestamp.experiments.frontier.methods_scenes import sheets
from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Figure, Result, reported
from tilestamp.experiments.questions.space import values_at
from tilestamp.experiments.studies.area import L2_MB, MEGABYTE, area, sm_area
from tilestamp.experiments.studies.study import Study
from tilestamp.experiments.studies_shipped.finding import WHAT_IF, finding
from tilestamp.models.errors import TilestampError
from tilestamp.models.machine import altered, load_machine
from tilestamp.reports.tornado import tornado

QUESTION = "What else could the area of an H200 be spent on, to draw faster?"
SLOW = True  # runs when it is named: tilestamp reproduce studies
MACHINE = "h200"
SIZE = (1280, 720)
AREAS = {"small": 4.0, "middle": 32.0, "large": 512.0}  # pixels a triangle; designed on the middle one
DESIGNED_ON = "middle"
STEPS = 6
GAIN = 0.007  # of a step that is worth taking
SMALLEST_L2 = 4 * MEGABYTE
MOVES = {  # factors of what the machine has
    "sm.count": (0.9, 1.1),
    "sm.schedulers": (0.5, 2.0),
    "pipe.fp32": (0.5, 2.0),
    "pipe.int32": (0.5, 2.0),
    "pipe.sfu": (0.5, 2.0),
    "sm.registers": (0.5, 2.0),
    "sm.shared_bytes": (0.5, 1.25),
}
FILLERS = ("L2", "SMs")  # what makes up for the area of a change
Design = Mapping[str, float]


def run(progress: Progress) -> Result:
    """Take steps until none gains, then price the design on frames that it was not made for."""
    steps = pd.DataFrame(descend(study_of(DESIGNED_ON), progress))
    tried, taken = steps, steps[steps["taken"]]
    last = taken.iloc[-1]
    design = {name: last[name] for name in (*MOVES, "memory.l2_bytes")}
    frames = {name: _gain(name, design) for name in AREAS}
    cells = [reported("the design", name, "", value) for name, value in design.items()]
    cells += [reported("time over that of an H200", f"{name} triangles", "", ratio) for name, ratio in frames.items()]
    figure = Figure("steps", partial(_draw, tried))
    title = f"A design better than an H200 for CudaRaster at equal area proxy, sheets of triangles, {SIZE[0]}x{SIZE[1]}"
    warnings = [WHAT_IF, "the area proxy: all weights are assumed (experiments/studies/area.py)"]
    return finding("better_than_h200", title, cells, [figure], notes(taken, frames), {"steps": tried}, warnings)


def study_of(name: str) -> Study:
    """CudaRaster on triangles of one size."""
    fixed: dict[str, Any] = {"pipeline": "cudaraster", "machine": MACHINE, "size": f"{SIZE[0]}x{SIZE[1]}"}
    return Study(title="better than an H200", fixed={**fixed, "scene": sheets(AREAS[name], *SIZE)})


def descend(study: Study, progress: Progress) -> list[dict[str, Any]]:
    """Take the best move of each step; a row for each design that was priced."""
    base = load_machine(MACHINE)
    here: Design = {name: base.number(name) for name in (*MOVES, "memory.l2_bytes")}
    time = float(values_at(study, [here], ["milliseconds"])[0][0, 0])
    rows = [{"step": 0, "move": "H200", "milliseconds": time, "gain": 1.0, "area": area(base), "taken": True, **here}]
    for step in range(1, STEPS + 1):
        progress(f"studies_shipped/better_than_h200: step {step}, {time:.4f} ms")
        moves = neighbours(here)
        times = values_at(study, list(moves.values()), ["milliseconds"])[0][:, 0]
        if np.isnan(times).all():
            break
        best = int(np.nanargmin(times))
        worth = times[best] < time * (1.0 - GAIN)
        for place, (move, design) in enumerate(moves.items()):
            proxy = area(altered(base, design))
            took = bool(worth and place == best)
            rows.append(
                {
                    "step": step,
                    "move": move,
                    "milliseconds": times[place],
                    "gain": times[place] / time,
                    "area": proxy,
                    "taken": took,
                    **design,
                }
            )
        if not worth:
            break
        here, time = list(moves.values())[best], float(times[best])
    return rows


def neighbours(here: Design) -> dict[str, Design]:
    """Designs one move away, of an H200's area: L2 or SMs make up for it; what cannot be is left out."""
    base = load_machine(MACHINE)
    found = {}
    for name, factors in MOVES.items():
        for factor in factors:
            value = here[name] * factor
            moved = {**here, name: round(value) if isinstance(base.number(name), int) else value}
            for filler in FILLERS if name != "sm.count" else FILLERS[:1]:
                with suppress(TilestampError):  # no machine has these together
                    design = filled(moved, filler)
                    if design["sm.count"] >= 1 and design["memory.l2_bytes"] >= SMALLEST_L2:
                        altered(base, design)
                        found[f"{name} x {factor:g}, {filler}"] = design
    return found


def filled(design: Design, filler: str) -> Design:
    """Spend on L2, or on SMs and the rest on L2, what a design is short of an H200's area."""
    base = load_machine(MACHINE)
    machine = altered(base, design)
    short = area(base) - area(machine)
    more = math.floor(short / sm_area(machine)) if filler == FILLERS[1] else 0
    l2 = design["memory.l2_bytes"] + (short - more * sm_area(machine)) * MEGABYTE / L2_MB
    return {**design, "sm.count": design["sm.count"] + more, "memory.l2_bytes": int(l2) // 1024 * 1024}


def _gain(name: str, design: Design) -> float:
    """Time with the design over that of an H200, on one frame."""
    times = values_at(study_of(name), [{}, design], ["milliseconds"])[0][:, 0]
    return float(times[1] / times[0])


def notes(taken: pd.DataFrame, frames: Mapping[str, float]) -> list[str]:
    """Say which steps were taken, what the design is, and whether it holds elsewhere."""
    first, last = taken.iloc[0], taken.iloc[-1]
    steps = ", then ".join(
        f"{row.move} ({row.milliseconds / before - 1:+.1%})"
        for row, before in zip(taken.iloc[1:].itertuples(), taken["milliseconds"], strict=False)
    )
    changed = ", ".join(f"{name} {first[name]:.6g} to {last[name]:.6g}" for name in (*MOVES, "memory.l2_bytes")
                        if first[name] != last[name])  # fmt: skip
    others = ", ".join(f"{ratio:.2f} on {name} triangles ({AREAS[name]:g} px)" for name, ratio in frames.items())
    return [
        f"Steps that gained, each the best of its neighbours: {steps or 'none: no neighbour is better'}.",
        f"The design: {changed or 'an H200'}; its proxy is {last['area'] / first['area']:.3f} of an H200's.",
        f"Its time over an H200's, designed on {DESIGNED_ON} triangles: {others}.",
        "Clock, latencies, bandwidths, atomic units and launch costs stay an H200's, whatever changes: assumed.",
    ]


def _draw(tried: pd.DataFrame, path: Path) -> None:
    """Draw what each move would do to the time, at each step."""
    rows = []
    for step, moves in tried[tried["step"] > 0].groupby("step"):
        for name, factors in MOVES.items():
            times = {factor: _least(moves, name, factor) for factor in factors}
            lower, higher = (next((f for f in factors if (f < 1) == less), 1.0) for less in (True, False))
            row = {"less": times.get(lower, math.nan), "more": times.get(higher, math.nan)}
            rows.append({"step": f"step {step}", "number": name, "lower": lower, "value": 1.0, "higher": higher, **row})
    title = "What each move would do to the time, at an H200's area (factors of a number)"
    tornado(pd.DataFrame(rows), path, panel="step", label="number", title=title, least=0.0)


def _least(moves: pd.DataFrame, name: str, factor: float) -> float:
    """Least time of a move over that before it, whatever makes up for the area; NaN where it cannot be made."""
    return float(moves.loc[moves["move"].str.startswith(f"{name} x {factor:g},"), "gain"].min())
