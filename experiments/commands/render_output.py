"""What ``tilestamp render`` leaves: a picture, a heat map, the table of stages or the run as JSON."""

import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tilestamp.experiments.commands.outputs import writing
from tilestamp.experiments.commands.render_table import print_stages
from tilestamp.experiments.commands.tables import print_lines
from tilestamp.models.error_model import was_measured
from tilestamp.simulator.run import Run
from tilestamp.simulator.run_views import draw


def write_png(image: NDArray[np.uint8], path: Path) -> None:
    """Write a picture, all of it or nothing."""
    from PIL import Image

    with writing(path) as partial:  # runs alone, no repeats further back: in a third of the time, 7 % larger
        Image.fromarray(image).save(partial, format="png", compress_type=zlib.Z_RLE)


def map_path(output: Path, name: str) -> Path:
    """File of a counter's heat map: ``out.tests.png`` beside ``out.png``."""
    return output.with_suffix(f".{name}.png")


def write_map(run: Run, name: str, path: Path) -> None:
    """Draw a counter's heat map."""
    with writing(path) as partial:
        draw(run, "map", partial, name)


def as_json(run: Run) -> dict[str, Any]:
    """The run as data for ``write_json``."""
    stages = run.stage_rows if run.counted else {}
    return {
        "scene": run.scene,
        "note": run.note,
        "pipeline": run.pipeline,
        "machine": run.machine.name,
        "width": run.width,
        "height": run.height,
        "fidelity": run.fidelity,
        "options": run.options,
        "milliseconds": run.milliseconds if run.counted else None,
        "error_interval_milliseconds": run.error_interval if _error_is_known(run) else None,
        "stages": stages,
        "counters": {name: {"title": c.title, "kind": c.kind} for name, c in run.counters.items()},
        "counts": run.counts if run.counted else {},
        "facts": run.frame.facts,
        "warnings": list(run.frame.remarks),
        "manifest": run.manifest(),
    }


def print_run(run: Run, output: Path | None, map_: str | None = None, columns: str = "") -> None:
    """Print the table of stages, and a line for all else that is to be said."""
    title = f"{run.scene} by {run.pipeline} on {run.machine.name}, {run.width}x{run.height}: {_shown_time(run)}"
    if run.counted:
        print_stages(run, title, columns)
    else:
        print_lines(title)
    lines = [
        _shown_error(run),
        run.note,
        *run.frame.remarks,
        f"picture: {output}" if output else "",
    ]
    lines += [f"map of {map_}: {map_path(output, map_)}"] if output and map_ else []
    print_lines(*filter(None, lines))


def _shown_time(run: Run) -> str:
    if not run.counted:
        return "nothing was counted, so there is no time"
    if run.fidelity == "counts":
        return "counts, no time"
    return f"{run.milliseconds:.4g} ms"


def _shown_error(run: Run) -> str:
    """Say how far the frame's time may be from a real machine's."""
    if not _error_is_known(run):
        return ""
    low, high = run.error_interval
    there = (
        f"kernel times measured on {run.machine.name}"
        if was_measured(run.machine)
        else "published times of other machines"
    )
    return f"expect {low:.4g} to {high:.4g} ms: 95 % of the {there} were that near"


def _error_is_known(run: Run) -> bool:
    """Whether the frame has a time, by the schedule: the residuals are of such times."""
    return run.counted and run.fidelity == "schedule" and run.milliseconds == run.milliseconds
