"""Frontier of the model itself: what each fidelity costs, and how far its answer is off.

Set TILESTAMP_FRONTIER=long for more frames (minutes).
"""

import time
from dataclasses import asdict, dataclass
from math import isnan
from pathlib import Path
from typing import Any

import pandas as pd

from tilestamp.experiments.frontier.model_frames import Timed, frames, warnings
from tilestamp.experiments.frontier.model_notes import BOUNDS, COUNTS, FULL, notes
from tilestamp.experiments.frontier.pareto import pareto_front
from tilestamp.experiments.harness.published import published
from tilestamp.experiments.harness.registry import Progress
from tilestamp.experiments.harness.result import Cell, Chart, Figure, Result, reported
from tilestamp.models.events import INSTRUCTION_CLASSES
from tilestamp.models.launch import Launch
from tilestamp.models.price import Fidelity
from tilestamp.reports.frontier_plot import frontier
from tilestamp.simulator.run import Run

QUESTION = "What does a more accurate answer of the simulator cost?"
SOURCE = (
    "Clock: this computer. Times of frames: Eisenacher & Loop 2010, Laine & Karras 2011, an H200. Other simulators: as "
    "published (detailed_simulators.csv names each source)"
)
FIDELITIES: dict[Fidelity, str] = {"schedule": FULL, "bounds": BOUNDS, "counts": COUNTS}
EXECUTED = "ours, executed"
CHART = Chart(
    name="methods", kind="front", table="methods", title="Seconds that an answer takes, against its error.",
    alt="Scatter plot: mean error of a frame's time, against the full run, over CPU seconds.",
    of={"x": "cpu_seconds", "y": "error_against_full", "color": "method", "label": "method",
        "titles": ["time to simulate one frame [CPU s]", "mean error of the frame's time"]},
)  # fmt: skip
REPEATS = 2  # of pricing, which takes milliseconds


@dataclass(frozen=True)
class Answer:
    """One simulation of one frame: its cost and what it said."""

    method: str
    cpu_seconds: float
    pricing_seconds: float  # of them
    milliseconds: float
    instructions: float


def run(progress: Progress) -> Result:
    """Simulate every frame in every way, against the clock."""
    rows: list[dict[str, Any]] = []
    for frame in frames():
        progress(f"frontier/model: {frame.name}")
        rows += _rows(frame, _answers(frame))
    table = pd.DataFrame(rows)
    ours = _by_method(table)
    theirs = _detailed(table[table.method == FULL].instructions.mean())
    count = table.frame.nunique()
    return Result(
        name="frontier-model",
        title="What accuracy costs: the simulation's own time against the error of its answer",
        source=SOURCE,
        cells=_cells(ours, theirs),
        answer=_answer(ours),
        figures=[
            Figure("against-full-run", lambda path: _draw_full(ours, count, path)),
            Figure("against-published", lambda path: _draw_published(ours, theirs, count, path)),
        ],
        charts=[CHART],
        notes=notes(table, ours, theirs, _beside(ours, theirs)),
        warnings=warnings(),
        tables={"frames": table, "methods": ours, "detailed-simulators": theirs},
    )


def _answer(ours: pd.DataFrame) -> str:
    """Each method's cost, and its distance from the full run."""
    said = [
        f"{row.method} {row.cpu_seconds:.2f} s ({row.error_against_full:.2%} off)"
        for row in ours.itertuples()
        if not isnan(row.error_against_full)
    ]
    return f"CPU seconds a frame, and distance from the full run: {'; '.join(said)}."


def _answers(frame: Timed) -> list[Answer]:
    """Execute, and price at each fidelity; the full one comes first."""
    frame.warm_up()
    start = time.process_time()
    drawn = frame.simulate()
    seconds = time.process_time() - start
    return [_priced(frame, drawn, fidelity, method, seconds) for fidelity, method in FIDELITIES.items()]


def _priced(frame: Timed, drawn: Run, fidelity: Fidelity, method: str, seconds: float) -> Answer:
    """Price an execution; the quickest of some times counts."""
    quickest = float("inf")
    for _ in range(REPEATS):
        start = time.process_time()
        run = drawn.on(drawn.machine, fidelity)
        milliseconds = frame.milliseconds_of(run)
        quickest = min(quickest, time.process_time() - start)
    warps = [launch.events[:, list(INSTRUCTION_CLASSES)].sum() for launch in run.launches if isinstance(launch, Launch)]
    return Answer(method, seconds + quickest, quickest, milliseconds, float(sum(warps)))


def _rows(frame: Timed, answers: list[Answer]) -> list[dict[str, Any]]:
    """Each answer beside the full one and what is known."""
    full = answers[0]
    return [
        {
            "frame": frame.name,
            **asdict(answer),
            "known_ms": frame.known_ms,
            "known": frame.kind,
            "error_against_full": abs(answer.milliseconds / full.milliseconds - 1.0),
            "error_of_instructions": abs(answer.instructions / full.instructions - 1.0),
            "error_against_known": abs(answer.milliseconds / frame.known_ms - 1.0),
        }
        for answer in answers
    ]


def _by_method(table: pd.DataFrame) -> pd.DataFrame:
    """Mean over the frames: seeds first, so that every frame counts once."""
    frames_ = table.groupby(["method", "frame"], sort=False).mean(numeric_only=True)
    mean = frames_.groupby("method", sort=False).mean()
    worst = frames_.groupby("method", sort=False).max()
    return mean.assign(worst_against_full=worst.error_against_full).reset_index()


def _detailed(instructions: float) -> pd.DataFrame:
    """Simulators by others: their published error, and the seconds that their speed means for the mean frame."""
    table = published(__file__, "detailed_simulators")
    return table.assign(seconds=instructions / table.warp_instructions_per_second)


def _cells(ours: pd.DataFrame, theirs: pd.DataFrame) -> list[Cell]:
    shown = {
        "time to simulate a frame": ("cpu_seconds", "CPU s", 1),
        "mean error against the full run": ("error_against_full", "%", 100),
        "mean error against known times": ("error_against_known", "%", 100),
    }
    cells = [
        reported(row["method"], column, unit, scale * row[name])
        for row in ours.to_dict("records")
        for column, (name, unit, scale) in shown.items()
        if not isnan(row[name])
    ]
    for row in theirs[theirs.seconds.notna()].to_dict("records"):
        speed = str(row["speed_mark"]).partition(":")[0]
        cells.append(reported(row["name"], f"the mean frame at its {speed} speed", "s", row["seconds"]))
    return cells


def _points(ours: pd.DataFrame, column: str) -> pd.DataFrame:
    points = {"name": ours.method, "group": EXECUTED, "cost": ours.cpu_seconds, "error": 100 * ours[column]}
    return pd.DataFrame({**points, "published": False}).dropna(subset="error")  # counts have no time


def _draw_full(ours: pd.DataFrame, frames_: int, path: Path) -> None:
    points = _points(ours, "error_against_full")
    points["front"] = pareto_front(points.cost, points.error)
    again = points.assign(
        name=points.name.str.replace("executed", "priced again"),
        group="ours, priced again: no executing",
        cost=ours.pricing_seconds[points.index],
        front=False,  # there must have been an execution
    )
    points = pd.concat([points, again])
    title = f"Cost of a simulation against its distance from the full one, mean of {frames_} frames"
    frontier(path, points, "time to simulate one frame [CPU s]", "mean error of the frame's time [%]", title)


def _draw_published(ours: pd.DataFrame, theirs: pd.DataFrame, frames_: int, path: Path) -> None:
    frontier(
        path,
        _beside(ours, theirs),
        "time to simulate one frame [s; ours of CPU, others as published]",
        "mean error of a frame's time against silicon [%]",
        f"Cost of a simulation against its error on known times: {frames_} frames near fitted ones; others on theirs",
    )


def _beside(ours: pd.DataFrame, theirs: pd.DataFrame) -> pd.DataFrame:
    """Our methods and the simulators by others, with the front over both."""
    drawn = theirs[theirs.seconds.notna()]
    group = [
        "others, error and speed published" if mark == "published" else "others, speed derived"
        for mark in drawn.speed_mark
    ]
    names = drawn.name.where(drawn.error_against.str.startswith("silicon"), drawn.name + " (not against silicon)")
    others = {"name": names, "group": group, "cost": drawn.seconds, "error": drawn.error_percent}
    points = pd.concat([_points(ours, "error_against_known"), pd.DataFrame({**others, "published": True})])
    return points.assign(front=pareto_front(points.cost, points.error))
