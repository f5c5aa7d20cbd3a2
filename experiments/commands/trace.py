"""``tilestamp render --trace`` and ``--timeline``: the schedule of a run, to look into and to look at."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tilestamp.experiments.commands.outputs import writing
from tilestamp.models.spans import OWN
from tilestamp.reports.chrome_trace import Process, write_trace
from tilestamp.simulator.run import Run
from tilestamp.simulator.run_views import draw
from tilestamp.simulator.timeline import LaunchTimeline, timeline

SLICES = 200_000  # that a viewer still opens at once
UNITS = ("start", "stop", "sm", "slot", "holds", "items")  # what a timeline has of each unit


def write_schedule(run: Run, path: Path) -> str:
    """Write the trace of a run; return what it holds, in a line."""
    launches = list(timeline(run))
    shown = _shown(launches)
    units = sum(len(launch.start) for launch in shown)
    left_out = sum(len(launch.start) for launch in launches) - units
    with writing(path, "--trace") as partial:
        together = write_trace([_process(launch) for launch in shown], partial, SLICES)
    merged = f"{together} neighbours on a place of an SM as one slice" if together > 1 else "a slice each"
    merged += f", without {left_out:,} units of the shortest launches" if left_out else ""
    return f"trace: {path}, {units:,} units of {len(launches)} launches, {merged}; ui.perfetto.dev opens it"


def _shown(launches: list[LaunchTimeline]) -> list[LaunchTimeline]:
    """Launches, of which the shortest bear no units where even a slice for each place would be too many."""
    left, shown = SLICES, list(launches)
    for index in sorted(range(len(launches)), key=lambda i: launches[i].begin - launches[i].end):
        launch = launches[index]
        places = len(np.unique(_thread(launch)))
        if places > left:
            shown[index] = replace(launch, **{name: getattr(launch, name)[:0] for name in UNITS}, counters={})
        else:
            left -= places
    return shown


def _thread(launch: LaunchTimeline) -> NDArray[np.int64]:
    """Threads of the units: the places of an SM stand together."""
    return 1 + launch.sm * launch.slots + launch.slot


def _process(launch: LaunchTimeline) -> Process:
    """One launch: first what its time is made of, then a thread for each place of an SM."""
    thread = _thread(launch)
    one = launch.slots == 1
    names = {
        int(tid): f"SM {(tid - 1) // launch.slots:03}{'' if one else f' place {(tid - 1) % launch.slots:02}'}"
        for tid in np.unique(thread)
    }
    return Process(
        name=f"{launch.stage}: {launch.kernel}, bound: {launch.bound}",
        parts=[part for part in _parts(launch) if part[2] > part[1]],
        threads=names,
        thread=thread,
        start=launch.start,
        stop=launch.stop,
        label=launch.holds,
        labels=OWN,
        number=np.arange(len(launch.start)),
        amount=launch.items,
        unit=launch.unit,
        what=launch.what,
        counters=launch.counters,
    )


def _parts(launch: LaunchTimeline) -> list[tuple[str, float, float]]:
    """What the time of a launch is made of, from its beginning to its end."""
    overhead = ("kernel overhead", launch.begin, launch.units_begin)
    if launch.units_end == launch.units_begin:
        return [overhead, (f"not scheduled; bound: {launch.bound}", launch.units_begin, launch.end)]
    return [
        overhead,
        ("units on the SMs", launch.units_begin, launch.units_end),
        ("memory and atomic units, after the units", launch.units_end, launch.end),
    ]


def draw_timeline(run: Run, path: Path) -> None:
    """Draw which SMs are taken, over time, in a colour for each stage."""
    with writing(path, "--timeline") as partial:
        draw(run, "timeline", partial)
